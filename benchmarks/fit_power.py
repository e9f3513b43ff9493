"""Power and false alarms of the test of the fit, on synthetic pixels without a simulator.

    python benchmarks/fit_power.py [--quick] [--objective classes|likelihood]

Each synthetic ground has 1,000 independent pixels of 4 looks (2.5 looks in the last row of the table), in 12 fields,
between 20 and 50 degrees of incidence. The standard deviation of levels is 1 dB between fields and 0.4 dB within
fields. The true law is of the fitted form, ``mangia``, with X drawn from its bounds. The pixels of kind ``texture``
have texture unknown to the fit, a K distribution with an order that differs from field to field. The laws of kinds
``bump`` and ``step`` have a bump of 2 dB (sd 4 degrees) or a step of 1.5 dB in the middle of the incidence. In kind
``mixture``, a fifth of the pixels is 6 dB brighter. The law and the cumulants of its speckle take the place of the
simulator.

The table gives, for each kind, how often the test rejects the law, how often p is below 0.05 and 0.01, the median ratio
of the residual sum to its expectation, and the median of the looks found. A further line, for right laws, gives the
ratio of the residual sums of replicates after linearised refits to their residual sums after real refits.
"""

from __future__ import annotations

import argparse
import json
from typing import Any

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from radcal.assessment.fit_test import FitTest, check_fit
from radcal.assessment.linear_fit import linearised
from radcal.calibration.expected import LawForward
from radcal.calibration.grounds import GroundLaw, curve_prior, fit_grounds
from radcal.calibration.history import Score
from radcal.calibration.law_fit import fit_law
from radcal.calibration.misfit import BinMisfit, LikelihoodMisfit, Method
from radcal.calibration.moments import from_cumulants
from radcal.calibration.objectives import OBJECTIVES
from radcal.calibration.objectives.objective import Material
from radcal.measurement.class_target import ClassTarget
from radcal.measurement.goodness import Goodness
from radcal.measurement.ground import Ground
from radcal.measurement.target import Target
from radcal.radar.laws import LAWS

LAW = LAWS["mangia"]
BOX = np.array([[-45.0, 0.0], [0.0, 40.0], [0.0, 25.0], [0.5, 20.0]])
LOOKS, PIXELS, FIELDS = 4.0, 1000, 12
BETWEEN_DB, WITHIN_DB = 1.0, 0.4
MIDDLE_DEG = 35.0
KINDS = ("right", "texture", "bump", "step", "mixture")
SEVERAL = 5  # grounds whose spread is estimated together
Doubles = NDArray[np.float64]


def truth(rng: np.random.Generator) -> Doubles:
    """X with sigma0 between -25 and 0 dB over the incidence seen."""
    while True:
        x = rng.uniform(BOX[:, 0], BOX[:, 1])
        level = LAW(np.radians(np.linspace(20.0, 50.0, 7)), x)
        if level.min() > -25.0 and level.max() < 0.0:
            return np.asarray(x)


def made_ground(kind: str, looks: float, rng: np.random.Generator) -> Ground:
    """Pixels of one material."""
    incidence = rng.uniform(20.0, 50.0, PIXELS)
    patch = rng.integers(FIELDS, size=PIXELS)
    block = rng.integers(2, size=PIXELS)
    level = LAW(np.radians(incidence), truth(rng))
    if kind == "bump":
        level = level + 2.0 * np.exp(-0.5 * ((incidence - MIDDLE_DEG) / 4.0) ** 2)
    elif kind == "step":
        level = level + 1.5 * (incidence > MIDDLE_DEG)
    elif kind == "mixture":
        level = level + 6.0 * (rng.random(PIXELS) < 0.2)
    elif kind == "texture":
        order = rng.uniform(3.0, 12.0, FIELDS)[patch]
        level = level + 10.0 * np.log10(rng.gamma(order, 1.0 / order))
    level = level + (BETWEEN_DB * rng.normal(size=FIELDS))[patch]
    level = level + (WITHIN_DB * rng.normal(size=(FIELDS, 2)))[patch, block]
    return Ground(level + 10.0 * np.log10(rng.gamma(looks, 1.0 / looks, PIXELS)), incidence, patch, block)


def tested(found: GroundLaw, objective: str, rng: np.random.Generator) -> FitTest:
    """Test of the law of one ground, as a finished calibration makes it."""
    ground, method, x = found.ground, found.method, found.fit.parameters
    law, box = method.law, np.asarray(method.bounds, dtype=np.float64)
    bins = ClassTarget(found.classes, found.spread, 1, method.free_looks, method.priors, 0.0, x, method.looks)
    size = ground.values_db.size
    target = Target(
        pixels=np.arange(size), order=np.arange(size), values_db=ground.values_db,
        incidence_deg=ground.incidence_deg.astype(np.float32), dp=np.array([0.0, 1.0, 0.0]), eligible=size,
        at_boundary=False, effective=float(size), rms_sampling=1.0, cp_error=np.zeros(3), cp_interval=np.zeros((3, 2)),
        goodness=Goodness(0.0, 1.0, 0.0, 1.0), patch=ground.patch, block=ground.block, classes=bins,
    )  # fmt: skip
    comparison = OBJECTIVES[objective](Material("area", target, law, box, np.zeros(4, dtype=np.bool_), method.looks))
    statistics = from_cumulants(LawForward(law, found.classes.nodes_deg, method.looks)(x))
    score = Score(x.tolist(), [0.0, 1.0, 0.0], 0.0, statistics.tolist(), found.fit.looks, found.fit.cost)
    pixels = (ground.values_db, ground.values_db)
    return check_fit(comparison, score, pixels, float("nan"), rng)


