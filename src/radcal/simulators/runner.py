"""Runner of the simulator; it only simulates runs that the run store does not contain.

The configured simulator and its runners are made here, with the run store of the case. The texture of materials is
multiplied onto the pixels of a simulated image.
"""

from __future__ import annotations

import pkgutil
import time
from collections.abc import Iterator, Mapping, Sequence
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import Material, Radar
from radcal.config.part import Part
from radcal.errors import ConfigError, SimulatorError
from radcal.radar.geometry import Geometry, read_geometry
from radcal.scene.model import Scene
from radcal.sections.simulator import FOCUSED, SIMULATORS
from radcal.seeds import derived_seed
from radcal.seeds import noise_seed as seed_of_noise
from radcal.simulators.base import Looks, Simulator, SimulatorKind
from radcal.speckle.texture import equal_texture, texture_db, texture_order
from radcal.storage.files import digest
from radcal.storage.lock import claimed
from radcal.storage.runs import Parameters, Record, RunStore


def orders_of(materials: Mapping[str, Material], first: Radar, radar: Radar) -> dict[str, float]:
    """Order (shape parameter) of the gamma texture of each material with the key ``looks``.

    Parameters
    ----------
    materials : mapping
        Section ``materials``.
    first : Radar
        First pass; the key ``looks`` is the effective number of looks in the image of this pass.
    radar : Radar
        Pass of the simulated image; its speckle may have another number of looks.

    Returns
    -------
    dict
        Order of the texture by material, from :func:`radcal.speckle.texture.texture_order`; infinite if the effective
        looks need no texture.
    """
    return {
        name: texture_order(radar.looks, equal_texture(first.looks, material.looks, radar.looks))
        for name, material in materials.items()
        if material.looks is not None
    }


def textured(
    pixels_db: NDArray[np.float32], order: float, seed: int, name: str, fresh: bool = False
) -> NDArray[np.float32]:
    """Pixels of a material with gamma texture of unit mean.

    Parameters
    ----------
    pixels_db : ndarray of float32, shape (n,)
        All visible pixels of the material [dB].
    order : float
        Order of the gamma texture; infinite for no texture.
    seed : int
        Seed of the case, from which the random numbers are derived. The random numbers are the same in every run, so
        that the texture is a smooth function of its order.
    name : str
        Name of the material.
    fresh : bool
        Whether the random numbers are for the final check run, which has other random numbers than all other runs.

    Returns
    -------
    ndarray of float32, shape (n,)
        Pixels with texture [dB]; the array ``pixels_db`` itself if there is no texture.
    """
    if not np.isfinite(order):
        return pixels_db
    rng = np.random.default_rng([derived_seed(seed, "texture", name), int(fresh)])
    return (pixels_db + texture_db(rng.random(pixels_db.shape), order)).astype(np.float32)


def with_textures(
    image_db: NDArray[np.float32], geometry: Geometry, orders: Mapping[str, float], seed: int, fresh: bool
) -> NDArray[np.float32]:
    """Simulated image with texture on all pixels that contain a textured material alone.

    Parameters
    ----------
    image_db : ndarray of float32, shape ``geometry.shape``
        Simulated image [dB].
    geometry : Geometry
        Geometry of the pass, which determines the pixels of each material.
    orders : mapping
        Order of the texture by material (:func:`orders_of`).
    seed, fresh : int, bool
        As in :func:`textured`.

    Returns
    -------
    ndarray of float32, shape ``geometry.shape``
        Image with texture [dB]; the array ``image_db`` itself if no material of the image has a texture.
    """
    orders = {name: order for name, order in orders.items() if np.isfinite(order) and name in geometry.names}
    if not orders:
        return image_db
    image_db = image_db.copy()
    for name, order in orders.items():
        pixels = geometry.pixels(name)
        image_db.ravel()[pixels] = textured(image_db.ravel()[pixels], order, seed, name, fresh)
    return image_db


def _law_description(material: Material, first: Radar, radar: Radar, seed: int) -> dict[str, Any]:
    """Part of a run's description that identifies law and texture of a material, without the law's parameters."""
    description = dict(material.unbound_law.description)
    if material.looks is not None:
        # the texture depends on all four values; the description of an external program's pass does not contain the
        # looks
        description["looks"] = [material.looks, first.looks, radar.looks, seed]
    if any(material.integers):
        description["integer"] = [
            name for name, x in zip(material.parameter_names, material.integers, strict=True) if x
        ]
    return description


