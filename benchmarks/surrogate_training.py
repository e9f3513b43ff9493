"""CPU time and error of kriging by radcal and by smt's KRG at its defaults, on many points.

    python benchmarks/surrogate_training.py [--quick] [--points 970]

Outputs: mean, log sd and skewness of the published dyke's pixels, simulated at the points, and three closed forms,
which are smooth. The points are uniform in the bounds. Each output has a kriging of its own in both programs, since smt
leaves its hyper-parameters at their start if one KRG has several outputs. Both run to their end, in one thread; CPU
time is that of training, with the factor of the correlation matrix. Q2 is one minus the ratio of mean squared error to
variance, and `rms` the ratio of radcal's root mean square error to smt's, on 300 points not trained with.
"""

from __future__ import annotations

import argparse
import contextlib
import io
import json
import tempfile
import time
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from dyke_cases import ROOT, Bench, hidden_laws
from numpy.typing import NDArray
from smt.surrogate_models import KRG

from radcal.calibration.scoring import score
from radcal.calibration.steps import all_parameters, run_all_draws
from radcal.config import load
from radcal.objectives import make_objectives
from radcal.processes import one_thread
from radcal.proposals.kriging import Kriging, train

UNSEEN = 300
Array = NDArray[np.float64]


def moments(points: Array) -> dict[str, Array]:
    """Mean, log sd and skewness of the dyke's pixels in a run with each X."""
    with tempfile.TemporaryDirectory() as folder:
        bench = Bench(Path(folder))
        case = load([bench.reachable("training", hidden_laws(1)[0].tolist(), {"objective": "density"})])
        runner = bench.runner(case, Path(folder) / "runs")
        targets = bench.targets(case, runner)
        objectives = make_objectives(case, [targets])
        found = []
        for number, x in enumerate(points.tolist()):
            parameters = all_parameters(case.materials, {"dyke": x})
            records = run_all_draws(case, [runner], parameters)
            run = score("design", number, records, parameters, [targets], objectives, case.seed)
            found.append(run.scores["dyke"].statistics[0])
    return dict(zip(("mean", "log sd", "skewness"), np.array(found).T, strict=True))


def smooth(unit: Array) -> dict[str, Array]:
    """Closed forms at points of the unit box."""
    a, b, c, d = unit.T
    return {
        "exponential": np.exp(-a - 0.5 * b - 0.3 * c - 0.2 * d),
        "sine": np.sin(2.0 * a + b + 0.5 * c + 0.3 * d),
        "products": (a - 0.3) ** 2 * b + np.cos(2.0 * c) * d,
    }


def of_radcal(x: Array, y: Array, unseen: Array) -> tuple[Array, float]:
    """Prediction at unseen points, and CPU seconds of the training."""
    start = time.process_time()
    model = Kriging(x, y[:, None], *train(x, y[:, None]))
    return model.mean(unseen)[:, 0], time.process_time() - start


def of_smt(x: Array, y: Array, unseen: Array) -> tuple[Array, float]:
    """Prediction at unseen points, and CPU seconds of the training."""
    model = KRG(print_global=False)
    with warnings.catch_warnings(), contextlib.redirect_stdout(io.StringIO()):
        warnings.simplefilter("ignore")
        start = time.process_time()
        model.set_training_values(x, y[:, None])
        model.train()
        return model.predict_values(unseen)[:, 0], time.process_time() - start


def compared(outputs: dict[str, Array], unit: Array, count: int) -> dict[str, Any]:
    """Rows of a table, and their summary."""
    seconds, q2, rms = np.zeros(2), [], {}
    for name, y in outputs.items():
        errors = []
        for k, method in enumerate((of_radcal, of_smt)):
            predicted, used = method(unit[:count], y[:count], unit[count:])
            errors.append(float(np.sqrt(np.mean((predicted - y[count:]) ** 2))))
            seconds[k] += used
        q2.append([1.0 - (error / float(y[count:].std())) ** 2 for error in errors])
        rms[name] = errors[0] / errors[1]
        print(f"{name:12} rms {errors[0]:9.2e}, smt {errors[1]:9.2e}, ratio {rms[name]:.3f}", flush=True)
    print(f"CPU time {seconds[0]:.1f} s, smt {seconds[1]:.1f} s, ratio {seconds[1] / seconds[0]:.1f}")
    own, of_peer = np.array(q2).T
    return {"ratio": seconds[1] / seconds[0], "q2": own.tolist(), "q2_smt": of_peer.tolist(), "rms": rms}


def main() -> None:
    """Print two tables and, last, the summary as JSON; that of the closed forms is its item `smooth`."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="60 points")
    parser.add_argument("--points", type=int, default=970, help="number of points trained with")
    arguments = parser.parse_args()
    count = 60 if arguments.quick else arguments.points
    points = hidden_laws(count + UNSEEN)
    low, high = np.array(load([ROOT / "config/dyke_published.yaml"]).materials["dyke"].box).T
    unit = (points - low) / (high - low)
    with one_thread():
        found = compared(moments(points), unit, count)
        print(json.dumps({**found, "smooth": compared(smooth(unit), unit, count), "points": count}))


if __name__ == "__main__":
    main()
