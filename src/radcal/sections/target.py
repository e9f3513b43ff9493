"""Section ``target``: pixels, level and incidence-angle bins of the measured image that runs are compared with."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from radcal.sections.base import Section
from radcal.sections.limits import ALL_PIXELS, Decibels, Integer, Real

__all__ = ["TargetConfig"]


class TargetConfig(Section):
    """Pixels, level and incidence-angle bins of the measured image that runs are compared with."""

    pixels: Annotated[
        Integer,
        Field(ge=50, le=ALL_PIXELS),
        BeforeValidator(
            lambda value: ALL_PIXELS if value == "all" else value,
            json_schema_input_type=Annotated[int, Field(ge=50, le=ALL_PIXELS)] | Literal["all"],
        ),
    ] = Field(1000, description="number of pixels per material, drawn at random without replacement, or all")
    margin_px: Annotated[Integer, Field(ge=0, le=100)] = Field(
        1, description="largest distance from another material at which pixels are masked [pixels]"
    )
    fit: Literal["likelihood", "penalised"] = Field(
        "likelihood",
        description="fit of the densities: likelihood (maximum likelihood) or penalised (penalty on large alpha)",
    )
    snr_db: Decibels = Field(
        0.0,
        description="lowest local signal-to-noise ratio [dB], with radar.nesz_db as noise; other pixels are masked",
    )
    leave_out_point_targets: bool = Field(
        True, description="whether point targets (pixels far brighter than speckle explains) are masked"
    )
    normalisation: Literal["none", "offset", "image"] = Field(
        "none",
        description="change of images before the comparison: none, offset (the measured image's offset, from "
        "reference_materials, is subtracted) or image (both are scaled to zero median and unit interquartile range)",
    )
    reference_materials: list[str] | None = Field(
        None,
        description="materials from which the offset is estimated; by default all materials with fixed parameters",
    )
    incidence_classes: Annotated[Integer, Field(ge=1, le=20)] | Literal["auto"] = Field(
        "auto",
        description="number of incidence-angle bins; auto: one per 2 degrees, but 4 to 8; not for objective: density",
    )
    looks: Literal["free", "nominal"] = Field(
        "free",
        description="effective looks of a material: free (fitted) or nominal (radar.looks); not for objective: density",
    )
    priors: bool = Field(
        True,
        description="whether weak priors constrain the law's curve and looks (docs/right_law.md); not for objective: "
        "density",
    )
    incidence_error_deg: Annotated[Real, Field(ge=0, le=30)] | None = Field(
        None,
        description="standard error of the local incidence angle [deg]; by default estimated from the errors of "
        "elevation and registration",
    )
