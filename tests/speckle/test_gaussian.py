import numpy as np
import pytest
from scipy import stats
from speckle_samples import circular_gaussian

from radcal.speckle.gaussian import gaussian_row, philox, seed_words

SHAPE = (300, 200)
N = SHAPE[0] * SHAPE[1]


@pytest.mark.parametrize(
    ("counter", "key", "expected"),
    [
        # the known answers that come with Random123, the authors' own implementation
        ([0] * 4, [0] * 2, [0x6627E8D5, 0xE169C58D, 0xBC57AC4C, 0x9B00DBD8]),
        ([0xFFFFFFFF] * 4, [0xFFFFFFFF] * 2, [0x408F276D, 0x41C83B0E, 0xA20BC7C6, 0x6D5451FD]),
        (
            [0x243F6A88, 0x85A308D3, 0x13198A2E, 0x03707344],
            [0xA4093822, 0x299F31D0],
            [0xD16CFE09, 0x94FDCCEB, 0x5001E420, 0x24126EA1],
        ),
    ],
)
def test_philox_gives_the_published_words(counter, key, expected):
    assert [int(word) for word in philox(*map(np.uint32, [*counter, *key]))] == expected


def test_circular_gaussian_streams_are_reproducible_and_independent():
    streams = [(1, 0, 0), (1, 1, 0), (1, 0, 1), (2, 0, 0), (2**63 - 1, 0, 0), (1, 63, 256)]
    drawn = [circular_gaussian(*stream, SHAPE).astype(complex) for stream in streams]
    for k, (stream, u) in enumerate(zip(streams, drawn, strict=True)):
        np.testing.assert_array_equal(circular_gaussian(*stream, SHAPE), u.astype(np.complex64))
        for v in drawn[k + 1 :]:
            assert abs(np.mean(u * v.conj())) < 4 / np.sqrt(N)


def test_parts_are_normal_and_phases_uniform():
    u = circular_gaussian(7, 2, 3, SHAPE).astype(complex).ravel()
    assert stats.kstest(u.real * np.sqrt(2), "norm").pvalue > 1e-3
    assert stats.kstest(u.imag * np.sqrt(2), "norm").pvalue > 1e-3
    assert stats.kstest(np.angle(u) / (2 * np.pi) % 1.0, "uniform").pvalue > 1e-3
    assert stats.kstest(np.abs(u) ** 2, "expon").pvalue > 1e-3


@pytest.mark.parametrize("place", [30_473_775, 857_801_779, 12])
def test_power_follows_the_whole_word(place):
    """|z|^2 = -ln u of a word's 32 bits: the first place has the word 0, the second 2^32 - 2, both found by search."""
    seed, stream, look = 11, 3, 1
    word = int(philox(*map(np.uint32, [place, stream, look, 0, seed, 0]))[0])
    real, imaginary = np.empty((2, 1), np.float32)
    places, streams = np.array([place], np.uint32), np.array([stream], np.uint32)
    words = np.empty((2, 1), np.uint32)
    gaussian_row(1, places, streams, np.uint32(look), seed_words(seed), words, real, imaginary)
    # near u = 1 single precision ends at 1 - 2^-24
    expected = max(-np.log((word + 0.5) / 2**32), -np.log1p(-(2.0**-24)))
    assert float(real[0]) ** 2 + float(imaginary[0]) ** 2 == pytest.approx(expected, rel=1e-5)
