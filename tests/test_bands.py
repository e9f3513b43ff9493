import pytest

from radcal.bands import letter_band, same_label, within_band

# IEEE Std 521-2019: each band ends where the next one begins
BEGIN_GHZ = {
    "VHF": 0.03, "UHF": 0.3, "L": 1.0, "S": 2.0, "C": 4.0, "X": 8.0, "Ku": 12.0, "K": 18.0, "Ka": 27.0, "V": 40.0,
    "W": 75.0, None: 110.0,
}  # fmt: skip


@pytest.mark.parametrize(("letter", "before"), [*zip(BEGIN_GHZ, [None, *BEGIN_GHZ], strict=False)])
def test_an_edge_belongs_to_the_upper_band(letter, before):
    edge_hz = BEGIN_GHZ[letter] * 1e9
    assert (letter_band(edge_hz), letter_band(edge_hz * 0.999)) == (letter, before)
    assert letter_band(float("nan")) is None


def test_labels():
    for label in ("X", "x", "X-band", "X band", " x_BAND", "Xband"):
        assert same_label(label, "X")
        assert within_band(label, 9.65e9)
        assert within_band(label, 5.4e9) is False
    assert not same_label("K", "Ka")
    assert not same_label("band", "X")
    # P is a part of UHF
    assert [within_band("P", hz) for hz in (249e6, 250e6, 499e6, 500e6)] == [False, True, True, False]
    assert within_band("UHF", 435e6)
    for label in ("", "9.6 GHz", "third", "XX"):
        assert within_band(label, 9.6e9) is None
