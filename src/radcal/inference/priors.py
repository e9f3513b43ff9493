"""Weak priors on the curve of a backscatter law: knowledge that does not come from the measured image.

Each prior adds a residual, in standard deviations of the prior, to the residuals of the measured pixels. Priors on the
standard deviation between fields are those of :mod:`radcal.ground.patches` for the search and of
:mod:`radcal.posterior.fixed_laws` for the posterior.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.laws import Law

LOOKS_MOST = 1.1  # largest effective number of looks, in multiples of the sensor's looks
_LOOKS = (0.9, 0.6)  # median, times the sensor's looks; log standard deviation
_SLOPE_DEG = (30.0, 45.0)
_SLOPE = (0.2, 0.95)  # median [dB/deg], log standard deviation
_LEAST_SLOPE = 0.02  # [dB/deg]; a tangent continues the logarithm below it: flat curves have finite residuals
_LEVEL_SD_DB = 10.0
_LEAST_SHARE = 0.02  # in medians of a parameter; a tangent continues the logarithm below it
_RANGE_DB = 65.0  # width of the range of natural sigma0
_RANGE_DEG = np.linspace(20.0, 70.0, 11)
_LEAST_ROOM_DB = 5.0  # a tangent continues the logarithm below it


def _log(value: NDArray[np.float64], least: float) -> NDArray[np.float64]:
    """Natural logarithm, which a tangent continues below ``least``."""
    return np.asarray(np.log(np.maximum(value, least)) + np.minimum(value - least, 0.0) / least)


def _log_normal(value: NDArray[np.float64], median: float, log_sd: float, least: float) -> NDArray[np.float64]:
    """Residuals of a log-normal prior; below ``least`` a tangent continues the logarithm of the value.

    Half the square of the residual is, up to a constant, minus the logarithm of the log-normal density of a value v
    with median m and log standard deviation s: (ln v - ln m)^2 / (2 s^2) + ln v. Without the term ln v, a uniform
    distribution of X would give v the median m exp(s^2).
    """
    return np.asarray((_log(value, least) - np.log(median)) / log_sd + log_sd)


def _within_range(span_db: NDArray[np.float64]) -> NDArray[np.float64]:
    """Residuals of the prior on the span of a curve, the difference of its largest and its smallest sigma0 [dB].

    A curve whose absolute level is unknown fits into a range of width R at levels that fill an interval of R minus its
    span. For a level with a uniform distribution, the density of the curve is therefore proportional to R minus the
    span. The constant 0.1 keeps the square root smooth at flat curves, of span 0.
    """
    return np.asarray(np.sqrt(0.1 + 2.0 * (np.log(_RANGE_DB) - _log(_RANGE_DB - span_db, _LEAST_ROOM_DB))))


def looks_residuals(effective: ArrayLike, sensor: float) -> NDArray[np.float64]:
    """Residual of the prior on a material's effective looks: median 0.9 times the sensor's looks, log sd 0.6.

    Texture only lowers the effective number of looks. Natural surfaces at metre to decametre resolution show half to
    all of the sensor's looks (Oliver and Quegan, "Understanding Synthetic Aperture Radar Images", chapter 5); half of
    the looks is one standard deviation below the median of the prior. The prior is wide because texture differs from
    field to field: the pixels of a single field determine the looks with an error of 20 %, and a narrow prior would
    lower the looks of ground without texture. With the wide prior, a single field with speckle of 4 looks is
    estimated to have 3.95 looks, and one with 2.5 looks to have 2.6. The search for the effective looks stays below 1.1
    times the sensor's looks.

    Parameters
    ----------
    effective : array_like, shape (m,)
        Effective number of looks of the material; a scalar is taken as one value.
    sensor : float
        Number of looks of the sensor.

    Returns
    -------
    ndarray, shape (m,)
    """
    median, log_sd = _LOOKS
    return np.asarray(np.log(np.atleast_1d(np.asarray(effective, dtype=np.float64)) / (median * sensor)) / log_sd)


@dataclass(frozen=True)
class CurvePrior:
    """Weak priors on a material's curve.

    - slope: the mean decrease of sigma0 between 30 and 45 degrees is log-normal, median 0.2 dB/deg, log sd 0.95. The
      mean levels of terrain (soil, grass, crops, trees; L to X band) in Ulaby and Dobson, "Handbook of Radar
      Scattering Statistics for Terrain" (1989), decrease by about 0.05 (trees) to 0.6 dB/deg (smooth soil).
    - level: normal about the measured mean, standard deviation 10 dB.
    - parameters for which the law has a prior (``Law.log_normal``): log-normal.
    - range: natural sigma0 lies between -50 dB (noise of good sensors) and +15 dB (strongest natural surfaces). The
      absolute level of an image may be wrong, and ground near nadir is near the upper end of the range. The prior
      therefore limits the span of the curve between 20 and 70 degrees, and not its distance from the measured mean.
      The density is proportional to 65 dB minus the span; beyond a span of 60 dB, its logarithm decreases linearly, so
      that the prior does not outweigh the pixels of ground that the simulator or the map represents badly.

    Attributes
    ----------
    law : Law
        Backscatter law with a curve.
    level_db : float
        Mean of the measured pixels [dB].
    level_deg : float
        Mean local incidence of the measured pixels [deg].
    """

    law: Law
    level_db: float
    level_deg: float

    @property
    def angles_deg(self) -> NDArray[np.float64]:
        """Incidence angles at which the priors evaluate the curve [deg], shape (k,)."""
        return np.array([*_SLOPE_DEG, self.level_deg, *_RANGE_DEG])

    def residuals(self, parameters: ArrayLike) -> NDArray[np.float64]:
        """Residuals at one X, shape (d,): of slope, level, range, and parameters with a prior."""
        x = np.asarray(parameters, dtype=np.float64)
        return np.asarray(self.of_curves(self.law(np.radians(self.angles_deg), x)[None], x[None])[0])

    def of_curves(self, levels_db: NDArray[np.float64], parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Residuals of m curves, from their levels at :attr:`angles_deg`, shape (m, k), and X, shape (m, d)."""
        first, second, level, *_ = levels_db.T
        slope = (first - second) / (_SLOPE_DEG[1] - _SLOPE_DEG[0])
        found = [
            _log_normal(slope, *_SLOPE, _LEAST_SLOPE)[:, None],
            (level - self.level_db)[:, None] / _LEVEL_SD_DB,
            _within_range(np.ptp(levels_db[:, 3:], axis=1))[:, None],
        ]
        places = {name: k for k, name in enumerate(self.law.names)}
        found += [
            _log_normal(parameters[:, places[name]], median, log_sd, _LEAST_SHARE * median)[:, None]
            for name, (median, log_sd) in self.law.log_normal.items()
        ]
        return np.concatenate(found, axis=1)
