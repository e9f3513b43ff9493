"""Number of runs for a material whose law has no curve, and the cost that the stop leaves.

    python benchmarks/without_curve.py [--quick] [--truths 10] [--free X1,X3]

The dyke of the published case is calibrated as a material of ``law: external`` with two parameters (``--free``) of
``mangia``; the other two keep the values of the published case. The objective is ``classes``, the design has the
default size of 8 runs. Hidden values are drawn uniformly in the bounds; each measured image has its own speckle. The
simulator is the built-in one, called in this process in place of a program, with one draw of speckle, the default for a
program.

The gap is the cost at the stop minus the lowest cost that is known: of all runs of the search, of a run with the hidden
values, and of a dense search by runs of the simulator: 32 Sobol points, then 30 runs of Nelder-Mead from the best run,
from the hidden values and from the best of these points.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from classes_runs import gaps
from dyke_cases import Bench, hidden_laws
from numpy.typing import NDArray
from scipy.optimize import minimize
from scipy.stats import qmc

from radcal.calibration.loop import calibrate
from radcal.calibration.scoring import score
from radcal.calibration.steps import all_parameters, run_all_draws
from radcal.config import Case, load
from radcal.config.stages import STAGES
from radcal.config.yaml_file import read_case_file
from radcal.measurement.sources import make_measurement
from radcal.objectives import make_objectives
from radcal.processes import one_thread
from radcal.simulators.base import Simulator
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore
from radcal.targets.target import Targets

NAMES = ("X1", "X2", "X3", "X4")
FIXED = {"X1": 6.1, "X2": 14.2, "X3": 21.5, "X4": 3.3}
POINTS = 32


class Program:
    """Program that knows the law and the fixed parameters of the dyke.

    Parameters
    ----------
    simulator : Simulator
        Simulator of the published case.
    free : sequence of str
        Names of the parameters that a run gives.
    """

    def __init__(self, simulator: Simulator, free: Sequence[str]) -> None:
        self._simulator, self._free = simulator, free
        self.identity: Mapping[str, Any] = {"kind": "program"}

    def run(self, parameters: Mapping[str, Sequence[float]], noise_seed: int) -> NDArray[np.float32]:
        """Image of a run [dB]."""
        values = {**FIXED, **dict(zip(self._free, parameters["dyke"], strict=True))}
        return self._simulator.run({**parameters, "dyke": [values[name] for name in NAMES]}, noise_seed)


def main() -> None:
    """Print a line per hidden X and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="2 hidden values")
    parser.add_argument("--truths", type=int, default=10, help="number of hidden values")
    parser.add_argument("--free", default="X1,X3", help="names of the two parameters")
    arguments = parser.parse_args()
    free, count = arguments.free.split(","), 2 if arguments.quick else arguments.truths
    rows = []
    heads = f"{'ended':10} {'runs':>4} {'cost':>8} {'hidden':>8} {'lowest':>8} {'gap':>7}"
    print(f"{'hidden ' + arguments.free:20} {heads} found")
    with tempfile.TemporaryDirectory() as folder, one_thread():
        bench = Bench(Path(folder))
        for number, drawn in enumerate(hidden_laws(count)):
            truth = [float(drawn[NAMES.index(name)]) for name in free]
            row = searched(bench, free, number, truth, Path(folder))
            print(
                f"{np.round(truth, 1)!s:20} {row['ended']:10} {row['runs']:4d} {row['cost']:8.3f} {row['hidden']:8.3f} "
                f"{row['lowest']:8.3f} {row['gap']:7.3f} {np.round(row['x'], 2)}",
                flush=True,
            )
            rows.append(row)
    runs = [row["runs"] for row in rows]
    above = sum(row["cost"] > row["hidden"] for row in rows)
    print(
        json.dumps(
            {
                "n": len(rows),
                "settled": sum(row["ended"] == "settled" for row in rows),
                "median": float(np.median(runs)),
                "worst": max(runs),
                "above_hidden": above,
                "gaps": gaps([row["gap"] for row in rows]),
            }
        )
    )


def searched(bench: Bench, free: Sequence[str], number: int, truth: list[float], folder: Path) -> dict[str, Any]:
    """Runs and cost at the stop, cost at the hidden values, and lowest cost of a dense search."""
    case, runner, targets = prepared(bench, free, number, truth, folder)
    history, decision = calibrate(case, [runner], [targets])
    best = history.best("dyke")
    low, high = np.array(case.materials["dyke"].box).T

    objectives, settings = make_objectives(STAGES["scores"].of(case), [targets]), STAGES["verify"].of(case)

    def cost_at(x: NDArray[np.float64]) -> float:
        parameters = all_parameters(case.materials, {"dyke": x.tolist()})
        records = run_all_draws(settings, [runner], parameters)
        return score("infill", 0, records, parameters, [targets], objectives, case.seed).scores["dyke"].cost

    def cost(unit: NDArray[np.float64]) -> float:
        return cost_at(low + np.clip(unit, 0.0, 1.0) * (high - low))

    sample = qmc.Sobol(len(free), seed=number).random(POINTS)
    each = [cost(point) for point in sample]
    starts = [sample[int(np.argmin(each))], *((np.array(x) - low) / (high - low) for x in (best.parameters, truth))]
    options = {"xatol": 1e-3, "fatol": 1e-3, "maxfev": 30}
    local = [float(minimize(cost, start, method="Nelder-Mead", options=options).fun) for start in starts]
    lowest = min(best.cost, *each, *local)
    return {
        "ended": str(decision.reason),
        "runs": history.count("design") + history.count("infill"),
        "x": best.parameters,
        "cost": best.cost,
        "hidden": cost_at(np.array(truth)),
        "lowest": lowest,
        "gap": best.cost - lowest,
    }


def prepared(
    bench: Bench, free: Sequence[str], number: int, truth: list[float], folder: Path
) -> tuple[Case, Runner, Targets]:
    """Case without a curve, its runner and its targets."""
    values = {**FIXED, **dict(zip(free, truth, strict=True))}
    inside = load([bench.speckled(f"image_{number}", [values[name] for name in NAMES], 100 + number, {})])
    simulator, image = BuiltinSimulator(bench.geometry, inside.radar, inside.laws), folder / f"image_{number}.npy"
    np.save(image, make_measurement(STAGES["measurement"].of(inside), bench.geometry, simulator, bench.scene).image_db)
    dyke, rows = inside.materials["dyke"], [NAMES.index(name) for name in free]
    data = read_case_file(folder / f"image_{number}.yaml")
    data["measurement"] = {"source": "file", "path": str(image), "scale": "db", "radiometry": inside.radar.radiometry}
    data["simulator"] = {
        "kind": "command",
        "command": ["true"],
        "input": {"format": "json"},
        "output": {"file": "image.npy", "scale": "db"},
        "deterministic": True,
    }
    data["materials"]["dyke"] = {
        "calibrate": True,
        "law": "external",
        "names": list(free),
        "bounds": [list(dyke.box[k]) for k in rows],
        "start": [dyke.start_parameters[k] for k in rows],
    }
    path = folder / f"case_{number}.yaml"
    path.write_text(yaml.safe_dump(data))
    case = load([path])
    program = Program(simulator, free)
    store = RunStore(folder / f"runs_{number}")
    runner = Runner(store, program, bench.geometry, bench.scene.identity, STAGES["reference_run"].of(case))
    return case, runner, bench.targets(case, runner)


if __name__ == "__main__":
    main()
