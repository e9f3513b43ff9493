"""Backscatter laws: sigma0 in dB as a function of the local incidence angle.

``LAWS`` is the registry. The conditions that a law depends on besides its parameters (carrier frequency, polarisation,
knots) are bound to it once, by :func:`law_for`; every bound law is a function ``law(phi_rad, parameters) -> sigma0
[dB]``.

A law of the name ``EXTERNAL`` is not in the registry: it has names and units of parameters, but no curve, because only
the simulator can compute its backscatter.

Every law of the registry is finite from 0 to 90 degrees. Where a power vanishes at grazing incidence, the cosine is
limited to at least 1e-6 (incidence of 89.99994 degrees). Outside of its valid angles a law is
extrapolated by its own formula.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.errors import ConfigError

__all__ = [
    "EXTERNAL",
    "LAWS",
    "Law",
    "constant_gamma",
    "external_law",
    "law_for",
    "laws_table",
    "mangia",
    "oh1992",
    "tabulated",
    "ulaby_dobson",
]

EXTERNAL = "external"  # name of the law of a material whose backscatter only the simulator knows
_LEAST_COSINE = 1e-6
_LIGHT_CM_GHZ = 29.9792458  # speed of light [cm GHz]
Intervals = tuple[tuple[float, float], ...]


def mangia(phi_rad: ArrayLike, parameters: ArrayLike) -> NDArray[np.float64]:
    r"""Four-parameter law, equation 1 of the paper.

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
    Ulaby and Dobson, "Handbook of Radar Scattering Statistics for Terrain", Artech House (1989);
    it gives P1 to P6 by terrain, band and polarisation.
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
        Local incidence angle [rad], any shape. Its cosine is limited to at least 1e-6.
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
    return np.asarray(gamma_db + 10.0 * np.log10(_cosine(np.asarray(phi_rad, dtype=np.float64))))


def tabulated(phi_rad: ArrayLike, parameters: ArrayLike, *, angles_deg: Sequence[float]) -> NDArray[np.float64]:
    """Curve through sigma0 at given angles, without overshoot, constant beyond the first and last.

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
        sigma0 [dB], shape of ``phi_rad``. Between two knots the curve lies between their values.

    References
    ----------
    Fritsch and Butland, "A method for constructing local monotone piecewise cubic interpolants",
    SIAM J. Sci. Stat. Comput. 5 (1984), as ``scipy.interpolate.PchipInterpolator`` implements it.
    """
    from scipy.interpolate import PchipInterpolator

    knots = np.asarray(angles_deg, dtype=np.float64)
    with np.errstate(over="ignore"):  # the harmonic mean of slopes that all but vanish
        curve = PchipInterpolator(knots, np.asarray(parameters, dtype=np.float64))
    angle = np.degrees(np.asarray(phi_rad, dtype=np.float64))
    return np.asarray(curve(np.clip(angle, knots[0], knots[-1])))


