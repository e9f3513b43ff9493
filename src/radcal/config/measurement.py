"""Section ``measurement``: measured image from a file, or a synthetic one."""

from __future__ import annotations

from typing import Annotated, Literal, get_args

from pydantic import Field, ValidationInfo, field_validator
from pydantic_core import PydanticCustomError

from radcal.config.limits import Count, Decibels, Parameter, Real, Seed
from radcal.config.pydantic_errors import MISSING
from radcal.config.radar import Radiometry
from radcal.config.sections import Section

__all__ = [
    "RADIOMETRY_EXPECTED",
    "SICD_ENDINGS",
    "FileMeasurement",
    "MeasurementConfig",
    "Synthetic",
    "SyntheticMeasurement",
]

SICD_ENDINGS = (".nitf", ".ntf", ".sicd")  # endings of files that may give the radiometry
RADIOMETRY_EXPECTED = f"expected {', '.join(get_args(Radiometry)[:-1])} or {get_args(Radiometry)[-1]}"
_SOURCE = "synthetic or file; each has keys of its own"


class Synthetic(Section):
    """Hidden parameters, speckle, level and misregistration of a synthetic measurement."""

    parameters: dict[str, list[Parameter]] = Field(
        default_factory=lambda: {"dyke": [6.1, 14.2, 21.5, 3.3]},
        description="hidden parameters by material; other materials keep the parameters of section materials",
    )

    @property
    def is_written(self) -> bool:
        """Whether the hidden parameters are configured explicitly instead of taken from the default."""
        return "parameters" in self.model_fields_set

    seed: Seed = Field(2, description="seed of the measurement's speckle, noise and warp")
    offset_db: Decibels = Field(0.0, description="level offset of the measurement [dB]")
    warp_px: Annotated[Real, Field(ge=0, le=50)] = Field(2.0, description="rms misregistration [pixels]")


class SyntheticMeasurement(Section):
    """Measurement made by the simulator from hidden parameters."""

    source: Literal["synthetic"] = Field("synthetic", description=_SOURCE)
    synthetic: Synthetic = Field(Synthetic(), description="hidden parameters, speckle, level and misregistration")


class FileMeasurement(Section):
    """Measured image in a file, on the scene's image grid."""

    source: Literal["file"] = Field("file", description=_SOURCE)
    path: str = Field(
        description="SICD, GeoTIFF or other raster, npy, npz, mat, HDF5; ${RADCAL_DATA} and the like are expanded"
    )
    scale: Literal["db", "power", "amplitude", "complex"] = Field(description="scale of the file's numbers")
    band: Count | None = Field(None, description="band of a raster, from 1; needed where it has several")
    dataset: str | None = Field(
        None, description="name of the array in npz, mat or HDF5; needed where they hold several"
    )
    polarisation: Literal["HH", "HV", "VH", "VV"] | None = Field(
        None, description="transmitted and received polarisation; checked against radar.polarisation"
    )
    carrier_band: str | None = Field(
        None, description="label of the carrier's frequency band; checked against radar.band"
    )
    vrt_folders: list[str] | None = Field(
        None, description="folders in which sources of a VRT may lie, besides the VRT's own"
    )
    radiometry: Radiometry | None = Field(
        None,
        validate_default=True,
        description="quantity of its pixels, the same as radar.radiometry; needed where the file does not say it",
    )

    @field_validator("radiometry")
    @classmethod
    def _asked_for(cls, radiometry: Radiometry | None, info: ValidationInfo) -> Radiometry | None:
        path = info.data.get("path")  # missing where it is itself wrong
        # a name that ends with a variable is known when the file is read, which checks it, too
        if radiometry is None and path and not path.lower().endswith((*SICD_ENDINGS, "}")):
            raise PydanticCustomError(
                MISSING, "{path} does not say it, {expected}", {"path": path, "expected": RADIOMETRY_EXPECTED}
            )
        return radiometry


MeasurementConfig = Annotated[SyntheticMeasurement | FileMeasurement, Field(discriminator="source")]
