"""Scenes from the features of vector files."""

from __future__ import annotations

import json
import os
import warnings
from typing import Any

import numpy as np
import pandas as pd
import pyogrio
import pytest
import shapely
import yaml
from pyproj import CRS, Transformer
from raster_files import write_raster
from rasterio.transform import from_origin

from radcal.config import case_from
from radcal.config.inputs import input_files
from radcal.errors import SceneError
from radcal.scene.base import scene_size
from radcal.scene.grid import Grid
from radcal.scene.sources import make_scene
from radcal.sections.scene import VectorScene
from radcal.vectors.features import NUMBERS, objects_of
from radcal.vectors.mapping import VectorMapping

UTM, WEST, SOUTH, CELL, SIZE = "EPSG:32631", 600_000.0, 5_780_000.0, 10.0, 60
MAPPING: dict[str, Any] = {
    "attribute": "class",
    "background": "grass",
    "surfaces": {
        "field": "crops",
        "water": "water",
        "highway=*": {"material": "asphalt", "width_m": 35.0},
        "highway=track": "gravel",
    },
    "features": {
        "building=*": {"kind": "house", "rcs_db_per_m2": 3.0, "height_m": 5.0},
        "natural=tree": {"kind": "tree", "rcs_db_per_m2": -6.0, "length_m": 4.0, "width_m": 3.0, "height_m": 8.0},
    },
}


def square(x, y, wide, high, heading=0.0):
    """Rectangle around a place of the scene [m], turned clockwise."""
    box = shapely.box(x - wide / 2, y - high / 2, x + wide / 2, y + high / 2)
    return shapely.affinity.rotate(box, -heading)


def write(path, shapes, columns, crs=UTM, layer="one"):
    """Write features at places of the scene [m], in a CRS."""
    to = Transformer.from_crs(UTM, crs, always_xy=True).transform
    at = shapely.transform(np.array(shapes), lambda x: np.column_stack(to(*(x + (WEST, SOUTH)).T)))
    driver = {".gpkg": "GPKG", ".shp": "ESRI Shapefile", ".geojson": "GeoJSON"}[path.suffix]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        pyogrio.raw.write(
            path, shapely.to_wkb(at), [np.array(one) for one in columns.values()], list(columns), driver=driver,
            geometry_type="Unknown" if path.suffix != ".shp" else shapes[0].geom_type, crs=crs,
            append=path.exists(), **({} if path.suffix == ".shp" else {"layer": layer}),
        )  # fmt: skip
    return path


@pytest.fixture
def build(tmp_path):
    ramp = (np.arange(SIZE)[::-1, None] * 2.0 + np.arange(SIZE)[None] * 0.5).astype(np.float32)
    write_raster(tmp_path / "dem.tif", ramp, crs=UTM, transform=from_origin(WEST, SOUTH + SIZE * CELL, CELL, CELL))

    def make(materials, mapping=MAPPING, **keys):
        (tmp_path / "names.yaml").write_text(yaml.safe_dump(mapping, sort_keys=False))
        files = {"elevation": tmp_path / "dem.tif", "materials": materials, "names": tmp_path / "names.yaml"}
        files = {key: str(path) for key, path in files.items()}
        return VectorScene.model_validate({"source": "vectors", "vertical_datum": "local"} | files | keys)

    return make


def at(scene):
    """Place of each cell's centre [m from the corner of the heights], and the name of its material."""
    a, _, c, _, e, f = scene.transform
    row, column = np.indices(scene.material.shape) + 0.5
    x, y = Transformer.from_crs(scene.crs, UTM, always_xy=True).transform(c + a * column, f + e * row)
    return x - WEST, y - SOUTH, np.array(["", *scene.names])[scene.material]


def found(scene, code):
    return [one for one in scene.findings if one.code == code]


@pytest.mark.parametrize(("ending", "crs"), [("gpkg", UTM), ("shp", "EPSG:28992"), ("geojson", "EPSG:4326")])
@pytest.mark.parametrize("heading", [0.0, 33.0])
def test_areas_are_materials_of_the_cells_whose_centres_they_cover(tmp_path, build, ending, crs, heading):
    shapes = [square(200, 300, 240, 404), square(300, 150, 130, 170, 20), square(350, 350, 40, 40)]
    path = write(tmp_path / f"cover.{ending}", shapes, {"class": ["field", "water", "unknown"]}, crs)
    mapping = MAPPING | {"features": {}, "surfaces": {"field": "crops", "water": "water"}}
    scene = make_scene(build(path, mapping), ["grass", "crops", "water"], heading)
    x, y, name = at(scene)
    water, crops = (shapely.contains_xy(shape, x, y) for shape in (shapes[1], shapes[0]))
    # the CRS of the Netherlands differs by a metre where no grid of the datum shift is installed
    wrong = name != np.where(water, "water", np.where(crops, "crops", "grass"))
    assert wrong.mean() < (0.01 if ending == "shp" else 1e-9)
    assert found(scene, "features_burnt")[0].numbers == {"features": 2}
    assert found(scene, "features_unmapped")[0].numbers == {"features": 1, "codes": "unknown (1)"}


