"""Section ``simulator``: radcal's own simulator, or any other program."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, model_validator

from radcal.config.limits import LONGEST_S, Count, Integer, RetryWait, Timeout
from radcal.config.sections import Section

__all__ = ["BuiltinSimulation", "CommandSimulation", "InputFile", "Output", "RawType", "SimulatorConfig", "Template"]

_KIND = "builtin (radcal's own) or command (any other program)"
_SEED_BITS = 31  # width of an external program's seeds: a C int
_ONLY_MASKS = frozenset({"looks", "nesz_db", "range_resolution_m", "azimuth_resolution_m"})


_DRAWS = "draws of speckle in which each run is simulated; their statistics are averaged"
Draws = Annotated[Integer, Field(ge=1, le=64)]


class BuiltinSimulation(Section):
    """radcal's own simulator."""

    kind: Literal["builtin"] = Field("builtin", description=_KIND)
    keep_images: bool = Field(False, description="whether every run record keeps the whole image")
    draws: Draws = Field(1, description=_DRAWS + "; 4 by default with incidence-angle bins")

    @property
    def longest_run_s(self) -> float:
        """Upper limit of a run's duration [s], far above the usual one."""
        return 900.0 * self.draws

    @property
    def seed_width(self) -> int:
        """Number of bits of a run's seed."""
        return 63

    @property
    def not_told(self) -> frozenset[str]:
        """Keys of ``radar`` that change neither geometry nor a run."""
        return frozenset()


def _braced(value: object) -> object:
    """Text of a placeholder, where YAML has read an unquoted {input} in a list as a mapping."""
    if isinstance(value, dict) and len(value) == 1 and next(iter(value.values())) is None:
        return "{" + str(next(iter(value))) + "}"
    return value


def _inside(value: str) -> str:
    """Refuse file names that lead out of a run's folder, and reserved file names."""
    path = Path(value)
    if not path.parts or path.is_absolute() or ".." in path.parts:
        raise ValueError(f"is {value!r}, expected the name of a file in the run's own folder")
    if path.parts[0].startswith("radcal."):
        raise ValueError(f"is {value!r}, but names that begin with radcal. are reserved")
    return value


def _listed(value: object) -> object:
    """Refuse a command given as one text, as for a shell, instead of a list of words."""
    if isinstance(value, str):
        raise ValueError(f"is {value!r}, expected a list of program and arguments: no shell splits it")
    return value


def _without_null(value: str) -> str:
    """Refuse text with a null character, which no program can receive."""
    if "\0" in value:
        raise ValueError(f"is {value!r}, expected text without a null character")
    return value


def _environment(value: dict[str, str]) -> dict[str, str]:
    for name in value:
        if not name or "=" in name or "\0" in name:
            raise ValueError(f"{name!r} is not a name of an environment variable")
    return value


def _number_as_text(value: object) -> object:
    """Text of a number, since YAML reads OMP_NUM_THREADS: 1 as a number."""
    return str(value) if isinstance(value, int | float) and not isinstance(value, bool) else value


Argument = Annotated[
    str, BeforeValidator(_braced, json_schema_input_type=str | dict[str, None]), AfterValidator(_without_null)
]
Variable = Annotated[
    str, BeforeValidator(_number_as_text, json_schema_input_type=str | float), AfterValidator(_without_null)
]
Words = Annotated[list[Argument], Field(min_length=1), BeforeValidator(_listed)]
FileName = Annotated[str, AfterValidator(_inside)]


class InputFile(Section):
    """File with parameters, seed and settings of a run, written for the program."""

    file: FileName = Field("input.json", description="name of the file in the run's folder")
    format: Literal["json", "toml"] = Field("json", description="format of the file")
    radar: bool = Field(
        True, description="whether section radar is written into it; a change of looks or nesz_db is then a new run"
    )


class Template(Section):
    """The program's own input file, with markers in the places of parameters."""

    template: str = Field(description="path of the file with the markers")
    file: FileName = Field(description="name of the filled file in the run's folder")
    delimiter: Annotated[str, Field(pattern=r"^[^\sA-Za-z0-9_.:-]$")] = Field(
        "@",
        description="character on both sides of a marker, as in @dyke.X1@; it may stand nowhere else in the template",
    )


RawType = Literal[
    "float32", "float64", "complex64", "complex128", "int8", "uint8", "int16", "uint16", "int32", "uint32"
]


