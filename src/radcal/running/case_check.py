"""Check of a whole case before anything is run: all problems at once, and what a calibration of it will need."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from radcal.config import Case, check_reuse, load_with_problems, missing_inputs
from radcal.config.inputs import input_files
from radcal.errors import ConfigError, RadcalError
from radcal.running.memory_and_time import Stage, memory_mb, values_of

__all__ = ["CaseCheck", "check_case"]

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
    """

    problems: list[str]
    notes: list[str]
    files: Mapping[str, Path]
    shape: tuple[int, int] | None
    runs: Mapping[str, int]
    memory_mb: Mapping[Stage, int]

    def summary(self) -> str:
        """Lines on what would be read, made and needed."""
        lines = [f"  {key}: {path}" for key, path in self.files.items()]
        if self.shape is not None:
            lines.append(f"  simulated image: {self.shape[0]} x {self.shape[1]} pixels")
        kinds = ", ".join(f"{count} {kind}" for kind, count in self.runs.items() if count)
        lines.append(f"  simulator runs: at most {sum(self.runs.values())} ({kinds}); most cases need far fewer infill")
        stage = max(self.memory_mb, key=lambda name: self.memory_mb[name])
        lines.append(f"  memory: at most {self.memory_mb[stage]:,} MB a job ({stage})")
        return "\n".join([*lines, *(f"  note: {text}" for text in self.notes)])


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
    missing = missing_inputs(case)
    problems += missing
    files = {} if missing else input_files(case)
    if case.simulator.kind == "command" and not missing:
        from radcal.simulators.command import check_command

        problems += _refused(check_command, case)
    problems += _refused(check_reuse, case, results)
    notes: list[str] = []
    shape, demands = None, dict[Stage, int]()
    if not missing:
        try:
            values = values_of(case)
            demands = {stage: memory_mb(stage, values["scene" if stage == "scene" else "image"]) for stage in _STAGES}
            if max(values.values()) <= _LARGEST:
                notes, shape = _made(case, problems)
            else:
                notes.append("the scene is large: it is read when the calibration starts, not in this check.")
        except RadcalError as error:
            problems.append(str(error))
    passes = len(case.passes)
    runs = {
        # an external program is run twice, to find out whether it repeats
        "reference": passes * (2 if case.simulator.kind == "command" else 1),
        "design": passes * case.design_size,
        "infill": passes * (case.stop.max_runs - case.design_size),
        "final": passes * 2,
    }
    return CaseCheck(problems, notes, files, shape, runs, demands)


_STAGES: tuple[Stage, ...] = ("scene", "geometry", "measurement", "run", "registration", "target", "report")


def _refused(check: Any, *arguments: Any) -> list[str]:
    try:
        check(*arguments)
    except RadcalError as error:
        return [str(error)]
    return []


def _made(case: Case, problems: list[str]) -> tuple[list[str], tuple[int, int] | None]:
    """Remarks and image size of scene, geometry and measured images, which are made in memory as the workflow does."""
    from radcal.config import FileMeasurement, stages
    from radcal.measurement.sources import make_measurement
    from radcal.radar.projection import make_geometry
    from radcal.scene.sources import make_scene
    from radcal.simulators.protocol import Simulator

    try:
        scene = make_scene(case.scene, list(case.materials), case.radar.heading_deg)
    except RadcalError as error:
        problems.append(str(error))
        return [], None
    notes, shape = list(scene.notes), None
    for number, one in enumerate(case.passes):
        try:
            geometry = make_geometry(scene, one.radar)
            shape = shape or (int(geometry.shape[0]), int(geometry.shape[1]))
            if isinstance(one.measurement, FileMeasurement):
                nothing: Simulator = None  # type: ignore[assignment]  # a file needs no simulator
                measured = make_measurement(stages.Measurement.of(one), geometry, nothing, scene, partly=number > 0)
                notes += measured.notes
        except RadcalError as error:
            problems.append(str(error))
    return notes, shape
