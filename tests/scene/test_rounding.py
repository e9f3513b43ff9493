"""Steps of rounded heights, and the error of slopes that they leave."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from radcal.scene.raster import height_step_m


def relief(sigma_px=6.0):
    """Smooth hills with an sd of 9 m."""
    smooth = gaussian_filter(np.random.default_rng(3).standard_normal((120, 150)), sigma_px, mode="wrap")
    return 412.3 + 9.0 * smooth / smooth.std()


@pytest.mark.parametrize("step", [0.02, 0.1, 0.5, 1.0, 3.0])
@pytest.mark.parametrize("dtype", ["float32", "float64"])
def test_step_of_rounded_heights(step, dtype):
    heights = (np.round(relief() / step) * step).astype(dtype).astype(float)
    assert height_step_m(heights) == pytest.approx(step, rel=1e-3)
    heights[:, 7] = np.nan
    assert height_step_m(heights) == pytest.approx(step, rel=1e-3)


def test_heights_that_are_not_rounded_have_no_step():
    assert height_step_m(relief()) == 0.0
    assert height_step_m(relief().astype(np.float32).astype(float)) == 0.0
    mixed = np.round(relief())
    mixed[60, 70] += 0.4  # one height between
    assert height_step_m(mixed) == 0.0
    east, north = np.meshgrid(np.arange(30.0), np.arange(20.0))
    for plane in (0 * east, 3.0 + 2.0 * east, 5.0 + 2.0 * east - 1.0 * north, np.full((4, 5), np.nan)):
        assert height_step_m(plane) == 0.0


def test_step_of_mountains_in_single_precision():
    """Of 6,000 steps of 0.1 m, each known to 0.12 mm."""
    heights = (np.round((1500.0 + 15.0 * (relief() - 412.3)) / 0.1) * 0.1).astype(np.float32).astype(float)
    assert np.ptp(heights) > 600.0
    assert height_step_m(heights) == pytest.approx(0.1, rel=1e-5)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_a_ridge_or_a_valley_of_one_step_is_no_plane(sign):
    assert height_step_m(sign * np.tile([0.0, 2.0, 4.0, 4.0], (3, 1))) == 2.0