class Output(Section):
    """File with the image that the program writes."""

    file: FileName = Field(description="name of the file in the run's folder; a folder in the name is created")
    scale: Literal["db", "power", "amplitude", "complex"] = Field(description="scale of the file's numbers")
    format: Literal["npy", "npz", "mat", "hdf5", "raster", "raw"] | None = Field(
        None, description="format of the file; by its ending if missing"
    )
    band: Count | None = Field(None, description="band of a raster, from 1; needed where it has several")
    dataset: str | None = Field(
        None, description="name of the array in npz, mat or HDF5; needed where they hold several"
    )
    dtype: RawType | None = Field(None, description="type of a raw file's numbers, which stand row by row")
    byte_order: Literal["little", "big"] | None = Field(None, description="byte order of a raw file; little if missing")
    shape: tuple[Count, Count] | None = Field(
        None, description="[rows, columns] of a raw file as written; those of the simulated image if missing"
    )
    header_bytes: Annotated[Integer, Field(ge=0, le=10**12)] | None = Field(
        None, description="number of bytes before a raw file's numbers"
    )
    transpose: bool = Field(False, description="whether the file's rows are columns of the image (azimuth)")
    flip_rows: bool = Field(False, description="whether the last row is the nearest in slant range (after transpose)")
    flip_columns: bool = Field(False, description="whether columns run against the flight (after transpose)")

    @model_validator(mode="after")
    def _raw(self) -> Self:
        if self.format == "raw" and self.dtype is None:
            raise ValueError("format is raw, expected dtype: float32, complex64 or the like")
        if self.format != "raw":
            for key in ("dtype", "byte_order", "shape", "header_bytes"):
                if getattr(self, key) is not None:
                    raise ValueError(f"{key} is for files of format: raw")
        return self


class CommandSimulation(Section):
    """External program, called once for each run in a folder of its own."""

    kind: Literal["command"] = Field("command", description=_KIND)
    command: Words = Field(
        description="program and arguments; no shell reads them. {input}, {output}, {folder}, {geometry}, {python}, "
        "{noise_seed} and {material.parameter} are filled in"
    )
    output: Output = Field(description="file with the image that the program writes")
    name: str | None = Field(None, description="name of the simulator; the program's file name if missing")
    version: str | None = Field(None, description="version of the simulator, where version_command is not given")
    version_command: Words | None = Field(None, description="program and arguments that print the version")
    input: InputFile | None = Field(None, description="file with all parameters, written for the program")
    templates: list[Template] = Field(
        default_factory=list, description="input files of the program's own, in which radcal fills in parameters"
    )
    files: list[str] = Field(default_factory=list, description="files copied into each run's folder")
    links: list[str] = Field(default_factory=list, description="files or folders linked into each run's folder")
    environment: Annotated[dict[str, Variable], AfterValidator(_environment)] = Field(
        default_factory=dict, description="environment variables of the program, in addition to those of radcal"
    )
    timeout_s: Timeout = Field(3600.0, description="a run that takes longer is killed [s]")
    retries: Annotated[Integer, Field(ge=0, le=20)] = Field(
        0, description="number of times that a failed run is tried again"
    )
    retry_wait_s: RetryWait = Field(1.0, description="wait before the first retry [s]; doubles each time")
    accept_exit_codes: Annotated[list[Annotated[Integer, Field(ge=-64, le=255)]], Field(min_length=1)] = Field(
        default_factory=lambda: [0],
        description="exit codes with which the output is complete; -11 stands for signal 11",
    )
    deterministic: bool | None = Field(
        None, description="whether equal parameters and seed give equal images; tested by a second run if missing"
    )
    seed_bits: Annotated[Integer, Field(ge=8, le=63)] | None = Field(
        None,
        description="width of noise_seed in bits; if missing, that of the case's earlier runs, or 31 (a C int) without "
        "any",
    )
    seedless: bool = Field(
        False,
        description="whether the program takes no seed; it then need not receive one, and no rms with fresh speckle is "
        "given",
    )
    draws: Draws = Field(1, description=_DRAWS)
    keep_images: bool = Field(False, description="whether every run record keeps the whole image")
    keep_folders: bool = Field(False, description="whether the folders of successful runs are kept, too")

    @property
    def longest_run_s(self) -> float:
        """Upper limit of a run's duration with all its retries [s]."""
        return (self.timeout_s * (self.retries + 1) + self._waits_s) * self.draws

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
        """Number of bits of a run's seed."""
        return _SEED_BITS if self.seed_bits is None else self.seed_bits

    @property
    def not_told(self) -> frozenset[str]:
        """Keys of ``radar`` that change neither geometry nor a run, because only masks and checks read them."""
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
                        f"{key} is {str(path)!r}, inside {taken[above]}: expected a name of its own in the run's folder"
                    )
        return self


SimulatorConfig = Annotated[BuiltinSimulation | CommandSimulation, Field(discriminator="kind")]
