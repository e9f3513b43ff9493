"""Steps of the calibration loop for all calibrated materials: train surrogates, propose X, verify the proposals."""

from __future__ import annotations

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from types import MappingProxyType

from radcal.calibration.scoring import scatter, score
from radcal.calibration.stopping import decide, runs_left
from radcal.config import Material, Stop
from radcal.config.part import Part
from radcal.errors import SimulatorError
from radcal.findings import Finding
from radcal.objectives import Comparison
from radcal.objectives.base import MET
from radcal.objectives.history import History, Proposal, Run
from radcal.processes import each
from radcal.proposals.search import Search
from radcal.proposals.surrogate import Surrogate, Training, train_surrogate
from radcal.sections.simulator import SimulatorConfig
from radcal.seeds import derived_seed, draw_seeds, noise_seed
from radcal.simulators.runner import Runner
from radcal.storage.runs import Parameters, Record
from radcal.targets.target import Targets
from radcal.words import sentence

logger = logging.getLogger(__name__)


@contextmanager
def called(run: str) -> Iterator[None]:
    """Context in which a failure of the simulator begins with the name of the run, such as design run 3 of 12."""
    try:
        yield
    except SimulatorError as error:
        raise SimulatorError(f"{run}: {error}", error.about) from None


def reference_runs(case: Part, runners: Sequence[Runner]) -> list[list[Record]]:
    """Make the reference run, and repeat it if it is unknown whether the simulator is deterministic.

    Parameters
    ----------
    case : Part
        Starting parameters, seed and simulator.
    runners : sequence of Runner
        Simulator of each pass with the run store, made for ``case.at_start``, because starting parameters may belong to
        other laws.

    Returns
    -------
    list of list of Record
        Records of the reference run in all passes, with whole images, and, for an external simulator, those of the
        repetition. There is no repetition if the configuration declares whether the simulator is deterministic.

    Raises
    ------
    SimulatorError
        A run failed, or further speckle draws equal the first one.
    """
    parameters, seed = case.start_parameters, noise_seed(case)
    with called("reference run"):
        runs = [run_all_draws(case, runners, parameters, image=True)]
        if any(not one.largest_difference_db(draw) for one in runs[0] for draw in one.draws):
            raise SimulatorError(
                f"simulator.draws is {case.simulator.draws}, but speckle draws with other seeds are equal, expected "
                "draws that differ, or simulator.draws: 1."
            )
    if case.simulator.deterministic is None:
        with called("second reference run"):
            runs.append([one.run(parameters, seed, repeat=True) for one in runners])
    return runs


def run_all_draws(case: Part, runners: Sequence[Runner], parameters: Parameters, image: bool = False) -> list[Record]:
    """Records of a run in all passes, with all draws of speckle; ``image`` keeps the whole image of the first draw."""
    first, *others = draw_seeds(case)
    return [
        replace(one.run(parameters, first, image=image), draws=tuple(one.run(parameters, seed) for seed in others))
        for one in runners
    ]


def repeatability(simulator: SimulatorConfig, differences_db: Sequence[float]) -> list[Finding]:
    """Whether runs of equal parameters are equal; the surrogate smooths over runs that are not.

    Parameters
    ----------
    simulator : SimulatorConfig
        Section ``simulator`` of the configuration.
    differences_db : sequence of float
        Largest difference of a pixel between each repeated reference run and the first one [dB].

    Returns
    -------
    list of Finding
        Empty if no reference run was repeated and the simulator is not declared as non-deterministic.
    """
    if simulator.deterministic is False:
        return [Finding("declared_random", "note", "simulator")]
    if not differences_db:
        return []
    if max(differences_db) == 0:
        return [Finding("repeats", "note", "simulator")]
    return [Finding("does_not_repeat", "note", "simulator", {"largest_db": max(differences_db)})]


def not_fresh(simulator: SimulatorConfig, final: Sequence[Record]) -> list[Finding]:
    """Finding that the final run with another seed repeats the same pixels, bit for bit; empty if they differ.

    A final run with repeated pixels cannot check the calibration.

    Parameters
    ----------
    simulator : SimulatorConfig
        Section ``simulator`` of the configuration.
    final : sequence of two Record
        Final runs of the calibrated laws, the first with common and the second with fresh random numbers.
    """
    if final[0].largest_difference_db(final[1]) > 0:
        return []
    return [Finding("seedless" if simulator.seedless else "seed_without_effect", "note", "simulator")]


