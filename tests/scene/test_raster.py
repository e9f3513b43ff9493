"""Scenes from rasters against planes and maps whose values at any place are known."""

import functools
import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import rasterio
from affine import Affine
from pyproj import CRS, Geod, Transformer
from raster_files import write_raster
from scipy.ndimage import binary_erosion, gaussian_filter

from radcal.config import Radar, RasterScene
from radcal.errors import SceneError
from radcal.radar.projection import make_geometry
from radcal.scene.crs import crs_from, named_datum, same_datum, transformation_findings, vertical_datum
from radcal.scene.raster import raster_scene

UTM, EGM96 = "EPSG:32631", "EPSG:32631+5773"
WEST, SOUTH = 600_000.0, 5_780_000.0  # in Flevoland
NAMES = {"1": "grass", "2": "water", "3": "dyke"}


def plane(x, y):
    """Height [m] of a place in UTM."""
    return 100.0 + 0.2 * (np.asarray(x) - WEST) - 0.1 * (np.asarray(y) - SOUTH)


def centres(scene):
    """Coordinates of all cell centres, by the documented meaning of the transform."""
    a, b, c, d, e, f = scene.transform
    row, column = np.indices(scene.material.shape) + 0.5
    return a * column + b * row + c, d * column + e * row + f


def write(path, values, **profile):
    return str(write_raster(path, values, **profile))


to_utm = functools.cache(functools.partial(Transformer.from_crs, crs_to=UTM, always_xy=True))


def grid(transform, shape, crs):
    """UTM coordinates of a raster's pixel centres."""
    row, column = np.indices(shape) + 0.5
    x = transform.a * column + transform.b * row + transform.c
    y = transform.d * column + transform.e * row + transform.f
    return to_utm(crs).transform(x, y)


HEIGHTS = Affine(10.0, 0.0, WEST, 0.0, -10.0, SOUTH + 500.0)  # 50 x 60 pixels, north up
SHAPE = (50, 60)


@pytest.fixture
def build(tmp_path):
    """Write both rasters, by default in UTM with EGM96 heights, and return the configuration."""

    def build(
        heights=None,
        ids=None,
        *,
        crs=EGM96,
        transform=HEIGHTS,
        ids_crs=UTM,
        ids_transform=HEIGHTS,
        profile=None,
        ids_profile=None,
        names=NAMES,
        **keys,
    ):
        if heights is None:
            heights = plane(*grid(transform, SHAPE, crs or UTM))
        if ids is None:
            ids = np.ones(SHAPE, dtype=np.uint8)
        (tmp_path / "names.json").write_text(json.dumps(names))
        return RasterScene(
            elevation=write(tmp_path / "heights.tif", heights, crs=crs, transform=transform, **(profile or {})),
            materials=write(tmp_path / "ids.tif", ids, crs=ids_crs, transform=ids_transform, **(ids_profile or {})),
            names=str(tmp_path / "names.json"),
            **keys,
        )

    return build


def numbers_of(scene, code):
    """Numbers of the scene's finding with a code; None without one."""
    return next((one.numbers for one in scene.findings if one.code == code), None)


def test_a_raster_on_the_scenes_own_grid_is_taken_as_it_lies(build):
    heights = np.random.default_rng(1).normal(50.0, 5.0, SHAPE)
    ids = np.random.default_rng(2).integers(1, 4, SHAPE, dtype=np.uint8)
    scene = raster_scene(build(heights, ids))
    # row 0 of the scene is in the south, of the file in the north
    np.testing.assert_allclose(scene.elevation_m, heights[::-1], rtol=1e-12)
    np.testing.assert_array_equal(scene.material, ids[::-1])
    assert numbers_of(scene, "resampled") == {"elevation": "as in the file", "materials": "of the nearest pixel"}
    assert scene.transform == (10.0, 0.0, WEST, 0.0, 10.0, SOUTH)
    assert scene.crs == UTM
    assert scene.cell_m == 10.0
    assert scene.names == ("grass", "water", "dyke")
    assert scene.elevation_m.dtype == np.float64
    assert scene.material.dtype == np.uint8
    assert numbers_of(scene, "no_material") is None


