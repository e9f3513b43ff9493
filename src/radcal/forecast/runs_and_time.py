"""Largest number of simulator runs of a case or of planned jobs, and the time that they take, from stored runs."""

from __future__ import annotations

import contextlib
import csv
import math
import statistics
from collections import Counter
from collections.abc import Container, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from radcal.config import Case
from radcal.sections.simulator import SimulatorConfig
from radcal.storage.runs import median_seconds

_FINAL_RUNS = 2  # of each pass: one with the noise seed of all runs, one with another noise seed
# infill runs of half of the searches of the workflow in docs/evidence/runs.md
_HALF_SEARCH_RUNS = 6
_LONG_RUN_S = 60.0  # a run beside which the other time of an iteration does not count


@dataclass(frozen=True)
class Standing:
    """How far the runs of a case are.

    Attributes
    ----------
    done : int
        Runs in the run store.
    expected : int or None
        Number of runs with which the search is expected to end; None after its final runs.
    left_s : float or None
        Time expected to the end of the final runs [s], if it is known.
    """

    done: int
    expected: int | None
    left_s: float | None

    def __str__(self) -> str:
        """Words for the terminal and the live page."""
        if self.expected is None:
            return f"{self.done} runs, the search has ended"
        left = "" if self.left_s is None else f", about {duration(self.left_s)} to the end of the search"
        return f"{self.done} of about {self.expected} runs{left}"


def reference_count(simulator: SimulatorConfig) -> int:
    """Number of reference runs of a pass: two if it is unknown whether a repeated run gives equal images, else one."""
    return 2 if simulator.deterministic is None else 1


def largest_runs(case: Case) -> dict[str, int]:
    """Largest number of simulator runs of a case over all passes, by kind; ``registration`` is onto fitted laws."""
    passes = len(case.passes)
    return {
        "reference": passes * reference_count(case.simulator),
        "registration": passes * case.registers_twice,
        "design": passes * case.design_size,
        "infill": passes * (case.stop.max_runs - case.design_size),
        "final": passes * _FINAL_RUNS,
    }


def planned_runs(case: Case, jobs: Sequence[tuple[str, Mapping[str, str]]]) -> dict[str, int]:
    """Largest number of simulator runs that planned jobs make, by kind, as if the run store held none of them.

    Parameters
    ----------
    case : Case
        Configuration of the case.
    jobs : sequence of (str, mapping)
        Rule and wildcards of each planned job.
    """
    planned = Counter(rule for rule, _ in jobs)
    sources = {str(number): one.measurement.source for number, one in enumerate(case.passes, start=1)}
    firsts = [int(words["chunk"]) % case.design_parts * case.design.chunk for rule, words in jobs
              if rule == "design_chunk"]  # fmt: skip
    iterations = [int(words["k"]) for rule, words in jobs if rule in ("train", "propose", "verify")]
    # the jobs of the iterations are planned once the scores are known
    begun = 0 if planned["scores"] else min(iterations, default=None)
    left = case.stop.max_runs - case.design_size - (begun or 0)  # an iteration has one run at least
    infill = 0 if begun is None or not planned["final_runs"] else max(left, 0)
    return {
        "measurement": sum(rule == "measurement" and sources[words["p"]] == "synthetic" for rule, words in jobs),
        "reference": planned["reference_run"] * reference_count(case.simulator),
        "registration": planned["registration_run"],
        "design": sum(min(case.design.chunk, case.design_size - first) for first in firsts),
        "infill": len(case.passes) * infill,
        "final": len(case.passes) * _FINAL_RUNS * planned["final_runs"],
    }


def stages_sentence(jobs: Sequence[tuple[str, Mapping[str, str]]]) -> str:
    """Sentence that lists the stages of planned jobs, in the order of the jobs, with the number of jobs above one."""
    counts = Counter(rule for rule, _ in jobs if rule != "all")
    listed = ", ".join(rule if number == 1 else f"{rule} ({number} jobs)" for rule, number in counts.items())
    search = "; the search repeats train, propose and verify" if "final_runs" in counts else ""
    return f"stages in their order: {listed or 'none'}{search}."


