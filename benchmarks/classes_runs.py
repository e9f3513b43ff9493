"""Number of runs until the stop criterion of ``objective: classes`` is met, and the cost that the stop leaves.

    python benchmarks/classes_runs.py [--quick] [--design 0] [--first 0] [--other 24] [--workflow 5] [--cases FOLDER]

Hidden X of the published dyke are drawn uniformly in the bounds; each measured image has its own speckle. The first
table is for the search without a design (or with one, ``--design 2``): its runs, its law error and its cost (half the
sum of squared residuals) at the stop, and the lowest cost of its runs after three more runs.

The second table is for another surrogate, whose length scales the library smt estimates, and which starts with a design
of 2, because smt needs two points. This search also goes on for three runs after its stop. The gap is the cost at the
stop of the first search minus the lowest cost of all runs of both searches. All runs have the same speckle, and the
lowest cost is the luckiest of some 15 runs with it. ``other speckle`` is the same gap between the same two X, averaged
over other draws of the runs' speckle, five times as many as a run has. A case file with bins refuses smt, which is
compared here only.

``--first 24`` takes the next 24 hidden X. The first hidden X of a table (``--workflow``) are also calibrated by the
workflow, from the same case file, whose results lie in results/<case> of this project. ``--cases`` keeps the case
files, for ``snakemake --configfile``.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from dyke_cases import Bench, hidden_laws, workflow_runs

from radcal.calibration.loop import calibrate
from radcal.calibration.scoring import score
from radcal.calibration.steps import all_parameters, run_all_draws, train_all
from radcal.calibration.stopping import decide
from radcal.config import Case, SurrogateConfig, load
from radcal.config.stages import STAGES
from radcal.objectives import make_objectives
from radcal.objectives.history import History, Score
from radcal.processes import one_thread
from radcal.proposals.search import Search
from radcal.proposals.surrogate import Surrogate
from radcal.seeds import derived_seed
from radcal.simulators.runner import Runner
from radcal.targets.target import Targets

COUNT = 24
MORE = 3  # runs after the stop
OTHERS = 5  # runs with other speckle


def main() -> None:
    """Print two tables with a line per hidden X and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="2 hidden X in place of 24")
    parser.add_argument("--design", type=int, default=0, help="runs of the design of the first search")
    parser.add_argument("--first", type=int, default=0, help="number of the first hidden X")
    parser.add_argument("--other", type=int, default=COUNT, help="number of hidden X for the other surrogate")
    parser.add_argument("--workflow", type=int, default=0, help="number of hidden X that the workflow calibrates, too")
    parser.add_argument("--cases", type=Path, help="folder for the case files; by default a temporary one")
    arguments = parser.parse_args()
    first, count = arguments.first, 2 if arguments.quick else COUNT
    truths = hidden_laws(first + count)[first:].tolist()
    with tempfile.TemporaryDirectory() as folder, one_thread():
        cases = arguments.cases or Path(folder)
        cases.mkdir(parents=True, exist_ok=True)
        bench = Bench(cases)
        paths = [
            bench.speckled(f"classes_{number}", truth, 100 + number, {"design": {"size": arguments.design}})
            for number, truth in enumerate(truths, start=first)
        ]
        rows = []
        print(f"{'hidden X':30} {'ended':8} {'runs':>4} {'law error':>9} {'cost':>7} {'3 more':>7} {'workflow':>8}")
        for number, (path, truth) in enumerate(zip(paths, truths, strict=True)):
            row = searched(bench, load([path]), truth)
            row["workflow"] = workflow_runs(path) if number < arguments.workflow else None
            print(
                f"{np.round(truth, 1)!s:30} {row['ended']:8} {row['runs']:4d} {row['law_error_db']:6.2f} dB "
                f"{row['stop'].cost:7.3f} {row['further'].cost:7.3f} {row['workflow'] or '':>8}",
                flush=True,
            )
            rows.append(row)
        print(f"{'hidden X':30} {'smt runs':>8} {'lowest':>7} {'gap':>6} {'other speckle':>13}")
        for path, truth, row in list(zip(paths, truths, rows, strict=True))[: arguments.other]:
            case = load([path])
            row |= searched_by_smt(bench, case)
            best = min((row[name] for name in ("stop", "further", "smt")), key=lambda score: score.cost)
            row["gap"] = row["stop"].cost - best.cost
            row["gap_other"] = gap_with_other_speckle(bench, case, row["stop"], best)
            print(
                f"{np.round(truth, 1)!s:30} {row['smt_runs']:8d} {row['smt'].cost:7.3f} {row['gap']:6.3f} "
                f"{row['gap_other']:13.3f}",
                flush=True,
            )
    print(json.dumps(summary(rows)))


def searched(bench: Bench, case: Case, truth: list[float]) -> dict[str, Any]:
    """Runs, law error [dB] and best score at the stop, and the best score after three more runs."""
    with tempfile.TemporaryDirectory() as folder:
        runner = bench.runner(case, Path(folder))
        targets = bench.targets(case, runner)
        history, decision = calibrate(case, [runner], [targets])
        best, seen = history.best("dyke"), targets["dyke"].incidence_deg
        return {
            "ended": decision.reason,
            "runs": history.count("design") + history.count("infill"),
            "law_error_db": case.laws["dyke"].largest_difference_db(best.parameters, truth, seen),
            "stop": best,
            "further": lowest(continued(case, runner, targets, history)),
        }


