"""Cells of all materials in one pass, from the registered image and from simulated images of the calibrated laws."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from numpy.typing import NDArray

from radcal.config.part import Part
from radcal.errors import MeasurementError
from radcal.ground.correlation import estimate_correlation
from radcal.ground.ground import Blocks
from radcal.ground.levels import Levels, median_and_range
from radcal.ground.pixels import IN_THE_NOISE, eligible_pixels, noise_limited, point_targets
from radcal.posterior.cells import WITHOUT_AREA, CellMeans, Simulated, area_db, cell_means
from radcal.radar.radiometry import noise_floor_db
from radcal.seeds import derived_seed
from radcal.simulators.runner import runners_of
from radcal.targets.target_fit import fields_of

if TYPE_CHECKING:
    from radcal.radar.geometry import Geometry
    from radcal.registration.registered import Registered
    from radcal.scene.model import Scene
    from radcal.storage.runs import Record

_LOOKS, _SEED_BITS = 32, 31
_FEWEST = 3  # cells of a material


def simulated_of(
    case: Part,
    scene: Scene,
    geometries: Sequence[Geometry],
    final: Sequence[tuple[Record, Mapping[str, Sequence[float]]]],
    folder: str,
) -> list[list[Simulated]]:
    """Simulated images of each pass: the final runs' and, of the built-in simulator, one of 32 looks at the same X.

    A focused image of 32 looks would need a far longer aperture: it is the mean of as many draws as have 32 looks.

    Parameters
    ----------
    case : Part
        Configuration.
    scene : Scene
        Scene.
    geometries : sequence of Geometry
        Geometry of each pass.
    final : sequence of (Record, mapping)
        Final runs with their X, two for each pass.
    folder : path
        Store of the images of 32 looks, which are no runs of the calibration.
    """
    found: list[list[Simulated]] = []
    for k, (one, geometry) in enumerate(zip(case.passes, geometries, strict=True)):
        own = [Simulated(run.image_db, x) for run, x in final[2 * k : 2 * k + 2] if run.image_db is not None]
        if case.simulator.own:
            looks = one.radar.looks if case.simulator.focused else float(_LOOKS)
            many = one.model_copy(update={"radars": [one.radar.model_copy(update={"looks": looks})]})
            (runner,), parameters = runners_of(many, scene, [geometry], [""], folder), final[2 * k][1]
            images = []
            for draw in range(math.ceil(_LOOKS / looks)):
                seed = derived_seed(case.seed, "posterior", "draw", *[draw] * (draw > 0), bits=_SEED_BITS)
                record = runner.run(parameters, seed, image=True)
                assert record.image_db is not None  # noqa: S101 - asked for
                images.append(record.image_db)
            own = [Simulated(images[0] if len(images) == 1 else _mean_db(images), parameters)]
        found.append(own)
    return found


def _mean_db(images_db: Sequence[NDArray[np.float32]]) -> NDArray[np.float32]:
    """Mean power of images [dB]."""
    mean = np.mean([10.0 ** (one.astype(np.float64) / 10.0) for one in images_db], axis=0)
    return np.asarray(10.0 * np.log10(mean), np.float32)


def observe(
    case: Part,
    geometry: Geometry,
    registered: Registered,
    simulated: Sequence[Simulated],
    levels: Levels,
    scene: Scene | None,
) -> dict[str, CellMeans]:
    """Cells of all materials in one pass; materials with too few usable pixels are absent.

    Pixels whose simulated level is near the noise, and point targets, are masked; cells of fixed materials into which
    other ground leaks are left out. With a section ``validation``, fold 1 holds the blocks that are held out or, if all
    are used, those of odd number.

    Parameters
    ----------
    case : Part
        Configuration of the pass.
    geometry : Geometry
        Geometry of the pass.
    registered : Registered
        Registered measured image.
    simulated : sequence of Simulated
        Simulated images of the pass.
    levels : Levels
        Level normalisation of the measured image.
    scene : Scene or None
        Scene, whose connected areas are the fields; None for those of the image.
    """
    image, laws = registered.measurement.image_db, case.laws
    mean_db = _mean_db([one.image_db for one in simulated])
    if levels.normalisation == "image":
        middle, spread = median_and_range(mean_db[(geometry.material > 0) & np.isfinite(image)])
        image = (Levels.apply(image, levels.measured) * spread + middle).astype(np.float32)
    noisy = case.simulator.own
    floor = noise_floor_db(case.radar, geometry.flat_incidence_deg)
    flags = {IN_THE_NOISE: noise_limited(mean_db, floor, case.target.snr_db)} if noisy else {}
    if case.target.leave_out_point_targets:
        flags["point targets"] = point_targets(image, geometry.material, case.radar)
    fold = None
    if case.validation is not None and case.validation.keep != "fields":
        blocks = Blocks.of(case.validation)
        part = blocks.parts_of(np.arange(image.size), geometry.shape[1])
        keep: Literal["even", "odd"] = "odd" if case.validation.keep == "odd" else "even"
        fold = np.where(blocks.kept(part, keep), 0, 1)
    measurement, area, found = replace(registered.measurement, image_db=image), area_db(geometry, case.radar), {}
    for name in geometry.names:
        if name not in case.materials or (not case.materials[name].calibrate and not laws[name].has_curve):
            continue
        try:
            pixels = eligible_pixels(name, geometry, measurement, case.target, registered.uncertainty_px, flags).pixels
        except MeasurementError:
            continue
        cells = cell_means(
            pixels,
            fields_of(name, geometry, scene)[pixels],
            image,
            simulated,
            name,
            laws[name],
            geometry,
            case.radar,
            estimate_correlation(image, pixels, geometry.incidence_deg),
            area,
            noisy,
            fold[pixels] if fold is not None and case.materials[name].calibrate else None,
        )
        if not case.materials[name].calibrate:
            cells = cells.without_leaks(case.radar.radiometry not in WITHOUT_AREA)
        if cells.size >= _FEWEST:
            found[name] = cells
    return found
