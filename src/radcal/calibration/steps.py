"""The steps of the loop on every calibrated material: train, propose, verify."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context
from typing import TYPE_CHECKING, TypeVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from radcal.calibration.class_search import ClassSearch, class_searches
from radcal.calibration.class_surrogate import ClassRuns
from radcal.calibration.history import History, Proposal, Run, score
from radcal.calibration.infill import propose
from radcal.calibration.noise import noise_variance
from radcal.calibration.stopping import decide
from radcal.calibration.surrogate import OUTPUTS, Surrogate
from radcal.config import CommandSimulation, Material, Optimiser, SimulatorConfig, Stop, stages
from radcal.running.jobs import die_with_parent
from radcal.seeds import derived_rng, derived_seed, noise_seed
from radcal.simulators.runner import Runner
from radcal.storage.runs import Parameters, Record

if TYPE_CHECKING:
    from radcal.measurement.target import Targets

__all__ = [
    "all_parameters",
    "design_line",
    "noise_seed",
    "not_fresh",
    "progress_line",
    "propose_all",
    "reference_parameters",
    "reference_runs",
    "repeatability",
    "score_reference",
    "train_all",
    "verify",
]

logger = logging.getLogger(__name__)

_Job = TypeVar("_Job")
_Result = TypeVar("_Result")


def reference_parameters(materials: Mapping[str, Material]) -> dict[str, list[float]]:
    """Parameters of the reference run: every material at its start, for the laws of ``Case.at_start``."""
    return {name: material.start_parameters for name, material in materials.items()}


def reference_runs(case: stages.ReferenceRun, runner: Runner) -> list[Record]:
    """The starting parameters simulated, and once more if it must be found out whether that repeats.

    Parameters
    ----------
    case : stages.ReferenceRun
        Starting parameters, seed and simulator.
    runner : Runner
        The simulator behind the run store, of ``case.at_start``: starts may be of other laws.

    Returns
    -------
    list of Record
        One, with the whole image, or two: radcal's own simulator is deterministic, and of another
        it may be declared.
    """
    parameters, seed = reference_parameters(case.materials), noise_seed(case)
    records = [runner.run(parameters, seed, image=True)]
    if isinstance(case.simulator, CommandSimulation) and case.simulator.deterministic is None:
        records.append(runner.run(parameters, seed, repeat=True))
    return records


def score_reference(case: stages.Scores, records: Sequence[Record], targets: Targets) -> list[Run]:
    """Score the reference run and its repetition, with how far their pixels differ.

    Parameters
    ----------
    case : stages.Scores
        Starting parameters, laws and seed.
    records : sequence of Record
        What :func:`reference_runs` gave.
    targets : mapping
        Target by calibrated material.

    Returns
    -------
    list of Run
        As many as records; ``rms_sampling`` is the first's, ``repeat_db`` [dB] that of all others,
        ``repeat_variance`` that of those which differ from the first.
    """
    start, others = reference_parameters(case.materials), case.start_with_another_law
    searches = class_searches(case, targets)
    runs = [
        score("reference", k, record, start, targets, other_law=others, searches=searches)
        for k, record in enumerate(records)
    ]
    runs[0] = replace(runs[0], rms_sampling={name: target.rms_sampling for name, target in targets.items()})
    for k, record in enumerate(records[1:], start=1):
        difference = records[0].largest_difference_db(record)
        runs[k] = replace(runs[k], repeat_db=difference)
        if difference > 0:
            runs[k] = replace(runs[k], repeat_variance=_repeat_variance(case, records[0], record, targets))
    return runs


def _repeat_variance(case: stages.Scores, first: Record, again: Record, targets: Targets) -> dict[str, list[float]]:
    pair = [(record.pixels_db, targets.levels.simulated(record.pixels_db)) for record in (first, again)]
    found = {}
    for name, target in targets.items():
        values = [targets.levels.apply(pixels_db[name][target.order], mapping) for pixels_db, mapping in pair]
        rng = derived_rng(case.seed, "repeat", name)
        variance = noise_variance(values[0], values[1], rng, target.effective, target.penalised)
        found[name] = [float(v) for v in variance]
    return found


def repeatability(simulator: SimulatorConfig, differences_db: Sequence[float]) -> str:
    """Say whether equal parameters give equal runs, and what follows.

    Parameters
    ----------
    simulator : SimulatorConfig
        Section of the configuration.
    differences_db : sequence of float
        Largest difference of each repeated reference run's pixels from the first's [dB].

    Returns
    -------
    str
        A sentence, empty where nothing is to be said.
    """
    smooths = "the surrogate smooths over runs instead of passing through them."
    if isinstance(simulator, CommandSimulation) and simulator.deterministic is False:
        return f"The simulator is declared not to be deterministic: {smooths}"
    if not differences_db:
        return ""
    if max(differences_db) == 0:
        return "The simulator is deterministic: the reference run repeated gives the same pixels."
    return (
        "The simulator is not deterministic: the reference run repeated, with equal parameters and seed, differs by up "
        f"to {max(differences_db):.2g} dB in a pixel; {smooths}"
    )


def not_fresh(simulator: SimulatorConfig, final: Sequence[Record]) -> str:
    """Say so where another seed gives the same pixels, bit for bit: the last run then checks nothing.

    Parameters
    ----------
    simulator : SimulatorConfig
        Section of the configuration.
    final : sequence of two Record
        The calibrated laws with common and with fresh random numbers.

    Returns
    -------
    str
        A sentence, empty where the random numbers of some material are fresh.
    """
    if final[0].largest_difference_db(final[1]) > 0:
        return ""
    if isinstance(simulator, CommandSimulation) and simulator.seedless:
        return "The simulator takes no seed: no run has fresh random numbers, and no rms of any is given."
    return (
        "The final run with another seed gives the same pixels as the one that it repeats, bit for bit: the seed does "
        "not reach the program's random numbers, or there are none (simulator.seedless: true says so). No rms with "
        "fresh random numbers is given."
    )


def _noisy(history: History, simulator: SimulatorConfig) -> bool:
    """Whether equal parameters give unequal runs."""
    declared = simulator.deterministic if isinstance(simulator, CommandSimulation) else True
    return any(history.repeat_db) if declared is None else not declared


def all_parameters(materials: Mapping[str, Material], calibrated: Parameters) -> dict[str, list[float]]:
    """Complete the calibrated materials' parameters with the fixed ones."""
    return {**reference_parameters(materials), **{name: list(x) for name, x in calibrated.items()}}


