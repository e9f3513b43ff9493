"""Section ``registration``: registration of the measured image onto the simulated image."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from radcal.sections.base import Section
from radcal.sections.limits import Real

__all__ = ["RegistrationConfig"]


class RegistrationConfig(Section):
    """Method and limits of the registration of the measured image onto the simulated image."""

    method: Literal["gefolki", "ilk", "none"] = Field(
        "gefolki", description="gefolki, ilk (iterative Lucas-Kanade of scikit-image) or none (no registration)"
    )
    rounds: Literal[1, 2] = Field(
        2,
        description="1: register onto the reference run; 2: register again, onto a run of the laws that fit the image "
        "as first registered (only if all calibrated laws have a curve, and the surrogate a baseline)",
    )
    global_shift: bool = Field(
        False, description="whether phase correlation first estimates one shift of the whole image"
    )
    max_displacement_px: Annotated[Real, Field(gt=0, le=1000)] = Field(
        20.0, description="largest plausible displacement [pixels]; if it is exceeded, the image is used unregistered"
    )
