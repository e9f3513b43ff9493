"""Time of the built-in simulator for images of up to 56 km2, compared with two Fourier transforms of the image.

    python benchmarks/simulator_scale.py [--quick]

The scene is hilly, with cells of 1 m, 24 materials in fields, and 3,358 objects per square kilometre (188,914 on 56
km2). Four fifths of the objects are trees and buildings with a footprint; the others are points. All times
are CPU seconds (user and system, with one thread) divided by those of a forward and an inverse complex64 transform of
the image's size (scipy.fft, one worker, padded by next_fast_len) in the same process. They are those of:

- one complete run, from laws to image in dB, at the default number of looks, and at one look (``ratio_per_look``);
- the next run, in which one material, which covers a tenth of the scene, has another law;
- the computation of the geometry and the writing of its file, once for a case (``geometry_ratio``);
- the reading of what a run needs from this file, in every job (``read_ratio``).

The result ``area_exponent`` is the exponent of a power law for the time of a complete run as a function of the area,
from 4 km2 on.
"""

from __future__ import annotations

import argparse
import json
import os
import resource
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

os.environ["NUMBA_NUM_THREADS"] = "1"  # before numba is imported: as many as the transform has

import numpy as np
from scipy import fft
from scipy.ndimage import gaussian_filter

from radcal.config import Radar
from radcal.laws import LAWS
from radcal.radar.geometry import read_geometry, write_geometry
from radcal.radar.projection import make_geometry
from radcal.scene.model import Scene
from radcal.scene.object_generator import generate_objects
from radcal.scene.objects import Objects
from radcal.simulators.builtin import BuiltinSimulator

MATERIALS = 24
OBJECTS_PER_M2 = 188_914 / 7500**2
FIELD_M = 200
RADAR = Radar(
    altitude_m=12_000.0, range_spacing_m=0.71, azimuth_spacing_m=1.0, range_resolution_m=1.0, azimuth_resolution_m=1.3
)  # fmt: skip


def scene(side: int) -> Scene:
    """Hills of some metres, and square fields of 200 m; material 1 covers a tenth."""
    rng = np.random.default_rng(1)
    coarse = gaussian_filter(rng.standard_normal((side // 25 + 2, side // 25 + 2)), 4.0)
    elevation = np.kron(coarse / coarse.std() * 4.0, np.ones((25, 25)))[:side, :side]
    elevation = gaussian_filter(elevation, 12.0)
    fields = -(-side // FIELD_M)
    share = np.array([0.1, *[0.9 / (MATERIALS - 1)] * (MATERIALS - 1)])
    kinds = 1 + rng.choice(MATERIALS, size=(fields, fields), p=share)
    material = np.kron(kinds, np.ones((FIELD_M, FIELD_M), dtype=int))[:side, :side].astype(np.uint8)
    names = tuple(f"m{k}" for k in range(1, MATERIALS + 1))
    return Scene("benchmark", names, material, elevation, 1.0, objects=objects(side))


def objects(side: int) -> Objects:
    """Seven tenths trees, one tenth buildings, the rest points."""
    n = round(OBJECTS_PER_M2 * side**2)
    trees, buildings = 7 * n // 10, n // 10
    some = generate_objects((side, side), 1, trees=trees, cars=n - trees - buildings, buildings=buildings)
    extended = some.kind != some.kinds.index("car")
    return replace(some, length_m=some.length_m * extended, width_m=some.width_m * extended)


def measure(side: int, repeats: int) -> dict[str, float]:
    """CPU seconds at one size, in the order in which the memory for each step is free for the next."""
    ground = scene(side)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "geometry.h5"
        made_s = cpu_s(lambda: write_geometry(path, make_geometry(ground, RADAR), RADAR))
        found = {"geometry_s": made_s, "file_mb": path.stat().st_size / 1e6}
        read_s = [cpu_s(read_for_a_run, path) for _ in range(repeats)]
        geometry = read_geometry(path)
    laws = dict.fromkeys(geometry.names, LAWS["mangia"])
    x = {name: [-20.0 + k, 5.0, 10.0, 3.0] for k, name in enumerate(geometry.names)}
    one_look = BuiltinSimulator(geometry, RADAR.model_copy(update={"looks": 1.0}), laws)
    # another seed, so that no part of the last run can be reused
    look_s = [cpu_s(one_look.run, x, n) for n in range(repeats)]
    simulator, image_s, rerun_s = BuiltinSimulator(geometry, RADAR, laws), [], []
    for n in range(repeats):
        image_s.append(cpu_s(simulator.run, x, n))
        x = {**x, "m1": [-20.0, 5.0, 10.0, 3.0 + 0.1 * (n + 1)]}
        rerun_s.append(cpu_s(simulator.run, x, n))
    field = np.ones([fft.next_fast_len(n) for n in geometry.shape], dtype=np.complex64)
    del one_look, simulator
    pair_s = [cpu_s(lambda: fft.ifft2(fft.fft2(field, workers=1), workers=1)) for _ in range(repeats)]
    seconds = {"read_s": read_s, "look_s": look_s, "image_s": image_s, "rerun_s": rerun_s, "fft_pair_s": pair_s}
    return {**found, "pixels": float(np.prod(geometry.shape)), **{key: min(each) for key, each in seconds.items()}}


def read_for_a_run(path: Path) -> None:
    """Read the arrays of a geometry's file that a run uses."""
    geometry = read_geometry(path)
    for name in ("cell_start", "cell_material", "facet_start", "facet_incidence", "facet_weight", "material"):
        np.array(getattr(geometry, name))


def cpu_s(work: Callable[..., object], *arguments: object) -> float:
    """CPU time of a call, user and system [s]."""
    started = time.process_time()
    work(*arguments)
    return time.process_time() - started


def main() -> None:
    """Print a line per size and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="up to 4 km2 in place of 56")
    sides = (1000, 2000) if parser.parse_args().quick else (2000, 4000, 7500)
    measure(500, 1)  # compiles
    rows = []
    print(f"{'km2':>5} {'pixels':>11} {'FFT pair':>9} | pairs: geometry and file, read, look, run, next run")
    for side in sides:
        row = measure(side, 3)
        rows.append(row)
        pairs = [row[key] / row["fft_pair_s"] for key in ("geometry_s", "read_s", "look_s", "image_s", "rerun_s")]
        print(
            f"{side**2 / 1e6:5.0f} {row['pixels']:11,.0f} {row['fft_pair_s']:7.2f} s | "
            f"{' '.join(f'{one:7.2f}' for one in pairs)} | {row['file_mb']:,.0f} MB",
            flush=True,
        )
    large = [(side**2, row["image_s"]) for side, row in zip(sides, rows, strict=True) if side >= 2000]
    exponent = np.polyfit(*np.log(large).T, 1)[0] if len(large) > 1 else np.nan
    last = rows[-1]
    pair_s = last["fft_pair_s"]
    result = {
        "fft_pair_s": pair_s,
        "image_s": last["image_s"],
        "looks": RADAR.looks,
        "ratio": last["image_s"] / pair_s,
        "ratio_per_look": last["look_s"] / pair_s,
        "rerun_ratio": last["rerun_s"] / pair_s,
        "geometry_ratio": last["geometry_s"] / pair_s,
        "read_ratio": last["read_s"] / pair_s,
        "file_mb": last["file_mb"],
        "peak_gib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        "area_exponent": None if np.isnan(exponent) else float(exponent),
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
