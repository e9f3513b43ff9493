"""Laws of natural surfaces: of any kind of terrain, of bare soil, and of clutter at grazing angles.

The parameters of the first describe the level and the shape of the curve, those of bare soil are physical quantities:
permittivity and roughness. A table of land clutter at grazing angles takes the place of law and speckle.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from radcal.laws.base import Law, cosine

# c1 to c5 of the formula of nrl_sea
_NRL = {
    "HH": (-73.0, 20.781, 7.351, 25.65, 0.0054),
    "VV": (-50.796, 25.93, 0.7093, 21.588, 0.00211),
}
_GRAZING_DEG = (0.1, 60.0)

LandClutter = Sequence[tuple[float, float, float]]
"""Rows of smallest depression angle [deg], mean sigma0 [dB] and Weibull spread, by falling angle."""

RURAL: LandClutter = (
    (4.0, -25.0, 2.6),
    (1.5, -27.0, 2.7),
    (0.75, -30.0, 3.0),
    (0.25, -32.0, 3.5),
    (0.0, -33.0, 3.8),
)
"""Interim model of rural ground of low relief.

From Billingsley, "Low-Angle Radar Land Clutter", William Andrew (2002), p. 295, at second hand: by public code that
cites this page.
"""
_LIGHT_CM_GHZ = 29.9792458  # speed of light [cm GHz]


def nrl_sea(
    phi_rad: ArrayLike, parameters: ArrayLike, *, frequency_ghz: float, polarisation: str
) -> NDArray[np.float64]:
    r"""Empirical law of the mean backscatter of the sea by the Naval Research Laboratory.

    With the grazing angle :math:`\alpha` in degrees, the frequency :math:`f` in GHz and the sea state :math:`S`:

    .. math::

        \sigma^0_{dB} = c_1 + c_2 \lg\sin\alpha + \frac{(27.5 + c_3 \alpha) \lg f}{1 + 0.95 \alpha}
            + c_4 (1 + S)^{1 / (2 + 0.085 \alpha + 0.033 S)} + c_5 \alpha^2

    Parameters
    ----------
    phi_rad : array_like
        Local incidence angle [rad], any shape: 90 degrees minus the grazing angle, which is limited to 0.1 to 60
        degrees, the angles of the law's data.
    parameters : array_like, shape (1,) or (1, m)
        Sea state, 0 to 6: one, or m sea states if the last axis of ``phi_rad`` has the length 1.
    frequency_ghz : float
        Carrier frequency [GHz].
    polarisation : {'HH', 'VV'}
        Transmitted and received polarisation.

    Returns
    -------
    ndarray
        sigma0 [dB], shape of ``phi_rad``; for m sea states, the last axis has the length m.

    Raises
    ------
    KeyError
        The polarisation is neither HH nor VV.

    References
    ----------
    Gregers-Hansen and Mital, "An improved empirical model for radar sea clutter reflectivity", Naval Research
    Laboratory, NRL/MR/5310-12-9346 (2012).
    """
    c1, c2, c3, c4, c5 = _NRL[polarisation]
    (state,) = np.asarray(parameters, dtype=np.float64)
    angle = np.clip(90.0 - np.degrees(np.asarray(phi_rad, dtype=np.float64)), *_GRAZING_DEG)
    swell = c4 * (1.0 + state) ** (1.0 / (2.0 + 0.085 * angle + 0.033 * state))
    frequency = (27.5 + c3 * angle) * np.log10(frequency_ghz) / (1.0 + 0.95 * angle)
    return np.asarray(c1 + c2 * np.log10(np.sin(np.radians(angle))) + frequency + swell + c5 * angle**2)


def land_clutter(depression_deg: ArrayLike, table: LandClutter) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean sigma0 and Weibull spread of land at low depression angles.

    Parameters
    ----------
    depression_deg : array_like
        Depression angle of the antenna's line of sight to the ground [deg]; below the last row its values hold.
    table : sequence of (float, float, float)
        Rows as of :data:`RURAL`.

    Returns
    -------
    mean_db : ndarray
        Mean sigma0 [dB].
    spread : ndarray
        Spread a: the power of a resolution cell is Weibull distributed with the exponent 1 / a. a = 1 is speckle alone.
    """
    rows = np.asarray(table, dtype=np.float64)[::-1]
    row = np.maximum(np.searchsorted(rows[:, 0], depression_deg, side="right") - 1, 0)
    return rows[row, 1], rows[row, 2]