class Runner:
    """Runner of the simulator in one pass: it reads recorded runs from the run store, and simulates all other runs.

    Parameters
    ----------
    store : RunStore
        Store of the runs.
    simulator : Simulator
        Simulator for runs that the store does not contain.
    geometry : Geometry
        Geometry of the pass, which defines the pixels of each material.
    scene_identity : str
        Hash that identifies the scene.
    case : Part
        Pass, laws, and calibrated materials, whose pixels are recorded.
    first : Radar, optional
        First pass of the case; the keys ``looks`` of the materials are effective looks in the image of this pass. By
        default the pass of ``case``.
    """

    def __init__(
        self,
        store: RunStore,
        simulator: Simulator,
        geometry: Geometry,
        scene_identity: str,
        case: Part,
        first: Radar | None = None,
    ) -> None:
        self._store, self._simulator = store, simulator
        self._geometry, self._scene_identity, self._case = geometry, scene_identity, case
        first = first or case.radar
        self._laws = {
            name: _law_description(material, first, case.radar, case.seed) for name, material in case.materials.items()
        }
        self._textures = orders_of(case.materials, first, case.radar)
        self._fresh, self._recorded = seed_of_noise(case, fresh=True), case.calibrated

    @property
    def identity(self) -> Mapping[str, Any]:
        """Identity of the simulator, as it was before the first run of this runner."""
        return self._simulator.identity

    def description(self, parameters: Parameters, noise_seed: int, repeat: bool = False) -> dict[str, Any]:
        """Plain data that determine the pixel values of a run, and whose hash is the hash of the run."""
        # If no frequency is configured, the key is omitted, so that runs from before the key existed keep their hashes.
        radar, simulator = self._case.radar, self._case.simulator
        left_out = simulator.not_told | ({"frequency_ghz"} if radar.frequency_ghz is None else set())
        radius = self._geometry.earth_radius_m
        return {
            "simulator": {**self._simulator.identity, **SIMULATORS.origin(simulator.kind)},
            "scene": self._scene_identity,
            "pass": {
                **{key: value for key, value in radar.described().items() if key not in left_out},
                **({} if radius is None else {"earth_radius_m": radius}),
            },
            "materials": {
                name: {**law, "parameters": [float(x) for x in parameters[name]]} for name, law in self._laws.items()
            },
            "noise_seed": noise_seed,
            **({"repeat": True} if repeat else {}),
        }

    def take(self, other: RunStore, key: str) -> bool:
        """Copy a record from another store, unless this store already has a record of the run.

        Parameters
        ----------
        other : RunStore
            Store from which the record is copied.
        key : str
            Hash of the run.

        Returns
        -------
        bool
            Whether this store now has the record. The result is False if the other store lacks the record, or if the
            record lacks the pixels of a calibrated material.
        """
        if self._store.get(key, self._recorded) is None:
            record = other.get(key, self._recorded)
            if record is None:
                return False
            self._store.put(record, other.description(key))
        return True

    def run(self, parameters: Parameters, noise_seed: int, image: bool = False, repeat: bool = False) -> Record:
        """Record of the run with the given parameters; the run is simulated only if the store lacks its record.

        Parameters
        ----------
        parameters : mapping
            Law parameters X of every material, by name of the material.
        noise_seed : int
            Seed of speckle and thermal noise.
        image : bool
            Whether the record must contain the whole image.
        repeat : bool
            Whether the run repeats a run with the same parameters and seed; the repetition gets a separate record.

        Raises
        ------
        SimulatorError
            The simulation failed, or the image has the wrong size or pixel values that are not finite.
        """
        description = self.description(parameters, noise_seed, repeat)
        key = digest(description)
        found = self._found(key, image)
        if found is not None:
            return found
        with claimed(self._store.folder, key):
            # while this job waited for the lock, a job of a killed command may have simulated this run
            found = self._found(key, image)
            return found if found is not None else self._simulate(key, description, parameters, noise_seed, image)

    def require_looks(self, product: str) -> None:
        """Raise a ConfigError on a product if the simulator does not give complex looks."""
        if not isinstance(self._simulator, Looks):
            raise ConfigError(
                f"the product {product} is not one of simulator.kind: {self.identity['kind']}, which gives intensity, "
                "expected a simulator of complex looks, such as builtin."
            )

    def looks(self, parameters: Parameters, noise_seed: int) -> Iterator[NDArray[np.complex64]]:
        """Complex looks of the run with the given parameters, with the texture of its image; they are not recorded."""
        assert isinstance(self._simulator, Looks)  # noqa: S101 - required before
        none_db = np.zeros(self._geometry.shape, dtype=np.float32)
        fresh = noise_seed == self._fresh
        texture_db = with_textures(none_db, self._geometry, self._textures, self._case.seed, fresh)
        for look in self._simulator.looks(parameters, noise_seed):
            yield look * 10.0 ** (texture_db / np.float32(20.0))

    def _found(self, key: str, image: bool) -> Record | None:
        """Record of a run; None if it is missing, or if its numbers of pixels differ from those of the geometry."""
        record = self._store.get(key, self._recorded, image)
        if record is not None and any(record.pixels_db[name].size != n for name, n in self._sizes.items()):
            return None
        return record

    @cached_property
    def _sizes(self) -> Mapping[str, int]:
        return {name: self._geometry.pixels(name).size for name in self._recorded}

    def _simulate(
        self, key: str, description: Mapping[str, Any], parameters: Parameters, noise_seed: int, image: bool
    ) -> Record:
        """Simulate a run, check the image and write the record into the store."""
        started = time.perf_counter()
        image_db = self._simulator.run(parameters, noise_seed)
        seconds = time.perf_counter() - started
        if image_db.shape != self._geometry.shape:
            raise SimulatorError(
                f"run {key}: the simulator's image has {image_db.shape} pixels, expected {self._geometry.shape}."
            )
        image_db = with_textures(image_db, self._geometry, self._textures, self._case.seed, noise_seed == self._fresh)
        pixels = {name: image_db.ravel()[self._geometry.pixels(name)] for name in self._recorded}
        for name, values in pixels.items():
            if not np.isfinite(values).all():
                raise SimulatorError(
                    f"run {key}: {np.count_nonzero(~np.isfinite(values))} of {values.size} pixels of {name!r} are not "
                    f"finite at {name} = {list(parameters[name])}."
                )
        record = Record(key, pixels, image_db if image or self._case.simulator.keep_images else None, seconds)
        self._store.put(record, description)
        return record


