"""What is known of a backscatter law before any image: weak priors on the curve, not on its parameters.

Each is a residual, in its own standard deviations, beside those of the measured classes.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.radar.laws import Law

__all__ = ["LOOKS_MOST", "CurvePrior", "looks_residuals"]

LOOKS_MOST = 1.1  # times the sensor's
_LOOKS = (0.9, 0.6)  # median, times the sensor's looks; log standard deviation
_SLOPE_DEG = (30.0, 45.0)
_SLOPE = (0.2, 0.95)  # median [dB/deg], log standard deviation
_LEAST_SLOPE = 0.02  # below, the logarithm goes on as its tangent: a flat or rising curve has a finite price
_LEVEL_SD_DB = 10.0
_LEAST_SHARE = 0.02  # of the median: below, the same
_RANGE_DB = 32.5  # on either side of the measured mean
_RANGE_DEG = np.linspace(20.0, 70.0, 11)
_RANGE_SD_DB = 1.0


def _log_normal(value: NDArray[np.float64], median: float, log_sd: float, least: float) -> NDArray[np.float64]:
    """Residual of a log-normal law, its logarithm continued by the tangent below ``least``.

    The density of the value itself, not of its logarithm: half the square of the residual is, but for a constant,
    (ln v - ln m)^2 / (2 s^2) + ln v. Without ln v a flat law of X would make the median m exp(s^2).
    """
    above = np.maximum(value, least)
    log = np.log(above) + np.minimum(value - least, 0.0) / least
    return np.asarray((log - np.log(median)) / log_sd + log_sd)


def looks_residuals(effective: ArrayLike, sensor: float) -> NDArray[np.float64]:
    """Residual of the looks of a material: log-normal about 0.9 of the sensor's, log sd 0.6.

    Texture only lowers the looks seen in dB; natural surfaces at metre to decametre resolution show
    half to all of the sensor's (Oliver and Quegan, "Understanding Synthetic Aperture Radar Images",
    chapter 5): half is one standard deviation below the median. It is wide because texture that differs from field to
    field leaves the spread of a single field's pixels with an error of 20 % in looks, so that a narrow prior about
    less than the sensor's looks would lower those of ground without texture: of one field with the speckle of 4 looks
    it leaves 3.95, of one with 2.5 it makes 2.6. Above 1.1 times the sensor's none is possible: the search ends there.

    Parameters
    ----------
    effective : array_like, shape (m,)
        Looks of the material; a number counts as one.
    sensor : float
        Looks of the sensor.

    Returns
    -------
    ndarray, shape (m,)
    """
    median, log_sd = _LOOKS
    return np.asarray(np.log(np.atleast_1d(np.asarray(effective, dtype=np.float64)) / (median * sensor)) / log_sd)


@dataclass(frozen=True)
class CurvePrior:
    """Weak priors on a material's curve.

    - slope: the mean fall between 30 and 45 degrees is log-normal, median 0.2 dB/deg, log sd 0.95. The
      means of terrain (soil, grass, crops, trees; L to X band) in Ulaby and Dobson, "Handbook of Radar
      Scattering Statistics for Terrain" (1989), fall by about 0.05 (trees) to 0.6 dB/deg (smooth soil).
    - level: normal about the measured mean, sd 10 dB.
    - parameters with a prior of their own (``Law.log_normal``): log-normal.
    - sigma0 between 20 and 70 degrees within 32.5 dB of the measured mean. From the noise of good sensors
      to the strongest natural surfaces it is -50 to +15 dB; taken about the measured mean, because an
      image's own level may be off.

    Attributes
    ----------
    law : Law
        With a curve.
    level_db : float
        Measured mean [dB].
    level_deg : float
        Mean local incidence of the measured pixels [deg].
    """

    law: Law
    level_db: float
    level_deg: float

    @property
    def angles_deg(self) -> NDArray[np.float64]:
        """Angles at which the curve is asked [deg], shape (k,)."""
        return np.array([*_SLOPE_DEG, self.level_deg, *_RANGE_DEG])

    def residuals(self, parameters: ArrayLike) -> NDArray[np.float64]:
        """Residuals at one X, shape (d,): slope, level, range at eleven angles, and each parameter that has a prior."""
        x = np.asarray(parameters, dtype=np.float64)
        return np.asarray(self.of_curves(self.law(np.radians(self.angles_deg), x)[None], x[None])[0])

    def of_curves(self, levels_db: NDArray[np.float64], parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Residuals of several curves, from their levels at the angles, shape (m, k), and X, shape (m, d)."""
        first, second, level, *_ = levels_db.T
        slope = (first - second) / (_SLOPE_DEG[1] - _SLOPE_DEG[0])
        outside = np.maximum(np.abs(levels_db[:, 3:] - self.level_db) - _RANGE_DB, 0.0)
        found = [
            _log_normal(slope, *_SLOPE, _LEAST_SLOPE)[:, None],
            (level - self.level_db)[:, None] / _LEVEL_SD_DB,
            outside / _RANGE_SD_DB,
        ]
        places = {name: k for k, name in enumerate(self.law.names)}
        found += [
            _log_normal(parameters[:, places[name]], median, log_sd, _LEAST_SHARE * median)[:, None]
            for name, (median, log_sd) in self.law.log_normal.items()
        ]
        return np.concatenate(found, axis=1)