def oh1992(
    phi_rad: ArrayLike, parameters: ArrayLike, *, frequency_ghz: float, polarisation: str
) -> NDArray[np.float64]:
    r"""Empirical backscatter of bare soil.

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
        Local incidence angle [rad], any shape. Its cosine is limited to at least 1e-6.
    parameters : array_like, shape (3,)
        Relative permittivity of the soil, real part and (positive) imaginary part, and rms height
        of its surface [cm].
    frequency_ghz : float
        Carrier frequency [GHz].
    polarisation : {'HH', 'HV', 'VH', 'VV'}
        HV and VH are the same.

    Returns
    -------
    ndarray
        sigma0 [dB], shape of ``phi_rad``.

    References
    ----------
    Oh, Sarabandi and Ulaby, "An empirical model and an inversion technique for radar scattering
    from bare soil surfaces", IEEE Trans. Geosci. Remote Sens. 30 (1992) 370-381; the same as model
    PRISM-1 in Ulaby and Long, "Microwave Radar and Radiometric Remote Sensing" (2014), section 10-5.
    """
    phi = np.clip(np.asarray(phi_rad, dtype=np.float64), 0.0, 0.5 * np.pi)
    real, imaginary, height_cm = (float(x) for x in np.asarray(parameters, dtype=np.float64))
    permittivity = complex(real, -imaginary)
    ks = _ks(height_cm, frequency_ghz)

    cosine = _cosine(phi)
    refracted = np.sqrt(permittivity - np.sin(phi) ** 2)
    gamma_h = np.abs((cosine - refracted) / (cosine + refracted)) ** 2
    gamma_v = np.abs((permittivity * cosine - refracted) / (permittivity * cosine + refracted)) ** 2
    gamma_0 = abs((1.0 - permittivity**0.5) / (1.0 + permittivity**0.5)) ** 2

    # logarithms keep the digits of a small angle to the power 1 / (3 Gamma0) and of 1 - exp of a small roughness
    share = np.log(np.maximum(2.0 * phi / np.pi, np.finfo(np.float64).tiny))
    root_p = -np.expm1(share / (3.0 * gamma_0) - ks)
    sigma0 = -0.7 * np.expm1(-0.65 * ks**1.8) * cosine**3 / root_p * (gamma_v + gamma_h)
    if polarisation == "HH":
        sigma0 = sigma0 * root_p**2
    elif polarisation in ("HV", "VH"):
        sigma0 = sigma0 * (-0.23 * np.sqrt(gamma_0) * np.expm1(-ks))
    return np.asarray(10.0 * np.log10(sigma0))


def _cosine(phi: NDArray[np.float64]) -> NDArray[np.float64]:
    """Cosine of an incidence angle, limited to at least 1e-6, so that powers in dB stay finite."""
    return np.asarray(np.maximum(np.cos(phi), _LEAST_COSINE))


def _ks(height_cm: float, frequency_ghz: float) -> float:
    """Wavenumber times rms height."""
    return float(2.0 * np.pi * frequency_ghz / _LIGHT_CM_GHZ * height_cm)


# of the surfaces measured: rms heights of 0.32 to 3.02 cm seen at 1.5 to 9.5 GHz, and volumetric moistures
# of 0.09 to 0.31, the latter turned into permittivity by the polynomial of Topp, Davis and Annan,
# "Electromagnetic determination of soil water content", Water Resour. Res. 16 (1980), eq. 6
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


@dataclass(frozen=True)
class Law:
    """Backscatter law with names, units, bounds and limits of its parameters.

    Attributes
    ----------
    function : callable or None
        ``(phi_rad, parameters) -> sigma0 [dB]``; the conditions in ``needs`` are keyword arguments. None: only the
        simulator knows the curve.
    names, units : tuple of str
        Name and unit of each parameter; empty for a law whose knots are not yet bound.
    bounds : tuple of (float, float) or None
        Default bounds of the search; None where no publication gives any.
    valid_deg : (float, float)
        Incidence angles that the law was made for [deg].
    limits : tuple of (float, float) or None
        Range in which a parameter has a meaning; None: no limits.
    needs : tuple of str
        Conditions that must still be bound: ``frequency_ghz``, ``polarisation``, ``angles_deg``.
    doubt : callable or None
        ``(parameters) -> str | None``, a sentence where the parameters lie outside the range of the law's data; the
        conditions in ``needs`` are keyword arguments.
    formula, source, remark : str Texts for the documentation.
    """

    function: Callable[..., NDArray[np.float64]] | None
    names: tuple[str, ...]
    units: tuple[str, ...]
    bounds: Intervals | None = None
    valid_deg: tuple[float, float] = (0.0, 90.0)
    limits: Intervals | None = None
    needs: tuple[str, ...] = ()
    doubt: Callable[..., str | None] | None = None
    formula: str = ""
    source: str = ""
    remark: str = ""

    def __call__(self, phi_rad: ArrayLike, parameters: ArrayLike) -> NDArray[np.float64]:
        """Evaluate the law: angle [rad] to sigma0 [dB]; a ConfigError if it has no curve."""
        if self.function is None:
            raise ConfigError(
                f"law {EXTERNAL!r} of the parameters {list(self.names)} has no curve, expected one of {sorted(LAWS)}: "
                "only the simulator knows what backscatter they make."
            )
        return self.function(phi_rad, parameters)

    @property
    def has_curve(self) -> bool:
        """Whether the law can be evaluated; external laws can only be simulated."""
        return self.function is not None

    def bound(self, **conditions: Any) -> Law:
        """Law with these conditions bound; those that are None or not needed are ignored."""
        known = {key: value for key, value in conditions.items() if key in self.needs and value is not None}
        law = replace(
            self,
            function=partial(self.function, **known) if self.function is not None else None,
            doubt=partial(self.doubt, **known) if self.doubt is not None else None,
            needs=tuple(key for key in self.needs if key not in known),
        )
        if "angles_deg" in known:
            angles = [float(angle) for angle in known["angles_deg"]]
            names = tuple(f"sigma0_{angle:.10g}deg" for angle in angles)
            law = replace(law, names=names, units=("dB",) * len(angles), valid_deg=(angles[0], angles[-1]))
        return law

    def outside(self, incidence_deg: ArrayLike) -> float:
        """Share of angles [deg] outside the law's valid angles; angles that are not finite are not counted."""
        angle = np.asarray(incidence_deg, dtype=np.float64)
        angle = angle[np.isfinite(angle)]
        low, high = self.valid_deg
        return float(np.mean((angle < low) | (angle > high))) if angle.size else 0.0


