"""Time, memory and disk of one look of a large scene in strips of azimuth, each computed by a process of its own.

    python benchmarks/simulator_strips.py [--quick] [--km2 500] [--rows 512] [--first 2] [--folder FOLDER]

The scene is hilly, with cells of 1 m, 7 materials in fields, and no objects; its file is written in pieces. One process
computes the frame of the strips, and each further one the geometry of a strip and one look of it in dB. ``--first``
stops after some strips; the totals of all are then in proportion. The peak of a process contains the pages of files
that it has mapped, which the operating system may take back; its own memory, read ten times a second, does
not.

Then the first four, the middle four and the last four strips are computed again as one strip each, and their pixels and
masks are compared with those of the strips (``unlike``: number of differing values).
"""

from __future__ import annotations

import argparse
import json
import math
import os
import re
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from contextlib import ExitStack
from dataclasses import asdict, replace
from pathlib import Path

from radcal.scene.model import Scene

os.environ["NUMBA_NUM_THREADS"] = "1"

import h5py
import numpy as np
from scipy.ndimage import gaussian_filter

from radcal.config import Radar
from radcal.laws import LAWS
from radcal.radar.geometry import Frame, read_geometry, write_geometry
from radcal.radar.projection import make_frame, make_geometry, strips_of
from radcal.scene.model import scene_on_disk
from radcal.simulators.builtin import BuiltinSimulator
from radcal.storage.records import write_hdf5

NAMES = tuple(f"m{k}" for k in range(1, 8))
MASKS = ("material", "layover", "shadow")
PATCH = 1024
RADAR = Radar(
    altitude_m=100_000.0, range_spacing_m=0.71, azimuth_spacing_m=1.0, range_resolution_m=1.0,
    azimuth_resolution_m=1.3, looks=1.0,
)  # fmt: skip


