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
    ] = Field(1000, description="number of pixels per material, drawn at random without replacement, or all")
    margin_px: Annotated[Integer, Field(ge=0, le=100)] = Field(
        1, description="pixels up to this distance from another material are masked [pixels]"
    )
    fit: Literal["likelihood", "penalised"] = Field(
        "likelihood",
        description="fit of the densities: likelihood (maximum likelihood) or penalised (penalty on large alpha)",
    )
    snr_db: Decibels = Field(
        0.0,
        description="lowest local signal-to-noise ratio, with radar.nesz_db as noise; pixels below it are masked [dB]",
    )
    leave_out_point_targets: bool = Field(
        True, description="whether point targets (pixels far brighter than speckle explains) are masked"
    )
    normalisation: Literal["none", "offset", "image"] = Field(
        "none",
        description="brightness of both images before the comparison: none (unchanged), offset (less the offset of "
        "reference_materials) or image (zero median, unit interquartile range)",
    )
    reference_materials: list[str] | None = Field(
        None,
        description="materials from which the offset is estimated; by default all materials with fixed parameters",
    )
    incidence_classes: Annotated[Integer, Field(ge=1, le=20)] | Literal["auto"] = Field(
        "auto",
        description="number of incidence-angle bins; auto: one per 2 degrees, 4 to 8; not for objective: density",
    )
    looks: Literal["free", "nominal"] = Field(
        "free",
        description="effective looks of a material: free (fitted) or nominal (radar.looks); not for objective: density",
    )
    priors: bool = Field(
        True,
        description="whether weak priors constrain law curve and looks (docs/right_law.md); not for objective: density",
    )
    incidence_error_deg: Annotated[Real, Field(ge=0, le=30)] | None = Field(
        None,
        description="standard error of the local incidence angle [deg]; by default estimated from the errors of "
        "elevation and registration",
    )
