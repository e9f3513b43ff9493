"""Check of a fitted law for signs of an error of the mapped local incidence."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.calibration.law_fit import LawFit
from radcal.radar.laws import Law, seen_rad
from radcal.radar.texture import log_speckle_cumulants

__all__ = ["error_behind", "incidence_warnings"]

_FEW_LOOKS = 0.5  # in multiples of the sensor's looks
_BENT_DB = 0.5  # change of a law that is worth a warning
_LIKELY_DEG = 6.0  # largest likely error of a map of incidence; texture causes larger apparent errors
_MOST_OF_SPREAD = 0.75  # largest error, as a share of the standard deviation of the mapped incidence


def _shape_variance(law: Law, fit: LawFit, phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variance, by the uncertainty of X, of a law minus its mean over the angles [dB^2], shape (k,), to first order."""
    x = fit.parameters
    steps = 1e-4 * np.sqrt(np.diag(fit.covariance)[:-1]) * np.eye(x.size)
    columns = [(law(phi, x + step) - law(phi, x - step)) / (2.0 * step.max()) for step in steps]
    slope = np.stack(columns, axis=-1)
    slope -= slope.mean(axis=0)
    return np.asarray(np.einsum("kd,de,ke->k", slope, fit.covariance[:-1, :-1], slope))


def error_behind(law: Law, fit: LawFit, incidence_deg: ArrayLike, sensor: float) -> tuple[float, float]:
    r"""Error of the local incidence that would alone explain the low effective looks, and its effect on the law.

    A classical error e adds the variance :math:`b^2 e^2 / \lambda` to the pixels of a bin of mapped incidence. The
    fitted slope b is :math:`\lambda = 1 - e^2 / V` times the true slope, where V is the variance of the mapped
    incidence. The function finds the error e whose added variance explains why the fitted looks are below the sensor's.

    Parameters
    ----------
    law : Law
        Backscatter law with a curve.
    fit : LawFit
        Law and looks fitted in bins of mapped incidence.
    incidence_deg : array_like
        Mapped incidence of the pixels [deg].
    sensor : float
        Number of looks of the sensor.

    Returns
    -------
    error_deg : float
        Error e in addition to the configured error [deg]; 0 if the fitted looks are not below the sensor's.
    bent_db : float
        Largest change that the error e causes in the shape of the law, over the incidence seen (5-95 %) [dB].
    """
    angle = np.asarray(incidence_deg, dtype=np.float64)
    missing = float(log_speckle_cumulants(fit.looks)[1] - log_speckle_cumulants(sensor)[1])
    phi = seen_rad(angle)
    level = law(phi, fit.parameters)
    step = np.radians(0.01)
    slope = (law(phi + step, fit.parameters) - law(phi - step, fit.parameters)) / 0.02
    spread = max(float(np.var(angle)), 1e-12)
    ratio = max(missing, 0.0) / max(float(np.mean(slope**2)), 1e-12) / spread
    error = np.sqrt(spread * ratio / (1.0 + ratio))
    return float(error), float(ratio * np.abs(level - level.mean()).max())


def incidence_warnings(name: str, law: Law, fit: LawFit, incidence_deg: ArrayLike, sensor: float) -> list[str]:
    """Warning if the pixels of a material have fewer effective looks than the sensor; else empty.

    Parameters
    ----------
    name : str
        Name of the material.
    law : Law
        Backscatter law with a curve.
    fit : LawFit
        Law and looks fitted in bins of mapped incidence.
    incidence_deg : array_like
        Mapped incidence of the pixels [deg].
    sensor : float
        Number of looks of the sensor.

    Returns
    -------
    list of str
    """
    lines = []
    error, bent = error_behind(law, fit, incidence_deg, sensor)
    spread = float(np.std(np.asarray(incidence_deg, dtype=np.float64)))
    few = np.log(sensor / fit.looks) > np.sqrt(fit.covariance[-1, -1])
    few = few and _shape_variance(law, fit, seen_rad(incidence_deg)).max() > 0.0  # a constant law has no shape
    if few and bent > _BENT_DB and error <= min(_LIKELY_DEG, _MOST_OF_SPREAD * spread):
        lines.append(
            f"{name}: its pixels spread as those of {fit.looks:.1f} looks, the sensor has {sensor:.3g}. "
            f"Texture does that; so does an error of the local incidence of {error:.1f} deg, which would have "
            f"flattened the law by up to {bent:.1f} dB over the incidence seen. If the map may be off that much, say "
            "so in target.incidence_error_deg."
        )
    elif fit.looks < _FEW_LOOKS * sensor:
        lines.append(
            f"{name}: its pixels spread as those of {fit.looks:.1f} looks, the sensor has {sensor:.3g}: "
            "texture, mixed ground, or an error of the local incidence (see incidence_error_deg)."
        )
    return lines