SOUTH_FIRST = Affine(10.0, 0.0, WEST, 0.0, 10.0, SOUTH)
EAST_FIRST = Affine(-10.0, 0.0, WEST + 600.0, 0.0, -10.0, SOUTH + 500.0)


@pytest.mark.parametrize(("transform", "axis"), [(SOUTH_FIRST, 0), (EAST_FIRST, 1)])
def test_the_order_of_rows_and_columns_does_not_matter(build, transform, axis):
    values = np.random.default_rng(1).normal(50.0, 5.0, SHAPE)
    ids = np.random.default_rng(2).integers(1, 4, SHAPE, dtype=np.uint8)
    expected = raster_scene(build(values, ids, cell_m=7.0))
    assert numbers_of(expected, "resampled") == {"elevation": "interpolated", "materials": "of the nearest pixel"}
    values, ids = np.flip(values, axis), np.flip(ids, axis)
    scene = raster_scene(build(values, ids, transform=transform, ids_transform=transform, cell_m=7.0))
    np.testing.assert_allclose(scene.elevation_m, expected.elevation_m, atol=1e-9)
    # between two pixels, either is the nearest
    assert (scene.material == expected.material).mean() > 0.999
    assert scene.transform == expected.transform


SECOND = 1.0 / 3600.0
GEOGRAPHIC = Affine(SECOND, 0.0, 4.45, 0.0, -SECOND, 52.17)  # 31 m by 19 m


@pytest.mark.parametrize(("cell_m", "error_m"), [(None, 0.01), (19.0, 0.005), (95.0, 0.02)])
def test_a_plane_in_degrees_has_its_heights_in_utm(build, cell_m, error_m):
    shape = (60, 100)
    heights = plane(*grid(GEOGRAPHIC, shape, "EPSG:4326"))
    config = build(
        heights, np.ones(shape, dtype=np.uint8), crs="EPSG:4326", transform=GEOGRAPHIC, ids_crs="EPSG:4326",
        ids_transform=GEOGRAPHIC, vertical_datum="EGM2008", cell_m=cell_m,
    )  # fmt: skip
    scene = raster_scene(config)
    assert scene.crs == UTM
    if cell_m is None:
        # a pixel at this latitude: 30.9 m of meridian by 30.9 cos(latitude) m, and a cell of the same area
        assert scene.cell_m == pytest.approx(30.9 * np.sqrt(np.cos(np.radians(52.16))), rel=0.01)
        assert scene.cell_m == float(f"{scene.cell_m:.3g}")
    else:
        assert scene.cell_m == cell_m
    inside = scene.material > 0
    assert inside.mean() > 0.9
    # next to the rasters' border the kernel of 2 pixels is one-sided
    reach_px = int(np.ceil(2 * 31.0 / scene.cell_m)) + 1
    inside = binary_erosion(inside, iterations=reach_px)
    error = (scene.elevation_m - plane(*centres(scene)))[inside]
    assert np.abs(error).max() < error_m
    # slopes are what incidence angles are made of
    north, east = np.gradient(scene.elevation_m, scene.cell_m)
    np.testing.assert_allclose(np.median(east[inside]), 0.2, atol=1e-4)
    np.testing.assert_allclose(np.median(north[inside]), -0.1, atol=1e-4)


def test_coarse_cells_take_the_mean_height_and_the_most_frequent_material(build):
    rng = np.random.default_rng(3)
    heights, ids = rng.normal(50.0, 5.0, SHAPE), rng.integers(1, 4, SHAPE, dtype=np.uint8)
    scene = raster_scene(build(heights, ids, cell_m=50.0))
    blocks = heights[::-1].reshape(10, 5, 12, 5).swapaxes(1, 2).reshape(10, 12, 25)
    np.testing.assert_allclose(scene.elevation_m, blocks.mean(axis=-1), rtol=1e-9)
    counts = np.stack(
        [(ids[::-1] == k).reshape(10, 5, 12, 5).swapaxes(1, 2).reshape(10, 12, 25).sum(axis=-1) for k in (1, 2, 3)]
    )
    most = np.sort(counts, axis=0)
    clear = most[-1] > most[-2]
    np.testing.assert_array_equal(scene.material[clear], counts.argmax(axis=0)[clear] + 1)
    assert numbers_of(scene, "resampled") == {"elevation": "averaged", "materials": "of the majority of pixels"}


