"""Check of a whole case before anything is run: all problems at once, and what a calibration of it will need."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radcal.config import Case, check_reuse, load_with_problems, missing_inputs
from radcal.config.inputs import input_files
from radcal.errors import ConfigError, RadcalError
from radcal.reading.safe import is_safe_name
from radcal.running.expected_memory import expected_mb
from radcal.running.memory_and_time import Stage, memory_mb, values_of
from radcal.running.time_left import largest_runs

if TYPE_CHECKING:
    from radcal.scene.model import Scene

__all__ = ["CaseCheck", "check_case"]

_LARGEST_RUN = 5_000_000  # pixels of a synthetic image that is made for the check, in some seconds
_LARGEST = 20_000_000  # values of a scene that is made for the check: more would take minutes


@dataclass(frozen=True)
class CaseCheck:
    """What the check of a case has found.

    Attributes
    ----------
    problems : list of str
        One sentence for each; none where the case can be run.
    notes : list of str
        Remarks of scene and measured image.
    files : mapping
        Input files by configuration key.
    shape : (int, int) or None
        Rows and columns of the simulated image; None where scene and image were not made.
    runs : mapping
        Largest number of simulator runs by kind: reference, design, infill, final.
    memory_mb : mapping
        Memory [MB] that the largest jobs request, by stage.
    peak_mb : mapping
        Memory [MB] that they will probably take, by kind of job.
    draws : int
        Number of speckle draws of a run.
    sections : tuple of str
        Section ``radar`` in YAML as the annotation of each measured image gives it, of images that have one.
    """

    problems: list[str]
    notes: list[str]
    files: Mapping[str, Path]
    shape: tuple[int, int] | None
    runs: Mapping[str, int]
    memory_mb: Mapping[Stage, int]
    peak_mb: Mapping[str, float] = field(default_factory=dict)
    draws: int = 1
    sections: tuple[str, ...] = ()

    def summary(self) -> str:
        """Lines on what would be read, made and needed."""
        lines = [f"  {key}: {path}" for key, path in self.files.items()]
        if self.shape is not None:
            lines.append(f"  simulated image: {self.shape[0]} x {self.shape[1]} pixels")
        kinds = ", ".join(f"{count} {kind}" for kind, count in self.runs.items() if count)
        each = f", each of {self.draws} speckle draws" if self.draws > 1 else ""
        most = sum(self.runs.values())
        lines.append(f"  simulator runs: at most {most} ({kinds}{each}); most cases need far fewer infill")
        if self.peak_mb:
            job = max(self.peak_mb, key=lambda name: self.peak_mb[name])
            peak, asked = round(self.peak_mb[job], -1), max(self.memory_mb.values())
            lines.append(
                f"  memory: about {peak:,.0f} MB in the largest job ({job}); a cluster is asked for {asked:,} MB"
            )
        return "\n".join([*lines, *self.remarks()])

    def remarks(self) -> list[str]:
        """Lines of the notes, and of section ``radar`` by each image; they are known with problems, too."""
        lines = [f"  note: {text}" for text in self.notes]
        for section in self.sections:
            lines += ["  section radar as the annotation of the image gives it:"]
            lines += [f"    {line}" for line in section.splitlines()]
        return lines


def check_case(
    paths: Sequence[str | Path], overrides: Mapping[str, Any] | None = None, results: str | Path = "results"
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

    Returns
    -------
    CaseCheck
        A wrong key is left out, so that the keys, files and images after it are checked all the same.
    """
    try:
        case, problems = load_with_problems(paths, overrides)
    except ConfigError as error:
        return CaseCheck([str(error)], [], {}, None, {}, {})
    if case is None:
        return CaseCheck(problems, [], {}, None, {}, {})
    found = _checked(case, problems, results)
    return replace(found, problems=_once(found.problems))


def _once(problems: Sequence[str]) -> list[str]:
    """Problems without those that call a key missing whose value is wrong or undecided, as another problem says."""
    there = [match[1] for text in problems if (match := re.search(r"(\w+\.\S+) is (?!missing).*, expected ", text))]
    return [text for text in problems if not any(f"{key} is missing" in text for key in there)]