def _train(job: tuple[Surrogate, NDArray[np.float64] | None, bool]) -> Surrogate:
    surrogate, start, retry = job
    with threadpool_limits(1):
        return surrogate.train(start, retry=retry)


def _propose(job: tuple[Surrogate, NDArray[np.float64], Optimiser, int, NDArray[np.float64], float, int]) -> Proposal:
    with threadpool_limits(1):
        return propose(*job)


def _propose_law(job: tuple[ClassSearch, ClassRuns, Optimiser, int, tuple[list[float], float]]) -> Proposal:
    search, runs, config, seed, best = job
    with threadpool_limits(1):
        fit = search.propose(search.surrogate(runs.parameters, runs.cumulants), config, seed, [best])
    return Proposal([float(v) for v in fit.parameters], "exploit", looks=fit.looks, predicted_cost=fit.cost)


def _each(function: Callable[[_Job], _Result], jobs: Sequence[_Job], processes: int) -> list[_Result]:
    """Apply a function to independent jobs; the result does not depend on the number of processes."""
    if min(processes, len(jobs)) <= 1:
        return [function(job) for job in jobs]
    with ProcessPoolExecutor(
        min(processes, len(jobs)), mp_context=get_context("fork"), initializer=die_with_parent
    ) as pool:
        return list(pool.map(function, jobs))


def train_all(
    history: History,
    case: stages.Train,
    iteration: int,
    previous: Mapping[str, Surrogate | ClassRuns] | None,
    processes: int = 1,
) -> dict[str, Surrogate | ClassRuns]:
    """Train the surrogates of all calibrated materials.

    Parameters
    ----------
    history : History
        Runs so far.
    case : stages.Train
        Bounds, and settings of the training.
    iteration : int
        Number of the iteration, from 0.
    previous : mapping, optional
        Surrogates of the last iteration, by material.
    processes : int
        Materials trained at the same time.

    Returns
    -------
    dict
        Surrogate by material; of classes of incidence, the runs that correct law and speckle.
    """
    if history.of_classes:
        return {name: history.class_training(name) for name in case.calibrated}
    warm = case.surrogate.training == "warm" and previous is not None and iteration % case.surrogate.retrain_every
    last = {name: item.theta for name, item in (previous or {}).items() if isinstance(item, Surrogate)}
    jobs = [
        (
            Surrogate(
                case.materials[name].box,
                *history.training(name),
                case.surrogate.outputs,
                noisy=_noisy(history, case.simulator),
                noise_variance=history.noise_variance(name),
                integer=case.materials[name].integers,
            ),
            last.get(name) if warm else None,
            case.surrogate.training == "warm",
        )
        for name in case.calibrated
    ]
    trained = dict(zip(case.calibrated, _each(_train, jobs, processes), strict=True))
    for name, surrogate in trained.items():
        for output, q2, status in zip(OUTPUTS[surrogate.outputs], surrogate.q2, surrogate.status, strict=True):
            level = logging.WARNING if q2 < 0 or status == "failed" else logging.INFO
            logger.log(level, "%s, %s: leave-one-out Q2 %.4f, optimiser %s", name, output, q2, status)
    return dict(trained)