def test_codes_of_a_land_cover_map_become_materials_in_their_order(build):
    ids = np.full(SHAPE, 40, dtype=np.uint8)
    ids[:, 30:] = 10
    ids[:10] = 80
    ids[40:] = 0
    scene = raster_scene(build(ids=ids, names={"80": "lake"}, landcover="esa_worldcover"))
    assert scene.names == ("tree_cover", "cropland", "lake")
    north_first = scene.material[::-1]
    assert [int(north_first[k, n]) for k, n in ((5, 5), (20, 5), (20, 55), (45, 5))] == [3, 2, 1, 0]


def test_of_equally_frequent_materials_the_lowest_id_counts(build):
    ids = np.full(SHAPE, 3, dtype=np.uint8)
    ids[::2] = 2
    ids[:, :20] = 1
    assert (raster_scene(build(ids=ids, cell_m=20.0)).material == np.where(np.arange(30) < 10, 1, 2)).all()


def test_bounds_cut_the_scene(build):
    bounds = [WEST + 103.0, SOUTH + 50.0, WEST + 309.0, SOUTH + 250.0]
    scene = raster_scene(build(bounds=bounds))
    assert scene.transform == (10.0, 0.0, WEST + 110.0, 0.0, 10.0, SOUTH + 50.0)
    assert scene.material.shape == (20, 19)  # whole cells inside the bounds
    np.testing.assert_allclose(scene.elevation_m, plane(*centres(scene)), atol=1e-6)
    with pytest.raises(SceneError, match=r"scene\.bounds are \[.*expected inside \[600000\.0, .*UTM zone 31N"):
        raster_scene(build(bounds=[0.0, 0.0, 10.0, 10.0]))
    with pytest.raises(ValueError, match="expected west < east and south < north"):
        build(bounds=[10.0, 0.0, 0.0, 10.0])


def test_a_small_scene_is_cut_from_rasters_of_the_world(build):
    """The extent of a global raster in UTM is nonsense; that of what they share is not."""
    world = Affine(1.0, 0.0, -180.0, 0.0, -1.0, 90.0)
    ids = np.full((180, 360), 2, dtype=np.uint8)
    scene = raster_scene(build(ids=ids, ids_crs="EPSG:4326", ids_transform=world))
    assert scene.material.shape == SHAPE
    assert (scene.material == 2).all()
    fields = np.ones(SHAPE, dtype=np.uint8)
    scene = raster_scene(build(np.full((180, 360), 7.0), fields, crs="EPSG:4326+5773", transform=world, cell_m=20.0))
    np.testing.assert_allclose(scene.elevation_m, 7.0)
    assert scene.crs == UTM
    assert abs(scene.material.shape[0] - 25) <= 1
    assert abs(scene.material.shape[1] - 30) <= 1


def test_web_mercator_is_no_grid_in_metres(build):
    mercator = CRS.from_epsg(3857)
    x, y = Transformer.from_crs(UTM, mercator, always_xy=True).transform(WEST, SOUTH + 500.0)
    transform = Affine(16.0, 0.0, x, 0.0, -16.0, y)
    heights = plane(*grid(transform, SHAPE, "EPSG:3857"))
    config = build(heights, crs="EPSG:3857", transform=transform, vertical_datum="EGM96")
    scene = raster_scene(config)
    assert scene.crs == UTM
    # the map's metre is 1 / cos(latitude) of one
    assert scene.cell_m == pytest.approx(16.0 * np.cos(np.radians(52.16)), rel=0.01)
    with pytest.raises(SceneError, match=r"scene\.crs is 'EPSG:3857' \(.*\), whose metre is 1\.6\d* times one at lon"):
        raster_scene(config.model_copy(update={"crs": "EPSG:3857"}))
    assert raster_scene(config.model_copy(update={"crs": "EPSG:28992"})).crs == "EPSG:28992"


