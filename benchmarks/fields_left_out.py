"""Errors of the predictor of other fields, of the law's model and of a constant, on whole fields left out of an image.

    python benchmarks/fields_left_out.py [--quick] [--images hh,hv] [--seed 0] [--draws 4]

The images are those of the AIRSAR image under RADCAL_DATA. The fields (connected areas) of each of its fourteen surface
materials are divided at random into two halves. Model and constant are fitted to the cells of each half and predict the
cells of the other half. Cells are those of the posterior: parts of a field in 24 x 24 pixels and 3 degrees of incidence
with 8 pixels or more. The errors are those of the mean power of cells in dB, less the expected bias of its logarithm.
Cells count between the 5 % and 95 % quantiles of the incidence of the calibrated cells. The ground is level and has no
materials with fixed laws: the image takes the place of the simulator, and the common effects have their priors.

``model`` is the posterior predictive mean, ``constant`` the generalised least squares mean with random effects of
fields and cells, and ``recommended`` their average. Ratios of errors are geometric means over the cases, which are a
material, a half and a draw. ``coverage_90`` is the share of all cells in the 90 % band of the recommended predictor.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from right_law import FLEVOLAND_BOUNDS, LAW, flevoland_grounds, geometric

from radcal.config import Uncertainty
from radcal.ground.ground import Ground
from radcal.inference.priors import CurvePrior
from radcal.posterior.calibrated import FORMS, LawModel, Parameters
from radcal.posterior.cells import CellMeans, Simulated, cell_means
from radcal.posterior.curves import curves_of
from radcal.posterior.effects import Observed, form_basis
from radcal.posterior.fixed_laws import image_from
from radcal.posterior.prediction import left_out
from radcal.posterior.result import HeldOut, Predicted
from radcal.processes import one_thread

SHAPE = (750, 1024)
CONFIG = Uncertainty(walkers=64)
WORSE = 1.15
FORM_KNOT_DEG = 2.0


def cells_of(ground: Ground) -> CellMeans:
    """Cells of measured pixels on level ground, with a simulated image of 0 dB and a law of 0 dB."""
    assert ground.pixels is not None
    assert ground.correlation is not None
    image, angle = np.full(SHAPE, np.nan, dtype=np.float32), np.zeros(SHAPE, dtype=np.float32)
    image.ravel()[ground.pixels], angle.ravel()[ground.pixels] = ground.values_db, ground.incidence_deg
    geometry: Any = SimpleNamespace(shape=SHAPE, incidence_deg=angle, flat_incidence_deg=np.zeros(SHAPE[0]))
    law: Any = SimpleNamespace(has_curve=False)
    simulated = [Simulated(np.zeros(SHAPE, dtype=np.float32), {"material": []})]
    return cell_means(
        ground.pixels,
        ground.patch,
        image,
        simulated,
        "material",
        law,
        geometry,
        None,  # type: ignore[arg-type] - not looked at without noise
        ground.correlation,
        noisy=False,
        area=np.zeros(image.size),
    )


def model_of(cells: CellMeans) -> LawModel:
    """Model of one material, with knots at whole degrees."""
    angle = cells.incidence_deg
    knots = np.arange(np.floor(angle.min()), np.ceil(angle.max()) + 1.0)
    weights = np.maximum(0.0, 1.0 - np.abs(angle[:, None] - knots))
    box = np.array(FLEVOLAND_BOUNDS, dtype=np.float64)
    prior = CurvePrior(LAW, *(float(np.average(of, weights=cells.pixels)) for of in (cells.measured_db, angle)))
    parameters = Parameters(
        box,
        np.zeros(len(box), dtype=np.bool_),
        lambda x: curves_of(LAW, x, np.radians(knots)),
        lambda x: -0.5 * (prior.of_curves(curves_of(LAW, x, np.radians(prior.angles_deg)), x) ** 2).sum(axis=1),
    )
    forms = form_basis(angle, np.arange(knots[0], knots[-1] + 2.0 * FORM_KNOT_DEG, FORM_KNOT_DEG), FORMS)
    observed = Observed([cells], [np.full(cells.size, cells.measured_db.mean())], [np.zeros(cells.size)])
    common = image_from({}, [0.0], ["sigma0_ref"], CONFIG, False, 1).shared["0"]
    return LawModel(observed, weights, parameters, forms, np.zeros(cells.size), common, [0.0], CONFIG)


def half_of(patch: NDArray[np.int64], rng: np.random.Generator) -> NDArray[np.bool_]:
    """Cells of half of the fields, drawn at random; of an odd number the larger half now and then."""
    fields = rng.permutation(np.unique(patch))
    return np.isin(patch, fields[: (fields.size + int(rng.integers(2))) // 2])


def part_of(held: HeldOut, mask: NDArray[np.bool_]) -> HeldOut:
    """Cells of a mask."""
    law, constant = (Predicted(*(each[mask] for each in vars(by).values())) for by in (held.law, held.constant))
    return HeldOut(held.patch[mask], held.incidence_deg[mask], held.measured_db[mask], law, constant)


def image(name: str, draws: range) -> dict[str, Any]:
    """Errors of all materials, halves and draws of one image."""
    grounds = flevoland_grounds(Path(os.environ["RADCAL_DATA"]) / "flevoland", name)
    models = {material: model_of(cells_of(ground)) for material, ground in grounds.items()}
    print(f"{name}: rmse of mean power of cells of fields left out [dB], and share of cells in the 90 % band")
    print("seed half material    fields cells constant  model recommended  inside")
    rows, inside, started = [], [], time.process_time()
    for seed in draws:
        rng = np.random.default_rng(seed)
        for material, model in models.items():
            first = half_of(model.patch, rng)
            angle = model.observed.together("incidence_deg")
            for half, kept in enumerate((first, ~first)):
                if not kept.any() or kept.all():
                    continue
                low, high = np.quantile(angle[kept], [0.05, 0.95])
                counts = ~kept & (angle >= low) & (angle <= high)
                if not counts.any():
                    continue
                found = left_out(model, np.where(kept, -1, 0), seed)
                if found is None:
                    continue
                found = part_of(found, (found.incidence_deg >= low) & (found.incidence_deg <= high))
                each = [found.rmse_db(by) for by in (found.constant, found.law, found.predicted)]
                rows.append(each)
                inside.append((found.coverage_90(found.predicted), found.patch.size))
                print(
                    f"{seed:4} {half:4} {material:11} {np.unique(model.patch[kept]).size:6} {found.patch.size:5} "
                    f"{each[0]:8.2f} {each[1]:6.2f} {each[2]:11.2f} {inside[-1][0]:7.2f}",
                    flush=True,
                )
    constant, law, recommended = np.array(rows).T
    share, count = np.array(inside).T
    return {
        "model_over_constant": geometric(law / constant),
        "recommended_over_constant": geometric(recommended / constant),
        "n": len(rows),
        "above_1.15": int((recommended / constant > WORSE).sum()),
        "coverage_90": float(np.average(share, weights=count)),
        "seconds_each": (time.process_time() - started) / len(rows),
    }


def main() -> None:
    """Print the tables and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="one draw")
    parser.add_argument("--images", default="hh,hv", help="which, with commas")
    parser.add_argument("--seed", type=int, default=0, help="of the first draw")
    parser.add_argument("--draws", type=int, default=4, help="number of draws")
    arguments = parser.parse_args()
    if "RADCAL_DATA" not in os.environ:
        print("RADCAL_DATA is not set: all images are skipped")
        return
    draws = range(arguments.seed, arguments.seed + (1 if arguments.quick else arguments.draws))
    result: dict[str, Any] = {}
    with one_thread():
        for name in arguments.images.split(","):
            found = result[name] = image(name, draws)
            print("  ".join(f"{k} {v:.3f}" if isinstance(v, float) else f"{k} {v}" for k, v in found.items()))
    print(json.dumps({"fields_left_out": result}))


if __name__ == "__main__":
    main()
