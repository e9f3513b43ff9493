"""Section ``stop``: criteria that end the calibration loop."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from radcal.config.limits import Count, Real
from radcal.config.sections import Section

__all__ = ["Stop"]


class Stop(Section):
    """Criteria that end the calibration loop; after a change of the criteria, no finished run is repeated."""

    rms: Annotated[Real, Field(gt=0, le=100)] = Field(
        1.0e-5, description="tolerance of the rms difference between the densities [1/dB]; only for objective: density"
    )
    max_runs: Count = Field(200, description="largest total number of design and infill runs")
    stagnation_runs: Count = Field(
        20, description="number of infill runs without improvement after which the search ends"
    )
    law_db: Annotated[Real, Field(gt=0, le=200)] = Field(
        0.05,
        description="the search ends if the best law that the surrogate predicts differs by less than this number from "
        "the best law found [dB]; not for objective: density",
    )
    at_sampling_error: bool = Field(
        False,
        description="whether the search also ends after 5 runs without improvement at an rms below a third of the "
        "sampling error; by default true for simulator.kind: command if stop.rms is not set",
    )
