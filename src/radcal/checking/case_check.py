"""Check of a case before any simulator run, by its stages; largest number of runs, memory and time."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from radcal.checking.outlook import bright_laws, cells_of, fixed_laws, hidden_ground, high_noise, outlook, unreachable
from radcal.config import Case, FileMeasurement, input_files, load_with_problems
from radcal.config.inputs import check_reuse, missing_inputs
from radcal.config.stages import STAGES
from radcal.errors import ConfigError, MissingSign, RadcalError
from radcal.findings import Finding, of_pass
from radcal.forecast.memory_and_time import memory_mb, values_of
from radcal.forecast.runs_and_time import largest_runs, runs_sentence, standing
from radcal.ground.one_incidence import Bounces, bounces_on, bounces_outside
from radcal.image.acquisition import radar_section
from radcal.image.base import opened
from radcal.image.model import Measurement
from radcal.posterior.cells import CellMeans
from radcal.programs.command_plan import check_command, check_image_shape
from radcal.radar.geometry import Geometry
from radcal.reading.base import reader_of
from radcal.scene.model import Scene
from radcal.sections.measurement import starts_as_truth
from radcal.session.replacement import check_replacement
from radcal.words import sentence

Say = Callable[[str], None]

_LARGEST_RUN = 5_000_000  # pixels of a synthetic image that is made for the check, in some seconds
_LARGEST = 20_000_000  # values of a scene that is made for the check: more would take minutes
_OF_SCENE = ("scene", "geometry", "measured image", "start image and levels against the laws")  # parts of the check


@dataclass
class CaseCheck:
    """Result of the check of a case: problems, findings, and what a calibration will need.

    Attributes
    ----------
    problems : list of str
        One sentence for each problem; empty if the case can be run.
    case : Case or None
        The case; None if its file cannot be read.
    forward : bool
        Whether the case has neither a measured image nor a material to calibrate: it is for ``radcal simulate``.
    findings : list of Finding
        Findings on the scene, the measured images and the start of the calibration.
    sections : list of str
        Section ``radar`` in YAML, from the annotation of each measured image that has an annotation.
    shape : (int, int) or None
        Rows and columns of the simulated image; None if the check has not made the geometry of any pass.
    memory_mb : mapping
        Largest memory [MB] that a job of each stage requests.
    search : str
        Line on the runs so far and on those expected; empty with problems.
    refused : list of str
        Reasons why ``radcal run`` would refuse this case beside its earlier results.
    unseen : tuple of str
        Parts of the case that could not be checked because of the problems.
    """

    problems: list[str]
    case: Case | None = None
    forward: bool = False
    findings: list[Finding] = field(default_factory=list)
    sections: list[str] = field(default_factory=list)
    shape: tuple[int, int] | None = None
    memory_mb: Mapping[str, int] = field(default_factory=dict)
    search: str = ""
    refused: list[str] = field(default_factory=list)
    unseen: tuple[str, ...] = _OF_SCENE

    def summary(self) -> list[str]:
        """Lines, without the warnings, on input files, image size, and expected simulator runs, memory and time."""
        if self.case is None:
            return []
        files, scene = input_files(self.case), self.case.scene
        folders = [f"scene.{name}" for name, kind in scene.files.items() if kind == "database"]
        lines = [f"  {key}: {path}" for key, path in files.items() if not key.startswith(tuple(folders))]
        lines += [f"  {key}: {sum(one.startswith(key) for one in files)} files in all" for key in folders]
        if self.shape is not None:
            lines.append(f"  simulated image: {self.shape[0]} x {self.shape[1]} pixels")
        if self.forward:
            lines.append("  the case has no section measurement and no material with calibrate: true: radcal simulate")
            lines.append("  makes its image; radcal run needs both of them, and radcal apply --to it a measurement")
            return [*lines, *self.remarks()]
        lines.append(f"  {runs_sentence(largest_runs(self.case), self.case.simulator.draws)}")
        if self.memory_mb:
            stage = max(self.memory_mb, key=lambda name: self.memory_mb[name])
            lines.append(f"  memory: at most {self.memory_mb[stage]:,} MB are requested for a job ({stage})")
        return [*lines, *[f"  {self.search}"] * bool(self.search), *self.remarks()]

    def warnings(self) -> list[str]:
        """Lines of the warnings, which are not in the lines of the summary."""
        return [f"  {sentence(one)}" for one in self.findings if one.severity != "note"]

    def remarks(self) -> list[str]:
        """Lines of the other notes and of each image's section ``radar``; a case with problems has them, too."""
        lines = [f"  note: {sentence(one)}" for one in self.findings if one.severity == "note"]
        lines += [f"  note: radcal run would refuse this case: {reason}" for reason in self.refused]
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
        return CaseCheck([str(error)])
    case, problems = loaded.rest, loaded.problems
    if case is None:
        return CaseCheck(problems)
    refused: list[tuple[str, RadcalError]] = [*missing_inputs(case, {})]
    if not problems:
        told = {error.about for _, error in refused} - {None}
        refused += [("simulator", error) for error in _refused(check_command, case) if error.about not in told]
        refused += [("design.reuse", error) for error in _refused(check_reuse, case, results)]
    problems += dict.fromkeys(loaded.at(key, error) for key, error in refused)
    found = CaseCheck(problems, case, loaded.forward)
    _check_stages(found, case, say)
    if found.problems or found.forward:
        return found
    found.findings += starts_as_truth(case.calibrated, [one.measurement for one in case.passes])
    if found.shape is not None:
        replaced = _refused(check_replacement, case, Path(results) / case.case, input_files(case))
        found.refused = list(map(str, replaced))
    found.search = f"simulator: {standing(case, Path(results) / case.case)}."
    return found


