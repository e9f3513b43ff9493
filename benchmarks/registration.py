"""Registration of two real images with independent speckle by radcal, scikit-image and GeFolki's own programs.

    RADCAL_DATA=... [GEFOLKI=...] python benchmarks/registration.py [--quick] [--tune] [--methods ours,ilk_32]
        [--lengths 60,75] [--first-seed 70001] [--draws 24]

The fixed image is Flevoland in HH; the moving image is Flevoland in HV, warped by a known smooth displacement field.
The displacement field is white noise, smoothed by a Gaussian filter of sigma s. The autocorrelation of the field,
exp(-d^2 / (4 s^2)), falls to 1/e at the correlation length 2 s. The largest displacement is 2 to 6 pixels, or none
(correlation length 0). The images are crops of 512 x 512 pixels at random places. The error of a draw is the mean
end-point error without the outer 40 pixels; the table gives the median over 8 draws of each correlation length. The
constants of ``radcal.registration.gefolki`` were chosen on draws of even seeds (``--tune``); the results are for odd
seeds. Column ``ratio`` is the geometric mean over the draws of radcal's error, divided by that of the method.

scikit-image's methods receive the images in dB; its ILK method is also tried with ranks in windows of 33 pixels,
and with its flow smoothed by a Gaussian filter (``ilk_24_smooth_10``: radius 24, sigma 10 pixels), whose sigmas were
chosen on even seeds.
The environment variable ``GEFOLKI`` names the folder ``python`` of the programs by GeFolki's authors
(github.com/aplyer/gefolki, GPL 3, not shipped). The program E-Folki is run with the settings of the authors'
demonstration. Column ``stated`` of the table is the ratio of the standard error given by radcal to the actual error,
both as root mean squares.
"""

from __future__ import annotations

import argparse
import json
import os
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rasterio
from numpy.typing import NDArray
from rasterio.errors import NotGeoreferencedWarning
from scipy.ndimage import gaussian_filter, map_coordinates
from skimage.registration import optical_flow_ilk, optical_flow_tvl1

from radcal.config import RegistrationConfig
from radcal.image.model import Measurement
from radcal.processes import one_thread
from radcal.registration.displacement import invert
from radcal.registration.gefolki import find_flow, pyramid, rank_transform
from radcal.registration.registered import register

SIZE, MARGIN = 512, 40
INSIDE = (slice(MARGIN, -MARGIN),) * 2
LENGTHS_PX = (60, 75, 90, 120, 180, 0)
RADII = (16, 24, 32, 48)
SMOOTHED = ((16, 15), (24, 10), (24, 22))  # radius of ILK and sigma of the filter on its flow [pixels]
Image = NDArray[np.float32]
Method = Callable[[Image, Image], NDArray[np.float64]]


def read_db(name: str) -> Image:
    """One of the images [dB], NaN where there is no power."""
    folder = os.environ.get("RADCAL_DATA")
    if not folder:
        sys.exit("Set RADCAL_DATA to the folder that holds flevoland/.")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", NotGeoreferencedWarning)
        with rasterio.open(Path(folder) / "flevoland" / name) as raster:
            power = raster.read(1).astype(np.float64)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(power > 0, 10.0 * np.log10(power), np.nan).astype(np.float32)


def pair(hh: Image, hv: Image, length_px: int, seed: int) -> tuple[Image, Image, NDArray[np.float64]]:
    """Fixed image, moving image, and a displacement between them with a given 1/e correlation length."""
    rng = np.random.default_rng([length_px, seed])
    row, column = (int(rng.integers(0, n - SIZE + 1)) for n in hh.shape)
    largest = rng.uniform(2.0, 6.0)
    field = np.zeros((2, SIZE, SIZE))
    if length_px:
        noise = rng.standard_normal((2, SIZE, SIZE))
        field = np.stack([gaussian_filter(part, length_px / 2, mode="reflect") for part in noise])
        field *= largest / np.hypot(*field).max()
    filled = np.where(np.isfinite(hv), hv, np.nanmedian(hv))
    at = np.indices((SIZE, SIZE)) + np.array([row, column])[:, None, None] + invert(field)
    moving = map_coordinates(filled, at, order=1, mode="reflect")
    return hh[row : row + SIZE, column : column + SIZE], moving, field


def standardised(image: Image) -> Image:
    """Image with zero mean, unit variance and no gaps, for scikit-image's methods."""
    filled = np.where(np.isfinite(image), image, np.nanmedian(image))
    return ((filled - filled.mean()) / filled.std()).astype(np.float32)


def ilk(radius: int, prepared: Callable[[Image], Image], sigma: float = 0.0) -> Method:
    """scikit-image's iterative Lucas-Kanade flow, smoothed."""

    def method(fixed: Image, moving: Image) -> NDArray[np.float64]:
        flow = optical_flow_ilk(prepared(fixed), prepared(moving), radius=radius)
        return np.stack([gaussian_filter(part, sigma) for part in flow]) if sigma else flow

    return method


def stretched(image: Image) -> Image:
    """Image between 0 and 1, for the authors' programs."""
    low, high = np.nanpercentile(image, [0.2, 99.8])
    filled = np.where(np.isfinite(image), image, np.nanmedian(image))
    return np.clip((filled - low) / (high - low), 0.0, 1.0).astype(np.float32)


def authors(folder: str) -> Method:
    """E-Folki by its authors; it takes and gives columns before rows."""
    sys.path.insert(0, folder)
    from algorithm import EFolki

    def method(fixed: Image, moving: Image) -> NDArray[np.float64]:
        settings = {"iteration": 2, "radius": [32, 24, 16, 8], "rank": 4, "levels": 5}
        across, along = EFolki(stretched(fixed), stretched(moving), **settings)
        return np.stack([along, across])

    return method


