"""Stop criteria: decision whether a calibration has ended, with the reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from radcal.config import Stop
from radcal.objectives import Objective, objective_class
from radcal.objectives.base import Progress, Reason, SearchState
from radcal.objectives.history import History


@dataclass(frozen=True)
class Decision:
    """Decision whether the calibration loop goes on.

    Attributes
    ----------
    materials : mapping
        State of the search by material.
    reason : str or None
        Reason why the loop ended, the first of max_runs, stagnation, unreachable, rms and settled that applies to a
        material; None while the loop goes on.
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
        return self.reason in ("rms", "settled")


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
        Decision that depends on the arguments alone: after a change of settings, earlier runs are judged as if the new
        settings had always held.
    """
    states = {name: _judge(history, name, stop, objective_class(objective)) for name in materials}
    reasons = {state.reason for state in states.values()}
    order: tuple[Reason | None, ...] = (None, "max_runs", "stagnation", "unreachable", "rms", "settled")
    return Decision(states, next(reason for reason in order if reason in reasons))


def _judge(history: History, name: str, stop: Stop, objective: type[Objective]) -> SearchState:
    """State of the search of one material: its infill runs are judged in order, until a criterion ends the search."""
    design = history.count("design")
    scores = [run.scores[name] for run in history.runs if run.kind != "infill"]
    best, idle = min(score.cost for score in scores if score.own_law), 0
    if ending := objective.ending_before_infill(name, best, stop):
        return ending
    for k, run in enumerate(history.infill, start=1):
        if design + k > stop.max_runs:
            break
        score, proposal = run.scores[name], run.proposals[name]
        if proposal.mode != "ended":
            idle = 0 if best - score.cost > objective.improvement else idle + 1
            best = min(best, score.cost)
        sampling = history.rms_sampling(name)
        if ending := objective.ending(Progress(name, design + k, best, idle, score, proposal, sampling), stop):
            return ending
        if idle >= stop.stagnation_runs:
            return SearchState.of("stagnation", "search_stagnated", name, idle=idle, **objective.standing(best, stop))
    if design + len(history.infill) >= stop.max_runs:
        numbers = {**objective.standing(best, stop), "runs": stop.max_runs}
        return SearchState.of("max_runs", "search_out_of_runs", name, **numbers)
    return SearchState.of(None, "search_goes_on", name, **objective.standing(best, stop))
