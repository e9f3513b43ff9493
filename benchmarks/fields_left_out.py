"""Errors of the recommended predictor and of a constant on left-out whole fields of a measured or synthetic image.

    python benchmarks/fields_left_out.py [--quick] [--images hh,hv] [--seed 0]

The fields (connected areas) of each material are divided at random into two halves. Law and constant are fitted to each
half and predict the other half. The predictions are compared with measured means of cells, which are parts of fields in
10 rows with 20 pixels or more. The cells have angles between the 5 % and 95 % quantiles of the angles of the calibrated
half. The constant is the generalised least squares mean with random effects of fields and cells. The variances of the
random effects are estimated from all materials together, for the constant as for the law.

The weight of the law in the recommended predictor is decided on the calibrated half alone. As in the workflow, a law
that does not fit the calibrated half has no weight. The laws are fitted to the measured pixels with the model of law
and speckle, without a simulator. Ratios of errors are geometric means over materials and folds. A further ratio shows
what a better choice between law and constant could gain: that of the better predictor, if it were known in each case.

Images ``hh`` and ``hv`` are those of the AIRSAR image under RADCAL_DATA, whose fields are divided four times. The other
images are made: twelve materials with 3 to 24 fields of 2 to 9 cells each at angles of their own, a standard deviation
of 0.3 to 1.5 dB between fields and of 0.3 dB within fields, and 4 looks. Four images of each kind are divided once:

- ``right``: laws of the fitted form, ``mangia``, with X drawn from a box;
- ``weak``: levels that change by 0.02 to 0.08 dB a degree;
- ``wrong``: as ``weak``, with a bump of 1 to 3 dB (sd 2 to 5 degrees);
- ``flat``: levels that do not change with the incidence;
- ``right_gradients``, ``flat_gradients``: in addition, a gradient in each field, with a standard deviation of half to
  all of that between fields.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from fit_power import tested, truth
from numpy.typing import NDArray
from radcal.assessment.constant import Constant, constants
from radcal.assessment.recommendation import Recommendation, leave_fields_out, recommend
from right_law import FLEVOLAND_BOUNDS, LAW, LOOKS, flevoland_grounds, geometric
from threadpoolctl import threadpool_limits

from radcal.assessment.prediction import Prediction, predict
from radcal.calibration.grounds import GroundLaw, fit_grounds
from radcal.calibration.misfit import Method
from radcal.measurement.ground import Ground
from radcal.seeds import derived_rng

DRAWS = 4
FEWEST = 20  # pixels in a cell
WORSE = 1.15
KNOWN_DB = 1.5  # default of uncertainty.known_db
KINDS = ("right", "right_gradients", "weak", "wrong", "flat", "flat_gradients")
MATERIALS, MADE = 12, 4
CELL_DEG, WITHIN_DB = 0.4, 0.3


def halves(grounds: dict[str, Ground], seed: int) -> dict[str, NDArray[np.bool_]]:
    """Pixels of half of each material's fields, drawn at random; of an odd number the larger half now and then."""
    rng = np.random.default_rng(seed)
    found = {}
    for name, ground in grounds.items():
        fields = rng.permutation(np.unique(ground.patch))
        count = (fields.size + int(rng.integers(2))) // 2
        found[name] = np.isin(ground.patch, fields[:count])
    return found


def made_ground(kind: str, rng: np.random.Generator) -> Ground:
    """Pixels of one material of a synthetic image."""
    count, between = int(rng.integers(3, 25)), rng.uniform(0.3, 1.5)
    gradient = between * rng.uniform(0.5, 1.0) if "gradients" in kind else 0.0
    x, level_db = truth(rng), rng.uniform(-20.0, -6.0)
    slope = rng.choice([-1.0, 1.0]) * rng.uniform(0.02, 0.08) if kind in ("weak", "wrong") else 0.0
    bump_db = rng.uniform(1.0, 3.0) if kind == "wrong" else 0.0
    middle, sd = rng.uniform(28.0, 36.0), rng.uniform(2.0, 5.0)
    parts = []
    for field in range(count):
        cells = int(rng.integers(2, 10))
        start, place = rng.uniform(20.0, 44.0 - CELL_DEG * cells), np.arange(cells)
        effect = between * rng.normal() + gradient * rng.normal() * (place - place.mean()) / place.std()
        effect = effect + WITHIN_DB * rng.normal(size=cells)
        cell = np.repeat(place, rng.integers(FEWEST, 3 * FEWEST, cells))
        angle = start + CELL_DEG * (cell + rng.random(cell.size))
        if "right" in kind:
            level = LAW(np.radians(angle), x)
        else:
            level = level_db + slope * (angle - 32.0) + bump_db * np.exp(-0.5 * ((angle - middle) / sd) ** 2)
        values = level + effect[cell] + 10.0 * np.log10(rng.gamma(LOOKS, 1.0 / LOOKS, cell.size))
        parts.append((values, angle, np.full(cell.size, field), cell))
    return Ground(*(np.concatenate(column) for column in zip(*parts, strict=True)))


