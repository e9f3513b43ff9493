"""The built-in scene: real SRTM terrain, seven materials and a dyke.

The elevation is the SRTM model of the Jacksboro fault (Tennessee), a sample file of matplotlib. The elevation model is
cut to 2 km by 2 km of valley floor at the foot of a ridge, and interpolated to cells of 5 m by cubic splines. Two
details finer than SRTM's 3 arc-seconds are added: a dyke beside a channel, and a random roughness of each material.
Owing to the roughness, the incidence angle varies within a material as on real ground.

The scene exists in two landscapes. In the landscape ``open``, the fields have neither furrows nor hedges, and the slope
of the dyke's face is constant. In the landscape ``enclosed``, the fields have ridge and furrow, and hedges stand
between them. The surface of the forest is raised by the height of the trees, so that the forest's edges cast shadows
and cause layover. The height of the dyke, and with it the slope of its face, varies along the dyke's axis.
"""

from __future__ import annotations

from typing import Any, Literal, cast

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.scene.base import SceneSize, SceneSource
from radcal.scene.model import Scene
from radcal.sections.scene import BuiltinScene
from radcal.storage.files import digest

MATERIALS = ("dyke", "water", "grass", "forest", "crops", "bare_soil", "road")

ROUGHNESS: dict[str, tuple[float, float]] = {
    # material: (rms height [m], correlation length [m]) of a Gaussian surface with a
    # Gaussian autocorrelation, whose rms slope along one axis is sqrt(2) rms / length
    "dyke": (1.07, 13.0),
    "water": (0.01, 10.0),
    "grass": (0.25, 15.0),
    "forest": (1.20, 14.0),
    "crops": (0.30, 16.0),
    "bare_soil": (0.35, 13.0),
    "road": (0.05, 20.0),
}

CELL_M = 5.0
_SIDE_M = 2000.0
CELLS = round(_SIDE_M / CELL_M) ** 2
_SRTM_NORTH_M = 92.6  # 3 arc-seconds of latitude
_SRTM_EAST_M = 74.4  # 3 arc-seconds of longitude at 36.6 degrees north
_SOUTH_ROW, _WEST_COLUMN = 141.0, 264.0  # the scene's corner in the SRTM array (row 0 is north)

_FACE_M, _CREST_M, _LEE_M, _HEIGHT_M = 42.0, 6.0, 54.0, 25.8  # the dyke's cross-section
_LOWEST = 0.35  # ratio of the dyke's smallest to its largest height in the landscape ``enclosed``
_WAVE_M = 700.0  # distance along the axis between two high parts of the dyke in the landscape ``enclosed``
_RIDGE_M, _RIDGES_M = 0.2, (18.0, 28.0)  # amplitude and range of periods of ridge and furrow
_HEDGE_M, _CANOPY_M = 3.5, 12.0  # heights of hedges and of the forest
_STEP_M = 220.0  # distance between the middles of the fields
_CHANNEL_M = (12.0, 72.0)  # distance of the channel's banks from the foot of the face


