"""Section ``design``: the runs made before any surrogate exists."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from radcal.config.limits import Integer
from radcal.config.sections import CaseName, Section

__all__ = ["Design"]


class Design(Section):
    """The runs made before any surrogate exists."""

    sampler: Literal["monte_carlo", "latin_hypercube", "sobol"] = Field(
        "sobol", description="monte_carlo, latin_hypercube or sobol"
    )
    size: Annotated[Integer, Field(ge=2, le=100_000)] | Literal["auto"] = Field(
        "auto", description="runs, or auto: 2, 16 for objective: density; a larger design keeps a smaller one's"
    )
    chunk: Annotated[Integer, Field(ge=1, le=1000)] = Field(4, description="runs per workflow job")
    reuse: CaseName | None = Field(None, description="earlier case of the same scene and simulator: its runs count")