def random_findings(case: Part, history: History, names: Iterable[str], final: Sequence[Record]) -> list[Finding]:
    """Findings on the simulator's random numbers, from the runs of the search and the two final runs."""
    found = repeatability(case.simulator, history.repeat_db)
    if (case.surrogate.outputs, case.surrogate.training) == ("centred", "posterior"):
        known = {name: history.noise_variance(name) for name in names}
        found += [scatter(name, variance) for name, variance in known.items() if variance is not None]
    return [*found, *not_fresh(case.simulator, final)]


def _noisy(history: History, simulator: SimulatorConfig) -> bool:
    """Whether runs of equal parameters differ, as the configuration declares or a repeated reference run shows."""
    declared = simulator.deterministic
    return any(history.repeat_db) if declared is None else not declared


def all_parameters(materials: Mapping[str, Material], calibrated: Parameters) -> dict[str, list[float]]:
    """Parameters of all materials: the given ones of calibrated materials, the configured ones of the others."""
    return {name: list(calibrated.get(name, material.start_parameters)) for name, material in materials.items()}


def proposed(case: Part, proposals: Mapping[str, Proposal]) -> dict[str, list[float]]:
    """Parameters of all materials in the run that verifies the proposals of the calibrated ones."""
    return all_parameters(case.materials, {name: proposal.parameters for name, proposal in proposals.items()})


def _trained(name: str, objective: Comparison, history: History, case: Part) -> Training:
    """Training of one material's surrogate by all runs so far."""
    noisy = _noisy(history, case.simulator)
    return train_surrogate(objective, *history.training(name), case.surrogate, history.noise_variance(name), noisy)


def train_all(
    history: History,
    case: Part,
    objectives: Mapping[str, Comparison],
    processes: int = 1,
    trained: Mapping[str, Training] = MappingProxyType({}),
) -> dict[str, Training]:
    """Train the surrogates of all calibrated materials by all runs so far.

    Parameters
    ----------
    history : History
        Runs so far.
    case : Part
        Settings of the training.
    objectives : mapping
        Objective by material.
    processes : int
        Number of materials that are trained at the same time.
    trained : mapping
        Trainings by the same runs that :func:`verify` has already made, by material.

    Returns
    -------
    dict
        Data and hyper-parameters of the surrogate by material.
    """
    left = {name: objective for name, objective in objectives.items() if name not in trained}
    made = each({name: partial(_trained, name, one, history, case) for name, one in left.items()}, processes)
    found = {name: made[name] if name in made else trained[name] for name in objectives}
    for name, training in found.items():
        level = logging.WARNING if "failed" in training.status else logging.INFO
        logger.log(level, "%s: %s", name, training.sentence())
    return found


def propose_all(
    trainings: Mapping[str, Training],
    objectives: Mapping[str, Comparison],
    history: History,
    case: Part,
    iteration: int,
    stop: Stop,
    processes: int = 1,
) -> list[dict[str, Proposal]]:
    """Propose the next X of every material whose search goes on; other materials repeat their best X.

    Parameters
    ----------
    trainings, objectives : mapping
        Training of the surrogate, and objective, by material.
    history : History
        Runs so far.
    case : Part
        Seed, and settings of the search.
    iteration : int
        Number of the iteration.
    stop : Stop
        Stop settings, which decide for which materials the search has ended.
    processes : int
        Number of materials that are searched at the same time.

    Returns
    -------
    list of dict
        Proposal by material for each run of the iteration: ``infill.batch`` runs, fewer if the stop settings admit
        fewer, or if no search finds as many different X.
    """
    verdicts = decide(history, list(objectives), stop, case.objective).materials
    best = {name: history.best(name) for name in objectives}
    count = max(min(case.infill.batch, runs_left(history, stop)), 1)
    work = {
        name: partial(
            Search(objective, Surrogate(trainings[name], objective)).batch,
            count,
            case.optimiser,
            derived_seed(case.seed, "propose", name, iteration),
            best[name],
            history.failures(name),
        )
        for name, objective in objectives.items()
        if verdicts[name].reason is None
    }
    found = each(work, processes)
    for name, proposals in found.items():
        for proposal in proposals:
            logger.info("%s: %s", name, proposal)
    ended = {name: Proposal(list(best[name].parameters), "ended") for name in objectives}
    runs = max(map(len, found.values()), default=1)
    return [{name: [*found.get(name, ()), *[ended[name]] * runs][j] for name in objectives} for j in range(runs)]


