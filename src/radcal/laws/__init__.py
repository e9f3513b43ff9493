"""Backscatter laws: sigma0 in dB as a function of the local incidence angle.

``LAWS`` contains the laws that have a name. Each module of this package contains a family of them; another distribution
adds a :class:`Law` by an entry point in the group ``radcal.laws``. A law may need conditions besides its parameters:
carrier frequency, polarisation, knots, the permittivity of a soil. :func:`law_for` finds a law and binds what the case
file gives for it, and :meth:`Law.bound` binds the conditions of a pass. Every law then has the signature
``law(phi_rad, parameters) -> sigma0 [dB]``.

The law ``EXTERNAL`` is not among them: it has names and units of parameters, but no curve, because only an external
simulator can compute its backscatter. The law ``FORMULA`` is not among them either: its curve is a formula in the case
file (:mod:`radcal.laws.formula`).

Every law of radcal's own is finite from 0 to 90 degrees. In laws whose power vanishes at grazing incidence, the cosine
is limited to at least 1e-6 (an incidence of 89.99994 degrees). Outside of its valid angles a law is extrapolated by its
own formula; ``tabulated`` and ``nrl_sea`` keep the value at the end of theirs.
"""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from radcal.laws.base import EXTERNAL, OF_PASS, Law, seen_rad
from radcal.laws.curves import CURVES
from radcal.laws.formula import FORMULA, formula_law, refuse_infinite
from radcal.laws.grazing import GRAZING
from radcal.laws.soil import SOIL
from radcal.plugins import Plugins

__all__ = [
    "DEFAULT_LAW",
    "EXTERNAL",
    "FORMULA",
    "LAWS",
    "OF_PASS",
    "Law",
    "formula_law",
    "law_for",
    "laws_known",
    "refuse_infinite",
    "seen_rad",
]

LAWS: Plugins[Law] = Plugins("radcal.laws", {**CURVES, **SOIL, **GRAZING})
DEFAULT_LAW = "mangia"


def laws_known(external: bool = True) -> list[str]:
    """Names of all laws, for error messages; without the law ``EXTERNAL`` if ``external`` is false."""
    return [*sorted(LAWS), FORMULA, *[EXTERNAL] * external]


def law_for(
    name: str,
    *,
    angles_deg: Sequence[float] | None = None,
    formula: str | None = None,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
    **conditions: Any,
) -> Law:
    """Law of a given name, with what a case file gives for it.

    Parameters
    ----------
    name : str
        Name of the law: a key of ``LAWS``, ``FORMULA`` or ``EXTERNAL``.
    angles_deg : sequence of float, optional
        Knots of a tabulated law [deg].
    formula : str, optional
        Formula of a law ``FORMULA``.
    names, units : sequence of str, optional
        Names and units of the parameters of an external law or of a formula.
    **conditions
        Values of further conditions of the law.

    Returns
    -------
    Law
        Law whose ``needs`` are the conditions without a value.

    Raises
    ------
    ValueError
        The law is unknown, its formula is not accepted, or a key does not belong to the law.
    """
    given = {"angles_deg": angles_deg, "formula": formula, "names": names, "units": units}
    if name in (FORMULA, EXTERNAL):
        takes = ("formula",) * (name == FORMULA) + ("names", "units")
    elif name in LAWS:
        takes = LAWS[name].needs
    else:
        raise ValueError(f"law is {name[:60]!r}, expected one of {', '.join(laws_known())}")
    for key, value in given.items():
        if value is None and key in takes and key in ("angles_deg", "formula"):
            raise ValueError(f"{key} is missing, law is {name!r}, which needs it")
        if value is not None and key not in takes:
            raise ValueError(f"{key} is given, law is {name!r}, which does not take it")
    _check_names(names or (), units)
    if name == EXTERNAL:
        law = Law(None, names=tuple(names or ()), units=tuple(units or ("",) * len(names or ())))
    elif formula is not None:
        law = formula_law(formula, names or (), units)
    else:
        law = LAWS[name]
    needs = [key for key in law.needs if key not in (*OF_PASS, "angles_deg")]
    if wrong := [key for key in conditions if key not in needs]:
        raise ValueError(f"conditions: {wrong[0]} is given, law {name!r} needs {', '.join(needs) or 'none'}")
    written: dict[str, Any] = {"law": name}
    if angles_deg is not None:
        if any(second <= first for first, second in itertools.pairwise(angles_deg)):
            raise ValueError(f"angles_deg is {angles_deg}, expected increasing angles")
        written["angles_deg"] = list(angles_deg)
    if name == FORMULA:
        written["formula"] = law.formula  # in a form that does not depend on blanks
    if name in (FORMULA, EXTERNAL):
        written["names"] = list(law.names)
    else:
        written |= LAWS.origin(name)
    if conditions:
        written["conditions"] = conditions
    return replace(law, description=written).bound(angles_deg=angles_deg, **conditions)


def _check_names(names: Sequence[str], units: Sequence[str] | None) -> None:
    """Refuse parameter names of the case file that are not identifiers or occur twice."""
    for name in names:
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
            raise ValueError(f"names: {name!r} is not a letter followed by letters, digits and _")
    if len(set(names)) != len(names):
        raise ValueError(f"names are {', '.join(names)}, expected each once")
    if units is not None and len(units) != len(names):
        raise ValueError(f"units has {len(units)} entries, names {len(names)}")
