"""Writer of small OGC CDB databases, by the formulas of the standard alone (OGC 15-113r6, sections 3.6.2 and 5.6).

It imports nothing of radcal: the reader computes places from names, the writer names from places.
"""

from __future__ import annotations

import math
import warnings

import numpy as np
import pyogrio
import rasterio
import shapely
from rasterio.transform import from_origin

FOLDERS = {
    1: "001_Elevation", 4: "004_Imagery", 5: "005_RMTexture", 6: "006_RMDescriptor", 100: "100_GSFeature",
    201: "201_RoadNetwork",
}  # fmt: skip
# table 3-29: latitudes of a zone and number of geocells of one degree in a geocell
ZONES = (
    (89, 90, 12), (80, 89, 6), (75, 80, 4), (70, 75, 3), (50, 70, 2), (-50, 50, 1),
    (-70, -50, 2), (-75, -70, 3), (-80, -75, 4), (-89, -80, 6), (-90, -89, 12),
)  # fmt: skip


def zone(latitude):
    return next(width for low, high, width in ZONES if low <= latitude < high)


def tile_of(longitude, latitude, lod):
    """Names of latitude and longitude, U and R of the tile of a place, and its west, south and height [deg]."""
    slice_id = math.floor(latitude + 90)
    north = f"S{90 - slice_id:02d}" if latitude < 0 else f"N{slice_id - 90:02d}"
    width = zone(latitude)
    index = math.floor((longitude + 180) / width) * width
    east = f"W{180 - index:03d}" if index < 180 else f"E{index - 180:03d}"
    tiles = 2 ** max(lod, 0)
    up = math.floor((latitude + 90 - slice_id) * tiles)
    right = math.floor((longitude + 180 - index) / width * tiles)
    return north, east, up, right, (index - 180 + width * right / tiles, slice_id - 90 + up / tiles, 1 / tiles)


def file_of(root, place, dataset, lod, ending, s=1, t=1):
    """Path of a file of the tile of a place, whose folder is made."""
    north, east, up, right, _ = tile_of(*place, lod)
    level = f"LC{-lod:02d}" if lod < 0 else f"L{lod:02d}"
    folder = root / "Tiles" / north / east / FOLDERS[dataset] / ("LC" if lod < 0 else level) / f"U{up}"
    folder.mkdir(parents=True, exist_ok=True)
    return folder / f"{north}{east}_D{dataset:03d}_S{s:03d}_T{t:03d}_{level}_U{up}_R{right}.{ending}"


def elements(place, lod, at):
    """Longitudes and latitudes of the elements of a tile; row 0 is in the north. Posts have at = 0, areas 0.5."""
    size = 1024 if lod >= 0 else 2 ** (10 + lod)
    *_, (west, south, height) = tile_of(*place, lod)
    along, up = np.arange(size) + at, np.arange(size)[::-1] + at
    return np.meshgrid(west + along * height * zone(place[1]) / size, south + up * height / size)


def write_raster(root, place, dataset, lod, values, s=1, t=1, shift=0.0):
    """Write a tile; ``shift`` moves its tags to the east by a part of an element."""
    path = file_of(root, place, dataset, lod, "tif", s, t)
    *_, (west, south, height) = tile_of(*place, lod)
    dx, dy = height * zone(place[1]) / values.shape[1], height / values.shape[0]
    half = 0.5 if dataset == 1 else 0.0  # posts lie on the south-west corners of elements
    transform = from_origin(west + (shift - half) * dx, south + height - half * dy, dx, dy)
    with rasterio.open(
        path, "w", driver="GTiff", height=values.shape[0], width=values.shape[1], count=1, dtype=values.dtype,
        crs="EPSG:4326", transform=transform,
    ) as raster:  # fmt: skip
        raster.write(values, 1)
    return path


def write_heights(root, place, lod, height, **more):
    values = np.asarray(height(*elements(place, lod, 0.0)))
    return write_raster(root, place, 1, lod, values.astype(more.pop("dtype", np.float32)), **more)


def write_imagery(root, place, lod, colour):
    """Write a tile of imagery without loss; ``colour`` gives red, green and blue of places."""
    path, values = file_of(root, place, 4, lod, "jp2"), np.asarray(colour(*elements(place, lod, 0.5))).astype(np.uint8)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a tile without tags
        with rasterio.open(
            path, "w", driver="JP2OpenJPEG", height=values.shape[1], width=values.shape[2], count=len(values),
            dtype="uint8", quality=100, reversible="YES",
        ) as raster:  # fmt: skip
            raster.write(values)
    return path


def write_materials(root, place, lod, layers, table, shares=()):
    """Write layers of indices, layers of shares, and the table of composite materials of a tile."""
    for k, layer in enumerate(layers, start=1):
        write_raster(root, place, 5, lod, layer.astype(np.uint8), s=1, t=k)
    for k, share in enumerate(shares, start=1):
        write_raster(root, place, 5, lod, share, s=2, t=k)
    rows = "".join(
        f'<Composite_Material index="{index}"><Name>{name}</Name><Primary_Substrate><Material><Name>BM_{name}</Name>'
        "<Weight>100</Weight></Material></Primary_Substrate></Composite_Material>"
        for index, name in table.items()
    )
    path = file_of(root, place, 6, lod, "xml")
    path.write_text(f"<Composite_Material_Table>{rows}</Composite_Material_Table>")
    return path


def write_features(root, place, lod, shapes, columns, classes, dataset=100, t=1):
    """Write instances and their classes, whose shapefile is empty."""
    path = file_of(root, place, dataset, lod, "shp", t=t)
    kind = {1: "Point Z", 3: "LineString Z", 5: "Polygon Z"}[t]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for target, geometry, data in (
            (path, shapely.to_wkb(np.array(shapes), output_dimension=3), columns),
            (file_of(root, place, dataset, lod, "dbf", t=t + 1), None, classes),
        ):
            pyogrio.raw.write(
                target, geometry, [np.array(values) for values in data.values()], list(data), driver="ESRI Shapefile",
                geometry_type=None if geometry is None else kind, crs=None,
            )  # fmt: skip
    file_of(root, place, dataset, lod, "shp", t=t + 1).touch()
    return path
