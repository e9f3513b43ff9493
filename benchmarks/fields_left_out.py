"""Errors of the recommended predictor and of a constant on left-out whole fields of a measured image.

    python benchmarks/fields_left_out.py [--quick] [--polarisations hh,hv] [--seed 0]

The fields (connected areas) of each material of the AIRSAR image under RADCAL_DATA are divided at random into two
halves, four times. Law and constant are fitted to each half and predict the other half. The predictions are compared
with measured means of cells, which are parts of fields in 10 rows with 20 pixels or more. The cells have angles between
the 5 % and 95 % quantiles of the angles of the calibrated half. The constant is the generalised least squares mean with
random effects of fields and cells. The variances of the random effects are estimated from all materials together, for
the constant as for the law.

The recommendation of law or constant uses the calibrated half alone. As in the workflow, a law that does not fit the
calibrated half is not recommended. The laws are fitted to the measured pixels with the model of law and speckle,
without a simulator. Ratios of errors are geometric means over materials and folds. Two ratios show what a better choice
could gain: those of the better predictor, if it were known in each case, or in each case of four or more fields, with
the constant in the others.
"""

from __future__ import annotations

import argparse
import json
import os
from pathlib import Path
from typing import Any

import numpy as np
from fit_power import tested
from numpy.typing import NDArray
from right_law import FLEVOLAND_BOUNDS, LAW, LOOKS, flevoland_grounds, geometric
from threadpoolctl import threadpool_limits

from radcal.assessment.constant import Constant, constants
from radcal.assessment.prediction import predict
from radcal.assessment.recommendation import Recommendation, leave_fields_out, recommend
from radcal.calibration.grounds import GroundLaw, fit_grounds
from radcal.calibration.misfit import Method
from radcal.measurement.ground import Ground
from radcal.seeds import derived_rng

DRAWS = 4
FEWEST = 20  # pixels in a cell
WORSE = 1.15
MANY = 4  # fields from which the errors on left-out fields alone decide
KNOWN_DB = 1.5  # default of uncertainty.known_db


def halves(grounds: dict[str, Ground], seed: int) -> dict[str, NDArray[np.bool_]]:
    """Pixels of half of each material's fields, drawn at random; of an odd number the larger half now and then."""
    rng = np.random.default_rng(seed)
    found = {}
    for name, ground in grounds.items():
        fields = rng.permutation(np.unique(ground.patch))
        count = (fields.size + int(rng.integers(2))) // 2
        found[name] = np.isin(ground.patch, fields[:count])
    return found


def errors(law: GroundLaw, constant: Constant, out: Ground) -> tuple[float, float, float, int] | None:
    """Root mean square errors of constant and law at angles seen [dB], plain mean's, and cells; None without cells."""
    cells = predict(law, constant, out)
    low, high = np.quantile(law.ground.incidence_deg, [0.05, 0.95])
    seen = (cells.count >= FEWEST) & (cells.incidence_deg >= low) & (cells.incidence_deg <= high)
    if not seen.any():
        return None
    cells = cells.part(seen)
    predicted = (cells.constant_db, cells.law_db, law.ground.values_db.mean())
    found = [float(np.sqrt(np.mean((cells.mean_db - values) ** 2))) for values in predicted]
    return found[0], found[1], found[2], int(seen.sum())


def choice(law: GroundLaw, constant: Constant, rng: np.random.Generator) -> Recommendation:
    """Recommended predictor; a law that does not fit is not recommended, as in the workflow."""
    if tested(law, "classes", rng).fits is False:
        return Recommendation("constant", "the law does not fit")
    return recommend(law, leave_fields_out(law, constant), KNOWN_DB)


def image(folder: Path, polarisation: str, draws: int, seed: int) -> dict[str, Any]:
    """Errors of all materials and folds of one image."""
    grounds = flevoland_grounds(folder, polarisation)
    method = Method(LAW, FLEVOLAND_BOUNDS, LOOKS)
    print(f"Flevoland {polarisation.upper()}: rmse of means of cells of fields left out [dB]")
    print(
        f"{'draw':4} {'way':3} {'material':11} {'fields':>6} {'cells':>5} {'mean':>6} {'constant':>8} {'law':>6} ratio"
    )
    rows: list[tuple[float, float, float, bool, int]] = []
    known: dict[str, int] = {}
    for draw in range(draws):
        first = halves(grounds, seed + draw)
        for way in (0, 1):
            kept = {name: mask if way == 0 else ~mask for name, mask in first.items()}
            kept = {name: mask for name, mask in kept.items() if mask.any() and not mask.all()}
            laws = fit_grounds({n: grounds[n].part(mask) for n, mask in kept.items()}, dict.fromkeys(kept, method))
            levels = constants({name: law.ground for name, law in laws.items()})
            for name, law in laws.items():
                found = errors(law, levels[name], grounds[name].part(~kept[name]))
                if found is None:
                    continue
                chosen = choice(law, levels[name], derived_rng(seed + draw, "fit", name, way))
                is_law = chosen.predictor == "law"
                fields = np.unique(law.ground.patch).size
                rows.append((*found[:3], is_law, fields))
                known[name] = known.get(name, 0) + is_law
                print(
                    f"{draw:4} {way:3} {name:11} {fields:6} {found[3]:5} {found[2]:6.2f} "
                    f"{found[0]:8.2f} {found[1]:6.2f} {found[1] / found[0]:5.2f} {chosen.predictor}: {chosen.why}",
                    flush=True,
                )
    constant, law_error, plain, is_law_all, fields_all = np.array(rows, dtype=np.float64).T
    better = np.minimum(law_error / constant, 1.0)
    ratio = np.where(is_law_all > 0.0, law_error, constant) / constant
    return {
        "recommended_over_constant": geometric(ratio),
        "law_over_constant": geometric(law_error / constant),
        "mean_over_constant": geometric(plain / constant),
        "better_over_constant": geometric(better),
        "better_if_many_fields_over_constant": geometric(np.where(fields_all >= MANY, better, 1.0)),
        "n": len(rows),
        "law_recommended": int(is_law_all.sum()),
        "above_1.15": int((ratio > WORSE).sum()),
        "materials_with_a_law": sorted(name for name, times in known.items() if times),
    }


def main() -> None:
    """Print the tables and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one draw in place of four")
    parser.add_argument("--polarisations", default="hh,hv", help="which images, with commas")
    parser.add_argument("--seed", type=int, default=0, help="of the first draw")
    arguments = parser.parse_args()
    data = os.environ.get("RADCAL_DATA")
    result: dict[str, Any] = {}
    if data is None:
        print("RADCAL_DATA is not set: Flevoland is skipped")
    else:
        with threadpool_limits(1):
            for polarisation in arguments.polarisations.split(","):
                found = image(Path(data) / "flevoland", polarisation, 1 if arguments.quick else DRAWS, arguments.seed)
                print("  ".join(f"{k} {v:.3f}" if isinstance(v, float) else f"{k} {v}" for k, v in found.items()))
                result[polarisation] = found
    print(json.dumps({"fields_left_out": result}))


if __name__ == "__main__":
    main()