def at_angles_seen(law: GroundLaw, constant: Constant, out: Ground) -> Prediction:
    """Predictions of the cells at angles seen in the calibrated ground."""
    cells = predict(law, constant, out)
    low, high = np.quantile(law.ground.incidence_deg, [0.05, 0.95])
    return cells.part((cells.count >= FEWEST) & (cells.incidence_deg >= low) & (cells.incidence_deg <= high))


def choice(law: GroundLaw, constant: Constant, rng: np.random.Generator) -> Recommendation:
    """Recommended predictor; a law that does not fit has no weight, as in the workflow."""
    if tested(law, "classes", rng).fits is False:
        return Recommendation(0.0, "the law does not fit")
    return recommend(law, leave_fields_out(law, constant), KNOWN_DB)


def cases(grounds: dict[str, Ground], seed: int) -> list[tuple[str, float, list[float]]]:
    """Name, weight of the law, and rmse of constant, law, mean and recommended predictor [dB] of all materials."""
    method = Method(LAW, FLEVOLAND_BOUNDS, LOOKS)
    first = halves(grounds, seed)
    rows = []
    for way in (0, 1):
        kept = {name: mask if way == 0 else ~mask for name, mask in first.items()}
        kept = {name: mask for name, mask in kept.items() if mask.any() and not mask.all()}
        laws = fit_grounds({n: grounds[n].part(mask) for n, mask in kept.items()}, dict.fromkeys(kept, method))
        levels = constants({name: law.ground for name, law in laws.items()})
        for name, law in laws.items():
            cells = at_angles_seen(law, levels[name], grounds[name].part(~kept[name]))
            if not cells.count.size:
                continue
            chosen = choice(law, levels[name], derived_rng(seed, "fit", name, way))
            recommended = chosen.levels_db(cells.law_db, cells.constant_db)
            predicted = (cells.constant_db, cells.law_db, law.ground.values_db.mean(), recommended)
            each = [float(np.sqrt(np.mean((cells.mean_db - values) ** 2))) for values in predicted]
            rows.append((name, chosen.weight, each))
            print(
                f"{seed:4} {way:3} {name:11} {np.unique(law.ground.patch).size:6} {cells.count.size:5} {each[2]:6.2f} "
                f"{each[0]:8.2f} {each[1]:6.2f} {each[3]:11.2f} {chosen.weight:6.2f}: {chosen.why}",
                flush=True,
            )
    return rows


def image(name: str, quick: bool, seed: int) -> dict[str, Any]:
    """Errors of all materials and folds of one image, or of the synthetic images of one kind."""
    print(f"{name}: rmse of means of cells of fields left out [dB], and weight of the law")
    print("seed way material    fields cells   mean constant    law recommended weight")
    rows = []
    if name in KINDS:
        for number in range(seed, seed + (1 if quick else MADE)):
            rng = np.random.default_rng(number)
            rows += cases({f"material {k}": made_ground(name, rng) for k in range(MATERIALS)}, number)
    else:
        grounds = flevoland_grounds(Path(os.environ["RADCAL_DATA"]) / "flevoland", name)
        for draw in range(1 if quick else DRAWS):
            rows += cases(grounds, seed + draw)
    names, weight, each = zip(*rows, strict=True)
    constant, law, mean, recommended = np.array(each).T
    return {
        "recommended_over_constant": geometric(recommended / constant),
        "law_over_constant": geometric(law / constant),
        "mean_over_constant": geometric(mean / constant),
        "better_over_constant": geometric(np.minimum(law / constant, 1.0)),
        "n": len(rows),
        "above_1.15": int((recommended / constant > WORSE).sum()),
        "mean_weight": float(np.mean(weight)),
        "weighted": int(np.count_nonzero(weight)),
        "materials_with_a_law": sorted({one for one, given in zip(names, weight, strict=True) if given}),
    }


def main() -> None:
    """Print the tables and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one draw or image in place of four")
    parser.add_argument("--images", default="hh,hv", help=f"which, with commas: hh, hv, {', '.join(KINDS)}")
    parser.add_argument("--seed", type=int, default=0, help="of the first draw or image")
    arguments = parser.parse_args()
    result: dict[str, Any] = {}
    with threadpool_limits(1):
        for name in arguments.images.split(","):
            if name not in KINDS and "RADCAL_DATA" not in os.environ:
                print(f"RADCAL_DATA is not set: {name} is skipped")
                continue
            found = result[name] = image(name, arguments.quick, arguments.seed)
            print("  ".join(f"{k} {v:.3f}" if isinstance(v, float) else f"{k} {v}" for k, v in found.items()))
    print(json.dumps({"fields_left_out": result}))


if __name__ == "__main__":
    main()
