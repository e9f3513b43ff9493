"""Names of the objectives, and what each of them asks of the rest of the configuration."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from typing import Annotated

from pydantic import AfterValidator, WithJsonSchema
from pydantic_core import PydanticCustomError

__all__ = ["OBJECTIVES", "Objective", "Traits", "names"]


@dataclass(frozen=True)
class Traits:
    """Properties of an objective that other sections depend on.

    Attributes
    ----------
    bins : bool
        Whether statistics are compared by incidence-angle bin, in dB.
    curve : bool
        Whether every calibrated law needs a curve.
    compares : str
        What is compared, in words.
    values : int
        Values compared in each bin whose squared residuals sum to about their number for a right law; 0 where there is
        no such number.
    """

    bins: bool
    curve: bool = False
    compares: str = ""
    values: int = 0


OBJECTIVES: dict[str, Traits] = {
    "classes": Traits(bins=True, compares="mean level, spread and skewness", values=3),
    "density": Traits(bins=False, compares="the histogram"),
    "likelihood": Traits(bins=True, curve=True, compares="the levels"),
}
"""Traits of each objective by its name; ``radcal.calibration.objectives`` holds their classes."""

DEFAULT = "classes"
SINGLE = "density"


def names(bins: bool | None = None, curve: bool | None = None) -> Collection[str]:
    """Names of the objectives with these traits."""
    return [name for name, one in OBJECTIVES.items() if bins in (None, one.bins) and curve in (None, one.curve)]


def _known(value: str) -> str:
    if value not in OBJECTIVES:
        *first, last = map(repr, sorted(OBJECTIVES))
        raise PydanticCustomError("literal_error", f"{', '.join(first)} or {last}")
    return value


Objective = Annotated[str, AfterValidator(_known), WithJsonSchema({"enum": sorted(OBJECTIVES), "type": "string"})]
