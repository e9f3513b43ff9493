"""Names of the objectives, and the requirements of each objective on other sections of the configuration."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Annotated

from pydantic import AfterValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

__all__ = ["OBJECTIVES", "Objective", "Traits", "names"]


@dataclass(frozen=True)
class Traits:
    """Properties of an objective, with which other sections of the configuration must be consistent.

    Attributes
    ----------
    bins : bool
        Whether the objective compares statistics in dB, separately in each incidence-angle bin.
    curve : bool
        Whether every calibrated law must be a curve of sigma0 over incidence that radcal can evaluate (not
        ``external``).
    compares : str
        Text that names the quantities that the objective compares.
    """

    bins: bool
    curve: bool = False
    compares: str = ""


OBJECTIVES: dict[str, Traits] = {
    "classes": Traits(bins=True, compares="mean level, spread and skewness"),
    "density": Traits(bins=False, compares="the histogram"),
    "likelihood": Traits(bins=True, curve=True, compares="the levels"),
}
"""Traits of each objective by name; ``radcal.objectives`` contains the classes of the objectives."""

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


Objective = Annotated[str, AfterValidator(_known), WithJsonSchema({"enum": sorted(OBJECTIVES), "type": "string"})]
