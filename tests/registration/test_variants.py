"""Wrong variants of a displacement: sign, axis order, order of two displacements, direction of an inverse."""

import numpy as np
from variants import agrees

from radcal.registration.displacement import invert, warp

ROWS, COLUMNS = 24, 31
R, C = np.mgrid[0:ROWS, 0:COLUMNS].astype(float)
INSIDE = np.s_[:, 6:-6, 6:-6]


def test_warp_takes_the_value_at_the_place_plus_the_displacement():
    image = (100.0 * R + C).astype(np.float32)
    move = np.stack([np.full_like(R, 2.0), np.full_like(R, -3.0)])
    right = (100.0 * (R + 2.0) + (C - 3.0))[5:-5, 5:-5]
    agrees(
        warp(image, move)[5:-5, 5:-5],
        right,
        sign=(100.0 * (R - 2.0) + (C + 3.0))[5:-5, 5:-5],
        axes=(100.0 * (R - 3.0) + (C + 2.0))[5:-5, 5:-5],
        rows_alone=(100.0 * (R + 2.0) + C)[5:-5, 5:-5],
    )
    half = warp(image, np.stack([np.full_like(R, 0.4), np.full_like(R, 0.7)]))[5:-5, 5:-5]
    agrees(
        half,
        (100.0 * R + C + 1.0)[5:-5, 5:-5],
        interpolated=(100.0 * (R + 0.4) + C + 0.7)[5:-5, 5:-5],
        floor=(100.0 * R + C)[5:-5, 5:-5],
    )


def test_inverse_of_linear_displacements():
    """Of displacements d(x) = a x, the inverse is 1 / (1 + a) - 1."""
    a, b = 0.10, -0.06
    move = np.stack([a * (R - 12.0), -b * (C - 15.0)])
    right = np.stack([-a / (1.0 + a) * (R - 12.0), b / (1.0 - b) * (C - 15.0)])
    agrees(
        invert(move)[INSIDE],
        right[INSIDE],
        atol=2e-3,
        rtol=0.0,
        minus=-move[INSIDE],
        same=move[INSIDE],
        axes=right[::-1][INSIDE],
        outward=np.stack([-a / (1.0 - a) * (R - 12.0), b / (1.0 + b) * (C - 15.0)])[INSIDE],
    )


def test_gaps_stay_gaps():
    image = np.where((R == 11.0) & (C == 17.0), np.nan, 0.0).astype(np.float32)
    np.testing.assert_array_equal(warp(image, np.zeros((2, ROWS, COLUMNS))), image)