def weibull_power(exponential: ArrayLike, spread: ArrayLike) -> NDArray[np.float64]:
    """Weibull power of mean 1 from an exponential number of mean 1, for a spread of :func:`land_clutter`."""
    shape = np.asarray(spread, dtype=np.float64)
    return np.asarray(np.asarray(exponential) ** shape / scipy.special.gamma(1.0 + shape))


GRAZING: dict[str, Law] = {
    "nrl_sea": Law(
        nrl_sea,
        names=("sea_state",),
        units=("",),
        bounds=((0.0, 6.0),),
        limits=((0.0, 6.0),),
        valid_deg=(90.0 - _GRAZING_DEG[1], 90.0 - _GRAZING_DEG[0]),
        needs=("frequency_ghz", "polarisation"),
        polarisations=tuple(_NRL),
        formula="c1 + c2 lg sin(g) + (27.5 + c3 g) lg f / (1 + 0.95 g) + c4 (1 + S)^(1 / (2 + 0.085 g + 0.033 S)) "
        "+ c5 g^2",
        source="Gregers-Hansen and Mital, NRL/MR/5310-12-9346 (2012)",
    ),
}


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


def oh1992(
    phi_rad: ArrayLike, parameters: ArrayLike, *, frequency_ghz: float, polarisation: str
) -> NDArray[np.float64]:
    r"""Empirical law of the backscatter of bare soil by Oh, Sarabandi and Ulaby (1992).

    With :math:`k` the wavenumber, :math:`s` the rms height and :math:`\Gamma_h, \Gamma_v, \Gamma_0`
    the Fresnel reflectivities at incidence :math:`\phi` and at nadir:

    .. math::

        \sigma^0_{vv} &= 0.7 \left[1 - e^{-0.65 (ks)^{1.8}}\right]
            \frac{\cos^3\phi}{\sqrt{p}} \left[\Gamma_v(\phi) + \Gamma_h(\phi)\right] \\
        \sigma^0_{hh} &= p\, \sigma^0_{vv}, \quad
            \sqrt{p} = 1 - \left(\frac{2\phi}{\pi}\right)^{1/(3\Gamma_0)} e^{-ks} \\
        \sigma^0_{hv} &= q\, \sigma^0_{vv}, \quad q = 0.23 \sqrt{\Gamma_0} \left(1 - e^{-ks}\right)

    Parameters
    ----------
    phi_rad : array_like
        Local incidence angle [rad], any shape. The cosine of the angle is limited to at least 1e-6.
    parameters : array_like, shape (3,) or (3, m)
        Relative permittivity of the soil, real part and (positive) imaginary part, and rms height
        of its surface [cm]: one set, or m sets if the last axis of ``phi_rad`` has the length 1.
    frequency_ghz : float
        Carrier frequency [GHz].
    polarisation : {'HH', 'HV', 'VH', 'VV'}
        HV and VH give the same sigma0.

    Returns
    -------
    ndarray
        sigma0 [dB], shape of ``phi_rad``; for m sets of parameters, the last axis has the length m.

    References
    ----------
    Oh, Sarabandi and Ulaby, "An empirical model and an inversion technique for radar scattering from bare soil
    surfaces", IEEE Trans. Geosci. Remote Sens. 30 (1992) 370-381; the law is also the model PRISM-1 in Ulaby and Long,
    "Microwave Radar and Radiometric Remote Sensing" (2014), section 10-5.
    """
    if np.ndim(parameters) > 1:  # numbers and arrays differ in the last digit of powers: each set has that of numbers
        sets = np.transpose(parameters)
        each = [oh1992(phi_rad, x, frequency_ghz=frequency_ghz, polarisation=polarisation) for x in sets]
        return np.concatenate(each, axis=-1)
    phi = np.clip(np.asarray(phi_rad, dtype=np.float64), 0.0, 0.5 * np.pi)
    real, imaginary, height_cm = (float(x) for x in np.asarray(parameters, dtype=np.float64))
    permittivity = complex(real, -imaginary)
    ks = _ks(height_cm, frequency_ghz)

    cosine_phi = cosine(phi)
    refracted = np.sqrt(permittivity - np.sin(phi) ** 2)
    gamma_h = np.abs((cosine_phi - refracted) / (cosine_phi + refracted)) ** 2
    gamma_v = np.abs((permittivity * cosine_phi - refracted) / (permittivity * cosine_phi + refracted)) ** 2
    gamma_0 = abs((1.0 - permittivity**0.5) / (1.0 + permittivity**0.5)) ** 2

    # Logarithms and expm1 avoid loss of precision in the power 1 / (3 Gamma0) of a small angle and in 1 - exp(-x) for
    # small roughness.
    share = np.log(np.maximum(2.0 * phi / np.pi, np.finfo(np.float64).tiny))
    root_p = -np.expm1(share / (3.0 * gamma_0) - ks)
    sigma0 = -0.7 * np.expm1(-0.65 * ks**1.8) * cosine_phi**3 / root_p * (gamma_v + gamma_h)
    if polarisation == "HH":
        sigma0 = sigma0 * root_p**2
    elif polarisation in ("HV", "VH"):
        sigma0 = sigma0 * (-0.23 * np.sqrt(gamma_0) * np.expm1(-ks))
    return np.asarray(10.0 * np.log10(sigma0))


