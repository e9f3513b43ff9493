"""The steps of the loop on every calibrated material: train, propose, verify."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from multiprocessing import get_context
from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from radcal.calibration.history import History, Kind, PassScore, Proposal, Run, Score
from radcal.calibration.noise import noise_variance
from radcal.calibration.objectives import OBJECTIVES, Comparison, make_objectives
from radcal.calibration.search import Search
from radcal.calibration.stopping import decide
from radcal.calibration.surrogate import Surrogate, Training, train_surrogate
from radcal.config import CommandSimulation, Material, SimulatorConfig, Stop, stages
from radcal.radar.texture import equal_texture, texture_db, texture_order
from radcal.running.jobs import die_with_parent
from radcal.seeds import derived_rng, derived_seed, draw_seeds, noise_seed
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
    "run_all_draws",
    "score",
    "score_reference",
    "train_all",
    "verify",
    "with_texture",
]

logger = logging.getLogger(__name__)

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
    records = [run_all_draws(case, runner, parameters, image=True)]
    if isinstance(case.simulator, CommandSimulation) and case.simulator.deterministic is None:
        again = [one.run(parameters, seed, repeat=True) for one in (runner, *runner.further)]
        records.append(replace(again[0], further=tuple(again[1:])))
    return records


def run_all_draws(case: stages.Simulation, runner: Runner, parameters: Parameters, image: bool = False) -> Record:
    """Record of a run in all passes, with its further draws of speckle; only the first draw holds the whole image."""
    first, *others = draw_seeds(case)
    record = runner.run(parameters, first, image=image)
    further = tuple(run_all_draws(case, one, parameters, image) for one in runner.further)
    return replace(record, draws=tuple(runner.run(parameters, seed) for seed in others), further=further)


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
    objectives = make_objectives(case, targets)
    runs = [
        score("reference", k, record, start, targets, objectives, case.seed, other_law=others)
        for k, record in enumerate(records)
    ]
    sampling = {name: target.rms_sampling for name, target in targets.items()}
    if targets.further:
        each = {name: [one[name].rms_sampling for one in targets.passes if name in one] for name in targets}
        sampling = {name: float(np.sqrt(np.mean(np.square(found)))) for name, found in each.items()}
    runs[0] = replace(runs[0], rms_sampling=sampling)
    for k, record in enumerate(records[1:], start=1):
        difference = records[0].largest_difference_db(record)
        runs[k] = replace(runs[k], repeat_db=difference)
        if difference > 0:
            runs[k] = replace(runs[k], repeat_variance=_repeat_variance(case, records[0], record, targets, objectives))
    return runs


def _repeat_variance(
    case: stages.Scores, first: Record, again: Record, targets: Targets, objectives: Mapping[str, Comparison]
) -> dict[str, list[list[float]]]:
    found: dict[str, list[NDArray[np.float64]]] = {name: [] for name in targets}
    for number, one in enumerate(targets.passes):
        records = [record.passes[number].pixels_db for record in (first, again)]
        pair = [(pixels_db, one.levels.simulated(pixels_db)) for pixels_db in records]
        for name, target in one.items():
            values = [one.levels.apply(pixels_db[name][target.order], mapping) for pixels_db, mapping in pair]
            objective = objectives[name].passes[number]
            assert objective is not None  # noqa: S101
            rng = derived_rng(case.seed, "repeat", name)
            found[name].append(noise_variance(values[0], values[1], objective.statistics, rng, target.effective))
    return {name: np.concatenate(each).tolist() for name, each in found.items()}


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


def _each(work: Sequence[Callable[[], _Result]], processes: int) -> list[_Result]:
    """Results of independent calls; they do not depend on the number of processes."""
    if min(processes, len(work)) <= 1:
        return [call() for call in work]
    _WORK[:] = work  # forked processes see it: objectives hold functions, which cannot be sent
    with ProcessPoolExecutor(
        min(processes, len(work)), mp_context=get_context("fork"), initializer=die_with_parent
    ) as pool:
        return list(pool.map(_call, range(len(work))))


_WORK: list[Callable[[], Any]] = []


def _call(number: int) -> Any:
    with threadpool_limits(1):
        return _WORK[number]()


def score(
    kind: Kind,
    index: int,
    record: Record,
    parameters: Parameters,
    targets: Targets,
    objectives: Mapping[str, Comparison],
    seed: int,
    other_law: Sequence[str] = (),
) -> Run:
    """Score a record against the targets.

    Parameters
    ----------
    kind, index
        As in :class:`radcal.calibration.history.Run`.
    record : Record
        The run with its draws of speckle, whose statistics are averaged.
    parameters : mapping
        X by material.
    targets : Targets
        By calibrated material.
    objectives : mapping
        Objective by material.
    seed : int
        Seed of the case, from which that of the texture derives.
    other_law : sequence of str
        Materials to which the run gave another law than the one that is calibrated.
    """
    draws = [
        [(draw.pixels_db, one.levels.simulated(draw.pixels_db)) for draw in (run, *run.draws)]
        for run, one in zip(record.passes, targets.passes, strict=True)
    ]
    found = {}
    for name, objective in objectives.items():
        statistics = _statistics(name, objective, targets, draws)
        looks, cost = objective.material.looks, None
        if name not in other_law:
            looks, cost = objective.worth(parameters[name], statistics)
        found[name] = statistics, looks, cost
    densities = [
        _densities(number, run.pixels_db, one, objectives, {name: looks for name, (_, looks, _) in found.items()}, seed)
        for number, (run, one) in enumerate(zip(record.passes, targets.passes, strict=True))
    ]
    scores = {}
    for name, (statistics, looks, cost) in found.items():
        dp, rms = densities[0][name]
        others = [each.get(name) for each in densities[1:]]
        every = [rms, *(other[1] for other in others if other is not None)]
        if cost is None:
            cost = float(objectives[name].together(np.array(every))) if len(every) > 1 else rms
        scores[name] = Score(
            parameters=[float(x) for x in parameters[name]],
            dp=[float(v) for v in dp],
            rms=rms,
            statistics=statistics.tolist(),
            looks=looks,
            cost=cost,
            own_law=name not in other_law,
            further=[None if one is None else PassScore([float(v) for v in one[0]], one[1]) for one in others],
        )
    return Run(
        kind=kind,
        index=index,
        key=record.key,
        seconds=sum(draw.seconds for run in record.passes for draw in (run, *run.draws)),
        scores=scores,
        further_keys=[run.key for run in record.further],
    )


_Values = Sequence[tuple[Mapping[str, NDArray[np.float32]], tuple[float, float]]]


def _statistics(name: str, objective: Comparison, targets: Targets, draws: Sequence[_Values]) -> NDArray[np.float64]:
    """Statistics of a material, averaged over the draws of speckle, one pass after the other, shape (n, 3)."""
    found = []
    for one, target, values in zip(objective.passes, targets.passes, draws, strict=True):
        if one is not None:
            order = target[name].order
            each = [one.statistics(target.levels.apply(db[name][order], mapping)) for db, mapping in values]
            found.append(np.mean(each, axis=0))
    return np.concatenate(found)


def _densities(
    number: int,
    pixels_db: Mapping[str, NDArray[np.float32]],
    targets: Targets,
    objectives: Mapping[str, Comparison],
    looks: Mapping[str, float],
    seed: int,
) -> dict[str, tuple[NDArray[np.float64], float]]:
    """Density of every material in one pass of a run, and its rms difference from the target's [1/dB]."""
    textured = dict(pixels_db)
    for name, objective in objectives.items():
        if name in targets:
            textured[name] = with_texture(pixels_db[name], objective, looks[name], seed, number=number)
    return targets.score(textured)


