"""Largest number of simulator runs of a case, and how long those that may still come take at most."""

from __future__ import annotations

import itertools
import os
import statistics
import time
from collections.abc import Sequence
from pathlib import Path

from radcal.config import Case, CommandSimulation, SimulatorConfig
from radcal.running.jobs import STARTED

__all__ = [
    "FINAL_RUNS", "at_most", "duration", "iteration_seconds", "largest_runs", "most_need", "reference_count",
]  # fmt: skip

FINAL_RUNS = 2  # of each pass: with the random numbers of all runs, and with others
_SHORT_S = 60.0
_SEARCH_RUNS = 16  # most infill runs that any of the 53 hidden laws in the table of docs/right_law.md needed
_RECENT = 5  # iterations whose median stands for the next ones: training takes longer as runs come


def reference_count(simulator: SimulatorConfig) -> int:
    """Number of reference runs of a pass: two where it must be found out whether a run can be repeated."""
    return 2 if isinstance(simulator, CommandSimulation) and simulator.deterministic is None else 1


def largest_runs(case: Case) -> dict[str, int]:
    """Largest number of simulator runs of a case in all passes, by kind: reference, design, infill, final."""
    passes = len(case.passes)
    return {
        "reference": passes * reference_count(case.simulator),
        "design": passes * case.design_size,
        "infill": passes * (case.stop.max_runs - case.design_size),
        "final": passes * FINAL_RUNS,
    }


def duration(seconds: float) -> str:
    """A duration in the unit that suits it, with two digits."""
    for size, unit in ((86_400.0, "days"), (3600.0, "h"), (60.0, "min")):
        if seconds >= 1.5 * size:
            return f"{seconds / size:.2g} {unit}" if seconds < 99.5 * size else f"{seconds / size:.0f} {unit}"
    return f"{seconds:.2g} s" if seconds < 99.5 else f"{seconds:.0f} s"


def most_need(design: int, max_runs: int) -> int:
    """Number of runs of design and infill within which most searches end, by those of ``docs/right_law.md``.

    Parameters
    ----------
    design : int
        Runs of the design.
    max_runs : int
        ``stop.max_runs``.
    """
    return min(design + _SEARCH_RUNS, max_runs)


def at_most(runs: int, seconds: float | None, usual: int, of: str = "") -> str:
    """Words on the runs that may still come and on their time, to be put after a line of progress.

    Parameters
    ----------
    runs : int
        Largest number of further runs.
    seconds : float or None
        Measured time of one run [s]; None before any has been measured.
    usual : int
        Number of further runs within which most searches end; 0 or less where this one has passed it.
    of : str
        What the time is of, where it is not all that passes.

    Returns
    -------
    str
        Empty if no run can come, no time is known, or it is less than a minute.
    """
    if runs <= 0 or seconds is None or runs * seconds < _SHORT_S:
        return ""
    most = f"most cases need at most {usual} more ({duration(usual * seconds)}), " if 0 < usual < runs else ""
    return (
        f"; about {duration(seconds)} each: {most}stop.max_runs allows at most {runs} more "
        f"({duration(runs * seconds)}{of})"
    )


def iteration_seconds(files: Sequence[str | Path], now: float | None = None) -> float | None:
    """Time of one iteration [s], training, proposal and start of jobs included, as this command has measured it.

    Parameters
    ----------
    files : sequence of path
        Outputs of the steps before this one, one for each iteration in turn; the first is that of the design.
    now : float, optional
        End of the present iteration [s since 1970]; by default the present time.

    Returns
    -------
    float or None
        Median of the last iterations; None if none began in this command.
    """
    started = float(os.environ.get(STARTED, "inf"))
    ends = [Path(file).stat().st_mtime for file in files]
    ends.append(time.time() if now is None else now)
    spans = [after - before for before, after in itertools.pairwise(ends) if before >= started]
    return statistics.median(spans[-_RECENT:]) if spans else None
