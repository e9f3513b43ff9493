"""The typed configuration of a case: the only place that interprets configuration.

A case is one YAML file. Missing keys take the defaults below, and the defaults are the
default case: ``config/config.yaml`` is written from them (``python -m radcal.config``).
Unknown keys are refused. All models are frozen.
"""

from __future__ import annotations

import difflib
import itertools
import math
import os
import re
import shutil
import sys
import types
import typing
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Self

from pydantic import (
    AfterValidator,
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Discriminator,
    Field,
    Tag,
    TypeAdapter,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from radcal.casefile import merged, read_case_file, read_value, shown
from radcal.disclosure import Undisclosed
from radcal.errors import ConfigError
from radcal.limits import (
    ALL_PIXELS,
    LONGEST_S,
    Altitude,
    Coordinate,
    Count,
    Decibels,
    Frequency,
    Integer,
    Length,
    Parameter,
    Real,
    RetryWait,
    Seed,
    Timeout,
)
from radcal.radar.bands import same_label, within_band
from radcal.radar.laws import EXTERNAL, LAWS, Law, external_law, law_for
from radcal.rasters import RasterRefused, raster_files
from radcal.scene.objects import check_curve

__all__ = [
    "BuiltinScene",
    "BuiltinSimulation",
    "Case",
    "CommandSimulation",
    "Design",
    "FileMeasurement",
    "InputFile",
    "Material",
    "Measurement",
    "Optimiser",
    "Output",
    "Radar",
    "RasterScene",
    "Registration",
    "Scene",
    "SceneObjects",
    "Simulator",
    "SlantRangeScene",
    "Start",
    "Stop",
    "Surrogate",
    "Synthetic",
    "SyntheticMeasurement",
    "Target",
    "Template",
    "Validation",
    "case_from",
    "default_yaml",
    "executable_path",
    "expand_path",
    "files_below",
    "input_files",
    "load",
    "nearest",
    "vrt_folders",
]

_SEED_BITS = 31  # of external programs: a C int
_ONLY_MASKS = frozenset({"looks", "nesz_db", "range_resolution_m", "azimuth_resolution_m"})
Radiometry = Literal["sigma0_local", "sigma0_ref", "beta0", "gamma0"]


_DEFAULT_LAW = "mangia"
_DESIGN_SIZE = {"classes": 2, "likelihood": 2, "density": 16}  # runs; classes know of law and speckle without any
_LARGEST_WHOLE = 2.0**53
_LONGEST_NAME = 100  # file systems take 255 bytes, and files named after a case add theirs
_LARGEST = 1000.0  # of any parameter: powers beyond 10^100 are a unit mix-up, and no single-precision image holds them
_COARSEST = 1000.0  # pixels to a resolution cell: the impulse response is sampled that much further


def _case_name(value: str) -> str:
    if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_-]*", value):
        raise ValueError(f"is {value!r}, expected a letter followed by letters, digits, _ or -")
    if len(value) > _LONGEST_NAME:
        raise ValueError(f"has {len(value)} letters, expected at most {_LONGEST_NAME}: a folder bears this name")
    return value


CaseName = Annotated[str, AfterValidator(_case_name)]


class _Strict(BaseModel):
    """A frozen section of the configuration that refuses unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class GeneratedObjects(_Strict):
    """Made-up objects, scattered evenly."""

    trees: Annotated[Integer, Field(ge=0, le=10_000_000)] = 0
    cars: Annotated[Integer, Field(ge=0, le=10_000_000)] = 0
    buildings: Annotated[Integer, Field(ge=0, le=10_000_000)] = 0
    seed: Seed = 1

    @model_validator(mode="after")
    def _some(self) -> Self:
        if self.trees + self.cars + self.buildings == 0:
            raise ValueError("has no object, expected a number of trees, cars or buildings")
        return self


class SceneObjects(_Strict):
    """Objects that stand in the scene: a table, or made up."""

    path: str | None = Field(None, description="table of objects: .csv, .gpkg or .h5")
    layer: str | None = Field(None, description="layer of a GeoPackage; needed where it has several")
    aspect: dict[str, list[tuple[Annotated[Real, Field(ge=-180, le=360)], Decibels]]] = Field(
        default_factory=dict, description="aspect class -> [aspect in degrees, cross-section in dBsm] pairs"
    )
    generate: GeneratedObjects | None = Field(None, description="made-up trees, cars and buildings in place of a table")

    @model_validator(mode="after")
    def _one_source(self) -> Self:
        if (self.path is None) == (self.generate is None):
            raise ValueError(
                f"has {'neither' if self.path is None else 'both'} path and generate, expected one of them"
            )
        if self.path is None and (self.layer is not None or self.aspect):
            raise ValueError(
                f"{'layer' if self.layer is not None else 'aspect'} is for a table, expected path beside it"
            )
        for name, points in self.aspect.items():
            if (wrong := check_curve(points)) is not None:
                raise ValueError(f"aspect.{name} {wrong}")
        return self


class BuiltinScene(_Strict):
    """Four square kilometres of real SRTM terrain with seven materials and a dyke."""

    source: Literal["builtin"] = "builtin"
    seed: Seed = Field(1, description="seed of the fields' layout and of the fine roughness")
    objects: SceneObjects | None = Field(None, description="what stands on the ground")


class SlantRangeScene(_Strict):
    """A label raster in slant range over flat ground: rows are range, columns are azimuth."""

    source: Literal["slant_range"] = "slant_range"
    labels: str = Field(description="GeoTIFF of material ids, 0 = no material")
    names: str = Field(description="JSON file: material id -> name")
    near_incidence_deg: Annotated[Real, Field(gt=0, lt=90)] = Field(
        description="local incidence angle at the first row [deg]"
    )
    far_incidence_deg: Annotated[Real, Field(gt=0, lt=90)] = Field(
        description="local incidence angle at the last row [deg]"
    )

    vrt_folders: list[str] | None = Field(
        None, description="folders in which sources of a VRT may lie, besides the VRT's own"
    )

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.near_incidence_deg >= self.far_incidence_deg:
            raise ValueError(
                f"near_incidence_deg ({self.near_incidence_deg:g}) must be below "
                f"far_incidence_deg ({self.far_incidence_deg:g})"
            )
        return self


class RasterScene(_Strict):
    """Elevation and materials from georeferenced rasters, resampled to one grid."""

    source: Literal["raster"] = "raster"
    elevation: str = Field(description="GeoTIFF or other raster of heights [m]")
    materials: str = Field(description="raster of material ids in any CRS, 0 = no material")
    names: str = Field(description="JSON file: material id -> name")
    crs: str | None = Field(
        None,
        description="projected CRS of the scene, such as EPSG:32631; the elevation's if that is in metres, else UTM",
    )
    cell_m: Length | None = Field(None, description="cell size [m]; the elevation's own if missing")
    bounds: tuple[Coordinate, Coordinate, Coordinate, Coordinate] | None = Field(
        None, description="[west, south, east, north] in the scene's CRS [m]; where both rasters are if missing"
    )
    vertical_datum: str | None = Field(
        None, description="what heights refer to, such as EGM96; needed where the elevation's CRS does not say"
    )
    elevation_error_m: Annotated[Real, Field(ge=0, le=100)] = Field(
        0.0, description="standard error of a height against its neighbours [m]: of the incidence a law is found at"
    )
    vrt_folders: list[str] | None = Field(
        None, description="folders in which sources of a VRT may lie, besides the VRT's own"
    )
    objects: SceneObjects | None = Field(None, description="what stands on the ground")

    @model_validator(mode="after")
    def _ordered(self) -> Self:
        if self.bounds is not None:
            west, south, east, north = self.bounds
            if not (west < east and south < north):
                raise ValueError(
                    f"bounds are [{west:g}, {south:g}, {east:g}, {north:g}], expected west < east and south < north"
                )
        return self


Scene = Annotated[BuiltinScene | SlantRangeScene | RasterScene, Field(discriminator="source")]


class Radar(_Strict):
    """One pass: track, sensor and image grid."""

    altitude_m: Altitude = Field(4000.0, description="height of the track above the scene's mean elevation [m]")
    depression_deg: Annotated[Real, Field(gt=5, lt=85)] = Field(
        45.0, description="depression angle towards the scene's centre [deg]"
    )
    look_side: Literal["right", "left"] = Field(
        "right", description="the track heads north: right looks east, left looks west"
    )
    band: str = Field("X", description="label of the carrier's band")
    frequency_ghz: Frequency | None = Field(None, description="carrier frequency [GHz], for laws that depend on it")
    polarisation: Literal["HH", "HV", "VH", "VV"] = "HH"
    range_resolution_m: Length = Field(2.0, description="-3 dB width in slant range [m]")
    azimuth_resolution_m: Length = Field(3.5, description="-3 dB width in azimuth [m]")
    range_spacing_m: Length = Field(1.5, description="pixel spacing in slant range [m]")
    azimuth_spacing_m: Length = Field(2.5, description="pixel spacing in azimuth [m]")
    looks: Annotated[Integer, Field(ge=1, le=64)] = Field(
        4, description="independent looks averaged in power; of external simulators: what masks and notes assume"
    )
    nesz_db: Annotated[
        Annotated[Decibels, Tag("one level")]
        | Annotated[list[tuple[Annotated[Real, Field(ge=0, lt=90)], Decibels]], Field(min_length=2), Tag("a table")],
        Discriminator(lambda value: "a table" if isinstance(value, list) else "one level"),
    ] = Field(
        -20.0,
        description="noise-equivalent sigma0 [dB], or a table of [incidence on flat ground in degrees, dB]; far below "
        "the image for external simulators without noise",
    )
    radiometry: Radiometry = Field(
        "sigma0_local", description="what a pixel holds: sigma0_local (no area term), sigma0_ref, beta0 or gamma0"
    )

    @field_validator("nesz_db", mode="after")
    @classmethod
    def _table_ascends(cls, table: float | list[tuple[float, float]]) -> float | list[tuple[float, float]]:
        if not isinstance(table, float):
            angles = [angle for angle, _ in table]
            if any(second <= first for first, second in itertools.pairwise(angles)):
                raise ValueError(f"the incidence angles are {angles}, expected increasing angles")
        return table

    @model_validator(mode="after")
    def _sampled(self) -> Self:
        for way in ("range", "azimuth"):
            resolution, spacing = getattr(self, f"{way}_resolution_m"), getattr(self, f"{way}_spacing_m")
            if resolution > _COARSEST * spacing:
                raise ValueError(
                    f"{way}_resolution_m is {resolution:g}, expected at most {_COARSEST:g} times {way}_spacing_m "
                    f"({spacing:g})"
                )
        return self

    @model_validator(mode="after")
    def _one_band(self) -> Self:
        if self.frequency_ghz is not None and within_band(self.band, self.frequency_ghz * 1e9) is False:
            raise ValueError(f"frequency_ghz is {self.frequency_ghz:g}, which is not in band {self.band!r}: mend one")
        return self


class BuiltinSimulation(_Strict):
    """radcal's own simulator."""

    kind: Literal["builtin"] = Field("builtin", description="builtin (radcal's own) or command (any other program)")
    keep_images: bool = Field(False, description="keep the whole image in every run record")

    @property
    def longest_run_s(self) -> float:
        """What a run takes at most, and far more than it does [s]."""
        return 900.0

    @property
    def seed_width(self) -> int:
        """Bits of a run's seed."""
        return 63

    @property
    def not_told(self) -> frozenset[str]:
        """Keys of ``radar`` that change neither geometry nor a run."""
        return frozenset()


