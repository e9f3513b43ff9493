"""Section ``design``: runs made before any surrogate exists (design of experiments)."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from radcal.config.limits import Integer
from radcal.config.sections import CaseName, Section

__all__ = ["Design"]


class Design(Section):
    """Runs made before any surrogate exists (design of experiments)."""

    sampler: Literal["monte_carlo", "latin_hypercube", "sobol"] = Field(
        "sobol", description="method that draws the parameters: monte_carlo, latin_hypercube or sobol"
    )
    size: Annotated[Integer, Field(ge=0, le=100_000)] | Literal["auto"] = Field(
        "auto",
        description="number of runs, or auto: 2, and at least 8 where no law predicts them (law: external); 0 starts "
        "from the reference run and needs the fewest runs; a larger design keeps the runs of a smaller one",
    )
    chunk: Annotated[Integer, Field(ge=1, le=1000)] = Field(4, description="number of runs in one workflow job")
    reuse: CaseName | None = Field(
        None, description="name of an earlier case of the same scene and simulator, whose runs are reused"
    )
