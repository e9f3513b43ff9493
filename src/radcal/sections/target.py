"""Sections ``target``, ``validation`` and ``uncertainty``: what runs are compared with, and how well that is known."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import BeforeValidator, Field, model_validator

from radcal.sections.base import Section
from radcal.sections.errors import Wrong
from radcal.sections.limits import ALL_PIXELS, Count, Decibels, Integer, Real

Share = Annotated[Real, Field(ge=0, le=1)]
Error = Annotated[Real, Field(ge=0, le=20)]


class TargetConfig(Section):
    """Pixels of the measured image with which runs are compared, and their statistics."""

    pixels: Annotated[
        Integer,
        Field(ge=50, le=ALL_PIXELS),
        BeforeValidator(
            lambda value: ALL_PIXELS if value == "all" else value,
            json_schema_input_type=Annotated[int, Field(ge=50, le=ALL_PIXELS)] | Literal["all"],
        ),
    ] = Field(1000, description="number of pixels per material, drawn at random, or all")
    margin_px: Annotated[Integer, Field(ge=0, le=100)] = Field(
        1, description="distance from another material up to which pixels are masked [pixels]"
    )
    fit: Literal["likelihood", "penalised"] = Field(
        "likelihood",
        description="fit of skew-normal densities: likelihood (maximum likelihood) or penalised (penalty on large "
        "alpha)",
    )
    snr_db: Decibels = Field(
        0.0, description="lowest ratio of local signal to the noise radar.nesz_db [dB]; pixels below it are masked"
    )
    leave_out_point_targets: bool = Field(
        True, description="whether point targets (far brighter than speckle explains) are masked"
    )
    normalisation: Literal["none", "offset", "image"] = Field(
        "none",
        description="none, offset (the measured image's offset from the laws of reference_materials is subtracted) or "
        "image (each image is scaled to zero median and unit interquartile range)",
    )
    reference_materials: list[str] | None = Field(
        None, description="materials that show errors of level and radiometry; by default all that are not calibrated"
    )
    incidence_classes: Annotated[Integer, Field(ge=1, le=20)] | Literal["auto"] = Field(
        "auto",
        description="number of incidence-angle bins; auto: one per 2 degrees, from 4 to 8; not for objective: density",
    )
    looks: Literal["free", "nominal"] = Field(
        "free",
        description="effective looks of a material: free (fitted) or nominal (radar.looks); not for objective: density",
    )
    priors: bool = Field(
        True,
        description="whether weak priors constrain the law's curve and looks (docs/method.md); not for objective: "
        "density",
    )
    incidence_error_deg: Annotated[Real, Field(ge=0, le=30)] | None = Field(
        None,
        description="standard error of the local incidence [deg]; by default estimated from errors of elevation and "
        "registration",
    )


class Uncertainty(Section):
    """Uncertainty budget of the laws, and its sampler (docs/uncertainty.md)."""

    known_db: Annotated[Real, Field(gt=0, le=20)] = Field(
        1.5, description="half-width of the 90 % band up to which sigma0 counts as determined [dB]"
    )
    level_db: Error = Field(
        0.33,
        description="standard error of the image's absolute level [dB]; the default is Sentinel-1's (1 dB for three "
        "sigma)",
    )
    noise_db: Error = Field(2.0, description="standard error of radar.nesz_db [dB]")
    field_db: Annotated[Real, Field(gt=0, le=20)] = Field(
        0.5,
        description="median of the log-normal prior (log sd 1) on the standard deviation of levels between fields [dB]",
    )
    fixed_law_db: Error = Field(
        1.0, description="scale of the half-normal prior on the standard deviation of errors of fixed laws [dB]"
    )
    fixed_slope: Annotated[Real, Field(ge=0, le=10)] = Field(
        0.2,
        description="standard deviation of the slope of a fixed law's error per 10 degrees, as a share of the error",
    )
    form_db: Annotated[Real, Field(gt=0, le=20)] = Field(
        0.5,
        description="scale of the half-normal prior on the standard deviation of the error of a law's form [dB], which "
        "is smooth over 8 degrees",
    )
    area: Share = Field(
        0.1,
        description="standard error of the exponent of a pixel's ground area in its value, which is 0 for the right "
        "radiometry",
    )
    point_spread: Share = Field(
        0.1, description="relative standard error of the resolutions, which change a law's slope"
    )
    incidence_error: Annotated[Real, Field(ge=0, le=3)] = Field(
        0.3, description="relative standard error of target.incidence_error_deg (of its logarithm)"
    )
    incidence_floor_deg: Annotated[Real, Field(ge=0, le=30)] = Field(
        0.2, description="standard error of an offset of the local incidence, which all pixels of a pass share [deg]"
    )
    walkers: Annotated[Integer, Field(ge=32, le=1000)] = Field(128, description="number of walkers of the sampler")
    steps: Annotated[Integer, Field(ge=100, le=100_000)] = Field(
        4000, description="largest number of steps of each walker; a warning says if the chains have not converged"
    )


class Validation(Section):
    """Blocks of the image that are held out of the calibration; the laws then predict their levels."""

    rows: Count = Field(20, description="number of image rows in a block, which is used or held out as a whole")
    columns: Count | None = Field(None, description="number of image columns in a block; by default all")
    means: Count = Field(
        10, description="number of image rows in a part of a block; the mean level of each part is predicted"
    )
    keep: Literal["even", "odd", "both", "fields"] = Field(
        "even",
        description="even or odd: these blocks are used, the others held out; both: all are used, and each half "
        "predicts the other; fields: all are used, and each fifth of the fields (connected areas) is "
        "predicted from the rest",
    )

    @property
    def holds_out(self) -> bool:
        """Whether a part of the ground is held out of the calibration."""
        return self.keep in ("even", "odd")

    @model_validator(mode="after")
    def _whole_parts(self) -> Self:
        if self.rows % self.means:
            raise Wrong("means", f" is {self.means}, expected a divisor of rows ({self.rows})")
        return self
