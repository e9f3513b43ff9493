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
        "sobol", description="method that samples the parameters: monte_carlo, latin_hypercube or sobol"
    )
    size: Annotated[Integer, Field(ge=0, le=100_000)] | Literal["auto"] = Field(
        "auto",
        description="number of runs; auto: 2, or at least 8 if radcal cannot predict the runs (as with law: external); "
        "0: no design, which took the fewest runs in tests (docs/right_law.md); a larger design contains the runs of a "
        "smaller one",
    )
    chunk: Annotated[Integer, Field(ge=1, le=1000)] = Field(4, description="number of design runs in one workflow job")
    reuse: CaseName | None = Field(
        None, description="name of an earlier case with the same scene and simulator; its runs are reused"
    )