LAWS: dict[str, Law] = {
    "mangia": Law(
        mangia,
        names=("X1", "X2", "X3", "X4"),
        units=("dB", "dB", "dB", "1/rad2"),
        bounds=((0.0, 50.0),) * 4,
        formula="X1 + X2 cos(phi) + X3 exp(-X4 phi^2)",
        source='"Calibration of a Radar Cross-section Model using a Surrogate Model Optimization Algorithm", eq. 1',
        remark="The bounds are the paper's; real sigma0 in dB needs X1 below 0.",
    ),
    "ulaby_dobson": Law(
        ulaby_dobson,
        names=("P1", "P2", "P3", "P4", "P5", "P6"),
        units=("dB", "dB", "1/rad", "dB", "", "rad"),
        # the exponential of a larger value overflows
        limits=((-1000.0, 1000.0),) * 2 + ((-100.0, 100.0),) + ((-1000.0, 1000.0),) * 3,
        valid_deg=(0.0, 70.0),
        formula="P1 + P2 exp(-P3 phi) + P4 cos(P5 phi + P6)",
        source="Ulaby and Dobson, Handbook of Radar Scattering Statistics for Terrain, Artech House (1989)",
        remark="P1 to P6 are tabulated there by terrain, band and polarisation, each with its own range of angles "
        "(many tables end at 70 deg): give parameters or bounds, there are no defaults.",
    ),
    "oh1992": Law(
        oh1992,
        names=("permittivity_real", "permittivity_imaginary", "rms_height"),
        units=("", "", "cm"),
        bounds=(_OH_PERMITTIVITY, (0.0, 6.0), (0.32, 3.02)),
        # from dry minerals to water; without any roughness there is no backscatter, which has no value in dB
        limits=((2.0, 90.0), (0.0, 50.0), (0.01, 100.0)),
        valid_deg=(10.0, 70.0),
        needs=("frequency_ghz", "polarisation"),
        doubt=_oh1992_doubt,
        formula="10 log10 of VV = 0.7 (1 - exp(-0.65 (ks)^1.8)) cos^3(phi) (Gv + Gh) / sqrt(p), HH = p VV, HV = q VV",
        source="Oh, Sarabandi and Ulaby, IEEE Trans. Geosci. Remote Sens. 30 (1992) 370-381",
        remark="Bare soil. sqrt(p) = 1 - (2 phi / pi)^(1 / (3 G0)) exp(-ks), q = 0.23 sqrt(G0) (1 - exp(-ks)), G the "
        "Fresnel reflectivities, k the wavenumber, s the rms height. Behind it: ks of 0.1 to 6, kl of 2.6 to 19.7 "
        "(l the correlation length, on which it does not depend), volumetric moisture of 0.09 to 0.31 (a permittivity "
        "of 5 to 18 by Topp et al., 1980), 1.5 to 9.5 GHz. In moist soil the imaginary part hardly matters: do not "
        "read it as known.",
    ),
    "constant_gamma": Law(
        constant_gamma,
        names=("gamma",),
        units=("dB",),
        valid_deg=(30.0, 80.0),
        formula="gamma + 10 log10(cos(phi))",
        source="Long, Radar Reflectivity of Land and Sea, 3rd edition, Artech House (2001)",
        remark="Describes the plateau between steep and grazing incidence. Where the plateau ends depends on the "
        "terrain; 30 to 80 deg is radcal's convention, no figure of the source. gamma has no default bounds.",
    ),
    "tabulated": Law(
        tabulated,
        names=(),
        units=(),
        needs=("angles_deg",),
        formula="curve through sigma0 at the angles of the material's angles_deg",
        source="Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984) 300-304 (PCHIP)",
        remark="As many parameters as angles, each sigma0 in dB at that angle; no overshoot between two of them, "
        "constant beyond the first and the last. No default bounds: where the target is one density of all angles, a "
        "rising curve can give the same density as the falling truth, and only the bounds tell them apart.",
    ),
}


