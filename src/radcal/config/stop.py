"""Section ``stop``: criteria that end the loop."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from radcal.config.limits import Count, Real
from radcal.config.sections import Section

__all__ = ["Stop"]


class Stop(Section):
    """Criteria that end the loop; a change of them repeats no finished run."""

    rms: Annotated[Real, Field(gt=0, le=100)] = Field(
        1.0e-5, description="tolerance on the rms difference of the densities [1/dB]; for objective: density"
    )
    max_runs: Count = Field(200, description="largest number of design and infill runs together")
    stagnation_runs: Count = Field(20, description="number of infill runs without a better one after which to stop")
    law_db: Annotated[Real, Field(gt=0, le=200)] = Field(
        0.05,
        description="change of a law over the incidence seen below which the stop criterion is met [dB]; not for "
        "objective: density",
    )
    at_sampling_error: bool = Field(
        False,
        description="whether an rms below a third of the sampling error ends the search, too, after 5 runs without a "
        "better one; true by default for simulator.kind: command without stop.rms",
    )