def make_simulator(case: Part, geometry: Geometry, geometry_path: str | Path, scene: Scene | None = None) -> Simulator:
    """Create the configured simulator for the geometry of a pass.

    Parameters
    ----------
    case : Part
        Configuration of simulator, pass and materials.
    geometry : Geometry
        Geometry of the pass.
    geometry_path : path
        Path of the geometry file, which an external simulator may read, and beside which one of focused images keeps
        what its runs share; empty for none.
    scene : Scene, optional
        Scene of the geometry, which a simulator of focused images needs.

    Raises
    ------
    ConfigError
        The configuration of an external simulator is wrong (:class:`~radcal.programs.command.CommandPlan`), or a
        law without a curve is configured for the built-in simulator, or radar or scene do not suit focused images.
    """
    if case.simulator.focused:
        folder = Path(geometry_path).parent / "focused" if geometry_path else None
        focused: Simulator = pkgutil.resolve_name(FOCUSED)(case, scene, geometry, folder)
        return focused
    found: Any = SIMULATORS[case.simulator.kind]
    kind: type[SimulatorKind] = found
    return kind.of(case, geometry, geometry_path)


def make_runners(
    case: Part, scene_path: str | Path, geometry_paths: Sequence[str | Path], runs: str | Path
) -> list[Runner]:
    """Runner of each pass, which reads runs from the case's run store, and simulates new ones as configured."""
    scene, geometries = Scene.read(scene_path), [read_geometry(path) for path in geometry_paths]
    return runners_of(case, scene, geometries, geometry_paths, runs)


def runners_of(
    case: Part, scene: Scene, geometries: Sequence[Geometry], paths: Sequence[str | Path], runs: str | Path
) -> list[Runner]:
    """Runners as of :func:`make_runners`, from the scene and the geometry of each pass.

    The files ``paths`` need not exist before the first run.
    """
    each, identity = case.passes, scene.identity
    return [
        Runner(RunStore(runs), make_simulator(one, geometry, path, scene), geometry, identity, one, each[0].radar)
        for one, geometry, path in zip(each, geometries, paths, strict=True)
    ]
