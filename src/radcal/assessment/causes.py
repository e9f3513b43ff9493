"""Likely cause of the misfit of a law, if the data show one."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.fit_test import MEAN_DB, SPREAD, FitTest
from radcal.assessment.incidence_check import error_behind
from radcal.assessment.reach import law_range_db
from radcal.calibration.grounds import GroundLaw
from radcal.measurement.target import Target
from radcal.radar.geometry import Geometry
from radcal.radar.texture import log_speckle_cumulants

__all__ = ["UNKNOWN", "area_slope", "joint_cause", "likely_cause"]

UNKNOWN = "cause unknown"
_FILTERED = 1.5  # least ratio of the image's looks to the sensor's looks in a speckle-filtered image
_LEAST_AREA_DB = 0.3  # least standard deviation of the area factor at equal incidence that shows a cause
_ERRORS, _ALIKE = 4.0, 0.35  # limits of the area slope: least size in standard errors, largest distance from 1
_MOST_OF_VARIANCE = 0.9  # largest share of the variance of the mapped incidence that its error may have
_FEW_LOOKS, _LIKELY_DEG = 0.8, 6.0


def likely_cause(
    law_name: str,
    law: GroundLaw,
    test: FitTest,
    target: Target,
    geometry: Geometry,
    image_looks: float,
) -> str:
    """Text that names the likely cause of the misfit of a law, or says that the cause is unknown.

    Parameters
    ----------
    law_name : str
        Name of the law.
    law : GroundLaw
        Law found, on the ground of the target.
    test : FitTest
        Result of the test of the fit, which the law has failed.
    target : Target
        Measured pixels.
    geometry : Geometry
        Geometry of the pass.
    image_looks : float
        Number of looks of the image's homogeneous areas; NaN if it is not known.
    """
    causes: list[Callable[[], str]] = [
        lambda: _noise(law, test, target.noise_db),
        lambda: _reach(law_name, law, test),
        lambda: _looks(law, test, image_looks),
        lambda: _radiometry(law, target, geometry),
        lambda: _held_back(test),
        lambda: _incidence(law, test),
    ]
    return next((said for cause in causes if (said := cause())), UNKNOWN)


def joint_cause(test: FitTest, why: str) -> str:
    """Cause of a misfit that shows in the test alone, without law and pixels of a pass; else ``why`` none is named."""
    return _at_limit(test) or _held_back(test) or f"{UNKNOWN}: {why}"


def _noise(law: GroundLaw, test: FitTest, noise_db: float) -> str:
    """Text that names noise as cause, if the worst bin's measured level lies below the simulated noise; else empty."""
    k = int(np.abs(law.classes.nodes_deg.mean(axis=1) - test.worst_deg).argmin())
    measured = float(law.classes.cumulants[k, 0] - log_speckle_cumulants(law.fit.looks)[0])
    if test.worst_mean_db > MEAN_DB and measured < noise_db:
        return (
            f"the measured {measured:.1f} dB lie below the noise that the simulator adds, {noise_db:.1f} dB (radar."
            "nesz_db)"
        )
    return ""


def _reach(law_name: str, law: GroundLaw, test: FitTest) -> str:
    """Text that names the bounds of X as cause, if no law inside them reaches the worst bin's level; else empty."""
    classes = law.classes
    k = int(np.abs(classes.nodes_deg.mean(axis=1) - test.worst_deg).argmin())
    level, there = law.method.law, classes.nodes_deg[k]
    low, high = law_range_db(level, law.method.bounds, there)
    asked = float(np.mean(level(np.radians(there), law.fit.parameters))) - test.worst_mean_db
    if not low <= asked <= high and test.bounds and abs(test.worst_mean_db) > MEAN_DB:
        return f"{law_name}'s bounds cannot reach {round(asked)} dB"
    return ""


def _held_back(test: FitTest) -> str:
    """Text that names the parameters held back by their bounds as cause; empty if there are none."""
    if len(test.bounds) == 1:
        return f"{test.bounds[0]} is held back by its bound"
    return f"{' and '.join(test.bounds)} are held back by their bounds" if test.bounds else ""


def _looks(law: GroundLaw, test: FitTest, image_looks: float) -> str:
    """Text on an image with too many looks for the sensor, or on effective looks at a limit; else empty."""
    sensor = law.method.looks
    if image_looks > _FILTERED * sensor:
        return f"the image has {image_looks:.1f} looks, radar.looks is {sensor:g}: speckle-filtered?"
    return _at_limit(test, f" {sensor:g}")


