"""Section ``registration``: registration of the measured image onto the simulated one."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from radcal.config.limits import Real
from radcal.config.sections import Section

__all__ = ["RegistrationConfig"]


class RegistrationConfig(Section):
    """Registration of the measured image onto the simulated one."""

    method: Literal["gefolki", "ilk", "none"] = Field(
        "gefolki", description="gefolki, ilk (scikit-image), or none: use the image unregistered"
    )
    global_shift: bool = Field(
        False, description="whether one shift of the whole image is found first, by phase correlation"
    )
    max_displacement_px: Annotated[Real, Field(gt=0, le=1000)] = Field(
        20.0, description="largest displacement; a registration that moves the image further is not used [pixels]"
    )
