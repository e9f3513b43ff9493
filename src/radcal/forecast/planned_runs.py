"""Largest number of simulator runs that the planned jobs of a command make, without runs in the run store."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from radcal.config import Case, stages
from radcal.errors import RadcalError
from radcal.forecast.runs_and_time import FINAL_RUNS, reference_count
from radcal.objectives.history import read_runs
from radcal.proposals.design import design_points
from radcal.radar import SIMULATOR_VERSION
from radcal.scene.model import read_scene
from radcal.seeds import noise_seed
from radcal.simulators.runner import Runner
from radcal.storage.records import read_json, understood
from radcal.storage.runs import RunStore

__all__ = ["planned_runs", "stages_sentence"]

Jobs = Sequence[tuple[str, Mapping[str, str]]]


@dataclass(frozen=True)
class _Known:
    """Object in place of a simulator, which has the simulator's identity but cannot make runs."""

    identity: Mapping[str, Any]


class _Flat:
    """Object in place of the geometry, which only tells that the earth is flat (no earth radius)."""

    earth_radius_m = None


def planned_runs(case: Case, jobs: Jobs, folder: str | Path) -> dict[str, int]:
    """Largest number of simulator runs that planned jobs make, by kind of run.

    Parameters
    ----------
    case : Case
        Configuration of the case.
    jobs : sequence of (str, mapping)
        Rule and wildcards of each planned job.
    folder : path
        Results folder of the case.

    Returns
    -------
    dict
        Number of runs by kind: measurement (synthetic), reference, design, infill, final.
    """
    folder = Path(folder)
    planned = {rule for rule, _ in jobs}
    counts = dict.fromkeys(("measurement", "reference", "design", "infill", "final"), 0)
    # beside a finished calibration, jobs that would write another scene are refused (radcal.session.replacement)
    kept = not case.replace and (folder / "calibration.h5").is_file()
    unsure = {"simulator", "reuse"} | (set() if kept else {"scene", "geometry"})
    parts = [divmod(int(words["chunk"]), case.design_parts) for rule, words in jobs if rule == "design_chunk"]
    for number, one in enumerate(case.passes):
        of_pass = Counter(rule for rule, words in jobs if words.get("p") == str(number + 1))
        counts["measurement"] += of_pass["measurement"] * (one.measurement.source == "synthetic")
        known = None if planned & unsure else _known(case, folder / f"passes/{number + 1}", folder)
        if of_pass["reference_run"]:
            start = stages.ReferenceRun.of(one).at_start
            stored = known is not None and known(start).is_recorded(one.start_parameters, noise_seed(start))
            counts["reference"] += reference_count(case.simulator) - stored
        counts["reference"] += of_pass["registration_run"]
        runner = None if known is None else known(stages.DesignChunk.of(one))
        counts["design"] += _of_design(case, [part for k, part in parts if k == number], runner)
    if "final_runs" in planned:
        counts["final"] = FINAL_RUNS * len(case.passes)
        counts["infill"] = len(case.passes) * _infill(case, jobs, folder)
    return counts


def _of_design(case: Case, parts: Sequence[int], runner: Runner | None) -> int:
    """Number of design runs that given parts of the design still need in one pass."""
    size, step = case.design_size, case.design.chunk
    numbers = [k for part in parts for k in range(part * step, min((part + 1) * step, size))]
    # reused runs replace an unknown number of them
    if not numbers or runner is None or case.design.reuse is not None:
        return len(numbers)
    stage = stages.DesignChunk.of(case)
    points, seed = design_points(stage, size), noise_seed(stage)
    return sum(not runner.is_recorded(points[k], seed) for k in numbers if k < len(points))


def _infill(case: Case, jobs: Jobs, folder: Path) -> int:
    """Largest number of infill runs in one pass: ``stop.max_runs`` minus design runs and finished iterations."""
    most = max(case.stop.max_runs - case.design_size, 0)
    if any(rule == "scores" for rule, _ in jobs):
        return most
    first = min((int(words["k"]) for rule, words in jobs if rule in ("train", "propose", "verify")), default=None)
    if first is None:
        return 0
    try:
        design = read_runs([folder / "scores.json"]).count("design")
    except RadcalError:
        return most
    return max(case.stop.max_runs - design - first, 0)


def _known(case: Case, of_pass: Path, folder: Path) -> Callable[[stages.Simulation], Runner] | None:
    """Function that makes a runner which only computes hashes of runs; None if hashes cannot be computed yet."""
    try:
        identity: dict[str, Any] = {"kind": "builtin", "version": SIMULATOR_VERSION}
        if case.simulator.kind == "command":
            with understood(of_pass / "simulator.json"):
                held = read_json(of_pass / "simulator.json")
                identity = {key: x for key, x in held.items() if key != "seed_bits"}
        scene = read_scene(folder / "scene.h5").identity
    except (RadcalError, OSError):
        return None
    if any(one.radar.earth != "flat" for one in case.passes):  # a run's hash holds the radius, which the geometry gives
        return None
    simulator: Any = _Known(identity)
    geometry: Any = _Flat()
    return lambda one: Runner(RunStore(folder / "runs"), simulator, geometry, scene, one, first=case.radar)


def stages_sentence(jobs: Jobs) -> str:
    """Sentence that lists the stages of planned jobs, in the order of the jobs, with the number of jobs above one."""
    counts = Counter(rule for rule, _ in jobs if rule != "all")
    listed = ", ".join(rule if number == 1 else f"{rule} ({number} jobs)" for rule, number in counts.items())
    search = "; the search repeats train, propose and verify" if "final_runs" in counts else ""
    return f"stages in their order: {listed or 'none'}{search}."
