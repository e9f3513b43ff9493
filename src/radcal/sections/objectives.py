"""Objectives by name: the requirements of each on other sections of the configuration, and the place of its class."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Annotated

from pydantic import AfterValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

from radcal.plugins import Plugins


@dataclass(frozen=True)
class Traits:
    """Properties of an objective, with which other sections of the configuration must be consistent.

    Attributes
    ----------
    place : str
        Place "package.module:name" of the class (:class:`radcal.objectives.base.Objective`), which is imported when it
        is first used.
    bins : bool
        Whether the objective compares statistics in dB, separately in each incidence-angle bin.
    curve : bool
        Whether every calibrated law must be a curve of sigma0 over incidence that radcal can evaluate (not
        ``external``).
    compares : str
        Text that names the quantities that the objective compares.
    """

    place: str
    bins: bool
    curve: bool = False
    compares: str = ""


_OWN = {
    "classes": Traits("radcal.objectives.bins:Bins", bins=True, compares="mean level, spread and skewness"),
    "density": Traits("radcal.objectives.density:Density", bins=False, compares="the histogram"),
    "likelihood": Traits("radcal.objectives.bins:Likelihood", bins=True, curve=True, compares="the levels"),
}
OBJECTIVES: Plugins[Traits] = Plugins("radcal.objectives", _OWN)
"""Objectives by name; another distribution adds the traits of its objective by an entry point."""

DEFAULT = "classes"
SINGLE = "density"


def names(bins: bool | None = None, curve: bool | None = None) -> Collection[str]:
    """Names of the objectives whose traits ``bins`` and ``curve`` equal the arguments; None accepts any value."""
    return [name for name, one in OBJECTIVES.items() if bins in (None, one.bins) and curve in (None, one.curve)]


def _known(value: str) -> str:
    if value not in OBJECTIVES:
        *first, last = map(repr, sorted(OBJECTIVES))
        raise PydanticCustomError("literal_error", f"{', '.join(first)} or {last}")
    return value


Objective = Annotated[str, AfterValidator(_known), WithJsonSchema({"enum": sorted(_OWN), "type": "string"})]
