"""Error of fitted laws, compared with a hidden law.

    python benchmarks/right_law.py [--quick] [--objectives classes,density,likelihood]

The pixels are 1,000 of the published dyke's hidden law with independent speckle. The law and the
cumulants of log-gamma speckle take the place of the simulator, so that the result depends on the objective and not on a
surrogate. The table gives the largest difference [dB] between hidden and found law over the incidence seen (5-95 %):
its median, 90 % quantile and maximum over the seeds. Further lines give the error of the law if the mapped incidence
has an error of 4 degrees, which is, or is not, configured as ``incidence_error_deg``.
"""

from __future__ import annotations

import argparse
import json
import warnings
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.ground.correlation import estimate_correlation
from radcal.ground.ground import Ground
from radcal.ground.patches import label_patches
from radcal.inference.misfit import LikelihoodMisfit, Method
from radcal.inference.pooled_laws import FittedLaw, fit_laws
from radcal.laws import LAWS
from radcal.processes import one_thread
from radcal.scene.slant_range import flat_incidence_deg

LAW = LAWS["mangia"]
TRUTH = [6.1, 14.2, 21.5, 3.3]
LOOKS = 4.0
PIXELS = 1000
FLEVOLAND_BOUNDS = [[-80, 10], [0, 60], [0, 60], [0, 20]]
MEANS = 10  # rows of a block
FITS: dict[str, dict[str, Any]] = {
    "classes": {},
    "likelihood": {"misfit": LikelihoodMisfit},
    "density": {"classes": 1, "free_looks": False, "priors": False},  # three statistics of all pixels, at known looks
}


def one_area(incidence_deg: NDArray[np.float64], looks: float, rng: np.random.Generator, error_deg: float) -> Ground:
    """Pixels of the hidden law with independent speckle, and with an error of their mapped angles."""
    level = LAW(np.radians(incidence_deg), TRUTH)
    values = level + 10.0 * np.log10(rng.gamma(looks, 1.0 / looks, incidence_deg.size))
    one = np.ones(incidence_deg.size, dtype=np.int64)
    return Ground(values, incidence_deg + rng.normal(0.0, error_deg, incidence_deg.size), one, one)


def hidden(seed: int, sd_deg: float, looks: float, method: Method, error_deg: float = 0.0) -> tuple[float, FittedLaw]:
    """Law error [dB] over the mapped incidence, and the law found."""
    rng = np.random.default_rng(seed)
    incidence = np.clip(rng.normal(45.0, sd_deg, PIXELS), 2.0, 85.0)
    ground = one_area(incidence, looks, rng, error_deg)
    found = fit_laws({"area": ground}, {"area": method})["area"]
    return LAW.largest_difference_db(found.fit.parameters, TRUTH, incidence), found


def synthetic(objectives: list[str], seeds: int) -> dict[str, Any]:
    """Errors for the hidden law, by objective, standard deviation of the incidence and true looks."""
    bounds = [[0, 50]] * 4
    results: dict[str, Any] = {}
    print(f"hidden law, {PIXELS} pixels, {seeds} seeds, looks assumed {LOOKS:g}: largest law error [dB]")
    print(f"{'objective':12} {'incidence sd':>12} {'looks':>6} {'median':>8} {'90 %':>8} {'worst':>8}")
    for objective in objectives:
        for sd_deg in (3.0, 6.0, 10.0):
            for looks in (4.0, 2.5):
                method = Method(LAW, bounds, LOOKS, **FITS[objective])
                errors = [hidden(seed, sd_deg, looks, method)[0] for seed in range(seeds)]
                row = {"median": float(np.median(errors)), "p90": float(np.quantile(errors, 0.9)), "worst": max(errors)}
                results.setdefault(objective, {})[f"sd{sd_deg:g}_looks{looks:g}"] = row
                shown = " ".join(f"{value:8.2f}" for value in row.values())
                print(f"{objective:12} {sd_deg:12g} {looks:6g} {shown}", flush=True)
    if "classes" in objectives:
        results["incidence_error"] = mapped_with_errors(bounds, seeds)
    return results


def mapped_with_errors(bounds: list[list[int]], seeds: int) -> dict[str, Any]:
    """Law errors for an incidence error of 4 degrees (sd of incidence 6), without and with ``incidence_error_deg``."""
    results = {}
    for told in (0.0, 4.0):
        method = Method(LAW, bounds, LOOKS, incidence_error_deg=told)
        errors = [hidden(seed, 6.0, LOOKS, method, error_deg=4.0)[0] for seed in range(seeds)]
        results["told" if told else "untold"] = {"median": float(np.median(errors)), "n": seeds}
        print(
            f"incidence mapped with an error of 4 deg, {'configured' if told else 'not configured'}: median law error "
            f"{np.median(errors):.2f} dB",
            flush=True,
        )
    return results


def flevoland_grounds(folder: Path, polarisation: str) -> dict[str, Ground]:
    """Pixels of the fourteen materials with fields, blocks of 10 rows and effective sample size."""
    import rasterio

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # an image in slant range has no georeference
        with rasterio.open(folder / "labels.tif") as file:
            labels = file.read(1)
        with rasterio.open(folder / f"sigma0_{polarisation}.tif") as file:
            power = file.read(1)
        image = 10.0 * np.log10(power)
    names = json.loads((folder / "labels.json").read_text())
    incidence = flat_incidence_deg(20.0, 44.0, labels.shape[0])
    grounds = {}
    for number in range(1, 15):
        mask = (labels == number) & np.isfinite(image)
        pixels, row = np.flatnonzero(mask), np.nonzero(mask)[0]
        grounds[names[str(number)]] = Ground(
            image[mask].astype(np.float64),
            incidence[row],
            label_patches(labels == number)[mask],
            row // MEANS,
            pixels,
            estimate_correlation(image, pixels),
        )
    return grounds


def geometric(values: NDArray[np.float64]) -> float:
    """Geometric mean."""
    return float(np.exp(np.mean(np.log(values))))


def main() -> None:
    """Print the tables and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="4 seeds in place of 20")
    parser.add_argument("--objectives", default="classes,density,likelihood", help="which, with commas")
    arguments = parser.parse_args()
    objectives = arguments.objectives.split(",")
    result: dict[str, Any] = {}
    with one_thread():
        result["synthetic"] = synthetic(objectives, 4 if arguments.quick else 20)
    print(json.dumps({"right_law": result}))


if __name__ == "__main__":
    main()
