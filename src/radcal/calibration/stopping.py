"""Stop criteria: decision whether a calibration has ended, with the reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby

from radcal.config import Stop
from radcal.objectives import Objective, objective_class
from radcal.objectives.base import MET, Progress, Reason, SearchState
from radcal.objectives.history import History, Kind


@dataclass(frozen=True)
class Decision:
    """Decision whether the calibration loop goes on.

    Attributes
    ----------
    materials : mapping
        State of the search by material.
    reason : str or None
        Reason why the loop ended, the first of max_runs, max_hours, stagnation, unreachable, rms and settled that
        applies to a material; None while the loop goes on.
    """

    materials: Mapping[str, SearchState]
    reason: Reason | None

    @property
    def ended(self) -> bool:
        """True if the search of every material has ended."""
        return self.reason is not None

    @property
    def converged(self) -> bool:
        """True if every material has its density within the tolerance, or meets the stop criterion of its law."""
        return self.reason in MET


def decide(history: History, materials: Sequence[str], stop: Stop, objective: str) -> Decision:
    """Decision whether the calibration goes on, from its runs and the stop settings.

    Parameters
    ----------
    history : History
        Runs so far: reference, reused, design and infill runs.
    materials : sequence of str
        The calibrated materials.
    stop : Stop
        Tolerance, largest number of runs, and number of runs without improvement after which a search ends.
    objective : str
        Name of the objective, whose stop criterion ends a search with success.

    Returns
    -------
    Decision
        Decision that depends on the arguments alone: after a change of settings, earlier iterations, each with all of
        its runs, are judged as if the new settings had always held.
    """
    states = {name: _judge(history, name, stop, objective_class(objective)) for name in materials}
    reasons = {state.reason for state in states.values()}
    order: tuple[Reason | None, ...] = (None, "max_runs", "max_hours", "stagnation", "unreachable", "rms", "settled")
    return Decision(states, next(reason for reason in order if reason in reasons))


def _judge(history: History, name: str, stop: Stop, objective: type[Objective]) -> SearchState:
    """State of the search of one material: its infill runs are judged in order, until a criterion ends the search."""
    seconds = _seconds(history, "design")
    before = History(run for run in history.runs if run.kind != "infill")
    best, idle = before.best(name).cost, 0
    if ending := objective.ending_before_infill(name, best, stop):
        return ending
    sampling, moved_db = history.rms_sampling(name), None
    for _, iteration in groupby(history.infill, key=lambda run: run.index):
        left, _ = _left(seconds, stop)
        if left <= 0:
            break
        runs = list(iteration)  # made together, so that none of them is a failure after a better one
        seconds += [run.seconds for run in runs]
        moved_db = runs[-1].scores[name].moved_db
        if costs := [run.scores[name].cost for run in runs if run.proposals[name].mode != "ended"]:
            idle = 0 if best - min(costs) > objective.improvement else idle + len(costs)
            best = min(best, *costs)
        for run in runs:
            progress = Progress(name, len(seconds), best, idle, run.scores[name], run.proposals[name], sampling)
            if ending := objective.ending(progress, stop):
                return ending
        if idle >= stop.stagnation_runs:
            return SearchState.of("stagnation", "search_stagnated", name, idle=idle, **objective.standing(best, stop))
    numbers = objective.standing(best, stop) | ({} if moved_db is None else {"moved_db": moved_db})
    left, reason = _left(seconds, stop)
    if left > 0:
        return SearchState.of(None, "search_goes_on", name, **numbers)
    if reason == "max_hours":
        return SearchState.of(reason, "search_out_of_time", name, **numbers, hours=sum(seconds) / 3600.0)
    return SearchState.of(reason, "search_out_of_runs", name, **numbers, runs=len(seconds))


def runs_left(history: History, stop: Stop) -> int:
    """Number of further runs within ``max_runs`` and, if each takes the mean time of the runs so far, ``max_hours``.

    Before any run of the search, each is taken to need the time of the reference run.
    """
    return _left(_seconds(history, "design", "infill"), stop, _seconds(history, "reference"))[0]


def _seconds(history: History, *kinds: Kind) -> list[float]:
    return [run.seconds for run in history.runs if run.kind in kinds]


def _left(seconds: Sequence[float], stop: Stop, before: Sequence[float] = ()) -> tuple[int, Reason]:
    """Number of further runs after runs of some wall times [s], and the setting that limits it.

    If there is no run yet, the runs ``before`` the search tell how long one takes.
    """
    within: list[tuple[int, Reason]] = [(stop.max_runs - len(seconds), "max_runs")]
    if stop.max_hours is not None and (like := sum(seconds or before)) > 0.0:
        mean = like / len(seconds or before)
        within.append((int((3600.0 * stop.max_hours - sum(seconds)) / mean), "max_hours"))
    return min(within, key=lambda one: one[0])
