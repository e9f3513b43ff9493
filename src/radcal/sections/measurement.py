"""Sections ``measurement`` and ``registration``: measured image, in a file or synthetic, and its registration."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, Any, Literal, get_args

from pydantic import AfterValidator, Field, ValidationInfo, WithJsonSchema, field_validator, model_validator
from pydantic_core import PydanticCustomError, PydanticKnownError

from radcal.findings import Finding, of_pass
from radcal.plugins import Plugins
from radcal.reading.base import reader_of
from radcal.sections.base import Band, Dataset, Section, VrtFolders, with_tag
from radcal.sections.errors import MISSING
from radcal.sections.limits import Decibels, Length, Looks, Parameter, Real, Seed
from radcal.sections.materials import OtherLaw
from radcal.sections.radar import Radiometry
from radcal.tables import read_table

RADIOMETRY_EXPECTED = f"expected {', '.join(get_args(Radiometry)[:-1])} or {get_args(Radiometry)[-1]}"
_OF_PIXELS = ("texture_db", "fields_db")
_SOURCE = "source of the measured image: synthetic or file; each source has its own keys"


def hidden_dyke() -> list[float]:
    """Hidden parameters of the default case's dyke."""
    return list(read_table("demonstration")["synthetic"]["parameters"]["dyke"])


class Synthetic(Section):
    """Hidden laws, speckle, level, misregistration and other mismatches of a synthetic measurement.

    By default, the measurement differs from the runs only in the hidden parameters, the speckle and a displacement.
    """

    parameters: dict[str, list[Parameter]] = Field(
        default_factory=lambda: {"dyke": hidden_dyke()},
        description="hidden parameters by material; by default those of section materials",
    )

    @property
    def is_written(self) -> bool:
        """Whether the case configures the hidden parameters explicitly instead of using the default."""
        return "parameters" in self.model_fields_set

    seed: Seed = Field(2, description="seed of speckle, noise and warp")
    offset_db: Decibels = Field(0.0, description="offset of the whole image [dB]")
    warp_px: Annotated[Real, Field(ge=0, le=50)] = Field(
        2.0, description="rms displacement from the simulated image [pixels]"
    )
    laws: dict[str, OtherLaw] = Field(
        default_factory=dict,
        description="hidden law by material, as {law, parameters}, if not that of section materials",
    )
    relief_m: Annotated[Real, Field(ge=0, le=100)] = Field(
        0.0, description="rms height of random relief in the image that the scene lacks [m]"
    )
    relief_length_m: Length = Field(5.0, description="correlation length of this relief [m]")
    resolution_factor: Annotated[Real, Field(ge=0.1, le=10)] = Field(
        1.0, description="ratio of the image's resolutions to those of section radar"
    )
    looks: Looks | None = Field(None, description="number of looks; by default radar.looks")
    nesz_db: Decibels | None = Field(None, description="noise-equivalent sigma0 [dB]; by default radar.nesz_db")
    texture_db: Annotated[Real, Field(ge=0, le=20)] = Field(0.0, description="standard deviation of gamma texture [dB]")
    texture_length_m: Length = Field(10.0, description="correlation length of the gamma texture on the ground [m]")
    fields_db: dict[str, Annotated[Real, Field(ge=0, le=20)]] = Field(
        default_factory=dict,
        description="standard deviation of sigma0 between fields (connected areas), by material [dB]",
    )
    wrong_labels: Annotated[Real, Field(ge=0, le=0.5)] = Field(
        0.0, description="share of cells with a wrong material, half on borders, half in patches"
    )

    product: Literal["intensity", "focused"] = Field(
        "intensity",
        description="image of the simulator (intensity), or focused from raw signals with the defaults of section "
        "signals",
        exclude_if=lambda value: value == "intensity",
    )

    @field_validator("product")
    @classmethod
    def _not_of_pixels(cls, product: str, info: ValidationInfo) -> str:
        # they are gains of the fast image's pixels
        if product == "focused" and (wrong := [key for key in _OF_PIXELS if info.data.get(key)]):
            raise ValueError(f"is focused, which has no {wrong[0]}: leave that key out")
        return product

    @property
    def disturbed(self) -> tuple[str, ...]:
        """Keys by which scene, pass or laws of the synthetic measurement differ from those of the runs."""
        keys = ("laws", "relief_m", "resolution_factor", "looks", "nesz_db", "texture_db", "fields_db", "wrong_labels")
        return tuple(key for key in keys if getattr(self, key) not in (None, {}, type(self).model_fields[key].default))


def within(parameters: Sequence[float], box: Sequence[Sequence[float]]) -> bool:
    """Whether parameters lie inside the bounds of as many parameters."""
    return len(box) == len(parameters) and all(
        low <= value <= high for value, (low, high) in zip(parameters, box, strict=True)
    )


def default_synthetic() -> Synthetic:
    """Synthetic measurement of the default case, made with other settings than the simulated images.

    A case that has a section ``measurement.synthetic`` gets none of the mismatches of this measurement by
    default.
    """
    return Synthetic.model_validate(read_table("demonstration")["synthetic"])


