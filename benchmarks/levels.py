"""Effect of ``target.normalisation`` on the law found if the level, or the laws of other materials, are wrong.

    python benchmarks/levels.py [--quick]

The case is the published dyke (config/dyke_published.yaml) without registration. The first table is for a measured
image whose level is raised by 3 dB. The raised level must not change the shape of the law found, which is the law minus
its mean over the incidence seen (5-95 %). In the second table, the laws of the six other materials have independent
errors with a standard deviation of 3 dB; the table gives the largest difference in shape between found and hidden law.
"""

from __future__ import annotations

import argparse
import json
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radcal.calibration.loop import calibrate
from radcal.calibration.steps import noise_seed
from radcal.config import load
from radcal.laws import LAWS
from radcal.measurement.sources import make_measurement
from radcal.processes import one_thread
from radcal.radar.projection import make_geometry
from radcal.registration.registered import register
from radcal.scene.sources import make_scene
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore
from radcal.targets.target_fit import make_targets

PUBLISHED = Path(__file__).resolve().parents[1] / "config/dyke_published.yaml"
TRUTH = {"dyke": [6.1, 14.2, 21.5, 3.3]}
WRONG_DB = 3.0


def shape_db(parameters: Sequence[float], phi_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Shape of a law: the law minus its mean [dB]."""
    values = LAWS["mangia"](phi_rad, parameters)
    return values - values.mean()


class Bench:
    """Published dyke with one run store for all calibrations."""

    def __init__(self, folder: Path) -> None:
        self.default = load([PUBLISHED])
        scene = make_scene(self.default.scene, list(self.default.materials))
        self.geometry = make_geometry(scene, self.default.radar)
        self.simulator = BuiltinSimulator(self.geometry, self.default.radar, self.default.laws)
        self.runner = Runner(RunStore(folder), self.simulator, self.geometry, scene.identity, self.default)
        dyke = self.geometry.incidence_deg.ravel()[self.geometry.pixels("dyke", 1)]
        self.phi = np.radians(np.linspace(*np.percentile(dyke, [5.0, 95.0]), 201))

    def found(
        self, normalisation: str, seed: int, offset_db: float, hidden: Mapping[str, list[float]]
    ) -> tuple[list[float], str, float]:
        """X of the dyke, reason of the end, and level subtracted [dB]."""
        case = load(
            [PUBLISHED],
            {
                "measurement": {
                    "synthetic": {"parameters": dict(hidden), "seed": seed, "offset_db": offset_db, "warp_px": 0.0}
                },
                "registration": {"method": "none"},
                "objective": "density",
                "target": {"normalisation": normalisation},
            },
        )
        measurement = make_measurement(case, self.geometry, self.simulator)
        reference = self.runner.run(case.start_parameters, noise_seed(case), image=True).image_db
        assert reference is not None  # asked for
        registered = register(reference, measurement, case.registration)
        targets = make_targets(case, self.geometry, registered, reference, None)
        history, decision = calibrate(case, [self.runner], [targets])
        return list(history.best("dyke").parameters), str(decision.reason), targets.levels.offset_db


def main() -> None:
    """Print both tables and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="2 draws of wrong laws in place of 10")
    seeds = range(1, 3 if parser.parse_args().quick else 11)
    lifted, wrong = {}, {}
    with tempfile.TemporaryDirectory() as folder, one_thread():
        bench = Bench(Path(folder))
        print("the measurement raised by 3 dB")
        for normalisation in ("offset", "image"):
            one, other = (bench.found(normalisation, 2, offset, TRUTH) for offset in (0.0, 3.0))
            lifted[normalisation] = float(np.abs(shape_db(one[0], bench.phi) - shape_db(other[0], bench.phi)).max())
            print(
                f"{normalisation:>8}: level {one[2]:.3f} and {other[2]:.3f} dB, ended {one[1]}, {other[1]}; "
                f"shape differs by {lifted[normalisation]:.1e} dB",
                flush=True,
            )
        print(f"other laws wrong by {WRONG_DB:g} dB (sd), draws {seeds[0]} to {seeds[-1]}")
        for normalisation in ("none", "offset", "image"):
            errors = []
            for seed in seeds:
                rng = np.random.default_rng(seed)
                others = {
                    name: [
                        x + (rng.normal(0.0, WRONG_DB) if k == 0 else 0.0)
                        for k, x in enumerate(material.start_parameters)
                    ]
                    for name, material in bench.default.materials.items()
                    if name != "dyke"
                }
                x, reason, level = bench.found(normalisation, seed, 0.0, {**TRUTH, **others})
                errors.append(float(np.abs(shape_db(x, bench.phi) - shape_db(TRUTH["dyke"], bench.phi)).max()))
                line = f"{normalisation:>8}, draw {seed:2d}: {reason:12} level {level:6.2f} dB"
                print(f"{line}, shape error {errors[-1]:.2f} dB", flush=True)
            wrong[normalisation] = {"median": float(np.median(errors)), "worst": max(errors)}
    for normalisation, error in wrong.items():
        print(f"{normalisation:>8}: shape error median {error['median']:.2f}, worst {error['worst']:.2f} dB")
    print(json.dumps({"lifted_db": lifted, "wrong_laws_db": wrong}))


if __name__ == "__main__":
    main()
