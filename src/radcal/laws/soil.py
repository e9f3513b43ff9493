"""Laws of bare soil, whose parameters are physical quantities: permittivity and roughness."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.laws.base import Law, cosine

_LIGHT_CM_GHZ = 29.9792458  # speed of light [cm GHz]


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
