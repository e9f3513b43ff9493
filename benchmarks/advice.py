"""Test of ``radcal advise``: how often the advised pass is the one that narrows the 90 % band of sigma0 most.

    python benchmarks/advice.py [--quick] [--truths 10] [--first 0] [--speckle 0]

The hidden laws are drawn uniformly in the bounds of the default case's dyke. Each law is measured in a first pass with
a depression of 45 degrees to the right, with independent speckle and no other mismatch, and is calibrated. ``radcal
advise`` then compares three further passes, with depressions of 30 and 60 degrees to the right, and of 45 degrees to
the left. Each further pass is also measured, and calibrated together with the first pass. The advice is right if the
advised pass leaves the smallest half-width of the 90 % band of sigma0, averaged over the incidence that the material
has in any of the four passes. The half-widths found are those of the posterior's whole sample, because quantiles of its
400 kept draws differ by up to a fifth. ``--speckle`` draws other speckle for the further passes of the same laws.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from passes import calibrated_passes
from threadpoolctl import threadpool_limits

from radcal.assessment.budget import Budget
from radcal.assessment.posterior import Posterior, posterior_of
from radcal.config import Case, case_from, stages
from radcal.measurement.levels import Levels
from radcal.radar.geometry import Geometry
from radcal.radar.projection import make_geometry
from radcal.report.advice import advice_on
from radcal.scene.model import Scene
from radcal.scene.sources import make_scene
from radcal.seeds import derived_rng

FIRST = {"depression_deg": 45.0, "look_side": "right"}
FURTHER = (
    {"depression_deg": 30.0, "look_side": "right"},
    {"depression_deg": 60.0, "look_side": "right"},
    {"depression_deg": 45.0, "look_side": "left"},
)
NAME = "dyke"


def main() -> None:
    """Print a line per truth and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="1 truth in place of 10")
    parser.add_argument("--truths", type=int, default=10, help="number of truths")
    parser.add_argument("--first", type=int, default=0, help="number of the first truth, to continue a benchmark")
    parser.add_argument("--speckle", type=int, default=0, help="number of the draw of speckle of the further passes")
    arguments = parser.parse_args()
    count = 1 if arguments.quick else arguments.truths
    base = case_of([-24.0, 10.0, 14.0, 5.0], 0, [FIRST])
    scene = make_scene(base.scene, list(base.materials))
    geometries = {str(one): make_geometry(scene, base.radar.model_copy(update=one)) for one in (FIRST, *FURTHER)}
    low, high = np.array(base.materials[NAME].box).T
    truths = low + derived_rng(1, "benchmark", "advice").random((arguments.first + count, len(low))) * (high - low)
    rows = []
    print(f"{'hidden X':28} {'now':>5}   expected after each of the three | found after each; advised and best")
    for number in range(arguments.first, arguments.first + count):
        with threadpool_limits(1):
            row = followed(truths[number].tolist(), number, scene, geometries, arguments.speckle)
        rows.append(row)
        both = (" ".join(f"{x:5.2f}" for x in row[key]) for key in ("expected_db", "found_db"))
        told = f"advised {row['advised']}, best {row['best']}"
        print(f"{np.round(truths[number], 1)!s:28} {row['now_db']:5.2f}   {' | '.join(both)}   {told}", flush=True)
    print(json.dumps(summary(rows)))


def case_of(truth: list[float], number: int, passes: list[dict[str, Any]], speckle: int = 0) -> Case:
    """Default case with a hidden law, and these passes; ``speckle`` numbers the draws of the further pass's speckle."""
    seeds = [100 + 10 * number + k + 1000 * speckle * (k > 0) for k in range(len(passes))]
    images = [
        {"source": "synthetic", "synthetic": {"parameters": {NAME: truth}, "seed": seed, "warp_px": 0}}
        for seed in seeds
    ]
    return case_from({"radar": passes, "measurement": images, "registration": {"method": "none"}})


def followed(
    truth: list[float], number: int, scene: Scene, geometries: dict[str, Geometry], speckle: int = 0
) -> dict[str, Any]:
    """Mean half-widths [dB] after the first pass, and after each further one as advised and as found."""
    with tempfile.TemporaryDirectory() as folder:
        case = case_of(truth, number, [FIRST])
        first = calibrated(case, scene, [geometries[str(FIRST)]], Path(folder))
        assert first.draws is not None
        curves = first.draws.curves_db(case.laws[NAME])
        radars = [case.radar.model_copy(update=one) for one in FURTHER]
        budget = Budget.of(case.uncertainty, Levels())
        advised = advice_on(case, scene, {NAME: (first.draws, curves)}, budget, radars)
        over = advised[0].over_deg
        after = {(row.radar.depression_deg, row.radar.look_side): row.after_db for row in advised}
        expected = [after[one["depression_deg"], one["look_side"]] for one in FURTHER]
        found = []
        for one in FURTHER:
            both = [geometries[str(FIRST)], geometries[str(one)]]
            narrowed = calibrated(case_of(truth, number, [FIRST, one], speckle), scene, both, Path(folder))
            found.append(half_width_db(narrowed, over))
    return {
        "now_db": half_width_db(first, over),
        "expected_db": expected,
        "found_db": found,
        "advised": int(np.argmin(expected)),
        "best": int(np.argmin(found)),
    }


def calibrated(case: Case, scene: Scene, geometries: list[Geometry], folder: Path) -> Posterior:
    """Posterior after a calibration."""
    targets, history, _ = calibrated_passes(case, scene, geometries, folder)
    return posterior_of(stages.Posterior.of(case), targets, history, NAME)


def half_width_db(posterior: Posterior, over_deg: tuple[float, float]) -> float:
    """Mean half-width of the 90 % band of sigma0 over an interval of incidence [dB], of the whole sample."""
    curve = posterior.curve
    assert curve is not None
    of = (over_deg[0] <= curve.incidence_deg) & (curve.incidence_deg <= over_deg[1])
    return float(0.5 * (curve.p95_db - curve.p05_db)[of].mean())


def summary(rows: list[dict[str, Any]]) -> dict[str, Any]:
    """How often the advised pass was the best, and how far the expected half-widths were from those found."""
    ratio = [row["expected_db"][row["advised"]] / row["found_db"][row["advised"]] for row in rows]
    found = np.array([row["found_db"] for row in rows])
    # how much wider the band is than after the best pass [%]
    regret = 100.0 * (found / found.min(axis=1, keepdims=True) - 1.0)
    of_advice = regret[np.arange(len(rows)), [row["advised"] for row in rows]]
    return {
        "n": len(rows),
        "right": sum(row["advised"] == row["best"] for row in rows),
        "within_5_percent": sum(row["found_db"][row["advised"]] <= 1.05 * min(row["found_db"]) for row in rows),
        "regret_percent": {"mean": float(of_advice.mean()), "worst": float(of_advice.max())},
        "regret_percent_of_the_same_pass": regret.mean(axis=0).round(2).tolist(),
        "regret_percent_of_a_random_pass": float(regret.mean()),
        "advised": [row["advised"] for row in rows],
        "best": [row["best"] for row in rows],
        "expected_over_found": float(np.median(ratio)),
        "now_db": float(np.median([row["now_db"] for row in rows])),
        "advised_db": float(np.median([row["found_db"][row["advised"]] for row in rows])),
        "others_db": float(np.median([np.delete(row["found_db"], row["advised"]).min() for row in rows])),
    }


if __name__ == "__main__":
    main()
