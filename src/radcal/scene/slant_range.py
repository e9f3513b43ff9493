"""Scenes over flat ground, from a raster of material labels in slant range."""

from __future__ import annotations

import hashlib

import numpy as np
from numpy.typing import NDArray

from radcal.config import SlantRangeScene, expand_path
from radcal.config.inputs import vrt_folders
from radcal.errors import SceneError
from radcal.reading.intake import LARGEST_VALUES, guarded
from radcal.reading.rasters import check_blocks, open_raster
from radcal.scene.base import SceneSize, SceneSource
from radcal.scene.model import Scene
from radcal.scene.names import by_id, read_names
from radcal.storage.files import digest


def flat_incidence_deg(near_deg: float, far_deg: float, rows: int) -> NDArray[np.float64]:
    """Incidence angle of each slant-range row over flat ground.

    For a radar at height H, cos(incidence) = H / slant range. The slant range grows in equal steps from the first row
    to the last.

    Parameters
    ----------
    near_deg, far_deg : float
        Incidence angle at the first and the last row [deg].
    rows : int
        Number of rows.

    Returns
    -------
    ndarray, shape (rows,)
        Incidence angle [deg].

    References
    ----------
    Ulaby, Moore and Fung, "Microwave Remote Sensing", vol. II, section 7-2 (flat earth).
    """
    near, far = 1.0 / np.cos(np.radians([near_deg, far_deg]))
    return np.degrees(np.arccos(1.0 / np.linspace(near, far, rows)))


def slant_range_scene(config: SlantRangeScene) -> Scene:
    """Scene from a label raster and a file with the names of its labels.

    Raises
    ------
    SceneError
        A file cannot be read, a label is not a material id, or a material id has no name.
    """
    names_path, path = expand_path(config.names, "scene.names"), expand_path(config.labels, "scene.labels")

    def refused(text: str) -> SceneError:
        return SceneError(f"scene.labels: {path} {text}")

    with guarded(path, refused, "a raster"), open_raster(path, vrt_folders(config)) as raster:
        if raster.count != 1:
            raise refused(f"has {raster.count} bands, expected one.")
        if raster.height * raster.width > LARGEST_VALUES:
            raise refused(f"has {raster.height} x {raster.width} pixels, expected at most {LARGEST_VALUES:.0e}.")
        check_blocks(raster)
        labels = np.asarray(raster.read(1))
    if labels.dtype.kind not in "ui" or labels.min() < 0 or labels.max() > 255:
        held = f"{labels.dtype} from {labels.min()} to {labels.max()}"
        raise refused(f"holds {held}, expected whole material ids from 0 to 255.")
    names = read_names(names_path, [int(k) for k in np.unique(labels)], path)
    return Scene(
        identity=digest(
            {
                "config": config.model_dump(mode="json", exclude={"labels", "names", "vrt_folders"}),
                "shape": list(labels.shape),
                "labels": hashlib.sha256(labels.astype(np.uint8).tobytes()).hexdigest(),
                "names": {str(k): v for k, v in names.items()},
                "version": 1,
            }
        ),
        names=by_id(names),
        material=labels.astype(np.uint8),
        elevation_m=None,
        cell_m=1.0,
        incidence_deg=flat_incidence_deg(config.near_incidence_deg, config.far_incidence_deg, labels.shape[0]),
    )


class SlantRangeSource(SceneSource):
    """Source ``slant_range``."""

    section = SlantRangeScene

    @staticmethod
    def size(config: SlantRangeScene) -> SceneSize:
        """Number of labels; pixels in slant range have no size on the ground."""
        path = expand_path(config.labels, "scene.labels")
        with (
            guarded(path, lambda text: SceneError(f"scene.labels: {path} {text}"), "a raster"),
            open_raster(path, vrt_folders(config)) as raster,
        ):
            cells = int(raster.width) * int(raster.height)
        return SceneSize(cells, None, cells)

    @staticmethod
    def make(config: SlantRangeScene, _: float) -> Scene:
        """Scene of the labels."""
        return slant_range_scene(config)