def searched_by_smt(bench: Bench, case: Case) -> dict[str, Any]:
    """Design and infill runs, and best score, of the search with the length scales of smt, to three after its stop."""
    other = case.model_copy(
        update={
            "surrogate": SurrogateConfig(training="smt"),
            "design": case.design.model_copy(update={"size": 2}),
            "stop": case.stop.model_copy(update={"max_runs": 2}),
        }
    )
    with tempfile.TemporaryDirectory() as folder:
        runner = bench.runner(case, Path(folder))
        targets = bench.targets(case, runner)
        history, _ = calibrate(other, [runner], [targets])  # the design alone
        history = continued(other.model_copy(update={"stop": case.stop}), runner, targets, history)
    return {"smt_runs": history.count("design") + history.count("infill") - MORE, "smt": lowest(history)}


def continued(case: Case, runner: Runner, targets: Targets, history: History) -> History:
    """History with further runs up to the stop of the search, and with three more runs.

    The steps are those of the calibration loop, but each surrogate is trained once: smt needs seconds for it.
    """
    settings, objectives = STAGES["verify"].of(case), make_objectives(STAGES["scores"].of(case), [targets])
    objective, more = objectives["dyke"], MORE

    def search() -> Search:
        return Search(objective, Surrogate(train_all(history, STAGES["train"].of(case), objectives)["dyke"], objective))

    now = search()
    while not (ended := decide(history, ["dyke"], case.stop, case.objective).ended) or more:
        more -= ended
        k, best = history.count("infill"), history.best("dyke")
        seed = derived_seed(case.seed, "propose", "dyke", k)
        proposal = now.propose(case.optimiser, seed, best, history.failures("dyke"))
        parameters = all_parameters(case.materials, {"dyke": proposal.parameters})
        records = run_all_draws(settings, [runner], parameters)
        run = score("infill", k, records, parameters, [targets], objectives, case.seed)
        run = replace(run, proposals={"dyke": proposal})
        history = History([*history.runs, run])
        now = search()
        if not ended:
            seed = derived_seed(case.seed, "outlook", "dyke", k)
            gain, floor, moved_db = now.outlook(history.best("dyke"), seed)
            found = replace(run.scores["dyke"], gain=gain, floor=floor, moved_db=moved_db)
            history = History([*history.runs[:-1], replace(run, scores={"dyke": found})])
    return history


def lowest(history: History) -> Score:
    """Score of the run with the smallest cost."""
    return history.best("dyke")


def gap_with_other_speckle(bench: Bench, case: Case, stop: Score, best: Score) -> float:
    """Difference in cost between the X of two runs, averaged over draws of speckle that neither search has seen."""
    each = case.simulator.draws
    simulator = case.simulator.model_copy(update={"draws": each * (1 + OTHERS)})
    settings = STAGES["reference_run"].of(case.model_copy(update={"simulator": simulator}))
    with tempfile.TemporaryDirectory() as folder:
        runner = bench.runner(case, Path(folder))
        targets = bench.targets(case, runner)
        objectives = make_objectives(STAGES["scores"].of(case), [targets])

        def mean_cost(found: Score) -> float:
            parameters = all_parameters(case.materials, {"dyke": found.parameters})
            draws = run_all_draws(settings, [runner], parameters)[0].draws[each - 1 :]
            others = [replace(draws[k], draws=draws[k + 1 : k + each]) for k in range(0, len(draws), each)]
            runs = [score("infill", 0, [one], parameters, [targets], objectives, case.seed) for one in others]
            return float(np.mean([run.scores["dyke"].cost for run in runs]))

        return 0.0 if stop.parameters == best.parameters else mean_cost(stop) - mean_cost(best)


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """Medians and worst values over the hidden X, and counts of the gaps."""
    runs = [row["runs"] for row in rows]
    errors = [row["law_error_db"] for row in rows]
    alone = [row["stop"].cost - min(row["stop"].cost, row["further"].cost) for row in rows]
    both, other = ([row[name] for row in rows if name in row] for name in ("gap", "gap_other"))
    again = [row["workflow"] == row["runs"] for row in rows if row["workflow"] is not None]
    return {
        "n": len(rows),
        "settled": sum(row["ended"] == "settled" for row in rows),
        "median": float(np.median(runs)),
        "worst": max(runs),
        "law_error_db": {
            "median": float(np.median(errors)),
            "rms": float(np.sqrt(np.mean(np.square(errors)))),
            "worst": max(errors),
        },
        "gap_same_search": gaps(alone),
        "gap_both_searches": gaps(both) if both else None,
        "gap_other_speckle": gaps(other) if other else None,
        "workflow": {"n": len(again), "same": sum(again)},
    }


def gaps(values: list[float]) -> dict[str, Any]:
    """Number of gaps of at most 0.05 and 0.3, and the largest gap."""
    near, far = (sum(value <= limit for value in values) for limit in (0.05, 0.3))
    return {"n": len(values), "within_0.05": near, "within_0.3": far, "worst": max(values)}


if __name__ == "__main__":
    main()
