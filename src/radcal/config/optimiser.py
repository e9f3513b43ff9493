"""Section ``optimiser``: settings of the search on the surrogate for the next parameters X."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from radcal.config.limits import Integer
from radcal.config.sections import Section

__all__ = ["Optimiser"]


class Optimiser(Section):
    """Settings of NSGA-II on the surrogate, and of the least-squares fit that starts from NSGA-II's best point."""

    objective: Literal["theta", "rms"] = Field(
        "theta",
        description="what NSGA-II minimises: theta (sum of squared residuals) or, only with objective: density, rms "
        "(difference of the densities, which hardly changes far from its minimum)",
    )
    # Platypus sorts in pure Python: its time grows in proportion to evaluations times population. The least-squares
    # fit and the multi-start search compensate for a small population.
    population: Annotated[Integer, Field(ge=4, le=10_000)] = Field(
        40, description="number of solutions in a generation"
    )
    evaluations: Annotated[Integer, Field(ge=1, le=10_000_000)] = Field(
        1600, description="number of evaluations of the surrogate"
    )
    polish: bool = Field(True, description="whether a least-squares fit on the surrogate refines NSGA-II's best point")
