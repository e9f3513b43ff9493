"""Check of a case before any simulator run: list of all problems, and expected runs, memory and time."""

from __future__ import annotations

import contextlib
import itertools
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radcal.checking.file_problems import is_on_map, scene_of, with_hints
from radcal.checking.finished import kept_results
from radcal.checking.outlook import bright_laws, hidden_ground, high_noise, low_track, outlook
from radcal.checking.places import images_elsewhere
from radcal.checking.unregistered import cells_of, fixed_laws, unreachable
from radcal.config import (
    Case,
    FileMeasurement,
    Loaded,
    check_reuse,
    load_with_problems,
    missing_inputs,
    starts_as_truth,
)
from radcal.config.inputs import input_files
from radcal.errors import ConfigError, MissingSign, NotInScene, RadcalError, UnknownMaterial
from radcal.findings import Finding, of_pass
from radcal.forecast.memory_and_time import Stage, memory_mb, values_of
from radcal.forecast.runs_and_time import largest_runs, runs_in_words, time_expected
from radcal.posterior.cells import CellMeans
from radcal.programs.command_plan import check_command, check_image_shape
from radcal.reading.safe import is_safe_name
from radcal.scene.size import scene_size
from radcal.words import sentence

if TYPE_CHECKING:
    from radcal.image.model import Measurement
    from radcal.radar.geometry import Geometry
    from radcal.scene.model import Scene

__all__ = ["CaseCheck", "check_case"]

Say = Callable[[str], None]

_LARGEST_RUN = 5_000_000  # pixels of a synthetic image that is made for the check, in some seconds
_LARGEST = 20_000_000  # values of a scene that is made for the check: more would take minutes


@dataclass(frozen=True)
class CaseCheck:
    """Result of the check of a case: problems, remarks, and the runs, memory and time of a calibration.

    Attributes
    ----------
    problems : list of str
        One sentence for each problem; empty if the case can be run.
    findings : list of Finding
        Findings on the scene, the measured images and the start of the calibration.
    files : mapping
        Input files by configuration key.
    shape : (int, int) or None
        Rows and columns of the simulated image; None if the check has not made the geometry of any pass.
    runs : mapping
        Largest number of simulator runs by kind: reference, design, infill, final.
    memory_mb : mapping
        Largest memory [MB] that a job of each stage requests.
    draws : int
        Number of speckle draws of a simulator run.
    sections : tuple of str
        Section ``radar`` in YAML, from the annotation of each measured image that has an annotation.
    time : str
        Line on the expected time; empty with problems.
    unseen : tuple of str
        Parts of the case that could not be checked because of the problems.
    forward : bool
        Whether the case has neither a measured image nor a material to calibrate: it is for ``radcal simulate``.
    """

    problems: list[str]
    findings: list[Finding]
    files: Mapping[str, Path]
    shape: tuple[int, int] | None
    runs: Mapping[str, int]
    memory_mb: Mapping[Stage, int]
    draws: int = 1
    sections: tuple[str, ...] = ()
    time: str = ""
    unseen: tuple[str, ...] = ()
    forward: bool = False
    registration_runs: int = 0

    def not_looked_at(self) -> str:
        """Sentence on what could not be checked because of the problems; empty if everything was."""
        return f"Not looked at yet, because of the above: {'; '.join(self.unseen)}." if self.unseen else ""

    def summary(self) -> str:
        """Lines, without the warnings, on input files, image size, and expected simulator runs, memory and time."""
        lines = [f"  {key}: {path}" for key, path in self.files.items()]
        if self.shape is not None:
            lines.append(f"  simulated image: {self.shape[0]} x {self.shape[1]} pixels")
        if self.forward:
            lines.append("  the case has no section measurement and no material with calibrate: true: radcal simulate")
            lines.append("  makes its image; radcal run needs both of them, and radcal apply --to it a measurement")
            return "\n".join([*lines, *self.remarks()])
        kinds = runs_in_words(self.runs, self.registration_runs, ("infill", "final"))
        each = f", each of {self.draws} speckle draws" if self.draws > 1 else ""
        most = sum(self.runs.values())
        earlier = "a search that meets its stop criterion ends earlier"
        lines.append(f"  simulator runs: at most {most} ({kinds}{each}); {earlier}")
        if self.memory_mb:
            stage = max(self.memory_mb, key=lambda name: self.memory_mb[name])
            lines.append(f"  memory: less than {self.memory_mb[stage]:,} MB in the largest job ({stage})")
        lines += [f"  {self.time}"] * bool(self.time)
        return "\n".join([*lines, *self.remarks()])

    def warnings(self) -> list[str]:
        """Lines of the warnings, which are not in the lines of the summary."""
        return [f"  {sentence(one)}" for one in self.findings if one.severity != "note"]

    def remarks(self) -> list[str]:
        """Lines of the other notes and of each image's section ``radar``; a case with problems has them, too."""
        lines = [f"  note: {sentence(one)}" for one in self.findings if one.severity == "note"]
        for section in self.sections:
            lines += ["  section radar as the annotation of the image gives it:"]
            lines += [f"    {line}" for line in section.splitlines()]
        return lines


