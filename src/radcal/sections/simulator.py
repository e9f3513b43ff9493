"""Section ``simulator``: radcal's built-in simulator, an external program, or a simulator of another distribution."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, ClassVar, Literal, Self

from pydantic import AfterValidator, BeforeValidator, Field, SerializeAsAny, model_validator

from radcal.plugins import HasSection, Plugins, with_foreign
from radcal.sections.base import Band, Dataset, Section, with_tag
from radcal.sections.errors import Wrong
from radcal.sections.limits import LONGEST_S, Count, Integer, RetryWait, Timeout

_KIND = "kind of simulator: builtin (part of radcal) or command (an external program)"
_ONLY_MASKS = frozenset({"looks", "nesz_db", "range_resolution_m", "azimuth_resolution_m"})


_DRAWS = "number of speckle draws in a run; their statistics are averaged"
Draws = Annotated[Integer, Field(ge=1, le=64)]
KeepImages = Annotated[
    bool, Field(description="whether stored runs contain the whole image, not only pixels of calibrated materials")
]


class PythonSimulation(Section):
    """Settings of a simulator in Python; the model of a simulator of another distribution is derived from this class.

    Attributes
    ----------
    own : bool
        Whether it is radcal's own, which images the facets of the scene with the noise that section ``radar`` gives.
    only_parameters : bool
        Whether the simulator receives the parameters of the laws, but not the laws.
    deterministic : bool or None
        Whether equal parameters and seed give equal images; None if this is not known.
    seedless : bool
        Whether the simulator uses no seed.
    seed_bits : int
        Number of bits of the noise seed of a run.
    not_told : frozenset of str
        Keys of ``radar`` that the simulator does not receive.
    """

    own: ClassVar[bool] = False
    only_parameters: ClassVar[bool] = False
    deterministic: ClassVar[bool | None] = True
    seedless: ClassVar[bool] = False
    seed_bits: ClassVar[int] = 63
    not_told: ClassVar[frozenset[str]] = frozenset()
    kind: str = Field(description=_KIND)
    keep_images: KeepImages = False
    draws: Draws = Field(1, description=_DRAWS)
    strips: Annotated[Integer, Field(ge=1, le=1000)] = Field(
        1,
        description="number of strips in azimuth, of 256 or more rows of the scene; each has its own job for the "
        "geometry",
    )

    @property
    def focused(self) -> bool:
        """Whether images are focused from raw signals."""
        return False

    @property
    def longest_run_s(self) -> float:
        """Upper limit of the duration of a run [s], far above the usual duration."""
        return 900.0 * self.draws


class BuiltinSimulation(PythonSimulation):
    """Built-in simulator."""

    own = True
    kind: Literal["builtin"] = Field("builtin", description=_KIND)
    draws: Draws = Field(1, description=_DRAWS + "; by default 4 if the objective uses incidence-angle bins")
    product: Literal["intensity", "focused"] = Field(
        "intensity",
        description="whether runs make the fast image, or one focused from raw signals",
        exclude_if=lambda value: value == "intensity",
    )

    @property
    def focused(self) -> bool:
        """Whether images are focused from raw signals."""
        return self.product == "focused"


def _braced(value: object) -> object:
    """Text of a placeholder such as {input}, which YAML has converted to a mapping because it was not quoted."""
    if isinstance(value, dict) and len(value) == 1 and next(iter(value.values())) is None:
        return "{" + str(next(iter(value))) + "}"
    return value


def _inside(value: str) -> str:
    """Refuse a file name that leads out of the run's folder, and refuse a reserved file name."""
    path = Path(value)
    if not path.parts or path.is_absolute() or ".." in path.parts:
        raise ValueError(f"is {value!r}, expected the name of a file in the run's own folder")
    if path.parts[0].startswith("radcal."):
        raise ValueError(f"is {value!r}, but names that begin with radcal. are reserved")
    return value