def _ks(height_cm: float, frequency_ghz: float) -> float:
    """Wavenumber times rms height."""
    return float(2.0 * np.pi * frequency_ghz / _LIGHT_CM_GHZ * height_cm)


# Ranges of the surfaces measured for the law: rms heights of 0.32 to 3.02 cm at 1.5 to 9.5 GHz, and volumetric
# moistures of 0.09 to 0.31, which the polynomial of Topp, Davis and Annan, "Electromagnetic determination of soil water
# content", Water Resour. Res. 16 (1980), eq. 6, converts into permittivity
_OH_KS = (0.1, 6.0)
_OH_PERMITTIVITY = (5.0, 18.0)


def _oh1992_doubt(parameters: ArrayLike, *, frequency_ghz: float, polarisation: str) -> str | None:  # noqa: ARG001
    real, _, height_cm = (float(x) for x in np.asarray(parameters, dtype=np.float64))
    ks = _ks(height_cm, frequency_ghz)
    if not _OH_KS[0] <= float(f"{ks:.2g}") <= _OH_KS[1]:
        return f"its roughness ks is {ks:.2g}, the surfaces behind the law had {_OH_KS[0]:g} to {_OH_KS[1]:g}"
    if not _OH_PERMITTIVITY[0] <= real <= _OH_PERMITTIVITY[1]:
        return (
            f"its permittivity is {real:.3g}, the soils behind the law had {_OH_PERMITTIVITY[0]:g} to "
            f"{_OH_PERMITTIVITY[1]:g} (volumetric moisture of 0.09 to 0.31)"
        )
    return None


SOIL: dict[str, Law] = {
    "oh1992": Law(
        oh1992,
        names=("permittivity_real", "permittivity_imaginary", "rms_height"),
        units=("", "", "cm"),
        bounds=(_OH_PERMITTIVITY, (0.0, 6.0), (0.32, 3.02)),
        # the permittivity is limited to values from dry minerals to water; the rms height is above 0, because the
        # backscatter of a smooth surface is not finite in dB
        limits=((2.0, 90.0), (0.0, 50.0), (0.01, 100.0)),
        valid_deg=(10.0, 70.0),
        needs=("frequency_ghz", "polarisation"),
        doubt=_oh1992_doubt,
        formula="10 log10 of VV = 0.7 (1 - exp(-0.65 (ks)^1.8)) cos^3(phi) (Gv + Gh) / sqrt(p), HH = p VV, HV = q VV",
        source="Oh, Sarabandi and Ulaby, IEEE Trans. Geosci. Remote Sens. 30 (1992) 370-381",
    ),
}