def check_case(
    paths: Sequence[str | Path],
    overrides: Mapping[str, Any] | None = None,
    results: str | Path = "results",
    say: Say = lambda _: None,
) -> CaseCheck:
    """Check keys, values, files, scene and measured image of a case, without a run of the simulator.

    Parameters
    ----------
    paths : sequence of path
        Case files.
    overrides : mapping, optional
        Keys that the command line changes.
    results : path
        Folder that contains the results folders of all cases.
    say : callable
        Function that shows a line of text; it is called before each part of the check that may take long.

    Returns
    -------
    CaseCheck
        Problems of the whole case: a wrong key does not keep the other keys, files and images from being checked.
    """
    try:
        loaded = load_with_problems(paths, overrides)
    except ConfigError as error:
        return CaseCheck([str(error)], [], {}, None, {}, {}, unseen=("the keys, files, scene and measured image",))
    if loaded.case is None:
        nothing = ("contradictions between keys", "files, scene and measured image")
        return CaseCheck(loaded.problems, [], {}, None, {}, {}, unseen=nothing)
    found = _checked(paths, loaded.case, loaded, results, say)
    if loaded.forward:
        return replace(found, runs={}, time="", forward=True)
    kept = kept_results(found.problems, found.shape, loaded.case, results, found.files)
    return replace(found, findings=found.findings + kept)


class _Problems(list[RadcalError]):
    """List of a case's problems, without duplicates and without problems that only follow from a wrong key."""

    def __init__(self, loaded: Loaded) -> None:
        super().__init__(loaded.found)
        self._follows = loaded.follows
        self.unmeasured = False  # whether the measured image of a pass could not be made
        self.looked_at = False  # whether all parts of the case were checked

    def add(self, found: Iterable[RadcalError]) -> None:
        """Add those problems that are not in the list and do not follow from a wrong key."""
        for error in found:
            if any(str(one) == str(error) or one.about == error.about is not None for one in self):
                continue
            if not self._follows(error):
                if isinstance(error.about, NotInScene) and error.about.meant is not None:
                    other = UnknownMaterial(error.about.meant)  # other sections name the material as the scene does
                    self[:] = [one for one in self if one.about != other]
                self.append(error)