def external_law(names: Sequence[str], units: Sequence[str] | None = None) -> Law:
    """Law without a curve, whose parameters only the simulator understands.

    Parameters
    ----------
    names : sequence of str
        Name of each parameter; there may be none.
    units : sequence of str, optional
        Unit of each parameter; no units if missing.

    Returns
    -------
    Law
        Without a curve.
    """
    return Law(None, names=tuple(names), units=tuple(units) if units is not None else ("",) * len(names))


def law_for(
    name: str,
    *,
    frequency_ghz: float | None = None,
    polarisation: str | None = None,
    angles_deg: Sequence[float] | None = None,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
) -> Law:
    """Law of a name, with the conditions that it needs bound to it.

    Parameters
    ----------
    name : str
        A key of ``LAWS``, or ``EXTERNAL``.
    frequency_ghz : float, optional
        Carrier frequency [GHz].
    polarisation : str, optional
        Transmitted and received, such as "HH".
    angles_deg : sequence of float, optional
        Knots of a tabulated law [deg].
    names, units : sequence of str, optional
        Parameters of an external law.

    Returns
    -------
    Law
        Law with empty ``needs``, ready to be evaluated unless it is external.

    Raises
    ------
    ConfigError
        The law is unknown or needs something that is not given.
    """
    if name == EXTERNAL:
        return external_law(names or (), units)
    if name not in LAWS:
        raise ConfigError(f"law is {name!r}, expected one of {[*sorted(LAWS), EXTERNAL]}.")
    law = LAWS[name].bound(frequency_ghz=frequency_ghz, polarisation=polarisation, angles_deg=angles_deg)
    if law.needs:
        keys = {"angles_deg": "angles_deg of the material"}
        missing = keys.get(law.needs[0], f"radar.{law.needs[0]}")
        raise ConfigError(f"{missing} is missing: law {name!r} depends on it.")
    return law


def laws_table() -> str:
    """All laws as a table and remarks in Markdown, for the documentation."""
    lines = [
        "| law | sigma0 [dB] | parameters | default bounds | made for | also needs | source |",
        "|---|---|---|---|---|---|---|",
    ]
    keys = {"frequency_ghz": "`radar.frequency_ghz`", "polarisation": "`radar.polarisation`"}
    for name, law in LAWS.items():
        parameters = ", ".join(
            f"`{key}`{f' [{unit}]' if unit else ''}" for key, unit in zip(law.names, law.units, strict=True)
        )
        bounds = ", ".join(f"{low:g} to {high:g}" for low, high in law.bounds) if law.bounds else "none"
        valid = "its knots" if not law.names else f"{law.valid_deg[0]:g} to {law.valid_deg[1]:g} deg"
        needs = ", ".join(keys.get(key, f"`{key}`") for key in law.needs) or "nothing"
        cells = (f"`{name}`", law.formula, parameters or "sigma0 [dB] at each knot", bounds, valid, needs, law.source)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join([*lines, "", *(f"- `{name}`: {law.remark}" for name, law in LAWS.items())]) + "\n"


if __name__ == "__main__":
    import sys

    sys.stdout.write(laws_table())
