"""Backscatter laws: sigma0 in dB as a function of the local incidence angle.

``LAWS`` is the registry of laws. Each module of this package contains a family of laws, with their formulas and their
entries in the registry. A law may need conditions besides its parameters: carrier frequency, polarisation, knots. The
function :func:`law_for` binds these conditions to the law. With its conditions bound, every law has the signature
``law(phi_rad, parameters) -> sigma0 [dB]``.

The law ``EXTERNAL`` is not in the registry: it has names and units of parameters, but no curve, because only an
external simulator can compute its backscatter. The law ``FORMULA`` is not in the registry either: its curve is a
formula in the case file (:mod:`radcal.laws.formula`).

Every law of the registry is finite from 0 to 90 degrees. In laws whose power vanishes at grazing incidence, the cosine
is limited to at least 1e-6 (an incidence of 89.99994 degrees). Outside of its valid angles a law is extrapolated by its
own formula.
"""

from __future__ import annotations

from collections.abc import Sequence

from radcal.errors import ConfigError
from radcal.laws.curves import CURVES
from radcal.laws.formula import FORMULA, formula_law, refuse_infinite
from radcal.laws.law import EXTERNAL, Law, seen_rad
from radcal.laws.soil import SOIL

__all__ = [
    "DEFAULT_LAW",
    "EXTERNAL",
    "FORMULA",
    "LAWS",
    "Law",
    "external_law",
    "formula_law",
    "law_for",
    "laws_known",
    "laws_table",
    "refuse_infinite",
    "seen_rad",
]

LAWS: dict[str, Law] = {**CURVES, **SOIL}
DEFAULT_LAW = "mangia"


def laws_known(external: bool = True) -> list[str]:
    """Names of all laws, for error messages; without the law ``EXTERNAL`` if ``external`` is false."""
    return [*sorted(LAWS), FORMULA, *[EXTERNAL] * external]


def external_law(names: Sequence[str], units: Sequence[str] | None = None) -> Law:
    """Law without a curve, whose parameters only an external simulator understands.

    Parameters
    ----------
    names : sequence of str
        Name of each parameter; empty for a law without parameters.
    units : sequence of str, optional
        Unit of each parameter; by default the parameters have no units.

    Returns
    -------
    Law
        Law without a curve.
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
    formula: str | None = None,
) -> Law:
    """Law of a given name, with its conditions (carrier frequency, polarisation, knots) bound to it.

    Parameters
    ----------
    name : str
        Name of the law: a key of ``LAWS``, ``FORMULA`` or ``EXTERNAL``.
    frequency_ghz : float, optional
        Carrier frequency [GHz].
    polarisation : str, optional
        Transmitted and received polarisation, such as "HH".
    angles_deg : sequence of float, optional
        Knots of a tabulated law [deg].
    names, units : sequence of str, optional
        Names and units of the parameters of an external law or of a formula.
    formula : str, optional
        Formula of a law ``FORMULA``.

    Returns
    -------
    Law
        Law with empty ``needs``, ready to be evaluated unless it is external.

    Raises
    ------
    ConfigError
        The law is unknown, its formula is not accepted, or a condition that it needs is not given.
    """
    if name == EXTERNAL:
        return external_law(names or (), units)
    if name == FORMULA:
        try:
            unbound = formula_law(formula or "", names or (), units)
        except ValueError as error:
            raise ConfigError(f"{error}.") from None
    elif name in LAWS:
        unbound = LAWS[name]
    else:
        raise ConfigError(f"law is {name!r}, expected one of {laws_known()}.")
    law = unbound.bound(frequency_ghz=frequency_ghz, polarisation=polarisation, angles_deg=angles_deg)
    if law.needs:
        keys = {"angles_deg": "angles_deg of the material"}
        missing = keys.get(law.needs[0], f"radar.{law.needs[0]}")
        raise ConfigError(f"{missing} is missing: law {name!r} depends on it.")
    return law


def laws_table() -> str:
    """Table of all laws, with remarks, in Markdown for ``docs/laws.md``."""
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