@pytest.mark.parametrize(
    ("crs", "words"),
    [
        ("EPSG:4326", "expected a projected CRS such as EPSG:32631"),
        ("nonsense", "expected a projected CRS such as EPSG:32631"),
        ("EPSG:2263", "whose unit is US survey foot, expected metres"),
        ("EPSG:2048", "whose coordinates grow to the west"),
        ("EPSG:32631+5773", "has a vertical axis: heights are not transformed"),
        ("EPSG:32621", "whose metre is"),
        ("EPSG:4087", r"whose metre is 1\.6\d+ times"),  # true along meridians, not along parallels
    ],
)
def test_crs_that_give_no_grid_in_metres(build, crs, words):
    with pytest.raises(SceneError, match=rf"^scene\.crs is '{crs.replace('+', '.')}'.*{words}"):
        raster_scene(build().model_copy(update={"crs": crs}))


GRID = "+proj=utm +zone=31 +ellps=bessel +nadgrids=/tmp/shift.gsb +type=crs"


@pytest.mark.parametrize("crs", [GRID, "+proj=utm +zone=31 +ellps=GRS80 +nadgrids=@null,/tmp/shift.gsb +type=crs"])
def test_crs_with_files_of_grids_are_refused(build, tmp_path, crs):
    """PROJ would read the files."""
    with pytest.raises(SceneError, match=r"^scene\.crs is '.*', expected a projected CRS .* without files of grids"):
        raster_scene(build().model_copy(update={"crs": crs}))
    config = build(vertical_datum="EGM96")
    srs = CRS.from_user_input(crs).to_wkt().replace('"', "&quot;")
    mosaic = tmp_path / "heights.vrt"
    with rasterio.open(config.elevation) as raster:
        mosaic.write_text(
            f'<VRTDataset rasterXSize="{raster.width}" rasterYSize="{raster.height}"><SRS>{srs}</SRS>'
            f"<GeoTransform>{', '.join(map(str, raster.transform.to_gdal()))}</GeoTransform>"
            '<VRTRasterBand dataType="Float64" band="1"><SimpleSource>'
            '<SourceFilename relativeToVRT="1">heights.tif</SourceFilename></SimpleSource></VRTRasterBand></VRTDataset>'
        )
    named = r"cannot be read as a raster \(.*its CRS '.*' names the grid '.*/tmp/shift\.gsb', expected a CRS without"
    with pytest.raises(SceneError, match=rf"^scene\.elevation: .*heights\.vrt {named}"):
        raster_scene(config.model_copy(update={"elevation": str(mosaic)}))


def test_a_projection_that_names_no_file_is_read():
    """Files of Web Mercator often have +nadgrids=@null."""
    mercator = "+proj=merc +a=6378137 +b=6378137 +nadgrids=@null +wktext +type=crs"
    assert crs_from(mercator) == CRS.from_user_input(mercator)


def test_a_crs_of_another_planet_is_refused(build):
    said = r"^scene: coordinates in Moon .* cannot be converted to WGS 84 .*, expected CRSs of the earth"
    with pytest.raises(SceneError, match=said):
        raster_scene(build(np.zeros(SHAPE), crs="IAU_2015:30100", vertical_datum="local"))


