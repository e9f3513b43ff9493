"""Exports of a calibration, which other programs read: tables, calibrated materials and images."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from radcal.config.part import Part
from radcal.figures.drawing import material_colours
from radcal.figures.map_figures import gray_scale
from radcal.ground.levels import without_level
from radcal.products.geotiff import Classes, Layer, write_layers
from radcal.products.tables import (
    LAWS,
    PARAMETERS,
    calibrated_materials,
    calibrated_yaml,
    law_rows,
    parameter_rows,
    write_csv,
)
from radcal.programs.command import CommandSimulator
from radcal.radar.geometry import Geometry
from radcal.registration.registered import Registered
from radcal.results.archive import Archive
from radcal.results.summary import sentences
from radcal.scene.model import Scene
from radcal.sections.materials import Material
from radcal.seeds import noise_seed
from radcal.simulators.base import Simulator
from radcal.storage.files import atomic
from radcal.storage.runs import RunStore, read_index, record_of

_INPUT = "simulator_input"
_MASK: Classes = {
    1: ("clear", "#D9D9D9"),
    2: ("in layover", "#E69F00"),
    3: ("with ground in shadow", "#332288"),
    4: ("in layover, with ground in shadow", "#882255"),
}


def write_export(
    folder: str | Path,
    case: Part,
    archive: Archive,
    scene: Scene,
    geometries: Sequence[Geometry],
    registered: Sequence[Registered],
    final: str | Path,
    runs: str | Path,
    simulator: Simulator | None = None,
) -> list[Path]:
    """Write the folder ``export``, each file atomically.

    Parameters
    ----------
    folder : path
        The folder, which is created.
    case : Part
        Materials, passes and seed of the case.
    archive : Archive
        Results of the calibration, with images; that of the first pass has the texture of each material.
    scene : Scene
        Scene of the case.
    geometries, registered : sequence
        Geometry and registered image of each pass.
    final, runs : path
        Index of the final runs, two for each pass, and folder of the run store.
    simulator : Simulator, optional
        Simulator of the first pass, whose input is exported if it is an external program.

    Returns
    -------
    list of path
        Paths of the files.

    Raises
    ------
    StoreError
        A file cannot be written, or the record of a final run is missing or lacks its image.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / name for name in ("laws.csv", "parameters.csv", "calibrated.yaml")]
    write_csv(files[0], LAWS, law_rows(archive))
    write_csv(files[1], PARAMETERS, parameter_rows(archive))
    materials = calibrated_materials(archive)
    seed = noise_seed(case, fresh=True)
    with atomic(files[2]) as partial:
        text = calibrated_yaml(archive, materials, sentences(archive)[0], seed)
        partial.write_text(text, encoding="utf-8")
    if isinstance(simulator, CommandSimulator):
        parameters = {name: archive.laws[name].tolist() for name in case.materials}
        files += simulator.write_input(folder / _INPUT, parameters, seed)
    store, index = RunStore(runs), read_index(final)
    each = zip(case.passes, geometries, registered, archive.passes.values(), strict=True)
    for number, (one, geometry, image, result) in enumerate(each, start=1):
        calibrated_db = archive.images.calibrated_db
        if number > 1:
            key = index[2 * number - 1].key
            calibrated_db = record_of(store, final, key, case.calibrated, image=True).image_db
        assert calibrated_db is not None  # noqa: S101 - the archive holds that of the first pass
        measured_db = without_level(image.measurement.image_db, result.levels)
        text = f"measured image, {'registered' if image.applied else 'not registered'}"
        if result.levels.normalisation != "none":
            text += ", after subtraction of its assumed level"
        tags = {"case": archive.configured.case, "radiometry": one.radar.radiometry}
        gray = gray_scale(measured_db)
        simulated = "simulated image with the laws of the search and textures"
        layers = {
            "measured": Layer(measured_db, "dB", text, tags, gray=gray),
            "calibrated": Layer(calibrated_db, "dB", simulated, tags, gray=gray),
            "difference": Layer(calibrated_db - measured_db, "dB", "calibrated minus measured image", tags),
            **ground_layers(geometry, tags, case.materials),
        }
        files += write_layers(folder, number, layers, scene, geometry)
    return files


def ground_layers(geometry: Geometry, tags: Mapping[str, str], materials: Mapping[str, Material]) -> dict[str, Layer]:
    """Images of local incidence, materials and mask of a pass in slant range, by file name.

    Parameters
    ----------
    geometry : Geometry
        Geometry of the pass.
    tags : mapping
        Further tags of the files.
    materials : mapping
        Materials of the case by name, of which some have a colour.
    """
    configured = {name: one.colour for name, one in materials.items() if one.colour is not None}
    colours = material_colours(geometry.names, configured)
    of_material = dict(enumerate(zip(geometry.names, colours, strict=True), start=1))
    names = json.dumps(dict(enumerate(geometry.names, start=1)))
    alone = "material of pixels of one material alone, by number (tag materials); 0: mixed, or none"
    hidden = "1: clear; 2: in layover; 3: with ground in shadow; 4: both; 0: no ground (on a map: no pixel shows it)"
    material = np.where(geometry.visible, geometry.material, 0).astype(np.uint8)
    seen = geometry.visible | geometry.shadow
    mask = np.where(seen, 1 + geometry.layover + 2 * geometry.shadow, 0).astype(np.uint8)
    return {
        "incidence": Layer(geometry.incidence_deg, "deg", "mean local incidence of the pixel's ground", tags),
        "material": Layer(material, "1", alone, {**tags, "materials": names}, of_material),
        "mask": Layer(mask, "1", hidden, tags, _MASK),
    }
