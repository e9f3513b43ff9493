"""Wrong variants of the laws' formulas, written out again from their publications."""

import numpy as np
import pytest
from scipy.interpolate import PchipInterpolator
from variants import agrees

from radcal.laws.curves import tabulated
from radcal.laws.grazing import RURAL, land_clutter, nrl_sea, weibull_power

ANGLES = np.array([21.0, 37.0, 58.0])
PHI = np.radians(ANGLES)


def test_tabulated():
    knots, levels = (20.0, 40.0, 60.0), (-7.0, -13.0, -13.5)
    agrees(
        tabulated(PHI, levels, angles_deg=knots),
        PchipInterpolator(knots, levels)(ANGLES),
        straight=np.interp(ANGLES, knots, levels),
        radians=PchipInterpolator(knots, levels)(np.clip(PHI, *knots[::2])),
        in_cosine=np.interp(-np.cos(PHI), -np.cos(np.radians(knots)), levels),
    )


@pytest.mark.parametrize(("polarisation", "power"), [("HH", 2.1555e-4), ("VV", 4.0101e-4)])
def test_sea(polarisation, power):
    """Sea state 2 at a grazing angle of 10 degrees and 30 GHz, from an independent implementation."""
    other = {"HH": "VV", "VV": "HH"}[polarisation]

    def found(wave=polarisation, angle_deg=80.0, state=2.0, frequency_ghz=30.0):
        return nrl_sea(np.radians(angle_deg), [state], frequency_ghz=frequency_ghz, polarisation=wave)

    agrees(
        found(),
        10.0 * np.log10(power),
        atol=2e-3,
        other=found(other),
        grazing=found(angle_deg=10.0),
        state=found(state=3.0),
        megahertz=found(frequency_ghz=3e4),
    )
    assert found(angle_deg=90.0) == found(angle_deg=89.9) < found(angle_deg=89.0)
    assert found(angle_deg=0.0) == found(angle_deg=30.0)


def test_land_clutter():
    mean_db, spread = land_clutter([-0.1, 0.1, 0.25, 1.0, 3.0, 4.0, 30.0], RURAL)
    np.testing.assert_array_equal(mean_db, [-33, -33, -32, -30, -27, -25, -25])
    np.testing.assert_array_equal(spread, [3.8, 3.8, 3.5, 3.0, 2.7, 2.6, 2.6])


def test_weibull_power():
    """Mean 1; ratio of mean to median Gamma(1 + a) / (ln 2)^a, 1 / ln 2 of an exponential power."""
    levels = (np.arange(2_000_000) + 0.5) / 2_000_000
    drawn = weibull_power(-np.log(levels), 2.6)
    assert drawn.mean() == pytest.approx(1.0, abs=2e-3)  # the rarest 5e-7 of the power carry 1e-3 of the mean
    agrees(
        1.0 / weibull_power(np.log(2.0), [1.0, 2.6]),
        [1.0 / np.log(2.0), 3.71702 / np.log(2.0) ** 2.6],
        rtol=1e-5,
        exponent=[1.0 / np.log(2.0), 3.71702 / np.log(2.0) ** (1 / 2.6)],
        no_mean=[1.0 / np.log(2.0), 1.0 / np.log(2.0) ** 2.6],
    )