def test_gaps_are_filled_and_counted(build):
    heights = np.round(plane(*grid(HEIGHTS, SHAPE, UTM)), 3)
    gaps = np.zeros(SHAPE, dtype=bool)
    gaps[20:24, 30:35] = True
    heights[gaps] = -9999.0
    ids = np.ones(SHAPE, dtype=np.uint8)
    ids[:3, :4] = 0
    scene = raster_scene(build(heights, ids, profile={"nodata": -9999.0}))
    np.testing.assert_array_equal(scene.material == 0, (gaps | (ids == 0))[::-1])
    np.testing.assert_allclose(scene.elevation_m[~gaps[::-1]], heights[::-1][~gaps[::-1]], atol=1e-9)
    # inverse distances: about the height of a cell of the slope, 2.2 m along its fall
    np.testing.assert_allclose(scene.elevation_m, plane(*centres(scene)), atol=2.3)
    assert numbers_of(scene, "no_elevation") == {"cells": 20, "of": 3000}
    assert numbers_of(scene, "no_material") == {"cells": 32, "of": 3000}


def test_wide_gaps_take_the_nearest_height(build):
    heights = np.full((20, 400), np.nan)
    heights[:, :220] = 30.0
    config = build(heights, np.ones((20, 400), dtype=np.uint8))
    np.testing.assert_array_equal(raster_scene(config).elevation_m, 30.0)  # 180 cells: further than is interpolated


@pytest.mark.parametrize(
    ("crs", "key", "expected"),
    [
        (EGM96, "EGM96", "EGM96 height"),
        ("EPSG:32631+3855", "EPSG:3855", "EGM2008 height"),
        (UTM, "EPSG:5709", "NAP height"),
        (UTM, "WGS84 ellipsoid", "WGS84 ellipsoid"),
        (UTM, "EPSG:4979", "WGS 84 ellipsoid"),
        (UTM, "local", "local"),
    ],
)
def test_the_vertical_datum_is_read_or_given(build, crs, key, expected):
    scene = raster_scene(build(crs=crs, vertical_datum=key))
    assert scene.vertical_datum == expected
    origin = "from scene.vertical_datum" if crs == UTM else "from the CRS of the elevation"
    assert numbers_of(scene, "vertical_datum") == {"datum": expected, "origin": origin}
    assert scene.crs == UTM


def test_ellipsoidal_heights_are_read_from_a_three_dimensional_crs(build):
    heights = np.full((60, 100), 45.0)
    keys = {"crs": "EPSG:4979", "transform": GEOGRAPHIC}
    assert raster_scene(build(heights, **keys)).vertical_datum == "WGS 84 ellipsoid"
    with pytest.raises(SceneError, match="EGM96"):
        raster_scene(build(heights, **keys, vertical_datum="EGM96"))


def test_a_vertical_datum_is_asked_for_and_may_not_be_contradicted(build):
    with pytest.raises(SceneError, match=r"^scene\.vertical_datum is missing and .*heights\.tif, .*zone 31N\).*EGM96"):
        raster_scene(build(crs=UTM))
    with pytest.raises(SceneError, match=r"scene\.vertical_datum is 'EGM2008 height' .*heights\.tif\) says 'EGM96"):
        raster_scene(build(vertical_datum="EGM2008"))


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("EGM69", r"did you mean 'EGM96 height'\?"),
        ("sea", "expected a vertical datum of the EPSG database"),
        ("EPSG:32631", "says nothing about heights"),
        ("EPSG:1", "not a known CRS"),
    ],
)
def test_unknown_vertical_datums(text, words):
    with pytest.raises(SceneError, match=rf"^scene\.vertical_datum is '{text}'.*{words}"):
        named_datum(text)


def test_names_of_datums_that_are_the_same():
    assert same_datum("EGM96 height", "EGM96_Geoid")
    assert same_datum("WGS84 ellipsoid", "WGS 84 ellipsoidal height")
    assert same_datum("ellipsoid", "WGS 84 ellipsoid")
    assert not same_datum("GRS 1980 ellipsoid", "WGS 84 ellipsoid")
    assert not same_datum("ellipsoid", "EGM96 height")
    assert not same_datum("EGM96 height", "EGM2008 height")
    # libraries write "unknown" where a file names a unit of heights and nothing else
    unknown = (
        'COMPOUNDCRS["x",'
        + CRS(UTM).to_wkt()
        + (',VERTCRS["unknown",VDATUM["unknown"],CS[vertical,1],AXIS["up (H)",up,LENGTHUNIT["metre",1]]]]')
    )
    assert vertical_datum(CRS.from_wkt(unknown)) is None


