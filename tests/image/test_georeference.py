"""Georeferenced images of known functions of the place, seen from the scene's pixels."""

import math

import numpy as np
import pytest
import rasterio
from affine import Affine
from pyproj import CRS, Transformer
from raster_files import write_raster
from rasterio.windows import Window

from radcal.config import FileMeasurement, Radar
from radcal.errors import MeasurementError
from radcal.image.georeference import map_pixel_m, read_at_ground
from radcal.image.raster import Header, RasterReader

UTM = "EPSG:32631"
WEST, SOUTH, CELL_M = 600_000.0, 5_780_000.0, 5.0
SCENE = (CELL_M, 0.0, WEST, 0.0, CELL_M, SOUTH)
CONFIG = FileMeasurement(path="image.tif", scale="power", radiometry="sigma0_ref")


def header_of(path, config):
    return RasterReader(path, config, Radar()).header


def ground_of(rows=30, columns=40):
    """Ground of an image whose range grows to the east and azimuth to the north, with fractions and gaps."""
    rng = np.random.default_rng(1)
    ground = np.stack(
        [
            np.linspace(2.0, 70.0, columns) + rng.uniform(-0.4, 0.4, (rows, columns)),  # scene rows: north
            np.linspace(5.0, 90.0, rows)[:, None] + rng.uniform(-0.4, 0.4, (rows, columns)),  # scene columns: east
        ]
    ).astype(np.float32)
    ground[:, 4, 7] = np.nan
    return ground


def place(ground):
    """UTM coordinates, cell centres at integers."""
    return WEST + (ground[1].astype(float) + 0.5) * CELL_M, SOUTH + (ground[0].astype(float) + 0.5) * CELL_M


def numbers(shape):
    """Numbers of the pixels of an image."""
    return np.arange(shape[0] * shape[1], dtype=np.float64).reshape(shape)


def at_ground(folder, crs, transform, values, ground):
    """Values of an image in a file on the ground of the scene's image."""
    path = write_raster(folder / "image.tif", values, crs=crs, transform=transform)
    return read_at_ground(path, CONFIG, (UTM, SCENE), ground)


SAME = (UTM, Affine(3.0, 0, WEST - 30.0, 0, -3.0, SOUTH + 420.0), (160, 200))
PLACES = {
    "same CRS, north up": SAME,
    "south up": (UTM, Affine(3.0, 0, WEST - 30.0, 0, 3.0, SOUTH - 30.0), (160, 200)),
    "rotated": (UTM, Affine.translation(WEST - 250.0, SOUTH + 150.0) @ Affine.rotation(-30.0) @ Affine.scale(4.0, 4.0),
                (250, 250)),
    "degrees": ("EPSG:4326", Affine(5e-5, 0, 4.4615, 0, -4e-5, 52.1655), (120, 180)),
    "another datum": ("EPSG:28992", Affine(4.0, 0, 0.0, 0, -4.0, 0.0), (150, 190)),
}  # fmt: skip


@pytest.mark.parametrize("name", PLACES)
def test_each_pixel_takes_the_nearest_value(tmp_path, name):
    crs, transform, shape = PLACES[name]
    ground = ground_of()
    x, y = Transformer.from_crs(UTM, crs, always_xy=True).transform(*place(ground))
    if name == "another datum":
        known = np.isfinite(ground[0])
        transform = Affine.translation(x[known].min() - 20.0, y[known].max() + 20.0) @ transform
    found = at_ground(tmp_path, crs, transform, numbers(shape), ground)
    assert found.shape == ground.shape[1:]
    assert np.isnan(found[4, 7])
    assert np.isfinite(found).sum() == found.size - 1
    # by search: the centre of the pixel found is the nearest of all
    row, column = np.indices(shape)
    centre_x, centre_y = transform @ (column.ravel() + 0.5, row.ravel() + 0.5)
    rng = np.random.default_rng(2)
    for i, j in zip(rng.integers(0, 30, 60), rng.integers(0, 40, 60), strict=True):
        if (i, j) == (4, 7):
            continue
        # in units of pixels along the image's own axes, where squares have their nearest centre
        across, along = (~transform) @ (centre_x - x[i, j] + transform.c, centre_y - y[i, j] + transform.f)
        assert found[i, j] == np.argmin(np.hypot(across, along))


def test_outside_the_image_there_is_nothing(tmp_path):
    crs, transform, _ = SAME
    ground = ground_of()
    found = at_ground(tmp_path, crs, transform, numbers((160, 100)), ground)
    x, _ = place(ground)
    np.testing.assert_array_equal(np.isnan(found), ~(x < WEST - 30.0 + 300.0))
    said = r"image\.tif \(WGS 84 / UTM zone 31N\) covers no place of the scene's im"
    with pytest.raises(MeasurementError, match=said):
        at_ground(tmp_path, crs, Affine.translation(1e5, 0) @ transform, numbers((160, 200)), ground)
    with pytest.raises(MeasurementError, match="covers no place"):
        at_ground(tmp_path, "EPSG:32601", transform, numbers((160, 200)), ground)


