r"""What an error of the mapped local incidence does to the statistics of a class.

Two kinds of error of standard deviation e (Carroll, Ruppert, Stefanski and Crainiceanu, "Measurement
Error in Nonlinear Models", 2nd edition (2006), chapter 1):

- ``classical``: mapped = true + error. Noise of the elevation model and misregistration are of this kind.
  Given the mapped angle, the true one is drawn to the mean by :math:`\lambda = s_t^2 / (s_t^2 + e^2)`,
  :math:`s_t` the spread of the true angles, and scatters by :math:`e \sqrt\lambda`: a slope appears
  :math:`\lambda` times as steep (0.69 for e = 4 and :math:`s_t` = 6 degrees) in classes of mapped incidence.
- ``berkson``: true = mapped + error. Relief that a smooth elevation model leaves out is of this kind: slopes
  keep, and the spread grows by slope times e.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.calibration.law_fit import LawFit
from radcal.radar.laws import Law, seen_rad
from radcal.radar.texture import log_speckle_cumulants

__all__ = [
    "LEAST_SHARE",
    "ErrorKind",
    "attenuation",
    "error_behind",
    "incidence_warnings",
    "law_gap_db",
    "registration_error_deg",
    "true_nodes",
]

ErrorKind = Literal["classical", "berkson"]
_HERMITE = 5
LEAST_SHARE = 0.1  # of the mapped variance that may be true: an error as large as the spread leaves no classes
_GAP_DB = 0.7
_GAP_ERRORS = 2.0  # 1,000 pixels of a right law show up to 1 dB by chance (benchmarks/right_law.py)
_FEW_LOOKS = 0.5  # times the sensor's
_BENT_DB = 0.5  # change of a law that is worth a warning
_LIKELY_DEG = 6.0  # the most that maps are off by: what takes more is texture
_MOST_OF_SPREAD = 0.75  # times the mapped incidence's own: a map that is mostly error has no classes


def attenuation(incidence_deg: ArrayLike, error_deg: ArrayLike, rms_deg: float | None = None) -> NDArray[np.float64]:
    r"""Share of the variance of the mapped incidence that is not classical error, at least 0.1.

    With errors that differ, a place of error e has the share :math:`V_t / (V_t + e^2)`, :math:`V_t` the variance of
    the true angles: that of the mapped ones less the mean square of the errors (Carroll et al., section 4.4: regression
    calibration).

    Parameters
    ----------
    incidence_deg : array_like, shape (pixels,)
        Mapped angles [deg].
    error_deg : array_like, shape (k,) or ()
        Standard error at the places asked for [deg].
    rms_deg : float, optional
        Root mean square of the errors of all pixels [deg]; ``error_deg`` where one number holds for all.

    Returns
    -------
    ndarray, shape (k,) or ()
    """
    error = np.asarray(error_deg, dtype=np.float64)
    square = error**2 if rms_deg is None else rms_deg**2
    variance = max(float(np.var(np.asarray(incidence_deg, dtype=np.float64))), 1e-12)
    true = np.maximum(variance - square, LEAST_SHARE * variance)
    return np.where(error == 0.0, 1.0, np.maximum(LEAST_SHARE, true / (true + error**2)))


def registration_error_deg(
    incidence_deg: NDArray[np.float32], uncertainty_px: NDArray[np.float32], pixels: NDArray[np.int64]
) -> NDArray[np.float64]:
    r"""Standard error of the local incidence that a registration leaves, pixel by pixel.

    A pixel that lies a displacement off shows the incidence of another place: to first order the error is
    :math:`|\nabla\phi|\,u / \sqrt 2`, u the standard error of the displacement's length and the square root its
    share along the gradient. Edges of the relief, where the gradient is large, have most of it.

    Parameters
    ----------
    incidence_deg : ndarray, shape (rows, columns)
        Local incidence [deg], NaN where there is none.
    uncertainty_px : ndarray, shape (rows, columns)
        Standard error of the displacement's length [pixels]; 0 where the image was not registered, and then
        nothing is known of the error.
    pixels : ndarray of int
        Flat indices of the pixels concerned.

    Returns
    -------
    ndarray, shape (pixels,)
        Standard error [deg]; beside a pixel without incidence the root mean square of the others, and 0 everywhere
        where none is known.

    References
    ----------
    JCGM 100:2008, "Guide to the expression of uncertainty in measurement", section 5.1 (law of propagation of
    uncertainty).
    """
    if not np.any(uncertainty_px > 0):
        return np.zeros(pixels.size)
    down, right = np.gradient(incidence_deg.astype(np.float64))
    variance = 0.5 * (down**2 + right**2) * uncertainty_px.astype(np.float64) ** 2
    found = variance.ravel()[pixels]
    known = np.isfinite(found)
    usual = found[known].mean() if known.any() else 0.0
    return np.asarray(np.sqrt(np.where(known, found, usual)))


def true_nodes(
    nodes_deg: ArrayLike, error_deg: ArrayLike, kind: ErrorKind, mean_deg: float, share: ArrayLike
) -> NDArray[np.float64]:
    """True angles behind mapped ones.

    Parameters
    ----------
    nodes_deg : array_like, shape (n, m)
        Mapped angles that stand for each class [deg].
    error_deg : array_like, shape (n,) or ()
        Standard deviation of the error in each class [deg].
    kind : {'classical', 'berkson'}
        Which of the two the error moves.
    mean_deg : float
        Mean of the material's mapped angles [deg].
    share : array_like, shape (n,) or ()
        As :func:`attenuation` gave it; not used for ``berkson``.

    Returns
    -------
    ndarray, shape (n, 5 m) of float64
        Angles [deg] with nearly the distribution of the true ones, equally likely each: the five points of
        a normal law have its mean, variance and (by symmetry) third moment. Within 0 and 90.
    """
    nodes = np.asarray(nodes_deg, dtype=np.float64)
    sd, kept = (
        np.broadcast_to(np.asarray(values, dtype=np.float64), len(nodes))[:, None] for values in (error_deg, share)
    )
    if not sd.any():
        return nodes
    centre = nodes
    if kind == "classical":
        centre, sd = mean_deg + kept * (nodes - mean_deg), sd * np.sqrt(kept)
    points = np.arange(_HERMITE) - 0.5 * (_HERMITE - 1)
    points /= points.std()
    return np.asarray(np.clip(centre[..., None] + sd[..., None] * points, 0.0, 90.0).reshape(nodes.shape[0], -1))


def law_gap_db(law: Law, first: LawFit, second: LawFit, incidence_deg: ArrayLike) -> tuple[float, float]:
    """Largest difference of the shapes of two laws between the 5 % and 95 % of the incidence [deg].

    The mean difference is taken out: looks and level move it, errors of the incidence the shape.

    Returns
    -------
    gap_db : float
        The difference [dB].
    standard_errors : float
        The same in standard errors of its own.
    """
    phi = seen_rad(incidence_deg)
    difference = law(phi, first.parameters) - law(phi, second.parameters)
    difference = np.abs(difference - difference.mean())
    variance = _shape_variance(law, first, phi) + _shape_variance(law, second, phi)
    k = int(difference.argmax())
    return float(difference[k]), float(difference[k] / np.sqrt(max(variance[k], 1e-12)))


def _shape_variance(law: Law, fit: LawFit, phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Variance of a law about its mean over the angles, to first order in X [dB^2]."""
    x = fit.parameters
    steps = 1e-4 * np.sqrt(np.diag(fit.covariance)[:-1]) * np.eye(x.size)
    columns = [(law(phi, x + step) - law(phi, x - step)) / (2.0 * step.max()) for step in steps]
    slope = np.stack(columns, axis=-1)
    slope -= slope.mean(axis=0)
    return np.asarray(np.einsum("kd,de,ke->k", slope, fit.covariance[:-1, :-1], slope))


