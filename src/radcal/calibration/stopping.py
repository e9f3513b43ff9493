"""Stop criteria: end of a calibration, with its reason."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

from radcal.calibration.history import History, Proposal
from radcal.calibration.infill import UNREACHABLE_SHARE
from radcal.config import Stop

__all__ = ["Decision", "Verdict", "decide"]

_SETTLED = 0.05  # of half the sum of squares: the law is a third of its standard error from the minimum
_OF_SAMPLING = 1.0 / 3.0  # of the sampling error: less adds no more than a ninth to the variance that sampling leaves
_PATIENCE = 5  # runs without a better point there
_PROMISE = 0.2  # relative difference of promised and verified rms that counts as kept
Reason = Literal["rms", "settled", "unreachable", "stagnation", "max_runs"]


@dataclass(frozen=True)
class Verdict:
    """How a material stands.

    Attributes
    ----------
    reason : str or None
        Why it ended, None while it goes on.
    sentence : str
        The same for people.
    """

    reason: Reason | None
    sentence: str


@dataclass(frozen=True)
class Decision:
    """Whether the loop goes on.

    Attributes
    ----------
    materials : mapping
        Verdict per material.
    reason : str or None
        Why the loop ended (the first of max_runs, stagnation, unreachable, rms, settled that
        applies to a material); None while it goes on.
    """

    materials: Mapping[str, Verdict]
    reason: Reason | None

    @property
    def ended(self) -> bool:
        """True when every material has ended."""
        return self.reason is not None

    @property
    def converged(self) -> bool:
        """True when every material is within the tolerance, or its law meets the stop criterion."""
        return self.reason in ("rms", "settled")


def decide(history: History, materials: Sequence[str], stop: Stop) -> Decision:
    """Judge a history against the stop settings.

    Parameters
    ----------
    history : History
        Reference, design and verified proposals so far; where their classes of incidence were scored, it is
        the law that must settle and not the rms.
    materials : sequence of str
        The calibrated materials.
    stop : Stop
        Tolerance, maximum and stagnation.

    Returns
    -------
    Decision
        Nothing but the arguments goes into it: the same runs under other settings are
        judged as if they had always been these.
    """
    judge = _judge_law if history.of_classes else _judge
    verdicts = {name: judge(history, name, stop) for name in materials}
    if any(verdict.reason is None for verdict in verdicts.values()):
        return Decision(verdicts, None)
    reasons = {verdict.reason for verdict in verdicts.values()}
    order: tuple[Reason, ...] = ("max_runs", "stagnation", "unreachable", "rms", "settled")
    return Decision(verdicts, next(reason for reason in order if reason in reasons))


def _kept(proposal: Proposal, rms: float) -> bool:
    """Whether a verified rms is what the surrogate promised: only then is its floor worth its word."""
    promised = proposal.predicted_rms
    return proposal.mode == "exploit" and promised is not None and abs(rms - promised) <= _PROMISE * promised


def _judge(history: History, name: str, stop: Stop) -> Verdict:
    """Walk a material through its runs until something ends it."""
    design = history.count("design")
    best = min(run.rms[name] for run in history.runs if run.kind != "infill" and name not in run.other_law)
    idle, sampling = 0, history.rms_sampling(name)
    if best <= stop.rms:
        return Verdict("rms", f"{name}: rms {best:.2g} within the tolerance {stop.rms:.2g} before any infill.")
    for k, run in enumerate(history.infill, start=1):
        if design + k > stop.max_runs:
            break
        rms = run.rms[name]
        proposal = run.proposals[name]
        if proposal.mode != "ended":
            idle = 0 if rms < best else idle + 1
            best = min(best, rms)
        if best <= stop.rms:
            return Verdict(
                "rms", f"{name}: rms {best:.2g} within the tolerance {stop.rms:.2g} after {design + k} runs."
            )
        if proposal.floor_rms is not None and proposal.floor_rms >= UNREACHABLE_SHARE * best and _kept(proposal, rms):
            return Verdict(
                "unreachable",
                f"{name}: rms {best:.2g} after {design + k} runs, above the tolerance {stop.rms:.2g}; a multi-start "
                "search of the surrogate, two standard errors in favour, finds no rms below "
                f"{proposal.floor_rms:.2g} inside the bounds: the target is out of reach there.",
            )
        if proposal.mode == "exhausted":
            return Verdict(
                "unreachable",
                f"{name}: rms {best:.2g}, above the tolerance {stop.rms:.2g}: every combination of whole parameters "
                "inside the bounds has been simulated.",
            )
        if stop.at_sampling_error and idle >= _PATIENCE and best < _OF_SAMPLING * sampling:
            return Verdict(
                "stagnation",
                f"{name}: rms {best:.2g}, no better for {idle} runs and below a third of the sampling error "
                f"{sampling:.2g}: a better fit would not be significant (stop.at_sampling_error: false continues).",
            )
        if idle >= stop.stagnation_runs:
            return Verdict(
                "stagnation", f"{name}: rms {best:.2g}, above the tolerance {stop.rms:.2g}, no better for {idle} runs."
            )
    if design + len(history.infill) >= stop.max_runs:
        return Verdict(
            "max_runs",
            f"{name}: rms {best:.2g}, above the tolerance {stop.rms:.2g}, at the maximum of {stop.max_runs} runs.",
        )
    return Verdict(None, f"{name}: rms {best:.2g}, tolerance {stop.rms:.2g}.")


def _judge_law(history: History, name: str, stop: Stop) -> Verdict:
    """The same for classes of incidence: until a run's own correction would hardly change its law any more."""
    design = history.count("design")
    best = min(run.cost[name] for run in history.runs if run.kind != "infill" and name not in run.other_law)
    idle = 0
    for k, run in enumerate(history.infill, start=1):
        if design + k > stop.max_runs:
            break
        cost, predicted = run.cost[name], run.proposals[name].predicted_cost
        # all runs together promised no more than this, and were right
        promised = predicted is not None and best - predicted <= _SETTLED and abs(cost - predicted) <= _SETTLED
        if run.proposals[name].mode != "ended":
            idle = 0 if best - cost > _SETTLED else idle + 1
            best = min(best, cost)
        stands = run.left[name] <= _SETTLED or run.moved_db[name] <= stop.law_db
        if promised and not stands and cost <= best + _SETTLED:
            return Verdict(
                "settled",
                f"{name}: stop criterion met after {design + k} runs: all runs together predicted no better law, and "
                "the last confirmed it.",
            )
        if stands and cost <= best + _SETTLED:
            return Verdict(
                "settled",
                f"{name}: stop criterion met after {design + k} runs: the last one would change the law by "
                f"{run.moved_db[name]:.2g} dB over the incidence seen, {np.sqrt(2.0 * run.left[name]):.2g} of its "
                "standard error.",
            )
        if idle >= stop.stagnation_runs:
            return Verdict("stagnation", f"{name}: stop criterion not met, and the law is no better for {idle} runs.")
    if design + len(history.infill) >= stop.max_runs:
        return Verdict("max_runs", f"{name}: stop criterion not met at the maximum of {stop.max_runs} runs.")
    return Verdict(None, f"{name}: stop criterion not met yet.")