def _listed(value: object) -> object:
    """Refuse a command that is a single text, as for a shell, instead of a list of words."""
    if isinstance(value, str):
        raise ValueError(f"is {value!r}, expected a list of program and arguments: no shell splits it")
    return value


def _without_null(value: str) -> str:
    """Refuse a text with a null character, because no program can receive this character."""
    if "\0" in value:
        raise ValueError(f"is {value!r}, expected text without a null character")
    return value


def _environment(value: dict[str, str]) -> dict[str, str]:
    for name in value:
        if not name or "=" in name or "\0" in name:
            raise ValueError(f"{name!r} is not a name of an environment variable")
    return value


def _number_as_text(value: object) -> object:
    """Text of a number: an environment variable must be text, but YAML reads ``OMP_NUM_THREADS: 1`` as a number."""
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
    """File that passes the parameters, the seed and the settings of a run to the external program."""

    file: FileName = Field("input.json", description="name of the file in the run's folder")
    format: Literal["json", "toml"] = Field("json", description="format of the file")
    radar: bool = Field(
        True,
        description="whether the file contains section radar; other looks, nesz_db or resolutions then need new runs",
    )


class Template(Section):
    """Template of an input file in the program's own format; radcal replaces markers in it by the parameters."""

    template: str = Field(description="path of the template")
    file: FileName = Field(description="name of the input file that radcal writes into the run's folder")
    delimiter: Annotated[str, Field(pattern=r"^[^\sA-Za-z0-9_.:-]$")] = Field(
        "@", description="character on both sides of a marker, as in @dyke.X1@; it must stand nowhere else"
    )


RawType = Literal[
    "float32", "float64", "complex64", "complex128", "int8", "uint8", "int16", "uint16", "int32", "uint32"
]


class Output(Section):
    """File to which the external program writes the image."""

    file: FileName = Field(description="path of the file within the run's folder")
    scale: Literal["db", "power", "amplitude", "complex"] = Field(description="scale of the numbers in the file")
    format: Literal["npy", "npz", "mat", "hdf5", "raster", "raw"] | None = Field(
        None, description="format of the file; by default derived from the file's ending"
    )
    band: Band = None
    dataset: Dataset = None
    dtype: RawType | None = Field(None, description="type of the numbers in a raw file, stored row by row")
    byte_order: Literal["little", "big"] | None = Field(None, description="byte order of a raw file; little by default")
    shape: tuple[Count, Count] | None = Field(
        None, description="[rows, columns] of a raw file; by default the size of the simulated image"
    )
    header_bytes: Annotated[Integer, Field(ge=0, le=10**12)] | None = Field(
        None, description="number of header bytes before the numbers in a raw file"
    )
    transpose: bool = Field(False, description="whether the rows of the file are columns of the image (azimuth)")
    flip_rows: bool = Field(False, description="whether the last row, after transpose, has the smallest slant range")
    flip_columns: bool = Field(
        False, description="whether the columns, after transpose, run against the flight direction"
    )

    @model_validator(mode="after")
    def _raw(self) -> Self:
        if self.format == "raw" and self.dtype is None:
            raise Wrong("format", " is raw, expected dtype: float32, complex64 or the like")
        if self.format != "raw":
            for key in ("dtype", "byte_order", "shape", "header_bytes"):
                if getattr(self, key) is not None:
                    raise ValueError(f"{key} is for files of format: raw")
        return self