def with_texture(
    pixels_db: NDArray[np.float32],
    objective: Comparison,
    looks: float,
    seed: int,
    fresh: bool = False,
    number: int = 0,
) -> NDArray[np.float32]:
    """Pixels of a material in a run with the texture that makes the speckle's looks the material's.

    Parameters
    ----------
    pixels_db : ndarray
        All visible pixels of the material [dB].
    objective : Comparison
        The material's.
    looks : float
        Effective looks of the material in the first pass; texture only lowers those of the speckle.
    seed : int
        Seed of the case.
    fresh : bool
        Other random numbers, for the final check.
    number : int
        Number of the pass, from 0.

    Returns
    -------
    ndarray of float32
        The same random numbers for every run: the texture is a smooth function of the looks.
    """
    one = objective.passes[number]
    assert one is not None  # noqa: S101
    sensor = one.material.looks
    order = texture_order(sensor, equal_texture(objective.material.looks, looks, sensor))
    if not np.isfinite(order):
        return pixels_db
    rng = np.random.default_rng([derived_seed(seed, "texture", objective.material.name), int(fresh)])
    return (pixels_db + texture_db(rng.random(pixels_db.shape), order)).astype(np.float32)


def train_all(
    history: History, case: stages.Train, objectives: Mapping[str, Comparison], processes: int = 1
) -> dict[str, Training]:
    """Train the surrogates of all calibrated materials.

    Parameters
    ----------
    history : History
        Runs so far.
    case : stages.Train
        Settings of the training.
    objectives : mapping
        Objective by material.
    processes : int
        Materials trained at the same time.

    Returns
    -------
    dict
        Data and hyper-parameters by material.
    """
    noisy = _noisy(history, case.simulator)
    work = [
        partial(
            train_surrogate, objective, *history.training(name), case.surrogate, history.noise_variance(name), noisy
        )
        for name, objective in objectives.items()
    ]
    return dict(zip(objectives, _each(work, processes), strict=True))