def _terrain(east_m: NDArray[np.float64], north_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """SRTM elevation [m] at east and north coordinates of the scene, interpolated by cubic splines."""
    from matplotlib.cbook import get_sample_data  # imported here, because scenes of other sources need no matplotlib

    archive = cast(Any, get_sample_data("jacksboro_fault_dem.npz"))  # matplotlib has opened the file, without pickles
    with archive:
        srtm = archive["elevation"].astype(np.float64)
    rows = _SOUTH_ROW - north_m / _SRTM_NORTH_M
    columns = _WEST_COLUMN + east_m / _SRTM_EAST_M
    # without smoothing, the one-metre steps of the integer elevations would become terraces
    smooth = scipy.ndimage.gaussian_filter(srtm, 0.8)
    return np.asarray(scipy.ndimage.map_coordinates(smooth, [rows, columns], order=3, mode="nearest"))


def _dyke_axis_m(north_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """East coordinate [m] of the foot of the dyke's face, a gently bent line, as a function of the north coordinate."""
    return 1000.0 + 60.0 * np.sin(2.0 * np.pi * (north_m - 250.0) / _SIDE_M)


def _dyke_profile_m(across_m: NDArray[np.float64]) -> NDArray[np.float64]:
    """Height of the dyke above the ground [m], as a function of the eastward distance from the foot of its face."""
    crest = _FACE_M + _CREST_M
    return np.interp(across_m, [0.0, _FACE_M, crest, crest + _LEE_M], [0.0, _HEIGHT_M, _HEIGHT_M, 0.0])


def _correlated(rng: np.random.Generator, shape: tuple[int, int], length_m: float) -> NDArray[np.float64]:
    """Random Gaussian surface of unit variance, with the autocorrelation exp(-(d/length)^2) at the distance d."""
    sigma = length_m / 2.0 / CELL_M  # white noise smoothed by exp(-x^2 / 2s^2) has correlation length 2s
    field = scipy.ndimage.gaussian_filter(rng.standard_normal(shape), sigma, mode="wrap", truncate=6.0)
    # the field is divided by its own standard deviation, because the sampled filter has another gain than the
    # continuous one
    return np.asarray(field / field.std())


def _parcels(
    rng: np.random.Generator, east_m: NDArray[np.float64], north_m: NDArray[np.float64]
) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Land cover (0 grass, 1 crops, 2 bare soil) and number of each cell's field; fields are random Voronoi cells."""
    grid = np.arange(_STEP_M / 2 - 2 * _STEP_M, _SIDE_M + 2 * _STEP_M, _STEP_M)
    seeds = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 2)
    seeds = seeds + rng.uniform(-0.35 * _STEP_M, 0.35 * _STEP_M, seeds.shape)
    kind = rng.choice(3, size=len(seeds), p=[0.35, 0.4, 0.25])
    nearest = scipy.spatial.cKDTree(seeds).query(np.stack([east_m, north_m], axis=-1).reshape(-1, 2))[1]
    return np.asarray(kind[nearest].reshape(east_m.shape)), np.asarray(nearest.reshape(east_m.shape))


def _ridges_m(
    rng: np.random.Generator, field: NDArray[np.int64], east_m: NDArray[np.float64], north_m: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Height of ridge and furrow [m], whose direction, period and phase differ from field to field."""
    count = int(field.max()) + 1
    direction, phase = rng.uniform(0.0, np.pi, count), rng.uniform(0.0, 2.0 * np.pi, count)
    period = rng.uniform(*_RIDGES_M, count)
    across = east_m * np.cos(direction[field]) + north_m * np.sin(direction[field])
    return np.asarray(_RIDGE_M * np.sin(2.0 * np.pi * across / period[field] + phase[field]))


def _hedges(rng: np.random.Generator, field: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Mask of hedges, one cell wide, along about half of the borders between the fields, chosen at random."""
    hedge = np.zeros(field.shape, dtype=np.bool_)
    has_hedge = rng.random((int(field.max()) + 1,) * 2) < 0.5
    for axis in (0, 1):
        here, there = np.delete(field, -1, axis), np.delete(field, 0, axis)
        low, high = np.minimum(here, there), np.maximum(here, there)
        border = (here != there) & has_hedge[low, high]
        hedge |= np.pad(border, [(0, 1) if k == axis else (0, 0) for k in (0, 1)])
    return hedge


def builtin_scene(seed: int, landscape: Literal["enclosed", "open"] = "open") -> Scene:
    """Build the built-in scene; the same seed gives the same scene.

    Parameters
    ----------
    seed : int
        Seed of the random layout of the fields and of the random roughness of the ground.
    landscape : {"enclosed", "open"}
        Landscape of the fields and shape of the dyke (see the description of the module).

    Returns
    -------
    Scene
        Scene of 400 x 400 cells of 5 m.
    """
    layout, rough, enclosing = (np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(3))
    centres = np.arange(CELL_M / 2, _SIDE_M, CELL_M)
    north, east = np.meshgrid(centres, centres, indexing="ij")
    ground = _terrain(east, north)
    across = east - _dyke_axis_m(north)
    kind, field = _parcels(layout, east, north)
    material = _materials(ground, across, kind)

    # the ground below channel and dyke is level across the dyke's axis: it has the elevation at the foot of the dyke's
    # face
    beside = _terrain(_dyke_axis_m(north), north)
    crest = _FACE_M + _CREST_M
    weight = np.clip(1.0 - np.maximum(-across - 90.0, across - crest - _LEE_M - 40.0) / 150.0, 0.0, 1.0)
    dyke = _dyke_profile_m(across)
    if landscape == "enclosed":
        dyke *= 1.0 - 0.5 * (1.0 - _LOWEST) * (1.0 + np.cos(2.0 * np.pi * north / _WAVE_M))
    elevation = weight * beside + (1.0 - weight) * ground + dyke
    elevation -= 3.0 * (material == 2)
    for k, name in enumerate(MATERIALS, start=1):
        height_m, length_m = ROUGHNESS[name]
        elevation += (material == k) * height_m * _correlated(rough, north.shape, length_m)
    identity = {"source": "builtin", "seed": seed, "version": 2}
    if landscape == "enclosed":
        identity["landscape"] = landscape
        in_fields = np.isin(material, [3, 5, 6]) & (weight < 1.0)
        elevation += np.isin(material, [5, 6]) * in_fields * _ridges_m(enclosing, field, east, north)
        elevation += _CANOPY_M * (material == 4)
        hedge = in_fields & _hedges(enclosing, field)
        elevation += _HEDGE_M * hedge
        material[hedge] = 4
    return Scene(
        identity=digest(identity),
        names=MATERIALS,
        material=material,
        elevation_m=elevation,
        cell_m=CELL_M,
    )


def _materials(
    ground_m: NDArray[np.float64], across_m: NDArray[np.float64], kind: NDArray[np.int64]
) -> NDArray[np.uint8]:
    """Material ids: fields, forest on steep ground, dyke and channel, and a road beside the dyke."""
    crest = _FACE_M + _CREST_M
    slope_north, slope_east = np.gradient(ground_m, CELL_M)
    slope_deg = np.degrees(np.arctan(np.hypot(slope_north, slope_east)))
    material = np.array([3, 5, 6], dtype=np.uint8)[kind]
    material[scipy.ndimage.gaussian_filter(slope_deg, 4.0) > 7.0] = 4
    material[(across_m > -_CHANNEL_M[1] - 15.0) & (across_m < crest + _LEE_M + 20.0)] = 3
    material[(across_m > -_CHANNEL_M[1]) & (across_m < -_CHANNEL_M[0])] = 2
    material[(across_m >= 0.0) & (across_m < _FACE_M)] = 1
    material[(across_m > crest + _LEE_M + 20.0) & (across_m < crest + _LEE_M + 32.0)] = 7
    return np.asarray(material)


class BuiltinSource(SceneSource):
    """Source ``builtin``."""

    section = BuiltinScene

    @staticmethod
    def size(_: BuiltinScene) -> SceneSize:
        """Size of the only grid."""
        return SceneSize(CELLS, CELL_M, CELLS)

    @staticmethod
    def make(config: BuiltinScene, _: float) -> Scene:
        """Scene of the configured landscape."""
        return builtin_scene(config.seed, config.landscape)
