"""Time of the built-in simulator for images of up to 56 km2, compared with two Fourier transforms of the image.

    python benchmarks/simulator_scale.py [--quick]

The scene is hilly, with cells of 1 m, 24 materials in fields, and 3,358 objects per square kilometre (188,914 on 56
km2). Four fifths of the objects are trees and buildings with a footprint; the others are points. The times are those
of:

- one complete run, from laws to image in dB, at the default number of looks;
- the next run, in which one material, which covers a tenth of the scene, has another law;
- a forward and an inverse complex64 transform of the image's size (scipy.fft, 2 workers) in the same process;
- the computation of the geometry;
- writing the geometry's file, once for a case, and reading it, in every job.

The result ``area_exponent`` is the exponent of a power law for the time of a complete run as a function of the area.
"""

from __future__ import annotations

import argparse
import json
import resource
import tempfile
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.ndimage import gaussian_filter

from radcal.config import Radar
from radcal.laws import LAWS
from radcal.radar.geometry import Geometry, read_geometry, write_geometry
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
    """Wall times [s] at one size."""
    started = time.perf_counter()
    geometry = make_geometry(scene(side), RADAR)
    found = {"geometry_s": time.perf_counter() - started, "pixels": float(np.prod(geometry.shape))}
    found |= measure_file(geometry)
    simulator = BuiltinSimulator(geometry, RADAR, dict.fromkeys(geometry.names, LAWS["mangia"]))
    x = {name: [-20.0 + k, 5.0, 10.0, 3.0] for k, name in enumerate(geometry.names)}
    image_s, rerun_s, pair_s = [], [], []
    for n in range(repeats):
        # another seed, so that no part of the last run can be reused
        image_s.append(timed(simulator.run, x, n))
        x = {**x, "m1": [-20.0, 5.0, 10.0, 3.0 + 0.1 * (n + 1)]}
        rerun_s.append(timed(simulator.run, x, n))
    shape = geometry.shape
    del simulator, geometry
    field = np.ones([fft.next_fast_len(n) for n in shape], dtype=np.complex64)
    for _ in range(repeats):
        pair_s.append(
            timed(lambda: fft.ifft2(fft.fft2(field, workers=2, overwrite_x=True), workers=2, overwrite_x=True))
        )
    return {**found, "image_s": min(image_s), "rerun_s": min(rerun_s), "fft_pair_s": min(pair_s)}


def fft_pair(field: NDArray[np.complex64]) -> None:
    """Forward and inverse transform."""
    fft.ifft2(fft.fft2(field, workers=2, overwrite_x=True), workers=2, overwrite_x=True)


def measure_file(geometry: Geometry) -> dict[str, float]:
    """Wall times [s] and size [MB] of a geometry's file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "geometry.h5"
        written_s = timed(write_geometry, path, geometry, RADAR)
        return {"write_s": written_s, "read_s": timed(read_geometry, path), "file_mb": path.stat().st_size / 1e6}


def timed(work: Callable[..., object], *arguments: object) -> float:
    """Wall time of a call [s]."""
    started = time.perf_counter()
    work(*arguments)
    return time.perf_counter() - started


def main() -> None:
    """Print a line per size and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="up to 4 km2 in place of 56")
    sides = (1000, 2000) if parser.parse_args().quick else (1000, 2000, 4000, 7500)
    measure(500, 1)  # compiles
    rows = []
    print(
        f"{'km2':>5} {'pixels':>11} {'geometry':>9} {'written':>8} {'read':>7} {'file':>9} {'run':>8} {'next':>8} "
        f"{'FFT pair':>9} {'ratio':>6} {'next':>6}"
    )
    for side in sides:
        row = measure(side, 3)
        rows.append(row)
        print(
            f"{side**2 / 1e6:5.0f} {row['pixels']:11,.0f} {row['geometry_s']:7.1f} s {row['write_s']:6.1f} s "
            f"{row['read_s']:5.1f} s {row['file_mb']:6.0f} MB {row['image_s']:6.2f} s {row['rerun_s']:6.2f} s "
            f"{row['fft_pair_s']:7.2f} s {row['image_s'] / row['fft_pair_s']:6.2f} "
            f"{row['rerun_s'] / row['fft_pair_s']:6.2f}",
            flush=True,
        )
    exponent = np.polyfit(np.log([side**2 for side in sides]), np.log([row["image_s"] for row in rows]), 1)[0]
    last = rows[-1]
    result = {
        "fft_pair_s": last["fft_pair_s"],
        "image_s": last["image_s"],
        "ratio": last["image_s"] / last["fft_pair_s"],
        "rerun_ratio": last["rerun_s"] / last["fft_pair_s"],
        "looks": RADAR.looks,
        **{key: last[key] for key in ("geometry_s", "write_s", "read_s", "file_mb")},
        "peak_gib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        "area_exponent": float(exponent),
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
