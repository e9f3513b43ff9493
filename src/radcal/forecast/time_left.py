"""Largest number of simulator runs of a case, and longest time that the remaining runs may take."""

from __future__ import annotations

import contextlib
import csv
import itertools
import os
import statistics
import time
from collections.abc import Container, Mapping, Sequence
from pathlib import Path

from radcal.config import Case, CommandSimulation, SimulatorConfig
from radcal.session.jobs import STARTED

__all__ = [
    "FINAL_RUNS", "at_most", "duration", "iteration_seconds", "largest_runs", "most_need", "reference_count",
    "runs_in_words", "stored_iteration_seconds",
]  # fmt: skip

FINAL_RUNS = 2  # of each pass: one with the noise seed of all runs, one with another noise seed
_SHORT_S = 60.0
# shorter runs are a small part of an iteration, whose other steps take 10 to 20 s, and their first one is compiled
_LONG_RUN_S = 30.0
# infill runs within which 63 of the 64 searches with a baseline in the table of docs/right_law.md ended (one took 17);
# of 20 searches without a baseline, half ended within 8
_SEARCH_RUNS = 16
_RECENT = 5  # latest iterations, whose median predicts the next ones: training takes longer with more runs


def reference_count(simulator: SimulatorConfig) -> int:
    """Number of reference runs of a pass: two if it is unknown whether a repeated run gives equal images, else one."""
    return 2 if isinstance(simulator, CommandSimulation) and simulator.deterministic is None else 1


def largest_runs(case: Case) -> dict[str, int]:
    """Largest number of simulator runs of a case over all passes, for each kind: reference, design, infill, final."""
    passes = len(case.passes)
    return {
        "reference": passes * (reference_count(case.simulator) + case.registers_twice),
        "design": passes * case.design_size,
        "infill": passes * (case.stop.max_runs - case.design_size),
        "final": passes * FINAL_RUNS,
    }


def runs_in_words(counts: Mapping[str, int], registration: int = 0, most: Container[str] = ()) -> str:
    """Text of numbers of simulator runs by kind, without the kinds that have no run.

    Parameters
    ----------
    counts : mapping
        Number of runs by kind, as in :func:`largest_runs`.
    registration : int
        Number of the reference runs onto which the image is registered again.
    most : container of str
        Kinds whose number is an upper limit.
    """
    among = f" ({registration} of them for the registration)" if registration else ""
    return ", ".join(
        f"{'at most ' * (kind in most)}{count} {kind}{among * (kind == 'reference')}"
        for kind, count in counts.items()
        if count
    )


def duration(seconds: float) -> str:
    """Text of a duration in a suitable unit (s, min, h or days), with two digits or, above 99, in whole units."""
    for size, unit in ((86_400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.2g} {unit}" if seconds < 99.5 * size else f"{seconds / size:.0f} {unit}"
    return f"{seconds:.2g} s" if seconds < 99.5 else f"{seconds:.0f} s"


def most_need(design: int, max_runs: int) -> int:
    """Number of design and infill runs within which most searches end, according to ``docs/right_law.md``.

    Parameters
    ----------
    design : int
        Number of runs in the design.
    max_runs : int
        ``stop.max_runs``.
    """
    return min(design + _SEARCH_RUNS, max_runs)


def at_most(runs: int, seconds: float | None, usual: int, of: str = "") -> str:
    """Text about the largest number of further runs and their time, to be appended to a progress line.

    Parameters
    ----------
    runs : int
        Largest number of further runs.
    seconds : float or None
        Measured time of one run [s]; None before any has been measured.
    usual : int
        Number of further runs within which most searches end; 0 or less if the search has already made more runs.
    of : str
        Text that says which part of the time is meant, such as " of simulation in this pass"; empty if the time
        includes all steps.

    Returns
    -------
    str
        Text to append; empty if no further run is possible, no time is known, or the time is below one minute. It is
        also empty for a part of the time (``of``) if a run takes less than 30 s, because the other parts are then
        larger.
    """
    if runs <= 0 or seconds is None or runs * seconds < _SHORT_S or (of and seconds < _LONG_RUN_S):
        return ""
    steps = "" if of else ", with training and proposal"
    few = f"most laws of docs/right_law.md took at most {usual} more ({duration(usual * seconds)}), "
    most = few if 0 < usual < runs else ""
    return (
        f"; about {duration(seconds)} each{steps}: {most}stop.max_runs allows at most {runs} more "
        f"({duration(runs * seconds)}{of})"
    )


def stored_iteration_seconds(folder: str | Path) -> float | None:
    """Time of the jobs of an iteration (training, proposal, verification) of earlier commands [s], without their start.

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
            pages = [last.with_name(f"{stage}_{number}.tsv") for stage in ("train", "propose", "verify")]
            rows = [list(csv.DictReader(page.read_text("utf-8").splitlines(), delimiter="\t")) for page in pages]
            found.append(sum(float(row[-1]["s"]) for row in rows))
    return statistics.median(found) if found else None


def iteration_seconds(files: Sequence[str | Path], now: float | None = None) -> float | None:
    """Time of one iteration of the present command [s], including training, proposal and start of jobs.

    Parameters
    ----------
    files : sequence of path
        Output files of the earlier steps in order: first the output of the design, then one output for each iteration.
    now : float, optional
        End of the present iteration [s since 1970]; by default the present time.

    Returns
    -------
    float or None
        Median of the last five iterations; None if no iteration began in this command.
    """
    started = float(os.environ.get(STARTED, "inf"))
    ends = [Path(file).stat().st_mtime for file in files]
    ends.append(time.time() if now is None else now)
    spans = [after - before for before, after in itertools.pairwise(ends) if before >= started]
    return statistics.median(spans[-_RECENT:]) if spans else None
