"""Exports of a calibration, which other programs read: tables, calibrated materials and images."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from radcal.config import stages
from radcal.radar.geometry import Geometry
from radcal.report.archive import Archive
from radcal.report.geotiff import Layer, map_grid, write_geotiff
from radcal.report.summary import sentences
from radcal.report.tables import (
    LAWS,
    PARAMETERS,
    calibrated_materials,
    calibrated_yaml,
    law_rows,
    parameter_rows,
    write_csv,
)
from radcal.scene.model import Scene
from radcal.seeds import noise_seed
from radcal.storage.files import atomic

__all__ = ["layers_of", "write_export"]


def write_export(
    folder: str | Path, case: stages.Export, archive: Archive, scene: Scene, geometry: Geometry
) -> list[Path]:
    """Write the folder ``export``, each file atomically.

    Parameters
    ----------
    folder : path
        The folder, which is created.
    case : stages.Export
        Materials, pass and seed of the case.
    archive : Archive
        Results of the calibration, with images.
    scene, geometry : Scene, Geometry
        Scene of the case, and geometry of the first pass.

    Returns
    -------
    list of path
        The files.

    Raises
    ------
    StoreError
        A file cannot be written.
    """
    folder = Path(folder)
    folder.mkdir(parents=True, exist_ok=True)
    files = [folder / name for name in ("laws.csv", "parameters.csv", "calibrated.yaml")]
    write_csv(files[0], LAWS, law_rows(archive))
    write_csv(files[1], PARAMETERS, parameter_rows(archive))
    materials = calibrated_materials(archive, case.materials)
    with atomic(files[2]) as partial:
        text = calibrated_yaml(archive, materials, sentences(archive)[0], noise_seed(case, fresh=True))
        partial.write_text(text, encoding="utf-8")
    grid = map_grid(scene, geometry)
    for name, layer in layers_of(case, archive, geometry).items():
        files.append(folder / f"{name}.tif")
        write_geotiff(files[-1], layer, grid)
    return files


def layers_of(case: stages.Export, archive: Archive, geometry: Geometry) -> dict[str, Layer]:
    """Images of the first pass by the name of their file, in slant range.

    Parameters
    ----------
    case : stages.Export
        Pass of the case.
    archive : Archive
        Results of the calibration.
    geometry : Geometry
        Geometry of the first pass.

    Returns
    -------
    dict
        ``measured``, ``calibrated`` (with the texture of the materials) and ``difference`` [dB], ``incidence`` [deg]
        and ``material``. An image that is not archived is absent.
    """
    images, tags = archive.images, {"case": archive.case, "radiometry": case.radar.radiometry}
    found = {}
    measured, calibrated = images.measured_db, images.calibrated_db
    if measured is not None:
        said = "measured image, registered, after subtraction of its assumed level"
        found["measured"] = Layer(measured, "dB", said, tags)
    if calibrated is not None:
        found["calibrated"] = Layer(calibrated, "dB", "simulated image with the calibrated laws and textures", tags)
    if measured is not None and calibrated is not None:
        found["difference"] = Layer(calibrated - measured, "dB", "calibrated minus measured image", tags)
    if images.incidence_deg is not None:
        found["incidence"] = Layer(images.incidence_deg, "deg", "mean local incidence of the pixel's ground", tags)
    if images.material is not None:
        names = {str(k): name for k, name in enumerate(archive.names, start=1)}
        said = "material of pixels of one material alone, by number (tag materials); 0: mixed, or none"
        material = np.where(np.diff(geometry.cell_start).reshape(geometry.shape) > 0, images.material, 0)
        tagged = {**tags, "materials": json.dumps(names)}
        found["material"] = Layer(material.astype(np.uint8), "1", said, tagged)
    return found