def verify(
    proposals: Sequence[Mapping[str, Proposal]],
    targets: Sequence[Targets],
    objectives: Mapping[str, Comparison],
    runners: Sequence[Runner],
    case: Part,
    history: History,
    iteration: int,
    processes: int = 1,
) -> tuple[list[Run], dict[str, Training]]:
    """Simulate the proposals, score their runs, and predict the improvement that further runs may bring.

    The prediction comes from surrogates that are trained on all runs, including the new ones.

    Parameters
    ----------
    proposals : sequence of mapping
        Proposal by material, for each run of the iteration.
    targets : sequence of Targets
        Targets of the calibrated materials in each pass.
    objectives : mapping
        Objective by calibrated material.
    runners : sequence of Runner
        Simulator of each pass with the run store.
    case : Part
        Materials, seed and surrogate.
    history : History
        Runs so far.
    iteration : int
        Number of the iteration.
    processes : int
        Number of materials that are treated at the same time.

    Returns
    -------
    runs : list of Run
        Scored runs, all with the prediction.
    trained : dict
        Surrogates of the prediction by material, which the next iteration also needs (:func:`train_all`); without the
        materials whose search has no prediction.
    """
    runs = []
    for number, one in enumerate(proposals, start=history.count("infill") + 1):
        parameters = proposed(case, one)
        with called(f"infill run {number}"):
            records = run_all_draws(case, runners, parameters)
        run = score("infill", iteration, records, parameters, targets, objectives, case.seed)
        runs.append(replace(run, proposals=dict(one)))
    ahead = [name for name, objective in objectives.items() if objective.looks_ahead]
    history = History([*history.runs, *runs])

    def outlook(name: str) -> tuple[tuple[float, float | None, float | None], Training]:
        objective = objectives[name]
        training = _trained(name, objective, history, case)
        search = Search(objective, Surrogate(training, objective))
        seed = derived_seed(case.seed, "outlook", name, iteration)
        return search.outlook(history.best(name), seed), training

    found = each({name: partial(outlook, name) for name in ahead}, processes)
    for j, run in enumerate(runs):
        seen = {
            name: replace(run.scores[name], gain=gain, floor=floor, moved_db=moved_db)
            for name, ((gain, floor, moved_db), _) in found.items()
        }
        runs[j] = replace(run, scores={**run.scores, **seen})
    return runs, {name: training for name, (_, training) in found.items()}


def design_line(number: int, size: int, record: Record, targets: Targets) -> str:
    """Line of the log on one run of the design.

    Parameters
    ----------
    number, size : int
        Number of the run, from 1, and number of runs in the design.
    record : Record
        Record of the run.
    targets : mapping
        Target by calibrated material.

    Returns
    -------
    str
        Line with the wall time of the run [s] and the rms; for several materials, the smallest and the largest rms.
    """
    rms = {name: value for name, (_, value) in targets.score(record.pixels_db).items()}
    if len(rms) == 1:
        text = f"{next(iter(rms.values())):.2e}"
    else:
        low, high = (pick(rms, key=lambda name: rms[name]) for pick in (min, max))
        text = f"{rms[low]:.2e} ({low}) to {rms[high]:.2e} ({high})"
    unit = targets.levels.unit
    return (
        f"design run {number} of {size}: {record.draws_s:.1f} s; simulated and measured density differ by {text} per "
        f"{unit} (rms)"
    )


def progress_line(history: History, materials: Sequence[str], stop: Stop, objective: str) -> str:
    """Line of the log on the number of runs so far, and on the law that is farthest from the stop criterion."""
    runs = history.count("design") + history.count("infill")
    states = decide(history, materials, stop, objective).materials.values()
    left = [state.finding for state in states if state.reason not in MET]
    met = len(materials) - len(left)
    text = f"{met} of {len(materials)} laws {'meets' if met == 1 else 'meet'} the stop criterion"
    if left:
        farthest = max(left, key=lambda one: max(float(one.numbers.get(key, 0.0)) for key in ("moved_db", "rms")))
        text += f"; {sentence(farthest).removesuffix('.')}"
    return f"after {runs:>3} run{'s' * (runs != 1)} (iteration {history.iterations}): {text}"