def test_the_order_of_the_mapping_is_the_priority(tmp_path, build):
    shapes = [square(300, 300, 200, 200), square(300, 300, 400, 400)]
    path = write(tmp_path / "cover.gpkg", shapes, {"class": ["field", "water"]})
    surfaces = {"field": "crops", "water": "water"}
    for order, middle in ((surfaces, "water"), (dict(reversed(surfaces.items())), "crops")):
        _, _, name = at(make_scene(build(path, {"attribute": "class", "surfaces": order}), None))
        assert name[30, 30] == middle
        assert name[12, 12] == "water"
        assert name[5, 5] == ""


def test_lines_have_their_own_width_or_that_of_their_class(tmp_path, build):
    lines = [shapely.LineString([(x, 50.0), (x, 550.0)]) for x in (103.0, 253.0, 403.0)]
    columns = {"highway": ["primary", "service", "track"], "width": ["55 m", "", "2.5"]}
    path = write(tmp_path / "roads.geojson", lines, columns)
    mapping = MAPPING | {"surfaces": {key: MAPPING["surfaces"][key] for key in ("highway=*", "highway=track")}}
    scene = make_scene(build(path, mapping | {"features": {}}), None)
    x, y, name = at(scene)
    along = (y > 60) & (y < 540)
    expected = np.where((np.abs(x - 103) < 27.5) | (np.abs(x - 253) < 17.5), "asphalt", "grass")
    expected = np.where((x > 400) & (x < 410), "gravel", expected)  # one cell
    assert (name == expected)[along].all()
    assert found(scene, "features_narrow")[0].numbers == {"features": 1, "codes": "highway=track (1)"}


def test_points_and_footprints_are_boxes(tmp_path, build):
    shapes = [
        square(100, 400, 12, 30, 25), square(300, 300, 20, 10), square(400, 100, 30, 40), square(300, 500, 210, 9),
        shapely.Point(500, 500), shapely.Point(50, 50), shapely.Point(-5, 50),
    ]  # fmt: skip
    columns = {
        "building": ["yes", "house", "no", "yes", "", "", ""],
        "natural": ["", "", "", "", "tree", "tree", "tree"],
        "height": ["12.5 m", "", "3", "", "", "6", ""],
        "building:levels": ["9", "4", "", "", "", "", ""],
        "direction": ["", "", "", "", "40", "N", ""],
    }
    path = write(tmp_path / "osm.gpkg", shapes, columns, "EPSG:4326")
    scene = make_scene(build(path, MAPPING | {"surfaces": {"building=*": "roof"}}), None)
    objects = scene.objects
    assert np.abs(objects.x_m - [100, 300, 500, 50]).max() < 0.01
    assert np.abs(objects.y_m - [400, 300, 500, 50]).max() < 0.01
    assert objects.length_m == pytest.approx([30, 20, 4, 4], abs=0.01)
    assert objects.width_m == pytest.approx([12, 10, 3, 3], abs=0.01)
    assert objects.height_m == pytest.approx([12.5, 12, 8, 6])
    assert objects.heading_deg[:2] % 180 == pytest.approx([25, 90], abs=0.01)
    # true north lies 1.16 degrees from the grid's north at this place: sin(52.17 deg) times 1.47 deg from the meridian
    east = Transformer.from_crs(UTM, "EPSG:4326", always_xy=True).transform(WEST + 500, SOUTH + 500)[0] - 3.0
    assert objects.heading_deg[2] == pytest.approx(40 - np.sin(np.radians(52.17)) * east, abs=0.01)
    assert objects.rcs_dbsm == pytest.approx(np.array([3, 3, -6, -6]) + 10 * np.log10([360, 200, 12, 12]), abs=0.01)
    assert found(scene, "features_large")[0].numbers == {"features": 1, "codes": "building=* (1)"}
    assert found(scene, "features_unmapped")[0].numbers == {"features": 1, "codes": "building=no (1)"}
    assert scene.material[30, 30] == 1 + scene.names.index("roof")