def test_gaps_and_complex_values_are_kept(tmp_path):
    crs, transform, shape = SAME
    values = numbers(shape) * (1.0 + 0.5j)
    values[::2] = np.nan
    path = write_raster(tmp_path / "complex.tif", values, crs=crs, transform=transform)
    config = CONFIG.model_copy(update={"scale": "complex"})
    found = read_at_ground(path, config, (UTM, SCENE), ground_of())
    number = at_ground(tmp_path, crs, transform, numbers(shape), ground_of())
    np.testing.assert_array_equal(found, np.where(number // 200 % 2 == 0, np.nan, number * (1.0 + 0.5j)))


def test_files_are_read_with_their_place(tmp_path):
    _, transform, shape = SAME
    crs = "EPSG:32631+5773"  # whose heights do not matter
    values = np.arange(np.prod(shape), dtype=np.int32).reshape(shape)
    path = write_raster(tmp_path / "two.tif", np.stack([values, 2 * values]), crs=crs, transform=transform, nodata=0)
    config = CONFIG.model_copy(update={"band": 2})
    assert header_of(path, config) == Header(crs=CRS(UTM), pixel_m=pytest.approx((3.0, 3.0)), on_map=True)
    found = read_at_ground(path, config, (UTM, SCENE), ground_of())
    np.testing.assert_array_equal(found, 2 * at_ground(tmp_path, UTM, transform, numbers(shape), ground_of()))
    holes = np.where(values % 400 < 200, 0, values)  # every second row has no data
    path = write_raster(tmp_path / "holes.tif", holes, crs=crs, transform=transform, nodata=0)
    holed = read_at_ground(path, CONFIG, (UTM, SCENE), ground_of())
    np.testing.assert_array_equal(holed, np.where(found / 2 % 400 < 200, np.nan, found / 2))
    with pytest.raises(MeasurementError, match="2 bands, expected one: .*measurement.band"):
        read_at_ground(tmp_path / "two.tif", CONFIG, (UTM, SCENE), ground_of())


def test_of_a_large_image_the_scenes_part_is_read(tmp_path):
    crs, transform, shape = SAME
    path = tmp_path / "large.tif"
    large = transform @ Affine.translation(-30_000, -20_000)
    with rasterio.open(
        path, "w", driver="GTiff", count=1, height=60_000, width=70_000, dtype="float32", crs=crs, transform=large,
        tiled=True, SPARSE_OK=True, compress="deflate",
    ) as raster:  # fmt: skip
        raster.write(numbers(shape).astype(np.float32), 1, window=Window(30_000, 20_000, shape[1], shape[0]))
    found = read_at_ground(path, CONFIG, (UTM, SCENE), ground_of())  # the whole image would be refused
    np.testing.assert_array_equal(found, at_ground(tmp_path, crs, transform, numbers(shape), ground_of()))


def test_files_without_a_place_are_told_apart(tmp_path):
    values = np.ones((20, 30), dtype=np.float32)
    plain = write_raster(tmp_path / "plain.tif", values)
    no_transform = write_raster(tmp_path / "crs.tif", values, crs=UTM)
    no_crs = write_raster(tmp_path / "transform.tif", values, transform=SAME[1])
    local = write_raster(
        tmp_path / "local.tif", values, transform=SAME[1],
        crs=rasterio.crs.CRS.from_wkt('LOCAL_CS["radar",UNIT["metre",1]]'),
    )  # fmt: skip
    (tmp_path / "text.tif").write_text("no raster")
    assert [header_of(one, CONFIG).crs for one in (no_transform, no_crs, local)] == [CRS(UTM), None, None]
    for path in (plain, no_transform, no_crs, local):
        assert header_of(path, CONFIG).pixel_m is None, path
        with pytest.raises(MeasurementError, match=rf"{path.name} has no coordinate reference system or no transform"):
            read_at_ground(path, CONFIG, (UTM, SCENE), ground_of())
    with pytest.raises(MeasurementError, match=r"text\.tif cannot be read as a raster"):
        read_at_ground(tmp_path / "text.tif", CONFIG, (UTM, SCENE), ground_of())


def test_pixels_are_turned_into_range_and_azimuth(tmp_path):
    """Pixels of 3 m to the east and 5 m to the north, seen by a track to the north, the east and the north-east."""
    where = {"crs": UTM, "transform": Affine(3.0, 0, WEST, 0, -5.0, SOUTH)}
    header = header_of(write_raster(tmp_path / "a.tif", np.ones((9, 9), np.uint8), **where), CONFIG)
    assert header.pixel_m == pytest.approx((3.0, 5.0))
    half = math.cos(math.radians(60.0))
    for heading, across, along in ((0.0, 3.0, 5.0), (90.0, 5.0, 3.0), (45.0, math.sqrt(17.0), math.sqrt(17.0))):
        sides = map_pixel_m(header.pixel_m, Radar(heading_deg=heading, depression_deg=60.0))
        assert sides == pytest.approx((half * across, along), rel=1e-3)