class CommandSimulation(Section):
    """External program, started once for each run, in a folder of its own."""

    own: ClassVar[bool] = False
    focused: ClassVar[bool] = False
    only_parameters: ClassVar[bool] = True
    strips: ClassVar[int] = 1
    kind: Literal["command"] = Field("command", description=_KIND)
    command: Words = Field(
        description="program and its arguments, called without a shell; radcal replaces {input}, {output}, {folder}, "
        "{geometry}, {python}, {noise_seed} and {material.parameter}"
    )
    output: Output = Field(description="file with the image that the program writes")
    name: str | None = Field(None, description="name of the simulator; by default the file name of the program")
    version: str | None = Field(None, description="version of the simulator; not allowed together with version_command")
    version_command: Words | None = Field(
        None, description="command that prints the version: list of program and arguments"
    )
    input: InputFile | None = Field(None, description="file in which radcal gives the program all parameters")
    templates: list[Template] = Field(
        default_factory=list, description="templates of the program's own input files, with markers for the parameters"
    )
    files: list[str] = Field(default_factory=list, description="files copied into the folder of each run")
    links: list[str] = Field(default_factory=list, description="files or folders linked into the folder of each run")
    environment: Annotated[dict[str, Variable], AfterValidator(_environment)] = Field(
        default_factory=dict, description="further environment variables of the program"
    )
    timeout_s: Timeout = Field(3600.0, description="largest duration of a run [s], after which it is killed")
    retries: Annotated[Integer, Field(ge=0, le=20)] = Field(0, description="number of further attempts of a failed run")
    retry_wait_s: RetryWait = Field(1.0, description="wait before the first retry [s]; it doubles with each")
    accept_exit_codes: Annotated[list[Annotated[Integer, Field(ge=-64, le=255)]], Field(min_length=1)] = Field(
        default_factory=lambda: [0],
        description="exit codes after which radcal reads the output, by default 0 alone; -11 stands for signal 11",
    )
    deterministic: bool | None = Field(
        None, description="whether equal parameters and seed give equal images; by default a second run tests it"
    )
    seed_bits: Annotated[Integer, Field(ge=8, le=63)] = Field(
        31, description="number of bits of {noise_seed}; by default those of a C int"
    )
    seedless: bool = Field(
        False, description="whether the program uses no seed; the rms with fresh speckle is then not reported"
    )
    draws: Draws = Field(1, description=_DRAWS)
    keep_images: KeepImages = False
    keep_folders: bool = Field(
        False, description="whether folders of successful runs are kept; those of failed runs always are"
    )

    @property
    def longest_run_s(self) -> float:
        """Upper limit of the duration of a run [s], with all retries, waits and speckle draws."""
        return (self.timeout_s * (self.retries + 1) + self._waits_s) * self.draws

    @property
    def _waits_s(self) -> float:
        return self.retry_wait_s * (2.0**self.retries - 1.0)

    @property
    def not_told(self) -> frozenset[str]:
        """Keys of ``radar`` that the program does not receive; these keys change masks and checks, but not the runs."""
        return frozenset() if self.input is not None and self.input.radar else _ONLY_MASKS

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self._waits_s > LONGEST_S:
            raise Wrong(
                "retry_wait_s",
                f" is {self.retry_wait_s:g} and retries {self.retries}: waits that double each time add "
                f"up to {self._waits_s / 86_400:.3g} days, expected at most {LONGEST_S / 86_400:g}",
            )
        if self.seedless and self.draws > 1:
            raise Wrong("draws", f" is {self.draws}, expected 1 with seedless: true")
        if self.version is not None and self.version_command is not None:
            raise Wrong("version", " and version_command are both given, expected one of them")
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
            # a file below a link would lie outside the run's folder, where several runs would overwrite it
            for above in path.parents:
                if above in taken:
                    raise ValueError(
                        f"{key} is {str(path)!r}, inside {taken[above]}: expected a name of its own in the run's folder"
                    )
        return self


SIMULATORS: Plugins[HasSection] = Plugins(
    "radcal.simulators",
    {"builtin": "radcal.simulators.builtin:BuiltinSimulator", "command": "radcal.programs.command:CommandSimulator"},
)
"""Simulators (:class:`radcal.simulators.base.SimulatorKind`) by ``simulator.kind``."""
FOCUSED = "radcal.signals.simulator:FocusedSimulator"
"""Simulator of the built-in kind whose images are focused from raw signals."""

SimulatorConfig = Annotated[
    SerializeAsAny[BuiltinSimulation | CommandSimulation],
    Field(discriminator="kind"),
    with_foreign("kind", SIMULATORS, BuiltinSimulation, CommandSimulation),
    with_tag("simulator", "builtin"),
]