def propose_all(
    trainings: Mapping[str, Training],
    objectives: Mapping[str, Comparison],
    history: History,
    case: stages.Propose,
    iteration: int,
    stop: Stop,
    processes: int = 1,
) -> dict[str, Proposal]:
    """Propose the next X of every material that has not ended; the others repeat their best.

    Parameters
    ----------
    trainings, objectives : mapping
        By material.
    history : History
        Runs so far.
    case : stages.Propose
        Seed, and settings of the search.
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
    verdicts = decide(history, list(objectives), stop, case.objective).materials
    going = [name for name in objectives if verdicts[name].reason is None]
    best = {name: history.best(name).scores[name] for name in objectives}
    work = [
        partial(
            Search(objectives[name], Surrogate(trainings[name], objectives[name])).propose,
            case.optimiser,
            derived_seed(case.seed, "propose", name, iteration),
            best[name],
            history.failures(name),
        )
        for name in going
    ]
    found = dict(zip(going, _each(work, processes), strict=True))
    for name, proposal in found.items():
        logger.info("%s: %s", name, proposal)
    return {name: found.get(name) or Proposal(list(best[name].parameters), "ended") for name in objectives}


def verify(
    proposals: Mapping[str, Proposal],
    targets: Targets,
    runner: Runner,
    case: stages.Verify,
    history: History,
    iteration: int,
    processes: int = 1,
) -> Run:
    """Simulate the proposals in one run, score it, and ask the surrogate of all runs what it still promises.

    Parameters
    ----------
    proposals : mapping
        Proposal by material.
    targets : Targets
        By calibrated material.
    runner : Runner
        The simulator behind the run store.
    case : stages.Verify
        Laws, objective, seed and surrogate.
    history : History
        Runs so far.
    iteration : int
        Number of the iteration.
    processes : int
        Materials looked at at the same time.

    Returns
    -------
    Run
    """
    objectives = make_objectives(case, targets)
    parameters = all_parameters(case.materials, {name: proposal.parameters for name, proposal in proposals.items()})
    record = run_all_draws(case, runner, parameters)
    run = score("infill", iteration, record, parameters, targets, objectives, case.seed)
    run = replace(run, proposals=dict(proposals))
    ahead = [name for name, objective in objectives.items() if objective.looks_ahead]
    if not ahead:
        return run
    history = History([*history.runs, run])
    noisy = _noisy(history, case.simulator)

    def outlook(name: str) -> Score:
        variance = history.noise_variance(name)
        training = train_surrogate(objectives[name], *history.training(name), case.surrogate, variance, noisy)
        search = Search(objectives[name], Surrogate(training, objectives[name]))
        seed = derived_seed(case.seed, "outlook", name, iteration)
        gain, floor, moved_db = search.outlook(history.best(name).scores[name], seed)
        return replace(run.scores[name], gain=gain, floor=floor, moved_db=moved_db)

    found = dict(zip(ahead, _each([partial(outlook, name) for name in ahead], processes), strict=True))
    return replace(run, scores={**run.scores, **found})


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


def progress_line(history: History, materials: Sequence[str], stop: Stop, objective: str) -> str:
    """Runs used, and how the materials stand, in one line."""
    runs = history.count("design") + history.count("infill")
    verdicts = decide(history, materials, stop, objective).materials
    ended = [name for name in materials if verdicts[name].reason in ("rms", "settled")]
    text = OBJECTIVES[objective].progress_line(history, materials, ended, stop)
    return f"run {runs:>3} (iteration {history.count('infill')}): {text}"