def _checked(case: Case, problems: list[str], results: str | Path) -> CaseCheck:
    """What further checks of a case find, after those of its keys."""
    missing = missing_inputs(case)
    problems += missing
    files = {} if missing else input_files(case)
    if case.simulator.kind == "command" and not missing:
        from radcal.simulators.command import check_command

        problems += _refused(check_command, case)
    problems += _refused(check_reuse, case, results)
    notes: list[str] = []
    sections: list[str] = []
    shape, demands, peaks = None, dict[Stage, int](), dict[str, float]()
    if not missing:
        try:
            values = values_of(case)
            demands = {stage: memory_mb(stage, values["scene" if stage == "scene" else "image"]) for stage in _STAGES}
            peaks = expected_mb(case)
            if max(values.values()) <= _LARGEST:
                notes, shape = _made(case, problems, sections)
            else:
                notes.append("the scene is large: it is read when the calibration starts, not in this check.")
        except RadcalError as error:
            problems.append(str(error))
    if not sections:
        said, sections = _of_products(case)
        notes += said
    return CaseCheck(
        problems, notes, files, shape, largest_runs(case), demands, peaks, case.simulator.draws, tuple(sections)
    )


_STAGES: tuple[Stage, ...] = ("scene", "geometry", "measurement", "run", "registration", "target", "report")


def _refused(check: Any, *arguments: Any) -> list[str]:
    try:
        check(*arguments)
    except RadcalError as error:
        return [str(error)]
    return []


def _made(case: Case, problems: list[str], sections: list[str]) -> tuple[list[str], tuple[int, int] | None]:
    """Remarks and image size of scene, geometry and measured images, which are made in memory as the workflow does."""
    from radcal.config import FileMeasurement, stages
    from radcal.measurement.sources import make_measurement
    from radcal.measurement.synthetic import check_synthetic
    from radcal.radar.projection import make_geometry
    from radcal.scene.sources import make_scene
    from radcal.simulators.protocol import Simulator
    from radcal.simulators.sources import make_simulator

    try:
        scene = make_scene(case.scene, list(case.materials), case.radar.heading_deg)
    except RadcalError as error:
        problems.append(str(error))
        return [], None
    notes, shape = list(scene.notes), None
    for number, one in enumerate(case.passes):
        said: list[str] = []
        try:
            # before the geometry, which a wrong section radar may not have
            said, section = _by_annotation(one, scene)
            sections += section
            geometry = make_geometry(scene, one.radar)
            shape = shape or (int(geometry.shape[0]), int(geometry.shape[1]))
            stage = stages.Measurement.of(one)
            if isinstance(one.measurement, FileMeasurement):
                nothing: Simulator = None  # type: ignore[assignment]  # a file needs no simulator
                notes += make_measurement(stage, geometry, nothing, scene, partly=number > 0).notes
            elif one.simulator.kind == "builtin" and geometry.material.size <= _LARGEST_RUN:
                simulator = make_simulator(stage, geometry, "")
                notes += make_measurement(stage, geometry, simulator, scene, partly=number > 0).notes
            else:
                check_synthetic(one.radar, one.measurement.synthetic, (geometry.shape[0], geometry.shape[1]))
        except RadcalError as error:
            problems.append(str(error))
            notes += said
    return notes, shape


def _of_products(case: Case) -> tuple[list[str], list[str]]:
    """Notes and sections of :func:`_by_annotation` in a case whose other problems kept its images from being made."""
    from radcal.scene.size import scene_size
    from radcal.scene.sources import make_scene

    notes, sections = list[str](), list[str]()
    products = [one for one in case.passes if is_safe_name(getattr(one.measurement, "path", ""))]
    with contextlib.suppress(RadcalError):  # each is among the problems, or is one of another problem
        size = scene_size(case.scene) if products else None
        if size is not None and max(size.cells, size.resampled) <= _LARGEST:
            scene = make_scene(case.scene, list(case.materials), case.radar.heading_deg)
            for one in products:
                said, section = _by_annotation(one, scene)
                notes, sections = notes + said, sections + section
    return notes, sections


def _by_annotation(one: Case, scene: Scene) -> tuple[list[str], list[str]]:
    """Notes on a measured image that is a product, and section ``radar`` by its annotation; nothing for other images.

    Parameters
    ----------
    one : Case
        One pass of the case.
    scene : Scene
        Scene of the case.
    """
    from radcal.config import FileMeasurement, expand_path
    from radcal.measurement.acquisition import differences, radar_section
    from radcal.measurement.overpass import told

    image = one.measurement
    if not isinstance(image, FileMeasurement) or not is_safe_name(image.path):
        return [], []
    seen = told(expand_path(image.path, "measurement.path", folder=True), image, one.radar, scene)
    notes = [seen.acquisition.sentence(), *seen.notes, *differences(seen.acquisition, one.radar)]
    return notes, [radar_section(seen.acquisition)]