class SyntheticMeasurement(Section):
    """Image simulated from hidden parameters."""

    source: Literal["synthetic"] = Field("synthetic", description=_SOURCE)
    synthetic: Synthetic = Field(
        default_factory=Synthetic, description="hidden parameters, speckle, level and misregistration"
    )


def starts_as_truth(
    calibrated: Sequence[str], measurements: Sequence[SyntheticMeasurement | FileMeasurement]
) -> list[Finding]:
    """Notes, for each pass, on the calibrated materials that a synthetic measurement shows with their start.

    Parameters
    ----------
    calibrated : sequence of str
        Names of the materials to calibrate.
    measurements : sequence of section ``measurement``
        Measurement of each pass; only the synthetic ones have hidden laws.
    """
    found = []
    for number, one in enumerate(measurements, start=1):
        if not isinstance(one, SyntheticMeasurement):
            continue
        names = [name for name in calibrated if name not in {**one.synthetic.parameters, **one.synthetic.laws}]
        as_truth = [Finding("starts_as_truth", "note", ", ".join(names))] * bool(names)
        found += of_pass(as_truth, number, len(measurements))
    return found


class FileMeasurement(Section):
    """File with a measured image."""

    source: Literal["file"] = Field("file", description=_SOURCE)
    path: str = Field(
        description="SICD, SAFE folder of Sentinel-1 or its manifest, GeoTIFF or other raster, npy, npz, mat or "
        "HDF5; ${NAME} is an environment variable"
    )
    scale: Literal["db", "power", "amplitude", "complex"] = Field(
        description="scale of the numbers in the file; required unless the file's name gives it (docs/products.md)"
    )
    band: Band = None
    dataset: Dataset = None
    polarisation: Literal["HH", "HV", "VH", "VV"] | None = Field(
        None, description="transmitted and received polarisation; must equal radar.polarisation"
    )
    carrier_band: str | None = Field(None, description="frequency band; must equal radar.band")
    vrt_folders: VrtFolders = None
    radiometry: Radiometry | None = Field(
        None,
        validate_default=True,
        description="quantity that a pixel contains; must equal radar.radiometry; required unless the file gives it",
    )

    @model_validator(mode="before")
    @classmethod
    def _named(cls, data: Any) -> Any:
        """Data of the section with scale, radiometry and polarisation of a product that are part of its file name."""
        path = data.get("path") if isinstance(data, dict) else None
        product = reader_of(path).named(path) if isinstance(path, str) else None
        if product is None:
            return data
        named = {key: getattr(product, key) for key in ("scale", "radiometry", "polarisation")}
        named = {key: value for key, value in named.items() if value is not None}
        for key, value in named.items():
            if data.get(key) not in (None, value):
                raise ValueError(
                    f"{key} is {data[key]}, {path} is {product.called}, whose {key} is {value}: leave the key out"
                )
        return {**data, **named}

    @field_validator("radiometry")
    @classmethod
    def _asked_for(cls, radiometry: Radiometry | None, info: ValidationInfo) -> Radiometry | None:
        path = info.data.get("path")  # missing if the path is wrong
        # a name that ends with a variable is known only when the file is read; the radiometry is then checked
        if radiometry is None and path and not path.endswith("}") and not reader_of(path).gives_radiometry:
            raise PydanticCustomError(
                MISSING, "{path} does not say it, {expected}", {"path": path, "expected": RADIOMETRY_EXPECTED}
            )
        return radiometry


MeasurementConfig = Annotated[
    SyntheticMeasurement | FileMeasurement, Field(discriminator="source"), with_tag("measurement", "synthetic")
]


REGISTRATIONS: Plugins[Any] = Plugins(
    "radcal.registrations",
    {"gefolki": "radcal.registration.gefolki:gefolki_px", "ilk": "radcal.registration.ilk:ilk_px"},
)
"""Methods of registration (:class:`radcal.registration.base.Method`) by ``registration.method``."""


def _method(name: str) -> str:
    if name != "none" and name not in REGISTRATIONS:
        known = f"{', '.join(map(repr, REGISTRATIONS))} or 'none'"
        raise PydanticKnownError("literal_error", {"expected": known})
    return name


class RegistrationConfig(Section):
    """Registration of the measured image onto the simulated one."""

    method: Annotated[
        str, AfterValidator(_method), WithJsonSchema({"enum": ["gefolki", "ilk", "none"], "type": "string"})
    ] = Field("gefolki", description="gefolki, ilk (iterative Lucas-Kanade of scikit-image) or none (no registration)")
    rounds: Literal[1, 2] = Field(
        2,
        description="1: onto the reference run; 2: then again, onto a run with laws fitted to the image as first "
        "registered (not with law: external, nor without surrogate.baseline)",
    )
    global_shift: bool = Field(
        False, description="whether phase correlation first estimates one shift of the whole image"
    )
    max_displacement_px: Annotated[Real, Field(gt=0, le=1000)] = Field(
        20.0, description="largest plausible displacement [pixels], beyond which the image is used unregistered"
    )
