"""Section ``validation``: held-out ground."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from radcal.config.limits import Count
from radcal.config.sections import Section

__all__ = ["Validation"]


class Validation(Section):
    """Ground that is held out of the target and then predicted by the laws found."""

    rows: Count = Field(20, description="image rows of a block, which is calibrated on or held out as a whole")
    columns: Count | None = Field(None, description="image columns of a block; all columns of the image if missing")
    means: Count = Field(10, description="image rows of a part of a block, whose mean level is predicted")
    keep: Literal["even", "odd", "both"] = Field(
        "even",
        description="blocks that are calibrated on: even, odd or both (all, and each half is predicted from the other)",
    )

    @model_validator(mode="after")
    def _whole_parts(self) -> Self:
        if self.rows % self.means:
            raise ValueError(f"means is {self.means}, expected a divisor of rows ({self.rows})")
        return self