def _at_limit(test: FitTest, looks: str = "") -> str:
    """Text on effective looks that end at a limit of the search, with the value of radar.looks; else empty.

    A level that is off can press the looks to a limit, too, because the mean of log speckle depends on them. The
    simulated pixels then spread more at the lower limit, or less at the upper limit, than the measured ones.
    """
    ratio = test.sd_db / max(test.measured_sd_db, 1e-12)
    if test.looks_limit == "upper":
        if ratio < 1.0 / (1.0 + SPREAD):
            return "the looks found are the most that the search allows, and narrow the simulated pixels alone"
        return f"the pixels spread less than the speckle of radar.looks{looks}: speckle-filtered?"
    if test.looks_limit == "lower":
        if ratio > 1.0 + SPREAD:
            return "the looks found are the fewest that the search allows, and spread the simulated pixels alone"
        return "the pixels spread more than any speckle: mixed ground?"
    return ""


def _radiometry(law: GroundLaw, target: Target, geometry: Geometry) -> str:
    """Text that names a wrong radiometry as cause, if residuals are proportional to the area factor; else empty."""
    rows = target.pixels // geometry.shape[1]
    local, flat = np.radians(target.incidence_deg.astype(np.float64)), np.radians(geometry.flat_incidence_deg[rows])
    area_db = 10.0 * np.log10(np.sin(flat) / np.maximum(np.sin(local), 0.02))
    slope, error = area_slope(law, area_db)
    if abs(slope) > _ERRORS * error and abs(abs(slope) - 1.0) < _ALIKE:
        return f"radiometry: the residuals go with the area of the ground in a pixel ({slope:+.1f} dB for each dB)"
    return ""


def area_slope(law: GroundLaw, area_db: NDArray[np.float64]) -> tuple[float, float]:
    """Slope of the residuals against the area factor at equal incidence, and standard error of the slope.

    Law and area factor both depend on the incidence. In each bin, a polynomial of third degree in the incidence is
    therefore fitted to the residuals and to the area factor, and subtracted. The standard error follows from the
    covariance of the fit: effects of fields and of their parts, and sampling inside these parts. If the area factor is
    equal within each field, the slope is therefore no better known than the number of fields allows.

    Parameters
    ----------
    law : GroundLaw
        Law found.
    area_db : ndarray, shape (pixels,)
        Ratio of the area of the ground in each pixel to the area of level ground [dB].

    References
    ----------
    Cameron and Miller, "A practitioner's guide to cluster-robust inference", Journal of Human Resources 50 (2015),
    section 2: variance of a least squares slope whose errors have random effects of groups.
    """
    ground, member = law.ground, law.classes.member
    residual = ground.values_db - law.levels_db(ground.incidence_deg)
    left = [residual.copy(), area_db.astype(np.float64)]
    for k in range(law.classes.size):
        inside = member == k
        angle = ground.incidence_deg[inside]
        scaled = (angle - angle.mean()) / max(float(np.ptp(angle)), 1e-9)
        basis = np.vander(scaled, 4)
        for values in left:
            values[inside] -= basis @ np.linalg.lstsq(basis, values[inside], rcond=None)[0]
    away, area = left
    if np.std(area) < _LEAST_AREA_DB:
        return 0.0, np.inf
    power, cells = float(area @ area), ground.cells
    by_field = np.bincount(np.unique(ground.patch, return_inverse=True)[1], area)
    by_cell = np.bincount(cells.of_pixel, area)
    # variance of a pixel as it enters the sums over cells: variance of the cell's mean, times its number of pixels
    of_pixel = cells.sampling_variance(away, ground.independent) * cells.count
    variance = (
        law.spread.between**2 * (by_field @ by_field)
        + law.spread.within**2 * (by_cell @ by_cell)
        + of_pixel @ np.bincount(cells.of_pixel, area**2)
    )
    return float(area @ away / power), float(np.sqrt(variance) / power)


def _incidence(law: GroundLaw, test: FitTest) -> str:
    """Text on the error of the local incidence that would explain why the effective looks are few; else empty."""
    # an error of the incidence spreads the pixels of a bin and hardly moves their mean
    if law.fit.looks > _FEW_LOOKS * law.method.looks or abs(test.worst_mean_db) > MEAN_DB:
        return ""
    error, _ = error_behind(law.method.law, law.fit, law.ground.incidence_deg, law.method.looks)
    # an error as large as the spread of the mapped incidence explains nothing (material seen at one incidence)
    if not 0.0 < error <= _LIKELY_DEG or error**2 > _MOST_OF_VARIANCE * float(np.var(law.ground.incidence_deg)):
        return ""
    return f"an error of the local incidence of {error:.1f} degrees would spread the pixels so, as would texture"