def test_heights_above_the_datum_need_a_height():
    """Of boxes on ground at 700 m: above the ground, above the datum, and above the datum without a height."""
    grid = Grid(CRS.from_user_input(UTM), WEST, SOUTH, CELL, SIZE, SIZE)
    numbers = {**dict.fromkeys(NUMBERS, 5.0), "base_m": [2.0, 704.0, np.nan], "absolute": [0.0, 1.0, 1.0]}
    shapes = shapely.points(WEST + np.array([100.0, 200.0, 300.0]), SOUTH + 100.0)
    features = pd.DataFrame({"shape": shapes, "class": "", "highway": "", "building": "yes", "natural": "", **numbers})
    mapping = VectorMapping.model_validate(MAPPING)
    found = objects_of(features, grid, np.full((SIZE, SIZE), 700.0), mapping, None, [])
    assert found.height_m.tolist() == [7.0, 9.0, 5.0]


def test_classes_have_roofs_or_tables_of_cross_sections(tmp_path, build):
    """Of a building the roof and the walls, of a tree the class of an external code."""
    rows = [f"pine,X,HH,{a},{e},{a / 36 + e / 2}" for a in (0, 360) for e in (20, 60)]
    (tmp_path / "rcs.csv").write_text("\n".join(["class,band,polarisation,aspect_deg,elevation_deg,rcs_dbsm", *rows]))
    features = {
        "building=*": {"roof": "tiles", "wall_sigma0_db": -7.0, "height_m": 5.0},
        "natural=tree": {"cross_section": "pine", "length_m": 4.0, "width_m": 3.0, "height_m": 8.0, "bounce": True},
    }
    shapes = [square(100, 400, 12, 30), shapely.Point(500, 500), square(300, 300, 20, 10)]
    path = write(tmp_path / "osm.gpkg", shapes, {"building": ["yes", "", "yes"], "natural": ["", "tree", ""]})
    mapping = MAPPING | {"surfaces": {}, "features": features, "permittivity": {"wall": 5.0, "ground": 12.0}}
    scene = make_scene(build(path, mapping, cross_sections=str(tmp_path / "rcs.csv")), ["grass", "tiles"])
    objects = scene.objects
    assert objects.walls.roofs == ("tiles",)
    assert objects.walls.roof.tolist() == [0, -1, 0]
    assert objects.walls.bounce.tolist() == [True, True, True]
    assert objects.walls.permittivity == (5.0, 12.0)
    np.testing.assert_array_equal(objects.walls.sigma0_db, [-7.0, np.nan, -7.0])
    bearing = objects.heading_deg[1] + 180.0
    found = objects.cross_section_m2(np.full(3, bearing), np.full(3, 30.0), "X", "HH")
    assert 10.0 * np.log10(found[1]) == pytest.approx(20.0)
    with pytest.raises(SceneError, match=r"scene\.cross_sections has no class 'pine', found \[\]"):
        make_scene(build(path, mapping), None)
    for wrong in ({"rcs_db_per_m2": 3.0, "roof": "tiles", "wall_sigma0_db": -7.0}, {"roof": "tiles"}, {}):
        with pytest.raises(SceneError, match="one of rcs_db_per_m2, cross_section, and roof with wall_sigma0_db"):
            make_scene(build(path, mapping | {"features": {"building=*": wrong}}), None)


def test_the_grid_of_objects_may_be_turned(tmp_path, build):
    path = write(tmp_path / "osm.gpkg", [square(310, 290, 12, 30, 25)], {"building": ["yes"], "natural": [""]})
    scene = make_scene(build(path, MAPPING | {"surfaces": {}}), None, 50.0)
    x, y = scene.objects.x_m + scene.transform[2], scene.objects.y_m + scene.transform[5]
    place = Transformer.from_crs(scene.crs, UTM, always_xy=True).transform(x, y)
    assert np.abs(np.ravel(place) - (WEST + 310, SOUTH + 290)).max() < 0.01
    # the scene's axis points along the track, whose heading is from true north
    assert scene.objects.heading_deg[0] % 180 == pytest.approx((25 - 50 + 1.16) % 180, abs=0.05)


def test_several_layers_are_read(tmp_path, build):
    path = write(tmp_path / "osm.gpkg", [square(200, 300, 240, 410)], {"class": ["water"]}, UTM, "areas")
    write(path, [shapely.LineString([(0, 300), (600, 300)])], {"highway": ["track"]}, "EPSG:4326", "roads")
    mapping = MAPPING | {"layers": ["areas", "roads"], "features": {}}
    scene = make_scene(build(path, mapping), None)
    assert {*np.unique(at(scene)[2])} == {"grass", "water", "gravel"}
    with pytest.raises(SceneError, match=r"has the layers areas, roads: name one as layers in scene.names"):
        make_scene(build(path, MAPPING), None)