@pytest.mark.parametrize(("accuracy", "code"), [(2.5, "transformation"), (-1.0, "transformation_unknown")])
def test_a_missing_grid_of_shifts_is_told(monkeypatch, accuracy, code):
    assert transformation_findings(CRS(4326), CRS(UTM), "it") == []
    # which grids are installed depends on the machine
    missing = SimpleNamespace(best_available=False, transformers=[SimpleNamespace(accuracy=accuracy)])
    monkeypatch.setattr("pyproj.transformer.TransformerGroup", lambda *_, **__: missing)
    (found,) = transformation_findings(CRS(27700), CRS(32630), "scene.materials")
    assert (found.code, found.about) == (code, "scene.materials")
    assert found.numbers["source"] == "OSGB36 / British National Grid"
    assert found.numbers["target"] == "WGS 84 / UTM zone 30N"
    assert found.numbers.get("accuracy_m", -1.0) == accuracy


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"crs": None}, "has no geographic or projected coordinate reference system"),
        ({"transform": Affine(9.0, 2.0, WEST, 2.0, -9.0, SOUTH + 500)}, "is rotated against its coordinate axes"),
        ({"transform": Affine.identity()}, "has a coordinate reference system and no transform"),
        ({"values": np.ones((2, *SHAPE), np.uint8)}, "has 2 bands, expected one"),
        ({"values": np.ones(SHAPE, np.complex64)}, "holds complex64"),
        ({"profile": {"nodata": 1}}, "holds no .* in the scene's area, only no-data"),
    ],
)
def test_bad_rasters_end_in_a_sentence(build, change, words):
    change = {"values": np.ones(SHAPE, np.uint8), "crs": EGM96} | change
    for key, prefix, first in (("elevation", "", "heights"), ("materials", "ids_", "ids")):
        keys = {f"{prefix}{name}": value for name, value in change.items() if name != "values"}
        with pytest.raises(SceneError, match=rf"^scene\.{key}: .*{first}\.tif {words}"):
            raster_scene(build(**{first: change["values"]}, **keys))


@pytest.mark.parametrize(
    ("ids", "words"),
    [
        (np.full(SHAPE, 300, dtype=np.uint16), "holds uint16 from 300 to 300, expected whole material ids"),
        (np.full(SHAPE, -1, dtype=np.int16), "holds int16 from -1 to -1"),
        (np.full(SHAPE, 1.0, dtype=np.float32), "holds float32 from 1 to 1"),
        (np.zeros(SHAPE, dtype=np.uint8), "has no material where the elevation is"),
    ],
)
def test_rasters_that_are_no_materials(build, ids, words):
    with pytest.raises(SceneError, match=rf"^scene\.materials: .*ids\.tif {words}"):
        raster_scene(build(ids=ids))


@pytest.mark.parametrize(
    ("where", "tags", "unit"),
    [
        ("file", {"Vertical Units": "Feet"}, "Feet"),
        ("band", {"zUnit": "U.S. survey foot"}, "U.S. survey foot"),
        ("description", "elevation (ft)", "ft"),
        ("unit", "ft", "ft"),
        ("file", {"horizontal_units": "feet", "TITLE": "6 feet above ground (draft)", "units": "feet"}, None),
        ("description", "feet (first) of the hills", None),
        ("unit", "m", None),
    ],
)
def test_heights_in_feet_are_refused(build, where, tags, unit):
    config = build(crs=UTM, vertical_datum="EGM96")
    with rasterio.open(config.elevation, "r+") as raster:
        if where == "unit":
            raster.units = (tags,)
        elif where == "description":
            raster.set_band_description(1, tags)
        else:
            raster.update_tags(*([1] if where == "band" else []), **tags)
    if unit is None:
        assert raster_scene(config).cell_m == 10.0
        return
    with pytest.raises(SceneError, match=rf"^scene\.elevation: .*heights\.tif has heights in {unit}, expected metres"):
        raster_scene(config)


