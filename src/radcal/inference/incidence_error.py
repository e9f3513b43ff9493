r"""Effects of an error of the mapped local incidence on the statistics of an incidence-angle bin.

Noise of the elevation model and misregistration cause classical errors (mapped = true + error) of standard deviation e
(Carroll, Ruppert, Stefanski and Crainiceanu, "Measurement Error in Nonlinear Models", 2nd edition (2006), chapter 1).
The expected true angle is closer to the mean angle than the mapped angle is, by the factor
:math:`\lambda = s_t^2 / (s_t^2 + e^2)`, where :math:`s_t` is the standard deviation of the true angles. Given the
mapped angle, the true angle has the standard deviation :math:`e \sqrt\lambda`. In bins of mapped incidence, a law has
:math:`\lambda` times its true slope (0.69 for e = 4 and :math:`s_t` = 6 degrees).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

_HERMITE = 5
LEAST_SHARE = 0.1  # smallest share of the mapped variance that counts as variance of the true angles


def attenuation(incidence_deg: ArrayLike, error_deg: ArrayLike, rms_deg: float | None = None) -> NDArray[np.float64]:
    r"""Share of the variance of the mapped incidence that is not classical error, at least 0.1.

    If the standard error e differs between places, the share is :math:`V_t / (V_t + e^2)` at each place, where
    :math:`V_t` is the variance of the true angles. The variance of the true angles is the variance of the mapped angles
    minus the mean square of the errors (Carroll et al., section 4.4: regression calibration).

    Parameters
    ----------
    incidence_deg : array_like, shape (pixels,)
        Mapped angles [deg].
    error_deg : array_like, shape (k,) or ()
        Standard error of the local incidence at the places whose share is computed [deg].
    rms_deg : float, optional
        Root mean square of the errors of all pixels [deg]; ``error_deg`` if missing.

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
    r"""Standard error of each pixel's local incidence that the uncertainty of the registration causes.

    A pixel with a wrong displacement is assigned the incidence of another place. To first order, the standard error of
    the incidence :math:`\phi` is :math:`|\nabla\phi|\,u / \sqrt 2`, where u is the standard error of the displacement's
    length; the factor :math:`1 / \sqrt 2` gives the component along the gradient. The error of the incidence is largest
    at edges of the relief, where the gradient of the incidence is large.

    Parameters
    ----------
    incidence_deg : ndarray, shape (rows, columns)
        Local incidence [deg], NaN where there is none.
    uncertainty_px : ndarray, shape (rows, columns)
        Standard error of the displacement's length [pixels]; 0 everywhere if the image was not registered, because the
        error is then unknown.
    pixels : ndarray of int
        Flat indices of the pixels for which the error is computed.

    Returns
    -------
    ndarray, shape (pixels,)
        Standard error [deg]. A pixel next to one without incidence has the root mean square of the other pixels'
        errors. All errors are 0 if none can be computed.

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


def true_nodes(nodes_deg: ArrayLike, error_deg: ArrayLike, mean_deg: float, share: ArrayLike) -> NDArray[np.float64]:
    """Angles with the distribution of the true local incidence, given the mapped angles of each bin.

    Parameters
    ----------
    nodes_deg : array_like, shape (n, m)
        Mapped angles that represent each incidence-angle bin [deg].
    error_deg : array_like, shape (n,) or ()
        Standard deviation of the error in each bin [deg].
    mean_deg : float
        Mean of the material's mapped angles [deg].
    share : array_like, shape (n,) or ()
        Share of true variance, from :func:`attenuation`.

    Returns
    -------
    ndarray, shape (n, 5 m) of float64
        Equally likely angles [deg] with nearly the distribution of the true angles, between 0 and 90. Each mapped angle
        is replaced by five points that have the mean, variance and third moment of a normal distribution.
    """
    nodes = np.asarray(nodes_deg, dtype=np.float64)
    sd, kept = (
        np.broadcast_to(np.asarray(values, dtype=np.float64), len(nodes))[:, None] for values in (error_deg, share)
    )
    if not sd.any():
        return nodes
    centre, sd = mean_deg + kept * (nodes - mean_deg), sd * np.sqrt(kept)
    points = np.arange(_HERMITE) - 0.5 * (_HERMITE - 1)
    points /= points.std()
    return np.asarray(np.clip(centre[..., None] + sd[..., None] * points, 0.0, 90.0).reshape(nodes.shape[0], -1))
