"""Counter-based circular Gaussian random numbers, which do not depend on the order of calls.

The generator Philox4x32-10 computes uniform random bits from the seed, the place (index of the pixel), the stream
(material id, or 256 for thermal noise) and the look. The Box-Muller transform turns these bits into complex Gaussian
numbers. Logarithm, sine and cosine are computed with the polynomials of the Cephes library in single precision (Moshier
1992), without calls of a mathematical library. The compiler can therefore vectorise the loops, and every processor
gives the same bits.

References
----------
Salmon, Moraes, Dror and Shaw, "Parallel random numbers: as easy as 1, 2, 3", SC11 (2011).
Box and Muller, "A note on the generation of random normal deviates", Ann. Math. Statist. 29 (1958).
"""

from __future__ import annotations

from typing import Any

import numpy as np

from radcal.compiled import njit

_M0, _M1 = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_W0, _W1 = np.uint32(0x9E3779B9), np.uint32(0xBB67AE85)
_LOW = np.uint64(0xFFFFFFFF)
_32 = np.uint64(32)


@njit(inline="always")
def philox(c0: Any, c1: Any, c2: Any, c3: Any, k0: Any, k1: Any) -> Any:
    """Four random words (uint32) from four counter words and two key words, by ten rounds of Philox4x32."""
    for _ in range(10):
        p0, p1 = _M0 * np.uint64(c0), _M1 * np.uint64(c2)
        c0 = np.uint32(p1 >> _32) ^ c1 ^ k0
        c2 = np.uint32(p0 >> _32) ^ c3 ^ k1
        c1, c3 = np.uint32(p1 & _LOW), np.uint32(p0 & _LOW)
        k0, k1 = np.uint32(k0 + _W0), np.uint32(k1 + _W1)
    return c0, c1, c2, c3


_F = np.float32
_LOG = tuple(
    np.float32(c)
    for c in (
        7.0376836292e-2, -1.1514610310e-1, 1.1676998740e-1, -1.2420140846e-1, 1.4249322787e-1, -1.6668057665e-1,
        2.0000714765e-1, -2.4999993993e-1, 3.3333331174e-1,
    )
)  # fmt: skip
_SIN = tuple(np.float32(c) for c in (-1.6666654611e-1, 8.3321608736e-3, -1.9515295891e-4))
_COS = tuple(np.float32(c) for c in (4.166664568298827e-2, -1.388731625493765e-3, 2.443315711809948e-5))
_ONE, _HALF, _TWO24, _LN2 = np.float32(1.0), np.float32(0.5), np.float32(2.0**-24), np.float32(np.log(2.0))
_TWO32, _BELOW_ONE = np.float32(2.0**-32), np.float32(1.0 - 2.0**-24)
_QUARTER, _ROOT2 = np.float32(np.pi / 2.0), np.float32(np.sqrt(2.0))


@njit(inline="always")
def cosine_sine(y: Any) -> Any:
    """Cosine and sine of an angle of up to an eighth of a turn [rad], in single precision."""
    z = y * y
    sine = y + y * z * (_SIN[0] + z * (_SIN[1] + z * _SIN[2]))
    cosine = _ONE - _HALF * z + z * z * (_COS[0] + z * (_COS[1] + z * _COS[2]))
    return cosine, sine


@njit()
def gaussian_row(n: Any, place: Any, stream: Any, look: Any, seed: Any, words: Any, real: Any, imaginary: Any) -> None:
    """Circular Gaussian numbers of unit mean power for ``n`` places.

    Parameters
    ----------
    n : int
        Number of places; every array has at least ``n`` columns.
    place : ndarray of uint32
        Flat image index of each place.
    stream : ndarray of uint32
        Stream of random numbers at each place: material id for speckle, 256 for thermal noise.
    look : uint32
        Index of the look.
    seed : (uint32, uint32)
        Noise seed of the run.
    words : ndarray of uint32, shape (2, m)
        Work space.
    real, imaginary : ndarray of float32
        Real and imaginary parts of the random numbers, written by the function.
    """
    for i in range(n):
        a, b, _, _ = philox(place[i], stream[i], look, np.uint32(0), seed[0], seed[1])
        words[0, i] = a
        words[1, i] = b
    # A uniform number is the middle of one of 2^32 intervals between 0 and 1. Single precision resolves the intervals
    # near 0, where the power is largest (33 ln 2 = 22.9 at most). Near 1 the numbers are kept below 1, because the
    # number 1 would have no power.
    for i in range(n):
        real[i] = min((_F(words[0, i]) + _HALF) * _TWO32, _BELOW_ONE)
    bits = real.view(np.int32)
    mantissa = imaginary.view(np.int32)
    for i in range(n):
        mantissa[i] = (bits[i] & np.int32(0x7FFFFF)) | np.int32(0x3F800000)
    for i in range(n):
        exponent = _F((bits[i] >> np.int32(23)) - np.int32(127))
        f = imaginary[i]
        large = f > _ROOT2
        f = _HALF * f if large else f
        exponent = exponent + _ONE if large else exponent
        t = f - _ONE
        z = t * t
        p = _LOG[0]
        for c in _LOG[1:]:
            p = p * t + c
        log = t * z * p - _HALF * z + t + exponent * _LN2
        real[i] = np.sqrt(-log)
    for i in range(n):
        w = words[1, i]
        quadrant = w >> np.uint32(30)
        # the remaining angle lies within an eighth of a turn of the quadrant's middle
        y = ((_F((w & np.uint32(0x3FFFFFFF)) >> np.uint32(6)) + _HALF) * _TWO24 - _HALF) * _QUARTER
        cosine, sine = cosine_sine(y)
        swap = (quadrant & np.uint32(1)) != 0
        x = -sine if swap else cosine
        y = cosine if swap else sine
        size = -real[i] if (quadrant & np.uint32(2)) != 0 else real[i]
        real[i] = size * x
        imaginary[i] = size * y


def seed_words(seed: int) -> tuple[np.uint32, np.uint32]:
    """Lower and upper 32 bits of a seed below 2**64."""
    return np.uint32(seed & 0xFFFFFFFF), np.uint32(seed >> 32)
