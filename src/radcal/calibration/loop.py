"""Whole calibration loop in one process, for notebooks, benchmarks and tests.

The workflow executes the steps of the loop as separate jobs, which exchange files. Workflow and loop make
equal runs, bit for bit.
"""

from __future__ import annotations

from collections.abc import Callable

from radcal.calibration.design import design_points
from radcal.calibration.history import History
from radcal.calibration.objectives import make_objectives
from radcal.calibration.scoring import score, score_reference
from radcal.calibration.steps import (
    propose_all,
    reference_runs,
    run_all_draws,
    train_all,
    verify,
)
from radcal.calibration.stopping import Decision, decide
from radcal.config import Case, stages
from radcal.measurement.target import Targets
from radcal.simulators.runner import Runner

__all__ = ["calibrate"]


def calibrate(
    case: Case,
    runner: Runner,
    targets: Targets,
    report: Callable[[History], None] = lambda _: None,
    reference: Runner | None = None,
) -> tuple[History, Decision]:
    """Make the reference run, the design runs, and infill runs until the search of every material has ended.

    Parameters
    ----------
    case : Case
        Configuration of the case.
    runner : Runner
        Simulator with a run store; stored runs are not simulated again.
    targets : mapping
        Target by calibrated material, divided into incidence-angle bins if the objective needs them
        (:func:`radcal.calibration.bin_target.bin_targets`).
    report : callable, optional
        Function that is called with the history after the design and after every infill run.
    reference : Runner, optional
        Simulator for the reference run, made for ``case.at_start``; needed if the starting parameters of a calibrated
        material belong to another law.

    Returns
    -------
    history : History
        All runs with their scores.
    decision : Decision
        Reason why the loop ended.

    Raises
    ------
    ValueError
        If the starting parameters of a calibrated material belong to another law and ``reference`` is missing.
    """
    simulation, scores = stages.Verify.of(case), stages.Scores.of(case)
    train, proposal = stages.Train.of(case), stages.Propose.of(case)
    others = case.start_with_another_law
    if others and reference is None:
        raise ValueError(f"materials {others} start with another law: expected a reference runner")
    runs = score_reference(scores, reference_runs(stages.ReferenceRun.of(case), reference or runner), targets)
    objectives = make_objectives(scores, targets)
    for k, parameters in enumerate(design_points(stages.DesignChunk.of(case), case.design_size)):
        runs.append(
            score(
                "design", k, run_all_draws(simulation, runner, parameters), parameters, targets, objectives, case.seed
            )
        )
    history, k = History(runs), 0
    report(history)
    while not (decision := decide(history, list(targets), case.stop, case.objective)).ended:
        trainings = train_all(history, train, objectives)
        proposals = propose_all(trainings, objectives, history, proposal, k, case.stop)
        history = History([*history.runs, verify(proposals, targets, runner, simulation, history, k)])
        report(history)
        k += 1
    return history, decision
