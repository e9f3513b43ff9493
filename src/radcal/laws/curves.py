"""Laws for any kind of terrain, whose parameters describe the level and the shape of the curve."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from radcal.laws.base import Law, cosine


def mangia(phi_rad: ArrayLike, parameters: ArrayLike) -> NDArray[np.float64]:
    r"""Four-parameter law, equation 1 of the paper under References.

    .. math:: \sigma^0_{dB}(\phi; X) = X_1 + X_2 \cos\phi + X_3 \exp(-X_4 \phi^2)

    Parameters
    ----------
    phi_rad : array_like
        Local incidence angle [rad], any shape.
    parameters : array_like, shape (4,)
        X1, X2, X3 [dB] and X4 [1/rad^2].

    Returns
    -------
    ndarray
        sigma0 [dB], shape of ``phi_rad``.

    References
    ----------
    "Calibration of a Radar Cross-section Model using a Surrogate Model Optimization
    Algorithm", eq. 1.
    """
    phi = np.asarray(phi_rad, dtype=np.float64)
    x1, x2, x3, x4 = np.asarray(parameters, dtype=np.float64)
    return np.asarray(x1 + x2 * np.cos(phi) + x3 * np.exp(-x4 * phi**2))


def ulaby_dobson(phi_rad: ArrayLike, parameters: ArrayLike) -> NDArray[np.float64]:
    r"""Six-parameter law of the mean backscatter of terrain.

    .. math:: \sigma^0_{dB}(\phi; P) = P_1 + P_2 \exp(-P_3 \phi) + P_4 \cos(P_5 \phi + P_6)

    Parameters
    ----------
    phi_rad : array_like
        Local incidence angle [rad], any shape.
    parameters : array_like, shape (6,)
        P1, P2 [dB], P3 [1/rad], P4 [dB], P5 (no unit) and P6 [rad].

    Returns
    -------
    ndarray
        sigma0 [dB], shape of ``phi_rad``.

    References
    ----------
    Ulaby and Dobson, "Handbook of Radar Scattering Statistics for Terrain", Artech House (1989); the book tabulates P1
    to P6 by terrain, band and polarisation.
    """
    phi = np.asarray(phi_rad, dtype=np.float64)
    p1, p2, p3, p4, p5, p6 = np.asarray(parameters, dtype=np.float64)
    return np.asarray(p1 + p2 * np.exp(-p3 * phi) + p4 * np.cos(p5 * phi + p6))


def constant_gamma(phi_rad: ArrayLike, parameters: ArrayLike) -> NDArray[np.float64]:
    r"""One-parameter law of constant gamma0, the backscatter per area across the beam.

    .. math:: \sigma^0_{dB}(\phi; \gamma) = \gamma_{dB} + 10 \log_{10} \cos\phi

    Parameters
    ----------
    phi_rad : array_like
        Local incidence angle [rad], any shape. The cosine of the angle is limited to at least 1e-6.
    parameters : array_like, shape (1,)
        gamma [dB].

    Returns
    -------
    ndarray
        sigma0 [dB], shape of ``phi_rad``.

    References
    ----------
    Long, "Radar Reflectivity of Land and Sea", 3rd edition, Artech House (2001); Richards,
    "Fundamentals of Radar Signal Processing", 2nd edition, McGraw-Hill (2014), eq. 2.64 (with the
    grazing angle, whose sine is the cosine of the incidence).
    """
    (gamma_db,) = np.asarray(parameters, dtype=np.float64)
    return np.asarray(gamma_db + 10.0 * np.log10(cosine(np.asarray(phi_rad, dtype=np.float64))))


def tabulated(phi_rad: ArrayLike, parameters: ArrayLike, *, angles_deg: Sequence[float]) -> NDArray[np.float64]:
    """Curve that interpolates sigma0 at given angles without overshoot; constant beyond the first and last angle.

    Parameters
    ----------
    phi_rad : array_like
        Local incidence angle [rad], any shape.
    parameters : array_like, shape (n,)
        sigma0 at the knots [dB].
    angles_deg : sequence of float, shape (n,)
        Knots, increasing, at least two [deg].

    Returns
    -------
    ndarray
        sigma0 [dB], shape of ``phi_rad``. Between two knots, the curve lies between the values at these knots.

    References
    ----------
    Fritsch and Butland, "A method for constructing local monotone piecewise cubic interpolants",
    SIAM J. Sci. Stat. Comput. 5 (1984), as ``scipy.interpolate.PchipInterpolator`` implements it.
    """
    knots = np.asarray(angles_deg, dtype=np.float64)
    with np.errstate(over="ignore"):  # the interpolator's harmonic mean of slopes close to 0 overflows
        curve = scipy.interpolate.PchipInterpolator(knots, np.asarray(parameters, dtype=np.float64))
    angle = np.degrees(np.asarray(phi_rad, dtype=np.float64))
    return np.asarray(curve(np.clip(angle, knots[0], knots[-1])))


CURVES: dict[str, Law] = {
    "mangia": Law(
        mangia,
        names=("X1", "X2", "X3", "X4"),
        units=("dB", "dB", "dB", "1/rad2"),
        bounds=((0.0, 50.0),) * 4,
        # the specular part dies out between some 10 and 45 degrees, as the quasi-specular lobe of surfaces with rms
        # slopes of 0.1 to 0.5 does (Ulaby, Moore and Fung, "Microwave Remote Sensing", vol. 2, section 12-4)
        log_normal={"X4": (5.0, 1.0)},
        formula="X1 + X2 cos(phi) + X3 exp(-X4 phi^2)",
        source='"Calibration of a Radar Cross-section Model using a Surrogate Model Optimization Algorithm", eq. 1',
    ),
    "ulaby_dobson": Law(
        ulaby_dobson,
        names=("P1", "P2", "P3", "P4", "P5", "P6"),
        units=("dB", "dB", "1/rad", "dB", "", "rad"),
        # the exponential overflows beyond the limits of P3
        limits=((-1000.0, 1000.0),) * 2 + ((-100.0, 100.0),) + ((-1000.0, 1000.0),) * 3,
        valid_deg=(0.0, 70.0),
        formula="P1 + P2 exp(-P3 phi) + P4 cos(P5 phi + P6)",
        source="Ulaby and Dobson, Handbook of Radar Scattering Statistics for Terrain, Artech House (1989)",
    ),
    "constant_gamma": Law(
        constant_gamma,
        names=("gamma",),
        units=("dB",),
        valid_deg=(30.0, 80.0),
        formula="gamma + 10 log10(cos(phi))",
        source="Long, Radar Reflectivity of Land and Sea, 3rd edition, Artech House (2001)",
    ),
    "tabulated": Law(
        tabulated,
        names=(),
        units=(),
        needs=("angles_deg",),
        formula="curve through sigma0 at the angles of the material's angles_deg",
        source="Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300-304 (PCHIP)",
    ),
}
