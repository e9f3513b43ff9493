"""Section ``stop``: when the loop ends."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from radcal.config.limits import Count, Real
from radcal.config.sections import Section

__all__ = ["Stop"]


class Stop(Section):
    """When the loop ends; never touches finished runs."""

    rms: Annotated[Real, Field(gt=0, le=100)] = Field(1.0e-5, description="tolerance on the density mismatch [1/dB]")
    max_runs: Count = Field(200, description="design and infill runs together")
    stagnation_runs: Count = Field(20, description="infill runs without a better point")
    law_db: Annotated[Real, Field(gt=0, le=200)] = Field(
        0.05, description="change of a law over the incidence seen that counts as none [dB]; for objective: classes"
    )
    at_sampling_error: bool = Field(
        False,
        description="stop below a third of the sampling error, too, after 5 runs without a better point; true for "
        "simulator.kind: command without rms",
    )
