"""Section ``optimiser``: the search on the surrogate."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from radcal.config.limits import Integer
from radcal.config.sections import Section

__all__ = ["Optimiser"]


class Optimiser(Section):
    """NSGA-II on the surrogate, and a least-squares fit from its best point."""

    objective: Literal["theta", "rms"] = Field(
        "theta",
        description="quantity that NSGA-II minimises: theta (differences in the density's parameters) or rms (which "
        "saturates)",
    )
    # Platypus sorts in pure Python, with time growing as evaluations times population; the polish and
    # the multi-start search make up for a small population
    population: Annotated[Integer, Field(ge=4, le=10_000)] = Field(40, description="solutions in a generation")
    evaluations: Annotated[Integer, Field(ge=1, le=10_000_000)] = Field(
        1600, description="number of evaluations of the surrogate"
    )
    polish: bool = Field(True, description="whether a least-squares fit in theta follows from NSGA-II's best point")