def propose_all(
    surrogates: Mapping[str, Surrogate | ClassRuns],
    targets: Targets,
    history: History,
    case: stages.Propose,
    iteration: int,
    stop: Stop,
    processes: int = 1,
) -> dict[str, Proposal]:
    """Propose the next X of every material that has not ended; the others repeat their best.

    Parameters
    ----------
    surrogates, targets : mapping
        By material.
    history : History
        Runs so far.
    case : stages.Propose
        Laws, bounds, seed, and settings of the search.
    iteration : int
        Number of the iteration.
    stop : Stop
        Decides which materials have ended.
    processes : int
        Materials searched at the same time.

    Returns
    -------
    dict
        Proposal by material.
    """
    verdicts = decide(history, list(targets), stop).materials
    best = {name: history.best(name) for name in targets}
    going = [name for name in targets if verdicts[name].reason is None]
    seeds = {name: derived_seed(case.seed, "propose", name, iteration) for name in going}
    searches = class_searches(case, targets)
    if searches:
        law_jobs = [
            (
                searches[name],
                surrogate,
                case.optimiser,
                seeds[name],
                (best[name].parameters[name], best[name].looks[name]),
            )
            for name in going
            if isinstance(surrogate := surrogates[name], ClassRuns)
        ]
        found = dict(zip(going, _each(_propose_law, law_jobs, processes), strict=True))
    else:
        jobs = [
            (
                surrogate,
                targets[name].dp,
                case.optimiser,
                seeds[name],
                surrogate.unit(best[name].parameters[name]),
                best[name].rms[name],
                history.failures(name),
            )
            for name in going
            if isinstance(surrogate := surrogates[name], Surrogate)
        ]
        found = dict(zip(going, _each(_propose, jobs, processes), strict=True))
    for name, proposal in found.items():
        logger.info("%s: %s", name, proposal)
    return {name: found.get(name) or Proposal(list(best[name].parameters[name]), "ended") for name in targets}


def verify(
    proposals: Mapping[str, Proposal], targets: Targets, runner: Runner, case: stages.Verify, iteration: int
) -> Run:
    """Simulate the proposals in one run and score it."""
    parameters = all_parameters(case.materials, {name: proposal.parameters for name, proposal in proposals.items()})
    record = runner.run(parameters, noise_seed(case))
    return score("infill", iteration, record, parameters, targets, proposals, searches=class_searches(case, targets))


def design_line(number: int, size: int, record: Record, targets: Targets) -> str:
    """One run of the design in one line.

    Parameters
    ----------
    number, size : int
        Which run, from 1, of how many.
    record : Record
        The run.
    targets : mapping
        Target by calibrated material.

    Returns
    -------
    str
        Its wall time [s] and its rms, the smallest and the largest of several materials.
    """
    rms = {name: value for name, (_, value) in targets.score(record.pixels_db).items()}
    if len(rms) == 1:
        text = f"rms {next(iter(rms.values())):.2e}"
    else:
        low, high = (pick(rms, key=lambda name: rms[name]) for pick in (min, max))
        text = f"rms {rms[low]:.2e} ({low}) to {rms[high]:.2e} ({high})"
    return f"design run {number} of {size}: {record.seconds:.1f} s, {text}"


def progress_line(history: History, materials: Sequence[str], stop: Stop) -> str:
    """Runs used, best rms and tolerance in one line."""
    runs = history.count("design") + history.count("infill")
    if history.of_classes:
        verdicts = decide(history, materials, stop).materials
        settled = sum(verdict.reason == "settled" for verdict in verdicts.values())
        last = history.infill[-1]
        worst = max(materials, key=lambda name: last.moved_db[name])
        return (
            f"run {runs:>3} (iteration {len(history.infill)}): {settled} of {len(materials)} laws meet the stop "
            f"criterion, the last run would change that of {worst} by {last.moved_db[worst]:.2g} dB"
        )
    best = {name: history.best(name).rms[name] for name in materials}
    if len(best) == 1:
        text = f"best rms {next(iter(best.values())):.2e}"
    else:
        worst = max(best, key=lambda name: best[name])
        within = sum(value <= stop.rms for value in best.values())
        text = f"{within} of {len(best)} materials within tolerance, worst {worst} at rms {best[worst]:.2e}"
    return f"run {runs:>3} (iteration {history.count('infill')}): {text}, tolerance {stop.rms:.1e}"
