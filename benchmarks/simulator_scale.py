"""The built-in simulator at the size of a campaign, beside a pair of Fourier transforms of that size.

    python benchmarks/simulator_scale.py [--quick]

A hilly scene of 1 m cells with 24 materials in fields and 3,358 objects in a square kilometre (188,914 on 56 km2:
trees and buildings with a footprint, a fifth of them points), seen from the side. Timed: one single-look complex image
and its intensity from new laws; the same again when one material, a tenth of the scene, has another law; a forward
and inverse complex64 transform of the image's size (scipy.fft, 2 workers) in the same process; geometry too. The
exponent is that of time against area.
"""

from __future__ import annotations

import argparse
import json
import resource
import time
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy import fft
from scipy.ndimage import gaussian_filter

from radcal.config import Radar
from radcal.radar.geometry import make_geometry
from radcal.radar.image import ImageFormation
from radcal.radar.laws import law_for
from radcal.radar.reflectivity import law_tables, reflectivity
from radcal.scene.model import Scene
from radcal.scene.object_generator import generate_objects
from radcal.scene.objects import Objects

MATERIALS = 24
OBJECTS_PER_M2 = 188_914 / 7500**2
FIELD_M = 200
RADAR = Radar(
    altitude_m=12_000.0, looks=1, range_spacing_m=0.71, azimuth_spacing_m=1.0, range_resolution_m=1.0,
    azimuth_resolution_m=1.3,
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


def best(times: list[float]) -> float:
    """Smallest of some wall times [s]."""
    return min(times)


def measure(side: int, repeats: int) -> dict[str, float]:
    """Wall times [s] at one size."""
    started = time.perf_counter()
    geometry = make_geometry(scene(side), RADAR)
    found = {"geometry_s": time.perf_counter() - started, "pixels": float(np.prod(geometry.shape))}
    formation = ImageFormation(RADAR, geometry.shape, RADAR.nesz_db, geometry.points)
    laws = dict.fromkeys(geometry.names, law_for("mangia"))
    x = {name: [-20.0 + k, 5.0, 10.0, 3.0] for k, name in enumerate(geometry.names)}
    image_s, rerun_s, pair_s = [], [], []
    image: NDArray[np.float32] | None = None
    for n in range(repeats):
        started = time.perf_counter()
        cells = reflectivity(geometry, law_tables(geometry.names, laws, x))
        image = formation.intensity(cells, 1)
        image_s.append(time.perf_counter() - started)
        x = {**x, "m1": [-20.0, 5.0, 10.0, 3.0 + 0.1 * (n + 1)]}
        started = time.perf_counter()
        changed = np.arange(MATERIALS + 2) == 1
        tables = law_tables(geometry.names, {"m1": laws["m1"]}, x)
        cells = reflectivity(geometry, tables, cells, changed)
        formation.intensity(cells, 1, image, formation.touched(cells, changed))
        rerun_s.append(time.perf_counter() - started)
    del image
    size = [fft.next_fast_len(n) for n in geometry.shape]
    field = np.ones(size, dtype=np.complex64)
    for _ in range(repeats):
        started = time.perf_counter()
        fft.ifft2(fft.fft2(field, workers=2, overwrite_x=True), workers=2, overwrite_x=True)
        pair_s.append(time.perf_counter() - started)
    return {**found, "image_s": best(image_s), "rerun_s": best(rerun_s), "fft_pair_s": best(pair_s)}


def main() -> None:
    """Print a line per size and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="up to 4 km2 in place of 56")
    sides = (1000, 2000) if parser.parse_args().quick else (1000, 2000, 4000, 7500)
    measure(500, 1)  # compiles
    rows = []
    print(
        f"{'km2':>5} {'pixels':>11} {'geometry':>9} {'image':>8} {'rerun':>8} {'FFT pair':>9} {'ratio':>6} {'rerun':>6}"
    )
    for side in sides:
        row = measure(side, 3)
        rows.append(row)
        print(
            f"{side**2 / 1e6:5.0f} {row['pixels']:11,.0f} {row['geometry_s']:7.1f} s {row['image_s']:6.2f} s "
            f"{row['rerun_s']:6.2f} s {row['fft_pair_s']:7.2f} s {row['image_s'] / row['fft_pair_s']:6.2f} "
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
        "geometry_s": last["geometry_s"],
        "peak_gib": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20,
        "area_exponent": float(exponent),
    }
    print(json.dumps(result))


if __name__ == "__main__":
    main()