def test_heights_in_the_feet_of_a_crs_are_refused(build):
    with pytest.raises(SceneError, match=r"heights\.tif has heights in US survey foot, expected metres"):
        raster_scene(build(crs="EPSG:32631+6360"))


def test_heights_that_no_place_has_are_refused(build):
    heights = np.full(SHAPE, 30.0)
    heights[3, 3] = -9999.0
    said = r"holds heights from -9999 to 30 m, expected -1000 to 9000.*gdal_edit -a_nodata"
    with pytest.raises(SceneError, match=said):
        raster_scene(build(heights))


def test_more_gaps_than_elevation_are_refused(build):
    heights = np.full(SHAPE, np.nan)
    heights[:, :20] = 30.0
    said = r"scene\.elevation: .* has no elevation in 2000 of 3000 cells, expected in at"
    with pytest.raises(SceneError, match=said):
        raster_scene(build(heights))
    ids = np.ones(SHAPE, dtype=np.uint8)
    ids[:, :31] = 9
    with pytest.raises(SceneError, match=r"scene\.materials: .* covers 1450 of 3000 cells, expected at least half"):
        raster_scene(build(ids=ids, ids_profile={"nodata": 9}))


def test_rasters_of_different_places(build):
    said = r"scene\.materials: .* \(longitude 4.*\) and scene\.elevation: .*do not overlap"
    for west, north in ((WEST + 610.0, SOUTH + 500.0), (WEST, SOUTH + 1010.0)):
        with pytest.raises(SceneError, match=said):
            raster_scene(build(ids_transform=Affine(10.0, 0.0, west, 0.0, -10.0, north)))
    with pytest.raises(SceneError, match="do not overlap"):
        raster_scene(build(ids_crs="EPSG:4326", ids_transform=Affine(0.1, 0, 100.0, 0, -0.1, -30.0)))


def test_too_few_and_too_many_cells(build):
    assert raster_scene(build(cell_m=62.0)).material.shape == (8, 9)
    with pytest.raises(SceneError, match=r"scene\.cell_m is 80, which makes 7 x 6 cells .*expected at least 8 x 8"):
        raster_scene(build(cell_m=80.0))
    said = r"scene\.cell_m is 0.01, which makes 60000 x 50000 cells, expected at most 1e"
    with pytest.raises(SceneError, match=said):
        raster_scene(build(cell_m=0.01))


def test_identity_follows_what_the_simulator_sees(build, tmp_path):
    heights = plane(*grid(HEIGHTS, SHAPE, UTM))
    identity = raster_scene(build()).identity
    moved = build()
    Path(moved.elevation).rename(tmp_path / "moved.tif")
    moved = moved.model_copy(update={"elevation": str(tmp_path / "moved.tif")})
    assert raster_scene(moved).identity == identity
    assert raster_scene(build(crs=UTM, vertical_datum="NAP")).identity == identity  # the same heights
    assert raster_scene(build(heights + 1e-3)).identity != identity
    assert raster_scene(build(ids=np.full(SHAPE, 2, dtype=np.uint8))).identity != identity
    assert raster_scene(build(cell_m=20.0)).identity != identity
    assert raster_scene(build(names=NAMES | {"1": "reed"})).identity != identity


def test_an_error_of_the_heights_is_one_of_the_slopes(build):
    noise = np.random.default_rng(1).normal(0.0, 0.8, SHAPE)
    scene = raster_scene(build(50.0 + noise, elevation_error_m=0.8))
    slopes = np.degrees(np.arctan(np.diff(scene.elevation_m, axis=1) / scene.cell_m))
    assert scene.slope_error_deg == pytest.approx(slopes.std(), rel=0.05)
    # cells between the heights have no slopes of their own, larger cells have the heights' means
    assert raster_scene(build(50.0 + noise, elevation_error_m=0.8, cell_m=5.0)).slope_error_deg == scene.slope_error_deg
    assert raster_scene(build(50.0 + noise, elevation_error_m=0.8, cell_m=20.0)).slope_error_deg < scene.slope_error_deg
    # nothing that is simulated depends on it
    assert raster_scene(build(50.0 + noise)).identity == scene.identity