def runs_in_words(counts: Mapping[str, int], most: Container[str] = ()) -> str:
    """Text of numbers of simulator runs by kind, without the kinds that have no run.

    Parameters
    ----------
    counts : mapping
        Number of runs by kind, as in :func:`largest_runs`.
    most : container of str
        Kinds whose number is an upper limit.
    """
    return ", ".join(f"{'at most ' * (kind in most)}{count} {kind}" for kind, count in counts.items() if count)


def runs_sentence(counts: Mapping[str, int], draws: int = 1) -> str:
    """Sentence on the largest number of simulator runs.

    Parameters
    ----------
    counts : mapping
        Largest number of runs by kind.
    draws : int
        Number of speckle draws in each run of the search.
    """
    kinds = runs_in_words(counts, ("infill", "final"))
    if not kinds:
        return "no simulator run would be made."
    each = f"; runs of the search have {draws} speckle draws" if draws > 1 else ""
    search = "a search that meets its stop criterion ends earlier, and " * bool(counts.get("infill"))
    most = sum(counts.values())
    return f"at most {most} simulator runs would be made ({kinds}{each}); {search}no stored run is repeated."


def duration(seconds: float) -> str:
    """Text of a duration in a suitable unit (s, min, h or days), with two digits or, above 99, in whole units."""
    for size, unit in ((86_400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.2g} {unit}" if seconds < 99.5 * size else f"{seconds / size:.0f} {unit}"
    return f"{seconds:.2g} s" if seconds < 99.5 else f"{seconds:.0f} s"


def stored_iteration_seconds(folder: str | Path) -> float | None:
    """Time of an iteration's jobs (training to verification) of earlier commands [s], without their start.

    Parameters
    ----------
    folder : path
        Folder of Snakemake's benchmark files, which need not exist.

    Returns
    -------
    float or None
        Median of all iterations; None if no iteration has all files.
    """
    found = []
    for last in Path(folder).glob("verify_*.tsv"):
        number = last.stem.rpartition("_")[2]
        # Snakemake does not write these files atomically, so that a file may be incomplete after a kill
        with contextlib.suppress(OSError, KeyError, TypeError, ValueError, IndexError):
            own = [last.with_name(f"{stage}_{number}.tsv") for stage in ("train", "propose", "verify")]
            runs = Path(folder, "iterations", number).glob("infill_run_*.tsv")  # side by side
            found.append(sum(map(_job_seconds, own)) + max(map(_job_seconds, runs), default=0.0))
    return statistics.median(found) if found else None


def _job_seconds(page: Path) -> float:
    """Wall time in a benchmark file of Snakemake [s]."""
    return float(list(csv.DictReader(page.read_text("utf-8").splitlines(), delimiter="\t"))[-1]["s"])


def standing(case: Case, folder: str | Path) -> Standing:
    """How far the runs of a case are, from the files in its results folder.

    Parameters
    ----------
    case : Case
        Configuration of the case.
    folder : path
        ``results/<case>``, which need not exist. Records of runs with earlier settings of the case count as done.
    """
    folder, passes = Path(folder), len(case.passes)
    # each draw of a run has a record; repetitions of the reference run and final runs have one draw alone
    done = math.ceil(len(list((folder / "runs").glob("[!.]*.h5"))) / case.simulator.draws)
    if (folder / "final.json").exists():
        return Standing(done, None, None)
    counts = largest_runs(case)
    batch = case.infill.batch
    begun = batch * len(list((folder / "iterations").glob("*/verified.json")))
    infill = min(max(_HALF_SEARCH_RUNS - begun, batch), counts.pop("infill") // passes - begun)
    iterations, runs = -(-infill // batch), sum(counts.values()) + passes * begun
    expected = max(runs + passes * infill, done)
    each = case.simulator.draws * (median_seconds(folder / "runs") or 0.0)
    iteration = stored_iteration_seconds(folder / "benchmarks")
    if iteration is None and each < _LONG_RUN_S:
        return Standing(done, expected, None)
    final = counts["final"]
    left_s = (max(runs - done - final, 0) + final / case.simulator.draws) * each
    left_s += iterations * (iteration or passes * each)
    return Standing(done, expected, left_s)