def test_the_size_and_the_files_of_a_case(tmp_path, build):
    config = build(write(tmp_path / "cover.shp", [square(200, 300, 240, 410)], {"class": ["water"]}))
    assert scene_size(config).cells == SIZE**2
    case = case_from({"scene": config.model_dump(), "materials": {"water": {"calibrate": True}}})
    assert {path.suffix for path in input_files(case).values()} >= {".tif", ".shp", ".shx", ".dbf", ".prj", ".yaml"}


@pytest.mark.parametrize(
    ("mapping", "text"),
    [
        ({"surfaces": {"clas=field": "crops"}}, r"scene.names names the attribute 'clas', .* has class"),
        ({"surfaces": {"field": "crops"}, "attribute": ""}, r"keys without an attribute"),
        ({"surfaces": {}, "background": ""}, r"names 0 materials, expected 1 to 254"),
        ({"surfaces": {"field": {"width_m": 3}}}, r"surfaces.field.material"),
        ({"features": {"field": {"rcs": 3}}}, r"features.field"),
        ({"layers": ["two"]}, r"has the layers one, layers in scene.names is 'two'"),
        ({"surfaces": {"water": "water"}, "background": ""}, r"scene.materials: .*cover.gpkg has no material where"),
    ],
)
def test_wrong_mappings_are_told(tmp_path, build, mapping, text):
    path = write(tmp_path / "cover.gpkg", [square(200, 300, 240, 410)], {"class": ["field"]})
    plain = {"attribute": "class", "surfaces": {"field": "crops"}}
    with pytest.raises(SceneError, match=text):
        make_scene(build(path, plain | mapping), None)


def test_features_without_a_place_are_left_out(tmp_path, build):
    ring = [[4.45, 52.15], [4.47, 52.15], [4.47, 52.17], [4.45, 52.15]]
    shapes = [{"type": "Polygon", "coordinates": [one]} for one in (ring, [ring[0], ring[0]], [[1e300, 0], *ring])]
    features = [{"type": "Feature", "geometry": one, "properties": {"class": "field"}} for one in (*shapes, None)]
    path = tmp_path / "cover.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    mapping = MAPPING | {"surfaces": {"field": "crops"}, "features": {}}
    scene = make_scene(build(path, mapping), None)
    assert (at(scene)[2] == "crops").any()
    assert found(scene, "features_without_place")[0].numbers["features"] >= 2


def test_features_without_an_extent_and_whole_numbers(tmp_path, build):
    flat = shapely.Polygon([(100, 100), (120, 120), (140, 140)])
    shapes = [shapely.LineString([(200, 200), (200, 200)]), flat, square(400, 400, 50, 50), shapely.Point(300, 300)]
    path = write(
        tmp_path / "cover.gpkg", shapes, {"code": [3.0, 3.0, 12.0, np.nan], "building": ["", "yes", "", "yes"]}
    )
    features = {"building=*": MAPPING["features"]["building=*"]}
    surfaces = {"code=3": {"material": "road", "width_m": 30.0}, "code=12": "water"}
    scene = make_scene(build(path, {"background": "grass", "surfaces": surfaces, "features": features}), None)
    assert {*np.unique(at(scene)[2])} == {"grass", "water"}
    assert scene.objects is None
    assert found(scene, "features_without_size")[0].numbers == {"features": 2, "codes": "building=* (2)"}


def test_a_layer_needs_a_crs(tmp_path, build):
    path = write(tmp_path / "cover.shp", [square(200, 300, 240, 410)], {"class": ["water"]})
    path.with_suffix(".prj").unlink()
    with pytest.raises(SceneError, match=r"scene.materials: .*cover.shp layer 'cover' has the CRS None, expected"):
        make_scene(build(path, {"attribute": "class", "surfaces": {"water": "water"}}), None)


def test_a_vector_file_needs_its_source(build, tmp_path):
    os.link(tmp_path / "dem.tif", tmp_path / "cover.tif")
    with pytest.raises(ValueError, match=r"materials is .*cover.tif, expected a file ending with .gpkg, .shp"):
        build(tmp_path / "cover.tif")
    raster = {"source": "raster", "elevation": "dem.tif", "materials": "a.gpkg", "names": "a.json"}
    with pytest.raises(Exception, match=r"a.gpkg, a vector file, which needs scene.source: vectors"):
        case_from({"scene": raster})
