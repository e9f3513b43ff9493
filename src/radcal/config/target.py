"""Section ``target``: pixels, levels and bins of incidence that the targets are made of."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from radcal.config.limits import ALL_PIXELS, Decibels, Integer, Real
from radcal.config.sections import Section

__all__ = ["TargetConfig"]


class TargetConfig(Section):
    """Which pixels of a material make its target density."""

    pixels: Annotated[
        Integer,
        Field(ge=50, le=ALL_PIXELS),
        BeforeValidator(
            lambda value: ALL_PIXELS if value == "all" else value,
            json_schema_input_type=Annotated[int, Field(ge=50, le=ALL_PIXELS)] | Literal["all"],
        ),
    ] = Field(1000, description="pixels drawn without replacement, or all")
    margin_px: Annotated[Integer, Field(ge=0, le=100)] = Field(
        1, description="pixels this near to another material are left out"
    )
    fit: Literal["likelihood", "penalised"] = Field(
        "likelihood",
        description="likelihood, or penalised likelihood, whose alpha is finite; of runs too",
    )
    snr_db: Decibels = Field(
        0.0, description="pixels whose surroundings rise less above radar.nesz_db are left out [dB]"
    )
    leave_out_point_targets: bool = Field(True, description="pixels far above what speckle allows are left out")
    normalisation: Literal["none", "offset", "image"] = Field(
        "none", description="none, offset (a level seen in the fixed materials) or image (zero median, unit range)"
    )
    reference_materials: list[str] | None = Field(
        None, description="materials of a fixed law that say the measured image's level; all of them if missing"
    )
    incidence_classes: Annotated[Integer, Field(ge=1, le=20)] | Literal["auto"] = Field(
        "auto", description="classes of local incidence, or auto (4 to 8 by pixels and span); for objective: classes"
    )
    looks: Literal["free", "nominal"] = Field(
        "free", description="effective looks of a material searched, or radar.looks; for objective: classes"
    )
    priors: bool = Field(True, description="weak priors on curve and looks (docs/right_law.md); for objective: classes")
    incidence_error_deg: Annotated[Real, Field(ge=0, le=30)] | None = Field(
        None,
        description="standard error of the local incidence [deg]; from elevation and registration if missing",
    )