def error_behind(law: Law, fit: LawFit, incidence_deg: ArrayLike, sensor: float) -> tuple[float, float]:
    r"""Error of the local incidence that alone would make the looks found so few, and what it does to the law.

    A classical error e leaves in a class of mapped incidence the variance :math:`b^2 e^2 / \lambda`, b the slope
    found, which is :math:`\lambda = 1 - e^2 / V` times the true one, V the variance of the mapped incidence. Solved
    for e.

    Parameters
    ----------
    law : Law
        With a curve.
    fit : LawFit
        Law and looks found in classes of mapped incidence.
    incidence_deg : array_like
        Mapped incidence of the pixels [deg].
    sensor : float
        Looks of the sensor.

    Returns
    -------
    error_deg : float
        The error e besides any that was told [deg]; 0 where the looks are the sensor's.
    bent_db : float
        Largest change over the incidence seen (5-95 %) of the shape of the law, were that so [dB].
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


def incidence_warnings(
    name: str, law: Law, conditional: LawFit, marginal: LawFit, incidence_deg: ArrayLike, sensor: float
) -> list[str]:
    """Say where the law in classes of mapped incidence is not the one behind the spread of the whole material.

    Parameters
    ----------
    name : str
        Material.
    law : Law
        With a curve.
    conditional : LawFit
        Law fitted to the classes of mapped incidence.
    marginal : LawFit
        Law fitted to all pixels as one class, at the looks that neighbours show: an untold error of the
        incidence flattens the first law more than this.
    incidence_deg : array_like
        Mapped incidence of the pixels [deg].
    sensor : float
        Looks of the sensor.

    Returns
    -------
    list of str

    References
    ----------
    Hausman, "Specification tests in econometrics", Econometrica 46 (1978): two estimates of which an error
    of the regressor biases one more, with measurement error as an example.
    """
    lines = []
    gap, errors = law_gap_db(law, conditional, marginal, incidence_deg)
    if gap > _GAP_DB and errors > _GAP_ERRORS:
        lines.append(
            f"{name}: the law in incidence-angle bins and the one from the spread of all pixels differ by "
            f"{gap:.1f} dB over the incidence seen: texture, mixed ground, or an error of the local incidence "
            "(see incidence_error_deg), which flattens a law."
        )
    error, bent = error_behind(law, conditional, incidence_deg, sensor)
    spread = float(np.std(np.asarray(incidence_deg, dtype=np.float64)))
    few = np.log(sensor / conditional.looks) > np.sqrt(conditional.covariance[-1, -1])
    few = few and _shape_variance(law, conditional, seen_rad(incidence_deg)).max() > 0.0  # no shape, nothing to bend
    if few and bent > _BENT_DB and error <= min(_LIKELY_DEG, _MOST_OF_SPREAD * spread):
        lines.append(
            f"{name}: its pixels spread as those of {conditional.looks:.1f} looks, the sensor has {sensor:.3g}. "
            f"Texture does that; so does an error of the local incidence of {error:.1f} deg, which would have "
            f"flattened the law by up to {bent:.1f} dB over the incidence seen. If the map may be off that much, say "
            "so in target.incidence_error_deg."
        )
    elif conditional.looks < _FEW_LOOKS * sensor:
        lines.append(
            f"{name}: its pixels spread as those of {conditional.looks:.1f} looks, the sensor has {sensor:.3g}: "
            "texture, mixed ground, or an error of the local incidence (see incidence_error_deg)."
        )
    return lines
