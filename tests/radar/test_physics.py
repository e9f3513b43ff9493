"""The image's statistics, a point target, layover, shadow and normals against theory.

Tolerances are those that a radar engineer asks for; the sample sizes make each a 3 sigma statement.
"""

import numpy as np
import pytest

from radcal.config import Radar
from radcal.radar.image import ImageFormation
from radcal.radar.reflectivity import uniform
from radcal.speckle.response import impulse_response

DARK = -200.0  # [dB] no noise at all
# four pixels are over two and a half resolutions: below the -35 dB sidelobes, so uncorrelated
APART = np.s_[12:-12:4, 12:-12:4]
SHAPE = (1070, 1070)  # (3 / (0.05 dB in linear))^2 = 67,000 independent values, and the border


@pytest.mark.parametrize(("sigma0_db", "nesz_db"), [(-8.0, DARK), (DARK, -13.0), (-8.0, -13.0)])
def test_even_ground_is_even_up_to_the_border(sigma0_db, nesz_db):
    """Mean level of every row and column, the outermost too, over ground and noise of one level."""
    shape, radar = (300, 340), Radar(looks=64)
    even = uniform(np.full(shape, 10 ** (sigma0_db / 10), np.float32))
    power = ImageFormation(radar, shape, nesz_db).intensity(even, 8).astype(np.float64)
    expected = 10 ** (sigma0_db / 10) + 10 ** (nesz_db / 10)
    for axis, (spacing, resolution) in enumerate([(2.5, 3.5), (1.5, 2.0)], start=1):
        taps = impulse_response(resolution, spacing)
        # variance of the mean of n correlated intensities: sum of the squared correlations of the field (Siegert)
        correlation = np.correlate(taps, taps, mode="full") ** 2
        n = power.shape[axis % 2]
        sd = np.sqrt(correlation.sum() / (radar.looks * n))
        # 640 rows and columns in all: 4.5 sigma; the border was 14 % (0.65 and 0.74 dB) dark
        assert 4.5 * sd < 0.05
        np.testing.assert_allclose(power.mean(axis=axis % 2) / expected, 1.0, atol=4.5 * sd)