Knots = Annotated[list[Annotated[Real, Field(ge=0, le=90)]], Field(min_length=2)]


def _law_of(
    name: str,
    angles_deg: Sequence[float] | None,
    names: Sequence[str] | None = None,
    units: Sequence[str] | None = None,
) -> Law:
    """The law that a material names, its knots bound: names and units of its parameters are known."""
    if name not in LAWS and name != EXTERNAL:
        raise ValueError(f"law is {name!r}, expected one of {[*sorted(LAWS), EXTERNAL]}")
    if name != EXTERNAL and (names is not None or units is not None):
        raise ValueError(f"law {name!r} names its own parameters: names and units are for law: {EXTERNAL}")
    if name == EXTERNAL or "angles_deg" not in LAWS[name].needs:
        if angles_deg is not None:
            raise ValueError(f"angles_deg is given, law {name!r} has no knots")
    elif angles_deg is None:
        raise ValueError(f"angles_deg is missing, law {name!r} needs the incidence angles of its knots [deg]")
    elif any(second <= first for first, second in itertools.pairwise(angles_deg)):
        raise ValueError(f"angles_deg is {angles_deg}, expected increasing angles")
    if name == EXTERNAL:
        _check_names(names or (), units)
        return external_law(names or (), units)
    return LAWS[name].bound(angles_deg=angles_deg)


def _check_names(names: Sequence[str], units: Sequence[str] | None) -> None:
    """Refuse names of an external law's parameters that a program could not be told."""
    for name in names:
        if not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name):
            raise ValueError(f"names: {name!r} is not a letter followed by letters, digits and _")
    if len(set(names)) != len(names):
        raise ValueError(f"names are {list(names)}, expected each once")
    if units is not None and len(units) != len(names):
        raise ValueError(f"units has {len(units)} entries, names {len(names)}")


def _takes(law: Law, name: str) -> str:
    """How many parameters a law takes, in words."""
    # those of an external law stand in the case itself, and may be what is wrong
    named = "" if law.has_curve else f" (names: {', '.join(law.names) or 'none'})"
    return f"law {name!r} takes {len(law.names)}{named}"


def _check_parameters(key: str, values: Sequence[float], law: Law, name: str) -> None:
    """Refuse parameters of the wrong number, or that the law has no value for."""
    if len(values) != len(law.names):
        raise ValueError(f"{key} has {len(values)} numbers, {_takes(law, name)}")
    # what is large for a parameter of somebody else's, only they could say
    largest = _LARGEST if law.has_curve else math.inf
    limits = law.limits or ((-largest, largest),) * len(law.names)
    for parameter, x, (low, high) in zip(law.names, values, limits, strict=True):
        if not low <= x <= high:
            raise ValueError(f"{key}: {parameter} of law {name!r} is {x:g}, expected {low:g} to {high:g}")


class Start(_Strict):
    """A start with another law than the one that is calibrated: the reference run is made with it."""

    law: str = Field(description="law of the reference run")
    angles_deg: Knots | None = Field(None, description="knots of a tabulated law [deg]")
    parameters: list[Parameter] = Field(description="its parameters")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.law == EXTERNAL:
            raise ValueError(f"law is {EXTERNAL!r}, which is no law to start with, expected one of {sorted(LAWS)}")
        _check_parameters("parameters", self.parameters, _law_of(self.law, self.angles_deg), self.law)
        return self


def _braced(value: object) -> object:
    """YAML reads an unquoted {input} in a list as a mapping: the text that was meant."""
    if isinstance(value, dict) and len(value) == 1 and next(iter(value.values())) is None:
        return "{" + str(next(iter(value))) + "}"
    return value


