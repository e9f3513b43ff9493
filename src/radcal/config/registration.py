"""Section ``registration``: how the measured image is brought onto the simulated one."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from radcal.config.limits import Real
from radcal.config.sections import Section

__all__ = ["RegistrationConfig"]


class RegistrationConfig(Section):
    """How the measured image is brought onto the simulated one."""

    method: Literal["gefolki", "ilk", "none"] = Field(
        "gefolki", description="gefolki, ilk (scikit-image) or none: the image is taken as it lies"
    )
    global_shift: bool = Field(False, description="find one shift for the whole image first, by phase correlation")
    max_displacement_px: Annotated[Real, Field(gt=0, le=1000)] = Field(
        20.0, description="a registration that moves further is not used [pixels]"
    )