def methods() -> dict[str, Method | None]:
    """Methods by name, radcal's included."""
    found: dict[str, Method | None] = {"ours": None}
    found |= {f"ilk_{radius}": ilk(radius, standardised) for radius in RADII}
    found |= {f"ilk_{radius}_ranks": ilk(radius, rank_transform) for radius in RADII}
    found |= {f"ilk_{radius}_smooth_{sigma}": ilk(radius, standardised, sigma) for radius, sigma in SMOOTHED}
    if os.environ.get("GEFOLKI"):
        found["authors"] = authors(os.environ["GEFOLKI"])
    # scale and attachment chosen for it on the even seeds: with its defaults it is 10 times worse
    found["tvl1"] = lambda fixed, moving: optical_flow_tvl1(
        0.2 * standardised(fixed), 0.2 * standardised(moving), attachment=5
    )
    found["none"] = lambda fixed, _: np.zeros((2, *fixed.shape))
    return found


def whole(fixed: Image, moving: Image) -> float:
    """Time of the whole registration in the workflow [s]."""
    start = time.perf_counter()
    print("\n" + register(fixed, Measurement(moving, "HV"), RegistrationConfig()).verdict)
    return time.perf_counter() - start


def ours(fixed: Image, moving: Image, field: NDArray[np.float64]) -> dict[str, float]:
    """Error and time of radcal's field, and ratio of its standard error."""
    start = time.perf_counter()
    flow = find_flow(pyramid(fixed, moving))
    seconds = time.perf_counter() - start
    error = np.hypot(*(flow.displacement_px - field))[INSIDE]
    stated = float(np.sqrt(np.mean(flow.standard_error_px()[INSIDE] ** 2) / np.mean(error**2)))
    return {"epe_px": float(error.mean()), "seconds": seconds, "stated": stated}


def of(method: Method, fixed: Image, moving: Image, field: NDArray[np.float64]) -> dict[str, float]:
    """Error and time of another method's field."""
    start = time.perf_counter()
    found = method(fixed, moving)
    seconds = time.perf_counter() - start
    return {"epe_px": float(np.hypot(*(found - field))[INSIDE].mean()), "seconds": seconds}


def summary(draws: list[dict[str, dict[str, float]]]) -> dict[str, dict[str, float]]:
    """Medians over draws by method, and ratio of radcal's errors to its; ``ilk`` is the best of its settings."""
    rows = {
        name: {key: float(np.median([draw[name][key] for draw in draws])) for key in draws[0][name]}
        for name in draws[0]
    }
    for name in rows if "ours" in rows else ():
        logs = [np.log(draw["ours"]["epe_px"] / draw[name]["epe_px"]) for draw in draws]
        rows[name]["ratio"] = float(np.exp(np.mean(logs)))
    windows = [row for name, row in rows.items() if name.startswith("ilk_")]
    return rows | ({"ilk": min(windows, key=lambda row: row["epe_px"])} if windows else {})


def main() -> None:
    """Print a table for each correlation length and, last, the summary as JSON."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true", help="2 draws of each length in place of 8")
    parser.add_argument("--tune", action="store_true", help="even seeds in place of odd ones")
    parser.add_argument("--methods", default=None, help="some of them, separated by commas")
    parser.add_argument("--lengths", default=",".join(map(str, LENGTHS_PX)), help="correlation lengths [pixels]")
    parser.add_argument("--first-seed", type=int, help="of the draws, which have every second seed")
    parser.add_argument("--draws", type=int, help="number of draws of each length")
    arguments = parser.parse_args()
    hh, hv = read_db("sigma0_hh.tif"), read_db("sigma0_hv.tif")
    lengths = [int(length) for length in arguments.lengths.split(",")]
    first = arguments.first_seed if arguments.first_seed is not None else 0 if arguments.tune else 1
    seeds = range(first, first + 2 * (arguments.draws or (2 if arguments.quick else 8)), 2)
    tried = methods()
    if arguments.methods:
        tried = {name: tried[name] for name in arguments.methods.split(",")}
    if "authors" not in tried:
        print("The authors' method was not tried: set GEFOLKI to the folder of its Python programs.")
    by_length: dict[int, list[dict[str, dict[str, float]]]] = {}
    with one_thread():
        for length in lengths:
            by_length[length] = []
            for seed in seeds:
                fixed, moving, field = pair(hh, hv, length, seed)
                draw = {
                    name: of(method, fixed, moving, field) if method else ours(fixed, moving, field)
                    for name, method in tried.items()
                }
                by_length[length].append(draw)
            print(f"\n1/e correlation length {length} px, {len(seeds)} draws: medians")
            for name, row in summary(by_length[length]).items():
                extra = f"  ratio {row['ratio']:.3f}" if "ratio" in row else ""
                extra += f"  stated {row['stated']:.2f}" if "stated" in row else ""
                print(f"{name:13} {row['epe_px']:7.3f} px {row['seconds']:6.2f} s{extra}", flush=True)
    if "ours" in tried:
        fixed, moving, _ = pair(hh, hv, lengths[0], seeds[0])
        seconds = whole(fixed, moving)
        print(f"\nThe whole registration of the workflow, with its checks on held-out squares: {seconds:.2f} s")
    displaced = [draw for length in lengths if length for draw in by_length[length]]
    print(json.dumps(summary(displaced) | {"by_length_px": {n: summary(draws) for n, draws in by_length.items()}}))


if __name__ == "__main__":
    main()