def _inside(value: str) -> str:
    """Refuse names that do not stay inside a run's folder."""
    path = Path(value)
    if not path.parts or path.is_absolute() or ".." in path.parts:
        raise ValueError(f"is {value!r}, expected the name of a file in the run's own folder")
    if path.parts[0].startswith("radcal."):
        raise ValueError(f"is {value!r}, names that begin with radcal. are kept for radcal's own")
    return value


def _listed(value: object) -> object:
    """Refuse a command line written as for a shell."""
    if isinstance(value, str):
        raise ValueError(f"is {value!r}, expected a list of program and arguments: no shell takes it apart")
    return value


def _without_null(value: str) -> str:
    """Refuse what no program can be handed."""
    if "\0" in value:
        raise ValueError(f"is {value!r}, expected text without the character 0")
    return value


def _environment(value: dict[str, str]) -> dict[str, str]:
    for name in value:
        if not name or "=" in name or "\0" in name:
            raise ValueError(f"{name!r} is no name of an environment variable")
    return value


def _number_as_text(value: object) -> object:
    """YAML reads OMP_NUM_THREADS: 1 as a number."""
    return str(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


Argument = Annotated[str, BeforeValidator(_braced), AfterValidator(_without_null)]
Variable = Annotated[str, BeforeValidator(_number_as_text), AfterValidator(_without_null)]
Words = Annotated[list[Argument], Field(min_length=1), BeforeValidator(_listed)]
FileName = Annotated[str, AfterValidator(_inside)]


class InputFile(_Strict):
    """A file with all that the program needs to know of a run."""

    file: FileName = Field("input.json", description="its name in the run's folder")
    format: Literal["json", "toml"] = "json"
    radar: bool = Field(True, description="write the section radar into it: another looks or nesz_db is then a new run")


class Template(_Strict):
    """The program's own input file, with markers where parameters go."""

    template: str = Field(description="the file with the markers")
    file: FileName = Field(description="name of the filled file in the run's folder")
    delimiter: Annotated[str, Field(pattern=r"^[^\sA-Za-z0-9_.:-]$")] = Field(
        "@", description="the character on both sides of a marker, as in @dyke.X1@; nowhere else in the template"
    )


RawType = Literal[
    "float32", "float64", "complex64", "complex128", "int8", "uint8", "int16", "uint16", "int32", "uint32"
]


class Output(_Strict):
    """The image that the program writes."""

    file: FileName = Field(description="its name in the run's folder; a folder before it is made")
    scale: Literal["db", "power", "amplitude", "complex"] = Field(description="what its numbers are")
    format: Literal["npy", "npz", "mat", "hdf5", "raster", "raw"] | None = Field(
        None, description="what the file is; as its ending says if missing"
    )
    band: Count | None = Field(None, description="band of a raster, from 1; needed where it has several")
    dataset: str | None = Field(None, description="name in npz, mat or HDF5; needed where they hold several")
    dtype: RawType | None = Field(None, description="numbers of a raw file, row by row")
    byte_order: Literal["little", "big"] | None = Field(None, description="of a raw file; little if missing")
    shape: tuple[Count, Count] | None = Field(
        None, description="[rows, columns] of a raw file as written; the simulated image's if missing"
    )
    header_bytes: Annotated[Integer, Field(ge=0, le=10**12)] | None = Field(
        None, description="bytes before a raw file's numbers"
    )
    transpose: bool = Field(False, description="the file's rows are columns of the image (azimuth)")
    flip_rows: bool = Field(False, description="the last row is the nearest in slant range (after transpose)")
    flip_columns: bool = Field(False, description="columns run against the flight (after transpose)")

    @model_validator(mode="after")
    def _raw(self) -> Self:
        if self.format == "raw" and self.dtype is None:
            raise ValueError("format is raw, expected dtype: float32, complex64 or the like")
        if self.format != "raw":
            for key in ("dtype", "byte_order", "shape", "header_bytes"):
                if getattr(self, key) is not None:
                    raise ValueError(f"{key} is for files of format: raw")
        return self


class CommandSimulation(_Strict):
    """Any other program, called once for each run in a folder of its own."""

    kind: Literal["command"] = "command"
    command: Words = Field(
        description="program and arguments; no shell reads them. {input}, {output}, {folder}, {geometry}, {python}, "
        "{noise_seed} and {material.parameter} are filled in"
    )
    output: Output
    name: str | None = Field(None, description="of the simulator; the program's file name if missing")
    version: str | None = Field(None, description="of the simulator, if version_command does not tell it")
    version_command: Words | None = Field(None, description="program and arguments that print the version")
    input: InputFile | None = Field(None, description="write all parameters to a file")
    templates: list[Template] = Field(default_factory=list, description="the program's input files, to be filled in")
    files: list[str] = Field(default_factory=list, description="files copied into each run's folder")
    links: list[str] = Field(default_factory=list, description="files or folders linked into each run's folder")
    environment: Annotated[dict[str, Variable], AfterValidator(_environment)] = Field(
        default_factory=dict, description="environment variables, besides radcal's own"
    )
    timeout_s: Timeout = Field(3600.0, description="a run that takes longer is killed [s]")
    retries: Annotated[Integer, Field(ge=0, le=20)] = Field(0, description="times that a failed run is tried again")
    retry_wait_s: RetryWait = Field(1.0, description="wait before the first retry [s]; doubles each time")
    accept_exit_codes: Annotated[list[Annotated[Integer, Field(ge=-64, le=255)]], Field(min_length=1)] = Field(
        default_factory=lambda: [0],
        description="exit codes of a complete output; -11: ended by signal 11",
    )
    deterministic: bool | None = Field(
        None, description="whether equal parameters and seed give equal images; found out by a second run if missing"
    )
    seed_bits: Annotated[Integer, Field(ge=8, le=63)] | None = Field(
        None, description="width of noise_seed; if missing that of the case's earlier runs, 31 (a C int) if none"
    )
    seedless: bool = Field(
        False, description="the program takes no seed: it need not get one, and no rms is a fresh one"
    )
    keep_images: bool = Field(False, description="keep the whole image in every run record")
    keep_folders: bool = Field(False, description="keep the folders of successful runs too")

    @property
    def longest_run_s(self) -> float:
        """What a run takes at most, with all its retries [s]."""
        return self.timeout_s * (self.retries + 1) + self._waits_s

    @property
    def _waits_s(self) -> float:
        return self.retry_wait_s * (2.0**self.retries - 1.0)

    @model_validator(mode="after")
    def _patience(self) -> Self:
        if self._waits_s > LONGEST_S:
            raise ValueError(
                f"retry_wait_s is {self.retry_wait_s:g} and retries {self.retries}: waits that double each time add "
                f"up to {self._waits_s / 86_400:.3g} days, expected at most {LONGEST_S / 86_400:g}"
            )
        return self

    @property
    def seed_width(self) -> int:
        """Bits of a run's seed."""
        return _SEED_BITS if self.seed_bits is None else self.seed_bits

    @property
    def not_told(self) -> frozenset[str]:
        """Keys of ``radar`` that change neither geometry nor a run: masks and checks alone read them."""
        return frozenset() if self.input is not None and self.input.radar else _ONLY_MASKS

    @model_validator(mode="after")
    def _names(self) -> Self:
        if self.version is not None and self.version_command is not None:
            raise ValueError("version and version_command are both given, expected one of them")
        names = [
            *(("output.file", self.output.file),),
            *((("input.file", self.input.file),) if self.input else ()),
            *((f"templates.{k}.file", item.file) for k, item in enumerate(self.templates)),
            *((f"files.{k}", Path(item).name) for k, item in enumerate(self.files)),
            *((f"links.{k}", Path(item).name) for k, item in enumerate(self.links)),
        ]
        taken: dict[Path, str] = {}
        for key, name in names:
            if Path(name) in taken:
                raise ValueError(f"{key} and {taken[Path(name)]} are both {name!r} in the run's folder")
            taken[Path(name)] = key
        for path, key in taken.items():
            # a link leads out of the run's folder, where runs would write into one another's files
            for above in path.parents:
                if above in taken:
                    raise ValueError(
                        f"{key} is {str(path)!r}, inside of {taken[above]}: expected a name of its own in the run's "
                        "folder"
                    )
        return self


Simulator = Annotated[BuiltinSimulation | CommandSimulation, Field(discriminator="kind")]


class Material(_Strict):
    """A surface material: its law, and either fixed parameters or a box to search."""

    calibrate: bool = False
    law: str = _DEFAULT_LAW
    angles_deg: Knots | None = Field(None, description="incidence angles of a tabulated law's knots [deg]")
    names: list[str] | None = Field(None, description="of the parameters (law: external)")
    units: list[str] | None = Field(None, description="of the parameters (law: external)")
    integer: (
        Annotated[
            Annotated[list[str], Tag("a list")] | Annotated[bool, Tag("yes or no")],
            Discriminator(lambda value: "a list" if isinstance(value, list) else "yes or no"),
        ]
        | None
    ) = Field(None, description="names of parameters that are whole numbers, or true for all (law: external)")
    parameters: list[Parameter] | None = Field(None, description="fixed parameters (calibrate: false)")
    bounds: list[tuple[Parameter, Parameter]] | None = Field(None, description="[lower, upper] of each parameter")
    start: (
        Annotated[
            Annotated[list[Parameter], Tag("a list")] | Annotated[Start, Tag("a law")],
            Discriminator(lambda value: "a law" if isinstance(value, dict | Start) else "a list"),
        ]
        | None
    ) = Field(
        None, description="starting parameters, or {law, parameters}; the middle of the bounds if missing"
    )  # fmt: skip

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        law = self.unbound_law
        d = len(law.names)
        if not self.calibrate:
            if self.parameters is None and d > 0:
                raise ValueError(f"a material that is not calibrated needs parameters: {d} numbers {list(law.names)}")
            _check_parameters("parameters", self.parameters or [], law, self.law)
            self._check_integers()
            self.check_whole("parameters", self.parameters or [])
            return self
        if self.parameters is not None:
            raise ValueError("a calibrated material takes start and bounds, not parameters")
        if self.law == EXTERNAL and (d == 0 or self.bounds is None):
            raise ValueError("a calibrated material of law external needs names and bounds of its parameters")
        if self.bounds is None and law.bounds is None:
            raise ValueError(
                f"bounds is missing, law {self.law!r} has no default: expected [lower, upper] for each of "
                f"{', '.join(law.names)}"
            )
        if len(self.box) != d:
            raise ValueError(f"bounds has {len(self.box)} intervals, {_takes(law, self.law)}")
        for name, (low, high) in zip(law.names, self.box, strict=True):
            if not low < high:
                raise ValueError(f"bounds of {name} are [{low:g}, {high:g}], expected lower < upper")
            if law.has_curve and max(abs(low), abs(high)) > _LARGEST:
                raise ValueError(f"bounds of {name} are [{low:g}, {high:g}], expected within +-{_LARGEST:g}")
        self._check_integers()
        for values in zip(*self.box, strict=True):
            _check_parameters("bounds", values, law, self.law)
            self.check_whole("bounds", values)
        if self.starts_with_another_law:
            return self
        if len(self.start_parameters) != d:
            raise ValueError(f"start has {len(self.start_parameters)} numbers, {_takes(law, self.law)}")
        for name, x, (low, high) in zip(law.names, self.start_parameters, self.box, strict=True):
            if not low <= x <= high:
                raise ValueError(f"start of {name} is {x:g}, expected inside its bounds [{low:g}, {high:g}]")
        self.check_whole("start", self.start_parameters)
        return self

    def _check_integers(self) -> None:
        """Refuse names of whole parameters that the law does not have."""
        if self.integer and self.law != EXTERNAL:
            raise ValueError(f"integer is for parameters of law: {EXTERNAL}, law is {self.law!r}")
        for name in self.integer if isinstance(self.integer, list) else ():
            if name not in self.parameter_names:
                raise ValueError(f"integer: no parameter {name!r}{nearest(name, self.parameter_names)}")

    def check_whole(self, key: str, values: Sequence[float]) -> None:
        """Refuse values of whole parameters that are not whole.

        Parameters
        ----------
        key : str
            What the message calls them.
        values : sequence of float, shape (d,)
            One for each parameter.

        Raises
        ------
        ValueError
            One is not whole, or too large for a double to tell it from its neighbours.
        """
        for name, whole, x in zip(self.parameter_names, self.integers, values, strict=True):
            if whole and (x != round(x) or abs(x) > _LARGEST_WHOLE):
                raise ValueError(f"{key}: {name} is {x:g}, expected a whole number within +-2^53: it is integer")

    @property
    def integers(self) -> tuple[bool, ...]:
        """Whether each parameter is a whole number."""
        listed = self.integer if isinstance(self.integer, list) else self.parameter_names if self.integer else ()
        return tuple(name in listed for name in self.parameter_names)

    def handed(self, values: Sequence[float]) -> dict[str, float | int]:
        """Parameters by name as an external program gets them: whole ones without a decimal point.

        Parameters
        ----------
        values : sequence of float, shape (d,)
            X.

        Raises
        ------
        ValueError
            One that is declared to be whole is not.
        """
        self.check_whole("X", values)
        named = zip(self.parameter_names, self.integers, values, strict=True)
        return {name: int(x) if whole else float(x) for name, whole, x in named}

    @property
    def unbound_law(self) -> Law:
        """The law with names and units of its parameters, before the pass is known."""
        return _law_of(self.law, self.angles_deg, self.names, self.units)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Name of each parameter."""
        return self.unbound_law.names

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Unit of each parameter, empty where it has none."""
        return self.unbound_law.units

    @property
    def box(self) -> list[tuple[float, float]]:
        """Bounds of each parameter, the law's own where none are configured."""
        return list(self.bounds if self.bounds is not None else self.unbound_law.bounds or ())

    @property
    def start_parameters(self) -> list[float]:
        """Parameters of the reference run; of the start's law, if it names one."""
        if not self.calibrate:
            return list(self.parameters or [])
        if isinstance(self.start, Start):
            return list(self.start.parameters)
        if self.start is not None:
            return list(self.start)
        middle = [0.5 * (low + high) for low, high in self.box]
        return [float(math.ceil(x)) if whole else x for x, whole in zip(middle, self.integers, strict=True)]

    @property
    def starts_with_another_law(self) -> bool:
        """Whether the reference run is made with another law than the one that is calibrated."""
        return (
            self.calibrate
            and isinstance(self.start, Start)
            and (self.start.law, self.start.angles_deg) != (self.law, self.angles_deg)
        )

    @property
    def at_start(self) -> Material:
        """The material as the reference run sees it: of the start's law."""
        if not (self.starts_with_another_law and isinstance(self.start, Start)):
            return self
        # not checked again: bounds are the calibrated law's, and nothing of a reference run asks for them
        start = {"law": self.start.law, "angles_deg": self.start.angles_deg, "start": list(self.start.parameters)}
        return self.model_copy(update={**start, "bounds": None, "names": None, "units": None, "integer": None})


class Synthetic(_Strict):
    """The hidden truth of a synthetic measurement."""

    parameters: dict[str, list[Parameter]] = Field(
        default_factory=lambda: {"dyke": [6.1, 14.2, 21.5, 3.3]},
        description="hidden parameters by material; others keep theirs",
    )

    @property
    def is_written(self) -> bool:
        """Whether the parameters were configured rather than left to their default."""
        return "parameters" in self.model_fields_set

    seed: Seed = Field(2, description="seed of the measurement's speckle, noise and warp")
    offset_db: Decibels = Field(0.0, description="level offset of the measurement [dB]")
    warp_px: Annotated[Real, Field(ge=0, le=50)] = Field(2.0, description="rms misregistration [pixels]")


class SyntheticMeasurement(_Strict):
    """A measurement made by the simulator from hidden parameters."""

    source: Literal["synthetic"] = "synthetic"
    synthetic: Synthetic = Synthetic()


class FileMeasurement(_Strict):
    """A measured image in a file, on the scene's image grid."""

    source: Literal["file"] = "file"
    path: str = Field(
        description="SICD, GeoTIFF or other raster, npy, npz, mat, HDF5; ${RADCAL_DATA} and the like are expanded"
    )
    scale: Literal["db", "power", "amplitude", "complex"] = Field(description="what the file's numbers are")
    band: Count | None = Field(None, description="band of a raster, from 1; needed where it has several")
    dataset: str | None = Field(None, description="name in npz, mat or HDF5; needed where they hold several")
    polarisation: Literal["HH", "HV", "VH", "VV"] | None = Field(
        None, description="transmitted and received; checked against radar.polarisation"
    )
    carrier_band: str | None = Field(None, description="label of the carrier's band; checked against radar.band")
    vrt_folders: list[str] | None = Field(
        None, description="folders in which sources of a VRT may lie, besides the VRT's own"
    )
    radiometry: Radiometry = Field("sigma0_local", description="what its pixels hold; that of radar.radiometry")


Measurement = Annotated[SyntheticMeasurement | FileMeasurement, Field(discriminator="source")]


class Registration(_Strict):
    """How the measured image is brought onto the simulated one."""

    method: Literal["gefolki", "ilk", "none"] = Field(
        "gefolki", description="gefolki, ilk (scikit-image) or none: the image is taken as it lies"
    )
    global_shift: bool = Field(False, description="find one shift for the whole image first, by phase correlation")
    max_displacement_px: Annotated[Real, Field(gt=0, le=1000)] = Field(
        20.0, description="a registration that moves further is not used [pixels]"
    )


class Target(_Strict):
    """Which pixels of a material make its target density."""

    pixels: Annotated[
        Integer, Field(ge=50, le=ALL_PIXELS), BeforeValidator(lambda value: ALL_PIXELS if value == "all" else value)
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


class Validation(_Strict):
    """Ground that is kept out of the target, and predicted from what was found."""

    rows: Count = Field(20, description="image rows of a block that is kept or left out as a whole")
    columns: Count | None = Field(None, description="image columns of a block, next to one another; all if missing")
    means: Count = Field(10, description="rows of a part of a block whose mean level is predicted")
    keep: Literal["even", "odd", "both"] = Field(
        "even", description="blocks that are calibrated on; both: all, and each half is predicted from the other"
    )

    @model_validator(mode="after")
    def _whole_parts(self) -> Self:
        if self.rows % self.means:
            raise ValueError(f"means is {self.means}, expected a divisor of rows ({self.rows})")
        return self


class Design(_Strict):
    """The runs made before any surrogate exists."""

    sampler: Literal["monte_carlo", "latin_hypercube", "sobol"] = Field(
        "sobol", description="monte_carlo, latin_hypercube or sobol"
    )
    size: Annotated[Integer, Field(ge=2, le=100_000)] | Literal["auto"] = Field(
        "auto", description="runs, or auto: 2, 16 for objective: density; a larger design keeps a smaller one's"
    )
    chunk: Annotated[Integer, Field(ge=1, le=1000)] = Field(4, description="runs per workflow job")
    reuse: CaseName | None = Field(None, description="earlier case of the same scene and simulator: its runs count")


class Surrogate(_Strict):
    """What the kriging learns and how it is trained."""

    outputs: Literal["centred", "direct"] = Field(
        "centred", description="(mean, log sd, skewness) or (xi, omega, alpha)"
    )
    training: Literal["warm", "smt"] = Field(
        "warm", description="warm: from the last optimum, multi-start every retrain_every; smt: the library's defaults"
    )
    retrain_every: Count = Field(5, description="iterations between multi-start trainings (warm)")


class Optimiser(_Strict):
    """NSGA-II on the surrogate and the polish of its best point."""

    objective: Literal["theta", "rms"] = Field(
        "theta", description="NSGA-II minimises differences in theta, or rms (which saturates)"
    )
    # Platypus sorts in pure Python, with time growing as evaluations times population; the polish and
    # the multi-start search make up for a small population
    population: Annotated[Integer, Field(ge=4, le=10_000)] = Field(40, description="solutions in a generation")
    evaluations: Annotated[Integer, Field(ge=1, le=10_000_000)] = Field(
        1600, description="evaluations of the surrogate"
    )
    polish: bool = Field(True, description="least squares in theta from NSGA-II's best point")


class Stop(_Strict):
    """When the loop ends; never touches finished runs."""

    rms: Annotated[Real, Field(gt=0, le=100)] = Field(1.0e-5, description="tolerance on the density mismatch [1/dB]")
    max_runs: Count = Field(200, description="design and infill runs together")
    stagnation_runs: Count = Field(20, description="infill runs without a better point")
    law_db: Annotated[Real, Field(gt=0, le=200)] = Field(
        0.05, description="change of a law over the incidence seen that counts as none [dB]; for objective: classes"
    )
    at_sampling_error: bool = Field(
        False,
        description="stop below a third of the sampling error, too, after 5 runs without a better point; true for "
        "simulator.kind: command without rms",
    )


_SYNTHETIC_MATERIALS: dict[str, dict[str, Any]] = {
    "dyke": {
        "calibrate": True,
        "law": "mangia",
        "bounds": [[0, 50], [0, 50], [0, 50], [0, 50]],
        # bare soil of Oh et al. 1992 (docs/laws.md), at the level of this case's other laws: 30 dB up
        "start": [0.0, 13.07, 12.17, 0.09],
    },
    "water": {"parameters": [2.0, 3.0, 22.0, 6.0]},
    "grass": {"parameters": [10.0, 14.0, 6.0, 4.0]},
    "forest": {"parameters": [20.0, 9.0, 2.0, 2.0]},
    "crops": {"parameters": [12.0, 16.0, 5.0, 4.0]},
    "bare_soil": {"parameters": [6.0, 15.0, 14.0, 5.0]},
    "road": {"parameters": [2.0, 10.0, 18.0, 8.0]},
}


# sections of several kinds, and the key that says which
_TAGS = {"scene": "source", "simulator": "kind", "measurement": "source"}


def _default_materials() -> dict[str, Material]:
    return {name: Material.model_validate(value) for name, value in _SYNTHETIC_MATERIALS.items()}


def _with_fitting_stop(data: dict[str, Any]) -> dict[str, Any]:
    """Another's program, and no tolerance asked for: end where runs tell no more than the image does."""
    stop, simulator = data.get("stop", {}), data.get("simulator")
    # sections that come as models were fitted when they were made
    if not isinstance(stop, dict) or "rms" in stop or "at_sampling_error" in stop:
        return data
    kind = simulator.get("kind") if isinstance(simulator, dict) else getattr(simulator, "kind", None)
    return {**data, "stop": {**stop, "at_sampling_error": True}} if kind == "command" else data


class Case(_Strict):
    """Everything radcal needs to know about one calibration."""

    case: CaseName = Field("dyke", description="names the folder below results/")
    replace: bool = Field(False, description="let results of another scene or pass in that folder be replaced")
    seed: Seed = Field(1, description="every random draw not named elsewhere derives from it")
    scene: Scene = BuiltinScene()
    radar: Radar = Radar()
    simulator: Simulator = BuiltinSimulation()
    materials: dict[str, Material] = Field(default_factory=_default_materials, min_length=1)
    measurement: Measurement = SyntheticMeasurement()
    registration: Registration = Registration()
    objective: Literal["classes", "density", "likelihood"] = Field(
        "classes",
        description="classes or likelihood (the law, by classes of incidence: docs/right_law.md), density (histogram)",
    )
    target: Target = Target()
    validation: Validation | None = Field(None, description="ground kept out to check the laws: {rows, means, keep}")
    design: Design = Design()
    surrogate: Surrogate = Surrogate()
    optimiser: Optimiser = Optimiser()
    stop: Stop = Stop()

    @model_validator(mode="before")
    @classmethod
    def _fitting_defaults(cls, data: object) -> object:
        """Take the density where its one class is asked for, and where nothing else can be had."""
        if not isinstance(data, dict):
            return data
        data = _with_fitting_stop(data)
        if "objective" in data:
            return data
        target, materials = (data[key] if isinstance(data.get(key), dict) else {} for key in ("target", "materials"))
        alone = target.get("incidence_classes") in (1, "1") or target.get("normalisation") == "image"
        outside = any(
            isinstance(item, dict) and item.get("calibrate") and item.get("law") == EXTERNAL
            for item in materials.values()
        )
        return {**data, "objective": "density"} if alone or outside else data

    @field_validator("scene", "simulator", "measurement", mode="before")
    @classmethod
    def _default_tag(cls, value: object, info: ValidationInfo) -> object:
        if isinstance(value, dict) and info.field_name is not None:
            tag = _TAGS[info.field_name]
            if tag not in value:
                return {tag: getattr(cls.model_fields[info.field_name].default, tag), **value}
        return value

    @field_validator("materials")
    @classmethod
    def _material_names(cls, value: dict[str, Material]) -> dict[str, Material]:
        for name in value:
            if not re.fullmatch(r"[A-Za-z0-9]([A-Za-z0-9_ -]*[A-Za-z0-9_-])?", name):
                raise ValueError(f"name {name!r} is not made of letters, digits, blanks, _ and -")
        return value

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if not self.calibrated:
            raise ValueError("materials: none is marked calibrate: true, expected at least one")
        # the default truth is the default case's: where nobody wrote one, materials keep their start
        if isinstance(self.measurement, SyntheticMeasurement) and self.measurement.synthetic.is_written:
            for name, x in self.measurement.synthetic.parameters.items():
                if name not in self.materials:
                    raise ValueError(
                        f"measurement.synthetic.parameters.{name}: no such material{nearest(name, self.materials)}"
                    )
                material = self.materials[name]
                _check_parameters(f"measurement.synthetic.parameters.{name}", x, material.unbound_law, material.law)
                material.check_whole(f"measurement.synthetic.parameters.{name}", x)
        for name in self.target.reference_materials or []:
            if name not in self.materials:
                raise ValueError(f"target.reference_materials: no material {name!r}{nearest(name, self.materials)}")
            if self.materials[name].calibrate:
                raise ValueError(
                    f"target.reference_materials: {name!r} is calibrated, expected a material with fixed parameters"
                )
        if self.target.normalisation == "offset" and not self.reference_materials:
            raise ValueError(
                "target.normalisation is offset, expected at least one material with fixed parameters "
                "(calibrate: false) to say the level, found none"
            )
        if isinstance(self.measurement, SyntheticMeasurement):
            self._check_truth(self.measurement.synthetic)
        self._check_laws()
        if isinstance(self.measurement, FileMeasurement):
            self._check_pass(self.measurement)
        self._check_objective()
        if self.design.reuse == self.case:
            raise ValueError(f"design.reuse is {self.case!r}, this case itself, expected an earlier one")
        self._check_whole_box()
        if self.stop.max_runs < self.design_size:
            raise ValueError(
                f"stop.max_runs is {self.stop.max_runs}, expected at least design.size ({self.design_size})"
            )
        return self

    def _check_whole_box(self) -> None:
        """Refuse a box of whole numbers that has no room for the design beside the reference run."""
        materials = [self.materials[name] for name in self.calibrated]
        if not all(all(material.integers) for material in materials):
            return
        points = math.prod(int(high - low) + 1 for material in materials for low, high in material.box)
        if self.design_size >= points:
            raise ValueError(
                f"design.size is {self.design_size}, expected less than {points}: so many combinations of whole "
                "parameters there are inside the bounds, and the reference run is one of them"
            )

    def _check_objective(self) -> None:
        """Refuse what an objective has no use for, or cannot do."""
        if self.objective == "density" and self.target.incidence_classes not in (1, "auto"):
            raise ValueError(
                f"target.incidence_classes is {self.target.incidence_classes}, which objective: density has no use "
                "for, expected objective: classes"
            )
        if self.target.normalisation == "image" and self.validation is not None:
            raise ValueError(
                "validation is asked for and target.normalisation is image, whose values are no longer dB: errors of "
                "block means would have no unit, expected normalisation none or offset"
            )
        if self.objective != "density" and self.target.normalisation == "image":
            raise ValueError(
                f"objective is {self.objective} and target.normalisation is image, whose values are no longer dB: "
                "looks and priors have no meaning there, expected normalisation none or offset"
            )
        if self.objective != "density" or self.validation is not None:
            key = "validation is asked for" if self.objective == "density" else f"objective is {self.objective}"
            for name in self.calibrated:
                if self.materials[name].law == EXTERNAL:
                    raise ValueError(
                        f"{key} and materials.{name}.law is {EXTERNAL}, whose curve only the simulator knows, "
                        "expected objective: density without validation"
                    )

    def _check_truth(self, synthetic: Synthetic) -> None:
        """Refuse a synthetic measurement without a truth in the law that is calibrated."""
        for name, material in self.materials.items():
            key = f"measurement.synthetic.parameters.{name}"
            if name in synthetic.parameters and (synthetic.is_written or material.law == _DEFAULT_LAW):
                continue
            if name in synthetic.parameters:
                raise ValueError(
                    f"{key} is missing: its default is for law {_DEFAULT_LAW!r}, materials.{name}.law is "
                    f"{material.law!r}"
                )
            if material.starts_with_another_law:
                raise ValueError(
                    f"{key} is missing: the hidden truth is of law {material.law!r}, and materials.{name}.start is of "
                    "another law"
                )

    def _check_laws(self) -> None:
        """Refuse laws that the simulator does not know, or that depend on what the radar does not say."""
        command = isinstance(self.simulator, CommandSimulation)
        for name, material in self.materials.items():
            if material.law == EXTERNAL and not command:
                raise ValueError(
                    f"materials.{name}.law is {EXTERNAL}, which only simulator.kind: command can simulate, "
                    f"expected one of {sorted(LAWS)}"
                )
            if material.starts_with_another_law and command:
                raise ValueError(
                    f"materials.{name}.start is of law {material.at_start.law!r}, which simulator.kind: command would "
                    f"not be told: expected a list of {len(material.parameter_names)} numbers for law "
                    f"{material.law!r}"
                )
            for key, seen in ((name, material), (f"{name}.start", material.at_start)):
                if "frequency_ghz" in seen.unbound_law.needs and self.radar.frequency_ghz is None:
                    raise ValueError(
                        f"radar.frequency_ghz is missing: law {seen.law!r} of materials.{key} depends on it"
                    )

    def _check_pass(self, measurement: FileMeasurement) -> None:
        """Refuse an image that is declared to be of another pass than the radar's."""
        if measurement.radiometry != self.radar.radiometry:
            raise ValueError(
                f"measurement.radiometry is {measurement.radiometry}, radar.radiometry is {self.radar.radiometry}: set "
                "radar.radiometry to the measurement's, the simulation is made in it"
            )
        if measurement.polarisation not in (None, self.radar.polarisation):
            raise ValueError(
                f"measurement.polarisation is {measurement.polarisation}, radar.polarisation is "
                f"{self.radar.polarisation}: polarisations are never mixed, set both to the image's"
            )
        if measurement.carrier_band is not None and not same_label(measurement.carrier_band, self.radar.band):
            raise ValueError(
                f"measurement.carrier_band is {measurement.carrier_band!r}, radar.band is {self.radar.band!r}: "
                "bands are never mixed, set both to the image's"
            )

    @property
    def calibrated(self) -> list[str]:
        """Names of the materials to calibrate, in the order of the file."""
        return [name for name, material in self.materials.items() if material.calibrate]

    @property
    def design_size(self) -> int:
        """Runs of the design."""
        return _DESIGN_SIZE[self.objective] if self.design.size == "auto" else self.design.size

    @property
    def laws(self) -> dict[str, Law]:
        """Every material's law for this pass, ready to be evaluated unless it is external."""
        return {
            name: law_for(
                material.law,
                frequency_ghz=self.radar.frequency_ghz,
                polarisation=self.radar.polarisation,
                angles_deg=material.angles_deg,
                names=material.names,
                units=material.units,
            )
            for name, material in self.materials.items()
        }

    @property
    def at_start(self) -> Case:
        """The case as the reference run sees it: materials have the law of their start."""
        return self.model_copy(
            update={"materials": {name: material.at_start for name, material in self.materials.items()}}
        )

    @property
    def start_with_another_law(self) -> list[str]:
        """Names of the calibrated materials whose reference run is made with another law."""
        return [name for name, material in self.materials.items() if material.starts_with_another_law]

    @property
    def reference_materials(self) -> list[str]:
        """Names of the materials that say the measured image's level."""
        if self.target.reference_materials is not None:
            return list(self.target.reference_materials)
        return [name for name, material in self.materials.items() if not material.calibrate]

    def sections(self, *names: str) -> dict[str, Any]:
        """Return the named sections as plain data, for a rule's ``params``."""
        sections = self.model_dump(mode="json", include=set(names))
        if environment := sections.get("simulator", {}).get("environment"):
            sections["simulator"]["environment"] = Undisclosed(environment)
        return sections

    @classmethod
    def of_sections(cls, sections: Mapping[str, Any]) -> Case:
        """Rebuild a case from :meth:`sections`; reading any other section is an AttributeError.

        A job thus cannot depend on a key that its rule does not declare.
        """
        checked = {
            name: TypeAdapter[Any](typing.cast(Any, cls.model_fields[name].annotation)).validate_python(value)
            for name, value in sections.items()
        }
        case = cls.model_construct(**checked)
        for name in cls.model_fields.keys() - checked.keys():
            del case.__dict__[name]
        return case


def expand_path(text: str, key: str, folder: bool = False) -> Path:
    """Expand ``~`` and ``${VARIABLES}`` of a configured path.

    Parameters
    ----------
    text : str
        The path as written.
    key : str
        The configuration key, for the message.
    folder : bool
        Whether a folder will do, too.

    Raises
    ------
    ConfigError
        A variable is not set, or no such file exists.
    """
    missing = [name for name in re.findall(r"\$\{(\w+)\}", text) if name not in os.environ]
    if missing:
        raise ConfigError(
            f"{key} is {text!r} but the environment variable {missing[0]} is not set: "
            f"type export {missing[0]}=FOLDER first."
        )
    path = Path(os.path.expanduser(os.path.expandvars(text)))
    try:
        found = path.exists()
    except OSError as error:  # a name too long for the file system
        raise ConfigError(f"{key}: the file {shown(str(path), 200)} cannot be read ({error.strerror}).") from None
    if not found:
        raise ConfigError(f"{key}: the file {shown(str(path), 200)} does not exist.")
    if not path.is_file() and not (folder and path.is_dir()):
        raise ConfigError(f"{key}: {path} is not a file.")
    if not os.access(path, os.R_OK):
        raise ConfigError(f"{key}: no permission to read {path}.")
    return path


def executable_path(word: str, key: str, environment: Mapping[str, str]) -> Path:
    """The program that the first word of a command names.

    Parameters
    ----------
    word : str
        ``{python}``, the interpreter that runs radcal; a path, with a slash; or a name on the
        PATH.
    key : str
        The configuration key, for the message.
    environment : mapping
        Configured environment variables.

    Raises
    ------
    ConfigError
        There is no such program.
    """
    if word == "{python}":
        return Path(sys.executable)
    if not word.strip():
        raise ConfigError(f"{key}: its first word is empty, expected a program.")
    if "/" not in word:
        found = shutil.which(word, path=environment.get("PATH"))
        if found is None:
            raise ConfigError(
                f"{key}: no program {word!r} on the PATH; write a path, such as ./{word}, for a program elsewhere."
            )
        return Path(found).absolute()
    path = expand_path(word, key)
    if not os.access(path, os.X_OK):
        raise ConfigError(f"{key}: {path} is not executable: type chmod +x {path}.")
    return path.absolute()


def files_below(path: Path) -> list[Path]:
    """The file itself, or all files below a folder, in order."""
    return sorted(item for item in path.rglob("*") if item.is_file()) if path.is_dir() else [path]


def input_files(case: Case) -> dict[str, Path]:
    """Existing files that the case reads, by configuration key.

    Raises
    ------
    ConfigError
        A file is missing.
    """
    files: dict[str, Path] = {}
    rasters: tuple[str, ...] = ()
    if isinstance(case.scene, SlantRangeScene):
        rasters = ("labels",)
    elif isinstance(case.scene, RasterScene):
        rasters = ("elevation", "materials")
    if isinstance(case.scene, SlantRangeScene | RasterScene):
        for key in rasters:
            files |= _raster_inputs(case.scene, key, f"scene.{key}")
        files["scene.names"] = expand_path(case.scene.names, "scene.names")
    if isinstance(case.scene, BuiltinScene | RasterScene) and case.scene.objects and case.scene.objects.path:
        files["scene.objects.path"] = expand_path(case.scene.objects.path, "scene.objects.path")
    if isinstance(case.measurement, FileMeasurement):
        files |= _raster_inputs(case.measurement, "path", "measurement.path")
    if isinstance(case.simulator, CommandSimulation):
        files |= _simulator_files(case.simulator)
    return files


def vrt_folders(config: SlantRangeScene | RasterScene | FileMeasurement) -> tuple[Path, ...]:
    """Folders in which sources of a VRT may lie besides its own.

    Raises
    ------
    ConfigError
        One of them is missing.
    """
    section = "measurement" if isinstance(config, FileMeasurement) else "scene"
    return tuple(
        expand_path(text, f"{section}.vrt_folders.{k}", folder=True) for k, text in enumerate(config.vrt_folders or ())
    )


def _raster_inputs(config: SlantRangeScene | RasterScene | FileMeasurement, name: str, key: str) -> dict[str, Path]:
    """A file that may be a raster, and all that it is read together with."""
    path = expand_path(getattr(config, name), key)
    try:
        others = raster_files(path, vrt_folders(config))
    except RasterRefused as error:
        raise ConfigError(f"{key}: {path} cannot be read as a raster ({error}).") from None
    return {key: path} | {f"{key}.{k}": other for k, other in enumerate(others)}


def _simulator_files(config: CommandSimulation) -> dict[str, Path]:
    files = {}
    if config.command[0] != "{python}":
        files["simulator.command"] = executable_path(config.command[0], "simulator.command", config.environment)
    for k, item in enumerate(config.templates):
        files[f"simulator.templates.{k}"] = expand_path(item.template, f"simulator.templates.{k}.template")
    for k, text in enumerate(config.files):
        files[f"simulator.files.{k}"] = expand_path(text, f"simulator.files.{k}")
    for k, text in enumerate(config.links):
        for n, path in enumerate(files_below(expand_path(text, f"simulator.links.{k}", folder=True))):
            files[f"simulator.links.{k}.{n}"] = path
    return files


def nearest(key: str, known: Iterable[str]) -> str:
    """Hint at what may have been meant by a key that is not known, in brackets."""
    found = difflib.get_close_matches(key, list(known), n=1, cutoff=0.5)
    return f" (did you mean {found[0]!r}?)" if found else f" (known: {', '.join(known)})"


def _models_in(annotation: object) -> list[type[BaseModel]]:
    """Configuration models that an annotation admits."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if isinstance(annotation, types.UnionType) or typing.get_origin(annotation) is not None:
        return [model for part in typing.get_args(annotation) for model in _models_in(part)]
    return []


def _tags(model: type[BaseModel]) -> list[object]:
    return [model.model_fields[key].default for key in _TAGS.values() if key in model.model_fields]


def _known_keys(location: Sequence[int | str]) -> list[str]:
    """Keys allowed beside the last element of an error's location."""
    models: list[type[BaseModel]] = [Case]
    for part in location[:-1]:
        if len(models) > 1:  # a union: this part is its tag, not a key
            models = [model for model in models if part in _tags(model)]
        else:
            field = models[0].model_fields.get(str(part))
            models = (_models_in(field.annotation) if field else []) or models
    return sorted({name for model in models for name in model.model_fields})


_ALTERNATIVES = ("a list", "a law", "one level", "a table", "yes or no")  # of pydantic's unions


def _of_kind(match: re.Match[str]) -> str:
    """What people write where pydantic asks for a kind of Python's."""
    return {"dictionary": "keys and values", "tuple": "a list"}[match[1]]


def _sentence(error: ValidationError, origin: str) -> str:
    """The first problem of a validation error in one sentence."""
    # a misspelt key that is required is both unknown and missing: what people wrote comes first
    details = sorted(error.errors(), key=lambda detail: detail["type"] != "extra_forbidden")
    first = details[0]
    key = _key(first["loc"])
    found = first["input"]
    match first["type"]:
        case "extra_forbidden":
            *above, last = first["loc"]
            key = f"{_key(above)}.{last}" if above else str(last)
            text = f"unknown key {key}{nearest(str(last), _known_keys(first['loc']))}"
        case "missing":
            text = f"{key} is missing"
        case "value_error":
            text = f"{key}: {first['msg'].removeprefix('Value error, ')}"
        case "union_tag_invalid" | "union_tag_not_found":
            tag = _TAGS[key]
            text = f"{key}.{tag} is {_shown(found, tag)}, expected {first.get('ctx', {}).get('expected_tags', '')}"
        case "int_parsing_size":
            text = f"{key} is {shown(repr(found))}, expected an integer of fewer digits"
        case _:
            message = first["msg"].removeprefix("Input should be ").replace(" after validation", "")
            message = re.sub(r"^\w+ should have ", "", message)
            message = re.sub("^a valid (dictionary|tuple).*", _of_kind, message)
            text = f"{key} is {shown(repr(found))}, expected {message}"
    # of several alternatives for one key none fits, which is one problem
    others = {_key(detail["loc"]) for detail in details[1:]} - {key}
    more = f" (and {len(others)} more)" if others else ""
    return f"{origin}: {shown(text, 600)}{more}."


def _key(place: Sequence[int | str]) -> str:
    """Where an error is, as people write it: without the tags that pydantic puts there."""
    location = list(place)
    if location and location[0] in _TAGS and len(location) > 1:
        location.pop(1)
    location = [part for part in location if part not in _ALTERNATIVES and "[" not in str(part)]
    return ".".join(str(part) for part in location) or "the configuration"


def _shown(found: object, key: str) -> str:
    return repr(found.get(key)) if isinstance(found, Mapping) else repr(found)


def _parsed(overrides: Mapping[str, Any]) -> dict[str, Any]:
    """Sections that came from the command line as text, as data."""
    parsed = dict(overrides)
    for key, value in overrides.items():
        if isinstance(value, str) and key in Case.model_fields.keys() - {"case", "seed"}:
            parsed[key] = read_value(value, f"--config {key}")
    return parsed


def case_from(data: Mapping[str, Any], origin: str = "configuration") -> Case:
    """Check plain data and return the typed case.

    Raises
    ------
    ConfigError
        One sentence about the first problem found.
    """
    try:
        return Case.model_validate(dict(data))
    except ValidationError as error:
        raise ConfigError(_sentence(error, origin)) from None


def load(files: Sequence[str | Path], overrides: Mapping[str, Any] | None = None) -> Case:
    """Read configuration files and command-line overrides into one typed case.

    Parameters
    ----------
    files : sequence of path
        YAML files, later ones win.
    overrides : mapping, optional
        What ``snakemake --config`` gave, or Snakemake's merged configuration; nested
        values may be text.

    Raises
    ------
    ConfigError
        A file is missing, empty or not YAML, a key stands in it twice, or a value is refused.
    """
    data: dict[str, Any] = {}
    for file in files:
        data = merged(data, read_case_file(file))
    data = merged(data, _parsed(overrides or {}))
    return case_from(data, ", ".join(str(f) for f in files) or "configuration")


_HEADER = """\
# The default case. Every key below is a default: a case of your own needs only the keys that differ.
# Written by: python -m radcal.config > config/config.yaml
"""


def default_yaml() -> str:
    """Return the default case as commented YAML, the text of ``config/config.yaml``."""
    return _HEADER + "\n" + "\n".join(_lines(Case())) + "\n"


def _lines(section: BaseModel, indent: str = "") -> list[str]:
    """One line per key with its description; nested sections indented."""
    lines = []
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if value is None:
            continue
        nested = value if isinstance(value, dict) else {}
        if isinstance(value, BaseModel):
            lines += [f"{indent}{name}:", *_lines(value, indent + "  ")]
        elif any(isinstance(item, BaseModel) for item in nested.values()):
            lines.append(f"{indent}{name}:")
            for key, item in nested.items():
                lines += [f"{indent}  {key}:", *_lines(item, indent + "    ")]
        else:
            comment = f"  # {field.description}" if field.description else ""
            lines.append(f"{indent}{name}: {_inline(value)}{comment}")
    return lines


def _inline(value: object) -> str:
    """A plain value in YAML on one line; YAML 1.1 would read 1e-05 as text."""
    if isinstance(value, dict):
        return "{" + ", ".join(f"{key}: {_inline(item)}" for key, item in value.items()) + "}"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(_inline(item) for item in value) + "]"
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, float) and "e" in repr(value):
        return f"{value:.1e}"
    return f"{value:g}" if isinstance(value, float) and value == round(value) and abs(value) < 1e6 else str(value)


if __name__ == "__main__":
    import sys

    sys.stdout.write(default_yaml())