def _checked(paths: Sequence[str | Path], case: Case, loaded: Loaded, results: str | Path, say: Say) -> CaseCheck:
    """Result of all checks of a case, once the keys have been checked."""
    problems = _Problems(loaded)
    missing = missing_inputs(case)
    problems.add(missing)
    files = {} if missing else input_files(case)
    problems.add(_refused(check_command, case))
    problems.add(_refused(check_reuse, case, results))
    findings: list[Finding] = []
    sections: list[str] = []
    shape, demands, small = None, dict[Stage, int](), False
    if "scene" not in loaded.without:
        try:
            values = values_of(case)
            demands = {stage: memory_mb(stage, values["scene" if stage == "scene" else "image"]) for stage in _STAGES}
            small = max(values.values()) <= _LARGEST
            if not small:
                findings.append(Finding("scene_large", "note", "scene"))
        except RadcalError as error:
            problems.add([error])
            # a scene can be made even if, for example, the heading or a pixel spacing is wrong
            small = bool(_refused(scene_size, case.scene)) or scene_size(case.scene).resampled <= _LARGEST
    if small:
        findings, shape = _made(case, loaded, problems, sections, say)
    elif "scene" in loaded.without:
        _images_alone(case, loaded, problems)
    if not sections:
        told, sections = _of_products(case)
        findings += told
    if not any(isinstance(error.about, MissingSign) for error in problems):
        findings += high_noise(case.passes)
    findings += bright_laws(case)
    if not problems and "measurement" not in loaded.without:
        findings += starts_as_truth(case.calibrated, [one.measurement for one in case.passes])
    problems += images_elsewhere(problems, loaded.given)
    whole = problems.looked_at or not problems
    unseen = () if whole else _unseen(loaded, shape, problems.unmeasured)
    listed = [with_hints(error, paths) for error in problems]
    return CaseCheck(
        listed, findings, files, shape, largest_runs(case), demands, case.simulator.draws, tuple(sections),
        time_expected(case, results) if whole else "", unseen,
        registration_runs=len(case.passes) * case.registers_twice,
    )  # fmt: skip


def _unseen(loaded: Loaded, shape: tuple[int, int] | None, unmeasured: bool) -> tuple[str, ...]:
    """Parts of a case with problems that were not checked."""
    parts = ["how right values of the wrong keys fit the others"] if loaded.wrong or loaded.without else []
    if loaded.forward:
        return (*parts, "the image's geometry") if shape is None else tuple(parts)
    if unmeasured or shape is None or not loaded.has_geometry:
        parts.append("the measured image on the ground of the scene, with its levels and noise")
    return (*parts, "contrast of the start image, and levels against the laws")


def _images_alone(case: Case, loaded: Loaded, problems: _Problems) -> None:
    """Add the problems of measured images that can be found without the scene."""
    from radcal.measurement.sources import check_image

    for one in case.passes if "measurement" not in loaded.without else ():
        if isinstance(one.measurement, FileMeasurement):
            problems.add(check_image(one.measurement, one.radar, one.scene.source == "raster"))


_STAGES: tuple[Stage, ...] = ("scene", "geometry", "measurement", "run", "registration", "target", "report")


def _refused(check: Any, *arguments: Any) -> list[RadcalError]:
    try:
        check(*arguments)
    except RadcalError as error:
        return [error]
    return []


def _made(
    case: Case, loaded: Loaded, problems: _Problems, sections: list[str], say: Say
) -> tuple[list[Finding], tuple[int, int] | None]:
    """Make scene, geometry and measured images in memory, as the workflow does; return findings and image size."""
    from radcal.radar.projection import make_geometry

    say("scene ...")
    scene, found = scene_of(case, loaded)
    problems.add(found)
    if scene is None:
        _images_alone(case, loaded, problems)
        return [], None
    each, of_laws, shape = [list[Finding]() for _ in case.passes], list[Finding](), None
    cells, unreached = list[dict[str, CellMeans]](), list[RadcalError]()
    for number, (one, findings) in enumerate(zip(case.passes, each, strict=True)):
        told: list[Finding] = []
        which = f" of pass {number + 1}" * (len(case.passes) > 1)
        say(f"geometry{which}: scene of {' x '.join(map(str, scene.material.shape))} cells ...")
        try:
            # before the geometry, because that cannot be made if section radar is wrong
            told, section = _by_annotation(one, scene)
            sections += section
            geometry = make_geometry(scene, one.radar)
            shape = shape or (int(geometry.shape[0]), int(geometry.shape[1]))
        except RadcalError as error:
            problems.add([error])
            findings += told
            _images_alone(one, loaded, problems)
            continue
        problems.add(_refused(check_image_shape, one.simulator, geometry.shape) if loaded.has_geometry else ())
        findings += hidden_ground(scene, geometry)
        findings += low_track(one.radar, geometry) if scene.elevation_m is not None else []
        if "measurement" not in loaded.without:
            say(f"measured image{which}, for {shape[0]} x {shape[1]} pixels ...")
            measured = _measured(one, loaded, geometry, scene, problems, number)
            findings += told if measured is None else measured.findings
            problems.unmeasured |= measured is None
            try:
                findings += () if problems else outlook(one, geometry, measured)
                if measured is not None and not problems:
                    cells.append(cells_of(one, geometry, measured, scene))
                    unreached += unreachable(one, geometry, measured)
            except RadcalError as error:  # about a formula
                problems.add([error])
    problems.looked_at = len(cells) == len(case.passes)
    if problems.looked_at and all(cells):
        say("fixed laws against the measured image ...")
        of_laws += fixed_laws(case, cells)
    problems.add(unreached)
    of_passes = [of_pass(findings, k, len(each)) for k, findings in enumerate(each, 1)]
    return [*scene.findings, *itertools.chain(*of_passes), *of_laws], shape


