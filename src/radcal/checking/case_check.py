"""Check of a case before any simulator run, by its stages; largest number of runs, memory and time."""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radcal.checking.outlook import bright_laws, hidden_ground, high_noise, outlook
from radcal.checking.unregistered import cells_of, fixed_laws, unreachable
from radcal.config import (
    Case,
    FileMeasurement,
    check_reuse,
    input_files,
    load_with_problems,
    missing_inputs,
    stages,
    starts_as_truth,
)
from radcal.errors import ConfigError, MissingSign, RadcalError
from radcal.findings import Finding, of_pass
from radcal.forecast.memory_and_time import Stage, memory_mb, values_of
from radcal.forecast.runs_and_time import largest_runs, runs_in_words, time_expected
from radcal.posterior.cells import CellMeans
from radcal.programs.command_plan import check_command, check_image_shape
from radcal.reading.safe import is_safe_name
from radcal.scene.size import scene_size
from radcal.session.replacement import check_replacement
from radcal.words import sentence

if TYPE_CHECKING:
    from radcal.image.model import Measurement
    from radcal.radar.geometry import Geometry
    from radcal.scene.model import Scene

__all__ = ["CaseCheck", "check_case"]

Say = Callable[[str], None]

_LARGEST_RUN = 5_000_000  # pixels of a synthetic image that is made for the check, in some seconds
_LARGEST = 20_000_000  # values of a scene that is made for the check: more would take minutes
_STAGES: tuple[Stage, ...] = ("scene", "geometry", "measurement", "run", "registration", "target", "report")
_OF_SCENE = ("scene", "geometry", "measured image", "start image and levels against the laws")  # parts of the check


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
    registration_runs : int
        Number of the reference runs onto which the image is registered again.
    """

    problems: list[str]
    findings: list[Finding] = field(default_factory=list)
    files: Mapping[str, Path] = field(default_factory=dict)
    shape: tuple[int, int] | None = None
    runs: Mapping[str, int] = field(default_factory=dict)
    memory_mb: Mapping[Stage, int] = field(default_factory=dict)
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
            lines.append(f"  memory: at most {self.memory_mb[stage]:,} MB are requested for a job ({stage})")
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
    """Check of a case by the functions of its stages, in memory and without a run of the simulator.

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
        All mistakes of keys and all missing files; if there are none, what the stages refuse.
    """
    try:
        loaded = load_with_problems(paths, overrides)
    except ConfigError as error:
        return CaseCheck([str(error)], unseen=_OF_SCENE)
    case = loaded.case
    if case is None:
        return CaseCheck(loaded.problems, unseen=_OF_SCENE)
    problems = list[RadcalError](loaded.found)
    refused = [] if problems else [*_refused(check_command, case), *_refused(check_reuse, case, results)]
    for new in [*missing_inputs(case), *refused]:
        if not any(str(one) == str(new) or one.about == new.about is not None for one in problems):
            problems.append(new)
    if problems:
        findings, sections = _of_products(case)
        return CaseCheck([str(one) for one in problems], findings, sections=sections, unseen=_OF_SCENE)
    found = _of_stages(case, loaded.forward, say)
    if loaded.forward:
        return found
    if not found.problems:
        more = starts_as_truth(case.calibrated, [one.measurement for one in case.passes])
        refused = _refused(check_replacement, case, Path(results) / case.case, found.files) if found.shape else []
        more += [Finding("refused_beside_results", "note", case.case, {"error": str(one)}) for one in refused]
        found = replace(found, findings=[*found.findings, *more])
    return replace(
        found, runs=largest_runs(case), registration_runs=len(case.passes) * case.registers_twice,
        time="" if found.problems else time_expected(case, results),
    )  # fmt: skip


def _refused(check: Callable[..., Any], *arguments: Any) -> list[RadcalError]:
    try:
        check(*arguments)
    except RadcalError as error:
        return [error]
    return []


@dataclass
class _Pass:
    """What the stages of a pass say; ``cells`` are those of the image before registration, if it was made."""

    findings: list[Finding] = field(default_factory=list)
    section: tuple[str, ...] = ()
    shape: tuple[int, int] | None = None
    cells: dict[str, CellMeans] = field(default_factory=dict)
    refused: list[RadcalError] = field(default_factory=list)
    whole: bool = False  # whether no stage refused the pass


def _of_stages(case: Case, forward: bool, say: Say) -> CaseCheck:
    """Scene, geometry and measured images made in memory, as the workflow does, with what they find or refuse."""
    from radcal.scene.sources import make_scene

    found = CaseCheck([], files=input_files(case), draws=case.simulator.draws, forward=forward)
    try:
        values = values_of(case)
        demands = {stage: memory_mb(stage, values["scene" if stage == "scene" else "image"]) for stage in _STAGES}
        found = replace(found, memory_mb=demands)
        if max(values.values()) > _LARGEST:
            findings, sections = _of_products(case)
            return replace(found, findings=[Finding("scene_large", "note", "scene"), *findings], sections=sections)
        say("scene ...")
        scene = make_scene(case.scene, list(case.materials), case.radar.heading_deg)
    except RadcalError as error:
        findings, sections = _of_products(case)
        return replace(found, problems=[str(error)], findings=findings, sections=sections, unseen=_OF_SCENE[1:])
    passes = [_Pass() for _ in case.passes]
    for number, (one, seen) in enumerate(zip(case.passes, passes, strict=True), start=1):
        try:
            _check_pass(one, scene, number, forward, seen, say)
        except RadcalError as error:
            seen.refused.append(error)
    findings = list(scene.findings)
    for number, seen in enumerate(passes, start=1):
        findings += of_pass(seen.findings, number, len(passes))
    if all(seen.cells for seen in passes):
        say("fixed laws against the measured image ...")
        findings += fixed_laws(case, [seen.cells for seen in passes])
    refused = [error for seen in passes for error in seen.refused]
    if not any(isinstance(error.about, MissingSign) for error in refused):  # which says the same
        findings += high_noise(case.passes)
    findings += bright_laws(case)
    unseen = () if all(seen.whole for seen in passes) else _OF_SCENE[2:] if passes[0].shape is None else _OF_SCENE[3:]
    return replace(
        found,
        problems=list(dict.fromkeys(map(str, refused))),
        findings=findings,
        sections=tuple(text for seen in passes for text in seen.section),
        shape=passes[0].shape,
        unseen=unseen,
    )


def _check_pass(one: Case, scene: Scene, number: int, forward: bool, seen: _Pass, say: Say) -> None:
    """Geometry, measured image and start image of a pass, with what they find; a refusal is a RadcalError."""
    from radcal.radar.projection import make_geometry

    # before the geometry, because that cannot be made if section radar is wrong
    seen.findings, seen.section = _by_annotation(one, scene)
    say(f"pass {number}: geometry of {' x '.join(map(str, scene.material.shape))} cells ...")
    geometry = make_geometry(scene, one.radar)
    seen.shape = (int(geometry.shape[0]), int(geometry.shape[1]))
    check_image_shape(one.simulator, geometry.shape)
    seen.findings += hidden_ground(scene, geometry)
    if not forward:
        say(f"pass {number}: measured image for {seen.shape[0]} x {seen.shape[1]} pixels ...")
        measured = _measured(one, geometry, scene, number)
        if measured is not None:  # it has the findings of its annotation
            seen.findings = [*hidden_ground(scene, geometry), *measured.findings]
        seen.findings += outlook(one, geometry, measured)
        if measured is not None:
            seen.cells = cells_of(one, geometry, measured, scene)
            seen.refused += unreachable(one, geometry, measured)
    seen.whole = True


def _measured(one: Case, geometry: Geometry, scene: Scene, number: int) -> Measurement | None:
    """Measured image of a pass; None for a synthetic one that an external program or a long run would make."""
    from radcal.measurement.sources import make_measurement
    from radcal.measurement.synthetic import check_synthetic
    from radcal.simulators.protocol import Simulator
    from radcal.simulators.sources import make_simulator

    stage = stages.MeasurementStage.of(one)
    if isinstance(one.measurement, FileMeasurement):
        nothing: Simulator = None  # type: ignore[assignment]  # a file needs no simulator
        return make_measurement(stage, geometry, nothing, scene, partly=number > 1)
    if one.simulator.kind == "builtin" and geometry.material.size <= _LARGEST_RUN:
        return make_measurement(stage, geometry, make_simulator(stage, geometry, ""), scene, partly=number > 1)
    check_synthetic(one.radar, one.measurement.synthetic, (geometry.shape[0], geometry.shape[1]))
    return None


def _of_products(case: Case) -> tuple[list[Finding], tuple[str, ...]]:
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
                findings, sections = findings + told, [*sections, *section]
    return findings, tuple(sections)


def _by_annotation(one: Case, scene: Scene) -> tuple[list[Finding], tuple[str, ...]]:
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
        return [], ()
    seen = overpass_unchecked(expand_path(image.path, "measurement.path", folder=True), image, one.radar, scene)
    findings = [seen.acquisition.finding(), *seen.findings, *differences(seen.acquisition, one.radar)]
    return findings, (radar_section(seen.acquisition),)