def grounds_of(kind: str, objective: str, count: int, looks: float, seed: int) -> list[tuple[GroundLaw, FitTest]]:
    """Laws found of so many grounds, and their tests."""
    misfit = {"classes": BinMisfit, "likelihood": LikelihoodMisfit}[objective]
    results = []
    for first in range(0, count, SEVERAL):
        # the seed does not depend on the kind: the same truths are disturbed
        grounds = {
            str(k): made_ground(kind, looks, np.random.default_rng(seed + k)) for k in range(first, first + SEVERAL)
        }
        found = fit_grounds(grounds, dict.fromkeys(grounds, Method(LAW, BOX, LOOKS, misfit=misfit)))
        results += [(law, tested(law, objective, np.random.default_rng(int(name)))) for name, law in found.items()]
    return results


def row(results: list[tuple[GroundLaw, FitTest]]) -> dict[str, float]:
    """Line of the table."""
    tests = [test for _, test in results]
    return {
        "n": len(tests),
        "does_not_fit": float(np.mean([test.fits is False for test in tests])),
        "p_below_0.05": float(np.mean([test.p < 0.05 for test in tests])),
        "p_below_0.01": float(np.mean([test.p < 0.01 for test in tests])),
        "sum_over_expected": float(np.median([test.residual_sum / test.expected for test in tests])),
        "looks": float(np.median([law.fit.looks for law, _ in results])),
    }


def refits(results: list[tuple[GroundLaw, FitTest]], each: int) -> dict[str, float]:
    """Sums of squared residuals of replicates after linearised refits, over those after real ones."""
    linear, real = [], []
    for law, _ in results:
        misfit = BinMisfit.of(law.ground, law.classes, law.method, law.spread)
        forward = LawForward(LAW, law.classes.nodes_deg, LOOKS)
        prior = curve_prior(law.ground, law.method)
        x, looks, rng = law.fit.parameters, law.fit.looks, np.random.default_rng(5)
        centre = misfit(x, looks, forward(x))
        for disturbance in misfit.replicates(each, rng):

            def residuals(at: Doubles, n: float, away: Doubles = disturbance, middle: Doubles = centre) -> Doubles:
                return misfit(at, n, forward(at)) - middle + away  # noqa: B023

            refitted = fit_law(residuals, BOX, LOOKS, True, (x, looks), prior=prior)
            left = residuals(refitted.parameters, refitted.looks)
            real.append(float(left @ left))
            lin = linearised(residuals, x, looks, BOX, LOOKS, law.fit.prior_information)
            left = (np.eye(left.size) - lin.hat) @ disturbance
            linear.append(float(left @ left))
    ratio = np.array(linear) / np.array(real)
    return {"n": len(real), "median": float(np.median(ratio)), "mean_linear": float(np.mean(linear)),
            "mean_real": float(np.mean(real))}  # fmt: skip


def main() -> None:
    """Print the table and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="20 grounds of each kind in place of 120")
    parser.add_argument("--objective", choices=["classes", "likelihood"], default="classes", help="what was minimised")
    parser.add_argument("--first", type=int, default=1000, help="seed of the first ground of each kind")
    arguments = parser.parse_args()
    count = 20 if arguments.quick else 120
    result: dict[str, Any] = {}
    with threadpool_limits(1):
        columns = f"{'does not fit':>12} {'p < 0.05':>9} {'p < 0.01':>9} {'sum/expected':>12} {'looks':>6}"
        print(f"{'truth':14} {'n':>4} {columns}")
        for kind, looks in [*((kind, LOOKS) for kind in KINDS), ("right", 2.5)]:
            name = kind if looks == LOOKS else f"{kind}_{looks:g}_looks"
            found = grounds_of(kind, arguments.objective, count, looks, arguments.first)
            line = result[name] = row(found)
            print(
                f"{name:14} {line['n']:4.0f} {line['does_not_fit']:12.3f} {line['p_below_0.05']:9.3f} "
                f"{line['p_below_0.01']:9.3f} "
                f"{line['sum_over_expected']:12.2f} {line['looks']:6.2f}",
                flush=True,
            )
            if name == "right":
                result["refits"] = refits(found[:4], 5 if arguments.quick else 25)
        print("linearised over real refits:", result["refits"])
    print(json.dumps({"fit_power": result}))


if __name__ == "__main__":
    main()