def _measured(
    one: Case, loaded: Loaded, geometry: Geometry, scene: Scene, problems: _Problems, number: int
) -> Measurement | None:
    """Measured image of a pass, made in memory; None if it cannot be made or if that would take too long."""
    from radcal.config import stages
    from radcal.measurement.sources import make_measurement
    from radcal.measurement.synthetic import check_synthetic
    from radcal.simulators.protocol import Simulator
    from radcal.simulators.sources import make_simulator

    stage = stages.Measurement.of(one)
    # materials that the scene lacks because of another problem have no pixels
    there = {name: material for name, material in one.materials.items() if name in scene.names}
    stage = stage.model_copy(update={"materials": there})
    try:
        if isinstance(one.measurement, FileMeasurement):
            if not (loaded.has_geometry or is_on_map(one.measurement)):
                _images_alone(one, loaded, problems)
                return None
            nothing: Simulator = None  # type: ignore[assignment]  # a file needs no simulator
            return make_measurement(stage, geometry, nothing, scene, partly=number > 0)
        if one.simulator.kind == "builtin" and geometry.material.size <= _LARGEST_RUN and not problems:
            simulator = make_simulator(stage, geometry, "")
            return make_measurement(stage, geometry, simulator, scene, partly=number > 0)
        check_synthetic(one.radar, one.measurement.synthetic, (geometry.shape[0], geometry.shape[1]))
    except RadcalError as error:
        problems.add([error])
        _images_alone(one, loaded, problems)
    return None


def _of_products(case: Case) -> tuple[list[Finding], list[str]]:
    """Findings and sections ``radar`` from annotations, for a case whose images could not be made."""
    from radcal.scene.sources import make_scene

    findings, sections = list[Finding](), list[str]()
    products = [one for one in case.passes if is_safe_name(getattr(one.measurement, "path", ""))]
    with contextlib.suppress(RadcalError):  # the list has these problems already, or their cause
        size = scene_size(case.scene) if products else None
        if size is not None and max(size.cells, size.resampled) <= _LARGEST:
            scene = make_scene(case.scene, None, case.radar.heading_deg)
            for one in products:
                told, section = _by_annotation(one, scene)
                findings, sections = findings + told, sections + section
    return findings, sections


def _by_annotation(one: Case, scene: Scene) -> tuple[list[Finding], list[str]]:
    """Findings on a measured image in a SAFE folder, and section ``radar`` from its annotation; empty for other images.

    Parameters
    ----------
    one : Case
        One pass of the case.
    scene : Scene
        Scene of the case.
    """
    from radcal.config import expand_path
    from radcal.image.acquisition import differences, radar_section
    from radcal.sentinel1.overpass import overpass_unchecked

    image = one.measurement
    if not isinstance(image, FileMeasurement) or not is_safe_name(image.path):
        return [], []
    seen = overpass_unchecked(expand_path(image.path, "measurement.path", folder=True), image, one.radar, scene)
    findings = [seen.acquisition.finding(), *seen.findings, *differences(seen.acquisition, one.radar)]
    return findings, [radar_section(seen.acquisition)]
