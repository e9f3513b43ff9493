"""Generator of random trees, cars and buildings, for tests and benchmarks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.errors import SceneError
from radcal.scene.objects import Objects

Range = tuple[float, float]


@dataclass(frozen=True)
class Kind:
    """Sizes and cross-section of a kind of object; the sizes of each object are drawn from uniform distributions.

    Attributes
    ----------
    length_m, width_m, height_m : (float, float)
        Smallest and largest length, width and height [m].
    rcs_db_per_m2 : float
        Mean radar cross-section per square metre of the footprint [dB].
    spread_db : float
        Standard deviation of the cross-section between objects [dB].
    """

    length_m: Range
    width_m: Range
    height_m: Range
    rcs_db_per_m2: float
    spread_db: float


# round crowns, with a cross-section of the order of a forest's sigma0 at X band
TREE = Kind((3.0, 9.0), (3.0, 9.0), (4.0, 20.0), -6.0, 3.0)
# about 100 m2 for a footprint of 8 m2, as textbooks of radar give it (Skolnik, "Introduction to Radar Systems")
CAR = Kind((3.8, 5.0), (1.7, 1.95), (1.4, 1.9), 11.0, 5.0)
# the cross-section of a building depends on its walls and corners, and has no typical value; the value here exceeds
# that of the ground
BUILDING = Kind((8.0, 24.0), (7.0, 14.0), (3.0, 15.0), 3.0, 4.0)


def generate_objects(
    size_m: tuple[float, float], seed: int, *, trees: int = 0, cars: int = 0, buildings: int = 0
) -> Objects:
    """Random buildings, trees and cars, spread evenly over a scene; the same seed gives the same objects.

    Buildings do not overlap each other; the centres of trees and cars are outside buildings.

    Parameters
    ----------
    size_m : (float, float)
        East and north extent of the scene [m].
    seed : int
        Seed of all random numbers; each kind of object has its own random stream.
    trees, cars, buildings : int
        Number of objects of each kind.

    Returns
    -------
    Objects
        Objects in the order buildings, trees, cars.

    Raises
    ------
    SceneError
        The scene has no space for the buildings, or the buildings leave no space for trees and cars.
    """
    streams = [np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3)]
    plot = float(np.hypot(BUILDING.length_m[1], BUILDING.width_m[1]))  # a plot is large enough for any building
    plots = (int(size_m[0] / plot), int(size_m[1] / plot))
    if buildings > plots[0] * plots[1]:
        raise SceneError(
            f"scene.objects.generate.buildings is {buildings}, expected at most {plots[0] * plots[1]}: one for each "
            f"{plot:.0f} m x {plot:.0f} m."
        )
    rng = streams[0]
    taken = np.sort(rng.choice(plots[0] * plots[1], buildings, replace=False)) if buildings else np.zeros(0, np.int64)
    houses = _sizes(BUILDING, buildings, rng, round_=False)
    room = 0.5 * (plot - np.hypot(houses["length_m"], houses["width_m"]))
    houses["x_m"] = (taken % max(plots[0], 1) + 0.5) * plot + room * rng.uniform(-1.0, 1.0, buildings)
    houses["y_m"] = (taken // max(plots[0], 1) + 0.5) * plot + room * rng.uniform(-1.0, 1.0, buildings)
    owner = np.full(plots[0] * plots[1] + 1, -1, dtype=np.int64)
    owner[taken] = np.arange(buildings)
    parts = [houses]
    for kind, count, rng, round_ in ((TREE, trees, streams[1], True), (CAR, cars, streams[2], False)):
        part = _sizes(kind, count, rng, round_)
        part["x_m"], part["y_m"] = _outside(count, size_m, rng, houses, owner, plot, plots)
        parts.append(part)
    columns: dict[str, Any] = {name: np.concatenate([part[name] for part in parts]) for name in houses}
    return Objects(**columns, aspect=np.full(buildings + trees + cars, -1, dtype=np.int16))


def _sizes(kind: Kind, count: int, rng: np.random.Generator, round_: bool) -> dict[str, NDArray[np.float64]]:
    """Sizes, headings and cross-sections of objects of one kind; a round object (tree crown) is as wide as long."""
    length, width, height = (rng.uniform(*span, count) for span in (kind.length_m, kind.width_m, kind.height_m))
    width = length if round_ else np.minimum(width, length)
    spread = kind.spread_db * rng.standard_normal(count)
    return {
        "length_m": length,
        "width_m": width,
        "heading_deg": rng.uniform(0.0, 360.0, count),
        "height_m": height,
        "rcs_dbsm": 10.0 * np.log10(length * width) + kind.rcs_db_per_m2 + spread,
    }


def _outside(
    count: int, size_m: tuple[float, float], rng: np.random.Generator, houses: dict[str, NDArray[np.float64]],
    owner: NDArray[np.int64], plot: float, plots: tuple[int, int],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:  # fmt: skip
    """Random coordinates [m] of ``count`` places outside all buildings; each building stands on its own plot."""
    x, y = rng.uniform(0.0, size_m[0], count), rng.uniform(0.0, size_m[1], count)
    left = np.arange(count) if len(houses["x_m"]) else np.zeros(0, dtype=np.int64)
    for _ in range(100):
        if not left.size:
            return x, y
        column, row = (x[left] / plot).astype(np.int64), (y[left] / plot).astype(np.int64)
        inside = (column < plots[0]) & (row < plots[1])
        house = owner[np.where(inside, row * plots[0] + column, -1)]
        bearing = np.radians(houses["heading_deg"][house])
        east, north = x[left] - houses["x_m"][house], y[left] - houses["y_m"][house]
        along = np.abs(east * np.sin(bearing) + north * np.cos(bearing))
        across = np.abs(east * np.cos(bearing) - north * np.sin(bearing))
        within = (along < houses["length_m"][house] / 2) & (across < houses["width_m"][house] / 2)
        left = left[(house >= 0) & within]
        x[left], y[left] = rng.uniform(0.0, size_m[0], left.size), rng.uniform(0.0, size_m[1], left.size)
    raise SceneError("scene.objects.generate: the buildings leave no room for trees and cars, expected fewer of them.")