def write_large_scene(path: Path, side: int) -> None:
    """Scene of hills of some metres and fields of 64 m, which repeat themselves every 1024 m."""
    rng = np.random.default_rng(1)
    hills = gaussian_filter(rng.standard_normal((PATCH, PATCH)), 60.0, mode="wrap")
    hills *= 4.0 / hills.std()
    fields = np.kron(rng.integers(1, 8, (PATCH // 64, PATCH // 64)), np.ones((64, 64))).astype(np.uint8)
    across = np.arange(side) % PATCH
    with write_hdf5(path, "scene") as file:
        file.attrs["identity"], file.attrs["cell_m"] = "benchmark", 1.0
        file.create_dataset("names", data=np.array(NAMES, dtype=object))
        for name, patch in (("elevation_m", hills), ("material", fields)):
            data = file.create_dataset(name, (side, side), patch.dtype)
            for first in range(0, side, PATCH):
                data[first : first + PATCH] = patch[: side - first, across]


def job(folder: Path, task: str, rows: int) -> None:
    """Frame of the strips, or geometry and image of one strip, or of several as one (``3-6``)."""
    frame = folder / "frame.json"
    if task == "frame":
        with scene_on_disk(folder / "scene.h5") as scene:
            frame.write_text(json.dumps(asdict(make_frame(scene, RADAR))))
        return
    scene = Scene.read(folder / "scene.h5")
    side, shared = len(scene.material), Frame(**json.loads(frame.read_text()))
    strips, ends = strips_of(side, 1.0, RADAR, number_of(side, rows), shared), [int(one) for one in task.split("-")]
    strip = replace(strips[ends[0]], last=strips[ends[-1]].last, right=strips[ends[-1]].right)
    made = make_geometry(scene, RADAR, strip=strip)
    write_geometry(folder / f"{task}.h5", made, RADAR)
    del made
    geometry = read_geometry(folder / f"{task}.h5")
    simulator = BuiltinSimulator(geometry, RADAR, dict.fromkeys(NAMES, LAWS["mangia"]))
    image = simulator.run({name: [-20.0 + k, 5.0, 10.0, 3.0] for k, name in enumerate(NAMES)}, 1)
    with write_hdf5(folder / f"image-{task}.h5", "measurement") as file:
        file["image_db"] = strip.cut(image)
        for name in MASKS:
            file[name] = strip.cut(getattr(geometry, name))


def unlike(folder: Path, piece: str) -> int:
    """Number of values that differ between a piece and its strips."""
    first, last = (int(one) for one in piece.split("-"))
    found = 0
    with ExitStack() as opened:
        files = [
            opened.enter_context(h5py.File(folder / f"image-{one}.h5")) for one in (piece, *range(first, last + 1))
        ]
        for name in ("image_db", *MASKS):
            whole, *parts = (one[name][()] for one in files)
            found += np.count_nonzero(whole.view(np.uint8) != np.concatenate(parts, axis=-1).view(np.uint8))
    return found


def measured(command: list[str]) -> dict[str, float]:
    """What a process prints, its wall time and the largest of its own memory, without pages of mapped files."""
    started, own = time.perf_counter(), 0
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        status = Path(f"/proc/{process.pid}/status")
        while process.poll() is None:
            found = re.search(r"RssAnon:\s+(\d+)", status.read_text())
            own = max(own, int(found[1]) if found else 0)
            time.sleep(0.1)
        printed = process.communicate()[0]
    if process.returncode:
        sys.exit(process.returncode)
    return {**json.loads(printed), "own_gib": own / 2**20, "wall_s": time.perf_counter() - started}


def number_of(side: int, rows: int) -> int:
    """Number of strips of about ``rows`` rows."""
    return max(1, math.ceil(side / 256) * 256 // rows)


def main() -> None:
    """Print a line for each process and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="1 km2 in place of 500")
    parser.add_argument("--km2", type=float, default=500.0)
    parser.add_argument("--rows", type=int, default=512, help="rows of the scene in a strip, a multiple of 256")
    parser.add_argument("--first", type=int, help="number of strips to compute, instead of all")
    parser.add_argument("--folder", type=Path, default=Path(tempfile.gettempdir()))
    parser.add_argument("--job", nargs=2, help=argparse.SUPPRESS)
    options = parser.parse_args()
    if options.job:
        job(Path(options.job[0]), options.job[1], options.rows)
        used = resource.getrusage(resource.RUSAGE_SELF)
        print(json.dumps({"cpu_s": used.ru_utime + used.ru_stime, "peak_gib": used.ru_maxrss / 2**20}))
        return
    side = 1000 if options.quick else round(1000 * math.sqrt(options.km2))
    strips = number_of(side, options.rows)
    computed = min(strips, options.first or strips)
    pieces = sorted({f"{max(0, one)}-{min(one + 3, computed - 1)}" for one in (0, computed // 2 - 2, computed - 4)})
    folder = Path(tempfile.mkdtemp(dir=options.folder))
    try:
        write_large_scene(folder / "scene.h5", side)
        found = {}
        for task in ("frame", *map(str, range(computed)), *pieces):
            command = [sys.executable, __file__, "--rows", str(options.rows), "--job", str(folder), task]
            found[task] = one = measured(command)
            print(
                f"{task:>6}: {one['cpu_s']:7.1f} CPU s, {one['wall_s']:7.1f} s, peak {one['peak_gib']:.2f} GiB, "
                f"own memory {one['own_gib']:.2f} GiB",
                flush=True,
            )
        differing = int(sum(unlike(folder, piece) for piece in pieces))
        scene_gb = (folder / "scene.h5").stat().st_size / 1e9
        files = [folder / f"{prefix}{number}.h5" for prefix in ("", "image-") for number in range(computed)]
        strips_gb = sum(path.stat().st_size for path in files) / 1e9 * strips / computed
    finally:
        shutil.rmtree(folder)
    frame, each = found["frame"], [found[str(one)] for one in range(computed)]
    print(
        json.dumps(
            {
                "km2": side**2 / 1e6,
                "strips": strips,
                "computed": computed,
                "frame_s": frame["cpu_s"],
                "frame_gib": frame["peak_gib"],
                "frame_own_gib": frame["own_gib"],
                "strips_s": sum(one["cpu_s"] for one in each) * strips / computed,
                "strip_gib": max(one["peak_gib"] for one in each),
                "wall_s": frame["wall_s"] + sum(one["wall_s"] for one in each),
                "longest_s": frame["wall_s"] + max(one["wall_s"] for one in each),
                "scene_gb": scene_gb,
                "strips_gb": strips_gb,
                "pieces": len(pieces),
                "unlike": differing,
            }
        )
    )


if __name__ == "__main__":
    main()