def test_whole_metres_are_an_error_of_the_slopes(build):
    smooth = gaussian_filter(np.random.default_rng(2).standard_normal(SHAPE), 4.0)
    heights = 50.0 + 8.0 * smooth / smooth.std()
    plain = raster_scene(build(heights))
    assert plain.slope_error_deg == 0.0
    assert numbers_of(plain, "height_steps") is None
    whole = raster_scene(build(np.round(heights).astype(np.int16)))
    errors = np.diff(whole.elevation_m - plain.elevation_m, axis=1) / whole.cell_m
    assert whole.slope_error_deg == pytest.approx(np.degrees(np.arctan(errors.std())), rel=0.1)
    assert numbers_of(whole, "height_steps") == pytest.approx(
        {"step_m": 1.0, "rounding_m": 12**-0.5, "error_m": 12**-0.5, "slope_error_deg": 2.34}, rel=0.01
    )
    # rounding and the error of the heights are independent
    both = raster_scene(build(np.round(heights).astype(np.int16), elevation_error_m=0.8))
    slope = np.sqrt(2.0) * np.hypot(0.8, 12**-0.5) / 10.0
    assert np.tan(np.radians(both.slope_error_deg)) == pytest.approx(slope, rel=0.01)
    # steps of the file's numbers times its scale
    config = build(np.round(10 * heights).astype(np.int16), crs=UTM, vertical_datum="NAP")
    with rasterio.open(config.elevation, "r+") as raster:
        raster.scales, raster.offsets = (0.1,), (5.0,)
    tenths = raster_scene(config)
    assert tenths.slope_error_deg == pytest.approx(whole.slope_error_deg / 10, rel=0.01)


@pytest.mark.parametrize("heading", [12.0, 90.0, 192.0, 270.0, 348.3])
def test_the_grid_is_turned_to_the_track(build, heading):
    """Rows follow each other along the track, columns lie to its right, and the ground keeps its place."""
    ids = np.where(np.add(*np.indices(SHAPE)) < 50, 1, 2).astype(np.uint8)
    scene = raster_scene(build(ids=ids), heading)
    assert scene.heading_deg == heading
    x, y = centres(scene)
    east, north = Transformer.from_crs(CRS.from_user_input(scene.crs), UTM, always_xy=True).transform(x, y)
    np.testing.assert_allclose(scene.elevation_m, plane(east, north), atol=0.01)
    line = (SOUTH + 500.0 - north) / 10.0 + (east - WEST) / 10.0  # row + column of the raster, counted from its corner
    clear = np.abs(line - 51.0) > 2.0
    np.testing.assert_array_equal(scene.material[clear], np.where(line < 51.0, 1, 2)[clear])
    # the area is the largest that is inside of both rasters
    assert east.min() >= WEST
    assert east.max() <= WEST + 600.0
    assert north.min() >= SOUTH
    assert north.max() <= SOUTH + 500.0
    angle = np.radians(min(abs((heading - k * 90.0 + 180.0) % 360.0 - 180.0) for k in range(5)))
    assert scene.material.size * 100.0 > 0.9 * 600.0 * 500.0 * (1.0 - np.sin(angle)) ** 2
    longitude, latitude = Transformer.from_crs(UTM, "OGC:CRS84", always_xy=True).transform(east, north)
    middle = tuple(n // 2 for n in scene.material.shape)
    for step, bearing in (((5, 0), heading), ((0, 5), heading + 90.0)):
        there = tuple(np.add(middle, step))
        azimuth, _, distance = Geod(ellps="WGS84").inv(
            longitude[middle], latitude[middle], longitude[there], latitude[there]
        )
        assert (azimuth - bearing + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=0.01)
        assert distance == pytest.approx(50.0, rel=1e-4)
    with pytest.raises(SceneError, match=rf"radar.heading_deg is 13, the scene's grid is made for {heading:g}"):
        make_geometry(scene, Radar(heading_deg=13.0))
