"""Section ``validation``: ground that is held out of the calibration, to test the calibrated laws."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import Field, model_validator

from radcal.config.limits import Count
from radcal.config.sections import Section

__all__ = ["Validation"]


class Validation(Section):
    """Blocks of the image that are held out of the target; the calibrated laws then predict the blocks' levels."""

    rows: Count = Field(
        20, description="number of image rows in a block; a block is used for the calibration or held out as a whole"
    )
    columns: Count | None = Field(
        None, description="number of image columns in a block; by default all columns of the image"
    )
    means: Count = Field(
        10, description="number of image rows in a part of a block; the mean level of each part is predicted"
    )
    keep: Literal["even", "odd", "both", "fields"] = Field(
        "even",
        description="blocks used for the calibration: even, odd, or all blocks (both, fields); with both, each half of "
        "the blocks is then predicted from the other half; with fields, each fifth of the fields (connected areas) is "
        "predicted from the other fields",
    )

    @property
    def holds_out(self) -> bool:
        """Whether a part of the ground is held out of the calibration."""
        return self.keep in ("even", "odd")

    @model_validator(mode="after")
    def _whole_parts(self) -> Self:
        if self.rows % self.means:
            raise ValueError(f"means is {self.means}, expected a divisor of rows ({self.rows})")
        return self
