"""Section ``surrogate``: what the kriging learns, and its training."""

from __future__ import annotations

from typing import Literal

from pydantic import Field

from radcal.config.limits import Count
from radcal.config.sections import Section

__all__ = ["SurrogateConfig"]


class SurrogateConfig(Section):
    """What the kriging learns and how it is trained."""

    outputs: Literal["centred", "direct"] = Field(
        "centred", description="(mean, log sd, skewness) or (xi, omega, alpha)"
    )
    training: Literal["warm", "smt"] = Field(
        "warm", description="warm: from the last optimum, multi-start every retrain_every; smt: the library's defaults"
    )
    retrain_every: Count = Field(5, description="iterations between multi-start trainings (warm)")