def _refused(check: Callable[..., Any], *arguments: Any) -> list[RadcalError]:
    try:
        check(*arguments)
    except RadcalError as error:
        return [error]
    return []


def _check_stages(found: CaseCheck, case: Case, say: Say) -> None:
    """Make scene, geometry and measured images in memory, as the workflow does, and add what they find or refuse.

    Where the case has problems already, or its images would be large, only annotations of its images are read.
    """
    from radcal.scene.sources import make_scene

    whole = not found.problems
    images = [one.measurement for one in case.passes if isinstance(one.measurement, FileMeasurement)]
    annotated = any(reader_of(image.path).gives_acquisition for image in images)
    if not (whole or annotated):
        return
    try:
        values = values_of(case)
        if whole:
            found.memory_mb = {name: memory_mb(name, values) for name, stage in STAGES.items() if stage.only_if is None}
        if whole and max(values.values()) > _LARGEST:
            found.findings.append(Finding("scene_large", "note", "scene"))
            whole, found.unseen = False, ()
        if values["scene"] > _LARGEST or not (whole or annotated):
            return
        say("scene ...")
        scene = make_scene(case.scene, list(case.materials) if whole else None, case.radar.heading_deg)
    except RadcalError as error:
        if whole:
            found.problems.append(str(error))
            found.unseen = _OF_SCENE[1:]
        return
    cells, refused, bounces = list[dict[str, CellMeans]](), list[RadcalError](), list[dict[str, Bounces]]()
    found.findings += scene.findings if whole else ()
    for number, one in enumerate(case.passes, start=1):
        own = list[Finding]()
        try:
            if isinstance(one.measurement, FileMeasurement):
                # before the geometry, because that cannot be made if section radar is wrong
                facts = opened(one.measurement, one.radar).facts(scene)
                own += facts.findings
                if facts.acquisition is not None:
                    found.sections.append(radar_section(facts.acquisition))
            if whole:
                cells.append(_check_pass(found, one, scene, number, own, refused, bounces, say))
        except RadcalError as error:
            refused.append(error)
        found.findings += of_pass(own, number, len(case.passes))
    if not whole:  # the list has what was refused already, or its cause
        return
    found.findings += bounces_outside(bounces)
    whole = len(cells) == len(case.passes)
    if whole and all(cells):
        say("fixed laws against the measured image ...")
        found.findings += fixed_laws(case, cells)
    if not any(isinstance(error.about, MissingSign) for error in refused):  # which says the same
        found.findings += high_noise(case.passes)
    found.findings += bright_laws(case)
    found.problems = list(dict.fromkeys(map(str, refused)))
    found.unseen = () if whole else _OF_SCENE[2:] if found.shape is None else _OF_SCENE[3:]


def _check_pass(
    found: CaseCheck,
    one: Case,
    scene: Scene,
    number: int,
    own: list[Finding],
    refused: list[RadcalError],
    bounces: list[dict[str, Bounces]],
    say: Say,
) -> dict[str, CellMeans]:
    """Make geometry, measured image and start image of a pass, add what they find to ``own``, and return the cells.

    The pass's double bounces are added to ``bounces``. The cells are those of the image before registration; without a
    measured image there are none. At first, ``own`` has the findings of the image's annotation.
    """
    from radcal.radar.projection import make_geometry

    annotation = len(own)
    say(f"pass {number}: geometry of {' x '.join(map(str, scene.material.shape))} cells ...")
    geometry = make_geometry(scene, one.radar)
    if number == 1:
        found.shape = (int(geometry.shape[0]), int(geometry.shape[1]))
    check_image_shape(one.simulator, geometry.shape)
    own += hidden_ground(scene, geometry)
    bounces.append(bounces_on(geometry, one.calibrated))
    if found.forward:
        return {}
    say(f"pass {number}: measured image for {geometry.shape[0]} x {geometry.shape[1]} pixels ...")
    measured = _measured(one, geometry, scene, number)
    if measured is not None:  # it has the findings of its annotation
        own[:] = [*own[annotation:], *measured.findings]
    own += outlook(one, geometry, measured)
    if measured is None:
        return {}
    refused += unreachable(one, geometry, measured)
    return cells_of(one, geometry, measured, scene)


def _measured(one: Case, geometry: Geometry, scene: Scene, number: int) -> Measurement | None:
    """Measured image of a pass; None for a synthetic one that an external program or a long run would make."""
    from radcal.measurement.sources import make_measurement
    from radcal.measurement.synthetic import check_synthetic
    from radcal.simulators.runner import make_simulator

    stage = STAGES["measurement"].of(one)
    simulator: Any = None  # a file needs none
    focused = one.simulator.focused
    if focused:
        make_simulator(stage, geometry, "", scene)  # refuses what has no raw signal
    if not isinstance(one.measurement, FileMeasurement):
        if not one.simulator.own or focused or geometry.material.size > _LARGEST_RUN:
            check_synthetic(one.radar, one.measurement.synthetic, (geometry.shape[0], geometry.shape[1]))
            return None
        simulator = make_simulator(stage, geometry, "")
    return make_measurement(stage, geometry, simulator, scene, partly=number > 1)
