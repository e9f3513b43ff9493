"""STAC item of a finished case, with its exports as assets, for catalogues of geodata."""

from __future__ import annotations

import mimetypes
from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

from radcal.storage.records import read_hdf5

if TYPE_CHECKING:
    import pystac

_TABLES = ("export/laws.csv", "export/parameters.csv", "export/calibrated.yaml", "runs.csv")
_FILES = ("report.html", "summary.json", "calibration.h5", *_TABLES)
_OF_MATERIAL = ("law", "parameters", "fits", "known_between_deg")


def stac_item(folder: Path, summary: Mapping[str, Any], images: Iterable[str]) -> pystac.Item:
    """STAC item of a finished case.

    Parameters
    ----------
    folder : Path
        Results folder of the case.
    summary : mapping
        Content of ``summary.json``.
    images : iterable of str
        Names of the exported images.

    Returns
    -------
    pystac.Item
        Item whose assets are the files of the case, by file name. On a map, its geometry is the extent of the images in
        WGS 84; in slant range it has none. Its time is that of the acquisition, if the measured image gives it, else
        that at which the calibration was finished.

    Raises
    ------
    DamagedError, StoreError
        A file is missing or cannot be read.
    """
    import pystac

    from radcal.reading.rasters import open_raster

    folder = folder.resolve()
    with read_hdf5(folder / "calibration.h5", "calibration") as file:
        created = str(file.attrs["created"])
    taken = [one["numbers"]["start"] for one in summary.get("findings", []) if one["code"] == "acquisition"]
    time = datetime.fromisoformat(taken[0] if taken else created).replace(tzinfo=UTC)
    materials = {name: {key: one.get(key) for key in _OF_MATERIAL} for name, one in summary["materials"].items()}
    properties = {
        "title": f"radcal case {summary['case']}",
        "description": summary["verdict"],
        "created": created,
        "radcal:materials": materials,
    }
    assets, shape, box = {}, None, None
    for name in images:
        path = folder / "export" / f"{name}.tif"
        with open_raster(path) as raster:
            tags, layout = raster.tags(), raster.tags(ns="IMAGE_STRUCTURE").get("LAYOUT")
            band = {"unit": tags["unit"], "data_type": raster.dtypes[0]}
            if raster.crs is not None:
                shape, box = _extent(raster.crs, raster.bounds)
        media = pystac.MediaType.COG if layout == "COG" else pystac.MediaType.GEOTIFF
        assets[path.name] = pystac.Asset(str(path), name, tags["description"], media, ["data"], {"bands": [band]})
    for file in _FILES:
        kind = mimetypes.MimeTypes().guess_type(file)[0]
        assets[Path(file).name] = pystac.Asset(str(folder / file), media_type=kind, roles=["metadata"])
    return pystac.Item(summary["case"], shape, box, time, properties, assets=assets, href=str(folder / "item.json"))


def _extent(crs: Any, bounds: Any) -> tuple[dict[str, Any], list[float]]:
    """Extent of an image in WGS 84, as a polygon of GeoJSON and as a box (west, south, east, north) [deg]."""
    from rasterio.warp import transform_geom
    from shapely.geometry import box, mapping, shape

    polygon = transform_geom(crs, "OGC:CRS84", mapping(box(*bounds)))
    return polygon, list(shape(polygon).bounds)
