"""Section ``surrogate``: outputs and training of the kriging (objective: density)."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from radcal.config.limits import Count
from radcal.config.sections import Section

__all__ = ["SurrogateConfig"]


class SurrogateConfig(Section):
    """Outputs and training of the kriging."""

    outputs: Literal["centred", "direct"] = Field(
        "centred", description="outputs of the kriging: centred (mean, log sd, skewness) or direct (xi, omega, alpha)"
    )
    training: Literal["warm", "smt"] = Field(
        "warm",
        description="warm: start from the last optimum, and from several points every retrain_every iterations; "
        "smt: the library's defaults",
    )
    retrain_every: Count = Field(5, description="iterations between trainings from several points (warm)")
