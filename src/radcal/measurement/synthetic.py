"""Synthetic measurement: image of a scene, a pass and laws that may differ from those of the runs.

The differences (keys of ``measurement.synthetic``) represent properties of real images that no simulator knows. The
image is formed by the built-in simulator itself, from a changed scene, geometry, pass and laws.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.bands import WIDTH_FACTOR
from radcal.config import Material, Radar
from radcal.config.part import Part
from radcal.errors import MeasurementError
from radcal.ground.patches import patches_seen
from radcal.image.model import Measurement
from radcal.radar.geometry import Geometry
from radcal.radar.lines import refined_elevation
from radcal.radar.projection import make_geometry
from radcal.radar.size import refinement
from radcal.registration.displacement import invert, warp
from radcal.scene.model import Scene
from radcal.sections.measurement import Synthetic
from radcal.seeds import derived_rng, measurement_seed
from radcal.simulators.base import Simulator
from radcal.simulators.builtin import BuiltinSimulator
from radcal.speckle.texture import order_of_texture, texture_db

_WARP_SIGMA_PX = 60.0  # smoothing of a synthetic displacement field
_PATCH_CELLS = 4.0  # correlation length of patches with a wrong label


def make_synthetic(
    case: Part,
    synthetic: Synthetic,
    geometry: Geometry,
    simulator: Simulator,
    scene: Scene | None = None,
) -> Measurement:
    """Make the synthetic measurement of a case.

    Parameters
    ----------
    case : Part
        Pass and laws of the runs.
    synthetic : Synthetic
        Hidden laws, and differences of scene, pass and image from those of the runs.
    geometry : Geometry
        Geometry of the runs; the measurement has the same image grid.
    simulator : Simulator
        Simulator of the runs. This simulator also makes the measured image if only parameters and seed differ from
        those of the runs.
    scene : Scene, optional
        Scene of the runs, needed for relief and wrong labels.

    Raises
    ------
    MeasurementError
        The displacement field folds, so that it has no inverse, or the resolution is too fine for the pixel spacing.
    """
    hidden = {name: material.start_parameters for name, material in case.materials.items()}
    hidden.update({name: x for name, x in synthetic.parameters.items() if name in hidden})
    hidden.update({name: law.parameters for name, law in synthetic.laws.items()})
    seed = measurement_seed(case.simulator, synthetic.seed)
    if synthetic.product == "focused":
        image_db = _focused_db(case, synthetic, geometry, scene, hidden, seed)
    elif synthetic.disturbed:
        image_db = _other_simulator(case, synthetic, geometry, scene).run(hidden, seed)
    else:
        image_db = simulator.run(hidden, seed)
    field, inverse = _displacements(synthetic, (image_db.shape[0], image_db.shape[1]))
    if inverse is not None:
        image_db = warp(image_db, inverse)  # nearest pixels, because interpolation would smooth the speckle
    return Measurement(
        image_db + np.float32(synthetic.offset_db),
        f"synthetic, seed {synthetic.seed}",
        # parameters of another law have no meaning in the calibrated law
        {name: tuple(hidden[name]) for name in case.calibrated if name not in synthetic.laws},
        field.astype(np.float32) if field is not None else None,
    )


def check_synthetic(radar: Radar, synthetic: Synthetic, shape: tuple[int, int]) -> None:
    """Check the settings of a synthetic measurement without a simulator run.

    Parameters
    ----------
    radar : Radar
        Pass of the runs.
    synthetic : Synthetic
        Settings.
    shape : (int, int)
        Rows and columns of the image.

    Raises
    ------
    MeasurementError
        The displacement field folds, so that it has no inverse, or the resolution is too fine for the pixel spacing.
    """
    _other_pass(radar, synthetic)
    _displacements(synthetic, shape)


def _displacements(
    synthetic: Synthetic, shape: tuple[int, int]
) -> tuple[NDArray[np.float64], NDArray[np.float64]] | tuple[None, None]:
    """Displacement field of the measurement and its inverse, shape (2, rows, columns) [pixels]; None without a warp."""
    if synthetic.warp_px <= 0:
        return None, None
    field = smooth_warp(shape, synthetic.warp_px, derived_rng(synthetic.seed, "measurement", "warp"))
    try:
        return field, invert(field)
    except ValueError as error:
        raise MeasurementError(
            f"measurement.synthetic.warp_px is {synthetic.warp_px:g}: {error} Expected a smaller one."
        ) from None


def _other_ground(
    radar: Radar, synthetic: Synthetic, geometry: Geometry, scene: Scene | None
) -> tuple[Geometry, Scene]:
    """Geometry and scene with the relief and the wrong labels of the synthetic measurement."""
    if scene is None:
        raise MeasurementError(
            "measurement.synthetic: relief, fields, wrong labels and raw signals need the scene, which is missing."
        )
    if synthetic.relief_m > 0 or synthetic.wrong_labels > 0:
        scene = relabelled(scene, synthetic.wrong_labels, derived_rng(synthetic.seed, "measurement", "labels"))
        if synthetic.relief_m > 0:
            rng, k = derived_rng(synthetic.seed, "measurement", "relief"), refinement(scene.cell_m, radar)
            scene = roughened(scene, synthetic.relief_m, synthetic.relief_length_m, k, rng)
        geometry = make_geometry(scene, radar, onto=geometry)
    return geometry, scene


def _focused_db(
    case: Part,
    synthetic: Synthetic,
    geometry: Geometry,
    scene: Scene | None,
    hidden: Mapping[str, Sequence[float]],
    seed: int,
) -> NDArray[np.float32]:
    """Mean power of the looks of an image focused from raw signals of the disturbed scene, pass and laws [dB]."""
    from radcal.signals.simulator import FocusedSimulator

    radar = _other_pass(case.radar, synthetic)
    geometry, scene = _other_ground(radar, synthetic, geometry, scene)
    materials = {
        name: one.model_copy(update={"calibrate": False}) for name, one in _other_laws(case, synthetic).items()
    }
    flown = case.model_copy(update={"radars": [radar], "materials": materials})
    return FocusedSimulator(flown, scene, geometry).run(hidden, seed)


def _other_simulator(case: Part, synthetic: Synthetic, geometry: Geometry, scene: Scene | None) -> BuiltinSimulator:
    """Built-in simulator of the disturbed scene, pass and laws."""
    radar = _other_pass(case.radar, synthetic)
    if synthetic.relief_m > 0 or synthetic.wrong_labels > 0 or synthetic.fields_db:
        geometry, scene = _other_ground(radar, synthetic, geometry, scene)
        geometry = varied(geometry, scene, synthetic.fields_db, synthetic.seed)
    if synthetic.texture_db > 0:
        rng = derived_rng(synthetic.seed, "measurement", "texture")
        geometry = textured(geometry, radar, synthetic.texture_db, synthetic.texture_length_m, rng)
    return BuiltinSimulator(geometry, radar, case.model_copy(update={"materials": _other_laws(case, synthetic)}).laws)


def _other_laws(case: Part, synthetic: Synthetic) -> dict[str, Material]:
    """Materials with the hidden laws of the synthetic measurement."""
    return case.materials | {name: case.materials[name].with_law(law) for name, law in synthetic.laws.items()}


def _other_pass(radar: Radar, synthetic: Synthetic) -> Radar:
    """Pass with the resolution, looks and noise of the synthetic measurement."""
    update: dict[str, float | int] = {}
    for way in ("range", "azimuth"):
        resolution = synthetic.resolution_factor * getattr(radar, f"{way}_resolution_m")
        finest = WIDTH_FACTOR * getattr(radar, f"{way}_spacing_m")
        if synthetic.resolution_factor < 1 and resolution < finest * (1 - 1e-9):
            raise MeasurementError(
                f"measurement.synthetic.resolution_factor is {synthetic.resolution_factor:g}, which makes "
                f"radar.{way}_resolution_m {resolution:g} m, expected at least {finest:.2f} m at its pixel spacing "
                "(the image must be sampled above its bandwidth)."
            )
        update[f"{way}_resolution_m"] = resolution
    if synthetic.looks is not None:
        update["looks"] = synthetic.looks
    if synthetic.nesz_db is not None:
        update["nesz_db"] = synthetic.nesz_db
    return radar.model_copy(update=update)


def relabelled(scene: Scene, share: float, rng: np.random.Generator) -> Scene:
    """Copy of a scene in which a share of the cells has a wrong material.

    Half of the relabelled cells lie on borders between materials and get the material of the other side. The other half
    forms patches of several cells, and each patch gets the material of a random cell of the scene.

    Parameters
    ----------
    scene : Scene
        Original scene; its cells without a material stay without one.
    share : float
        Share of the cells that get a wrong material, between 0 and 1.
    rng : Generator
        Random generator of the places and of the materials there.
    """
    before = scene.material
    wanted = round(share * np.count_nonzero(before))
    if wanted == 0 or np.unique(before[before > 0]).size < 2:
        return scene
    material = before.copy()
    # the id 0 (no material) is never taken over
    low = scipy.ndimage.minimum_filter(np.where(before == 0, 255, before), 3)
    other = np.where(low < before, low, scipy.ndimage.maximum_filter(before, 3))
    border = np.flatnonzero((before > 0) & (other != before))
    chosen = rng.permutation(border)[: wanted // 2]
    material.ravel()[chosen] = other.ravel()[chosen]
    height = scipy.ndimage.gaussian_filter(rng.standard_normal(before.shape), _PATCH_CELLS / 2.0)
    height[(before == 0) | (material != before)] = -np.inf
    patches = np.zeros(before.size, dtype=np.bool_)
    patches[np.argsort(height, axis=None, kind="stable")[before.size - (wanted - chosen.size) :]] = True
    numbers, count = scipy.ndimage.label(patches.reshape(before.shape))
    drawn = np.concatenate([[0], rng.choice(before[before > 0], count)]).astype(before.dtype)[numbers]
    # a cell that already has the drawn material takes the scene's next one
    present = np.unique(before[before > 0])
    following = present[(np.searchsorted(present, before) + 1) % present.size]
    drawn = np.where(drawn == before, following, drawn)
    return replace(scene, material=np.where(numbers > 0, drawn, material).astype(before.dtype))


def roughened(scene: Scene, rms_m: float, length_m: float, k: int, rng: np.random.Generator) -> Scene:
    """Scene with additional random relief, in which each cell is divided into k x k cells.

    Parameters
    ----------
    scene : Scene
        Scene with an elevation.
    rms_m : float
        Rms height of the relief [m].
    length_m : float
        Correlation length l [m]: the autocorrelation at distance d is exp(-(d/l)^2), and the rms slope along one axis
        sqrt(2) rms / l. If l is shorter than a divided cell, the relief is uncorrelated between divided cells.
    k : int
        Number of cells into which the side of a cell is divided.
    rng : Generator
        Random generator of the relief.

    Returns
    -------
    Scene
        Scene of the same extent and mean elevation as the original scene.
    """
    assert scene.elevation_m is not None  # noqa: S101 - the configuration refuses relief in slant range
    fine = refined_elevation(scene.elevation_m, k, scene.cell_m)
    relief = _correlated(fine.shape, (length_m * k / scene.cell_m,) * 2, rng)
    return replace(
        scene,
        material=np.repeat(np.repeat(scene.material, k, axis=0), k, axis=1),
        # the track is above the mean elevation, and stays where it is
        elevation_m=fine + rms_m * relief + (scene.elevation_m.mean() - fine.mean()),
        cell_m=scene.cell_m / k,
    )


def textured(geometry: Geometry, radar: Radar, sd_db: float, length_m: float, rng: np.random.Generator) -> Geometry:
    """Geometry whose weights are multiplied by correlated gamma texture, so that its pixels are K-distributed.

    Parameters
    ----------
    geometry : Geometry
        Geometry of the pass.
    radar : Radar
        Pass with its pixel spacings.
    sd_db : float
        Standard deviation of the texture [dB].
    length_m : float
        Correlation length, on level ground [m], of the Gaussian field that is transformed to the texture.
    rng : Generator
        Random generator of the texture.

    References
    ----------
    Oliver and Quegan, "Understanding Synthetic Aperture Radar Images", sections 5.3 (K distribution) and 5.7
    (correlated texture).
    """
    ground_m = radar.range_spacing_m / np.sin(np.radians(float(np.median(geometry.flat_incidence_deg))))
    lengths = (length_m / ground_m, length_m / radar.azimuth_spacing_m)
    texture = texture_db(scipy.special.ndtr(_correlated(geometry.shape, lengths, rng)), order_of_texture(sd_db))
    return _brightened(geometry, texture)


def varied(geometry: Geometry, scene: Scene, sd_db: Mapping[str, float], seed: int) -> Geometry:
    """Geometry whose weights are multiplied by a gain of each field, so that the fields of a material differ.

    Parameters
    ----------
    geometry : Geometry
        Geometry of the pass.
    scene : Scene
        Scene from which the geometry is made; its connected areas of a material are the fields.
    sd_db : mapping
        Standard deviation of the normally distributed gains of a material's fields [dB], by material.
    seed : int
        Seed of the measurement, from which the gains are drawn.
    """
    if not sd_db:
        return geometry
    gain_db = np.zeros(geometry.shape)
    for name, sd in sd_db.items():
        number = geometry.names.index(name) + 1
        field = patches_seen(geometry.material == number, scene.material == number, geometry.ground)
        gains = derived_rng(seed, "measurement", "fields", name).normal(0.0, sd, int(field.max()) + 1)
        gain_db += np.where(field > 0, gains[field], 0.0)
    return _brightened(geometry, gain_db)


def _brightened(geometry: Geometry, gain_db: NDArray[np.float64]) -> Geometry:
    """Geometry whose weights are multiplied by a gain of each pixel, shape (rows, columns) [dB]."""
    first = geometry.facet_start[geometry.cell_start]  # first facet of each pixel
    power = np.repeat((10.0 ** (gain_db.ravel() / 10.0)).astype(np.float32), np.diff(first))
    return replace(geometry, facet_weight=geometry.facet_weight * power)


def smooth_warp(shape: tuple[int, int], rms_px: float, rng: np.random.Generator) -> NDArray[np.float64]:
    """Smooth random displacement field.

    Parameters
    ----------
    shape : (int, int)
        Image size.
    rms_px : float
        Root mean square length of the displacement [pixels].
    rng : Generator
        Random generator of the field.

    Returns
    -------
    ndarray, shape (2, rows, columns)
        Displacement along rows and columns [pixels].
    """
    field = np.stack(
        [scipy.ndimage.gaussian_filter(rng.standard_normal(shape), _WARP_SIGMA_PX, mode="reflect") for _ in range(2)]
    )
    return np.asarray(field * rms_px / np.sqrt(np.mean((field**2).sum(axis=0))))


def _correlated(shape: tuple[int, ...], lengths: tuple[float, float], rng: np.random.Generator) -> NDArray[np.float64]:
    """Gaussian field of mean 0 and variance 1, whose autocorrelation exp(-(d/l)^2) has a length l for each axis."""
    # white noise smoothed by exp(-x^2 / 2s^2) has the correlation length 2s
    sigma = [length / 2.0 for length in lengths]
    field = scipy.ndimage.gaussian_filter(rng.standard_normal(shape), sigma, mode="wrap", truncate=6.0)
    return np.asarray((field - field.mean()) / field.std())
