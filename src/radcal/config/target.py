"""Section ``target``: pixels, levels and incidence-angle bins of the targets."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from radcal.config.limits import ALL_PIXELS, Decibels, Integer, Real
from radcal.config.sections import Section

__all__ = ["TargetConfig"]


class TargetConfig(Section):
    """Pixels, levels and incidence-angle bins of the targets."""

    pixels: Annotated[
        Integer,
        Field(ge=50, le=ALL_PIXELS),
        BeforeValidator(
            lambda value: ALL_PIXELS if value == "all" else value,
            json_schema_input_type=Annotated[int, Field(ge=50, le=ALL_PIXELS)] | Literal["all"],
        ),
    ] = Field(1000, description="number of pixels of a material, drawn without replacement, or all")
    margin_px: Annotated[Integer, Field(ge=0, le=100)] = Field(
        1, description="pixels this near to another material are masked [pixels]"
    )
    fit: Literal["likelihood", "penalised"] = Field(
        "likelihood",
        description="fit of the densities: likelihood, or penalised likelihood, which keeps alpha finite",
    )
    snr_db: Decibels = Field(
        0.0, description="pixels whose surroundings rise less than this above radar.nesz_db are masked [dB]"
    )
    leave_out_point_targets: bool = Field(
        True, description="whether pixels far brighter than speckle allows are masked"
    )
    normalisation: Literal["none", "offset", "image"] = Field(
        "none",
        description="level removed before comparison: none, offset (estimated from the fixed materials) or image (zero "
        "median, unit interquartile range)",
    )
    reference_materials: list[str] | None = Field(
        None,
        description="materials of fixed law from which the measured image's level is estimated; all of them if missing",
    )
    incidence_classes: Annotated[Integer, Field(ge=1, le=20)] | Literal["auto"] = Field(
        "auto",
        description="number of incidence-angle bins, or auto (4 to 8 by pixels and span); not for objective: density",
    )
    looks: Literal["free", "nominal"] = Field(
        "free",
        description="free: search a material's effective looks; nominal: take radar.looks; not for objective: density",
    )
    priors: bool = Field(
        True,
        description="whether weak priors on curve and looks are used (docs/right_law.md); not for objective: density",
    )
    incidence_error_deg: Annotated[Real, Field(ge=0, le=30)] | None = Field(
        None,
        description="standard error of the local incidence angle [deg]; estimated from the errors of elevation and "
        "registration if missing",
    )
