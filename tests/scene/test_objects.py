"""Objects: aspect, tables and their refusals, the generator, and the way through a scene's file."""

import sqlite3
from dataclasses import replace

import h5py
import numpy as np
import pandas as pd
import pyogrio
import pytest
import shapely

from radcal.config import case_from
from radcal.config.inputs import input_files
from radcal.errors import ConfigError, SceneError
from radcal.reading import vectors
from radcal.scene.object_generator import BUILDING, CAR, TREE, generate_objects
from radcal.scene.object_tables import Place, read_objects
from radcal.scene.sources import make_scene
from radcal.sections.scene import check_curve
from radcal.storage.dataclass_groups import same

UTM = "EPSG:32631"
LOCAL = Place((200.0, 100.0))
MAP = Place((200.0, 100.0), (600_000.0, 5_780_000.0), UTM)
ROWS = {
    "x_m": [10.0, 60.5, 199.0],
    "y_m": [20.0, 30.25, 99.0],
    "length_m": [0.0, 12.0, 4.5],
    "width_m": [0.0, 8.0, 1.8],
    "heading_deg": [0.0, 30.0, 350.0],
    "height_m": [3.0, 9.5, 1.5],
    "rcs_dbsm": [10.0, 25.5, 15.0],
    "kind": ["reflector", "building", "car"],
}
CURVE = [[0.0, 20.0], [90.0, 30.0], [180.0, 10.0], [270.0, 30.0]]
WALLS = {"rcs_dbsm": [10.0, np.nan, 15.0], "roof": ["", "tiles", ""], "wall_sigma0_db": [np.nan, -4.0, np.nan]}


def csv(path, **columns):
    table = {name: values for name, values in (ROWS | columns).items() if values is not None}
    pd.DataFrame(table).to_csv(path / "objects.csv", index=False)
    return path / "objects.csv"


def hdf5(path, curves=None, crs=None, **columns):
    with h5py.File(path / "objects.h5", "w") as file:
        group = file.create_group("objects")
        for name, values in (ROWS | columns).items():
            if values is not None:
                group[name] = values
        if crs is not None:
            group.attrs["crs"] = crs
        for name, curve in (curves or {}).items():
            file[f"aspect/{name}"] = curve
    return path / "objects.h5"


def layers(path, shapes, columns, crs=UTM, count=1, ending="gpkg"):
    """Write the same layer some times into one file."""
    file = path / f"objects.{ending}"
    file.unlink(missing_ok=True)
    driver = {"gpkg": "GPKG", "shp": "ESRI Shapefile", "geojson": "GeoJSON"}[ending]
    fields = [np.array(values, dtype=None if isinstance(values[0], str) else float) for values in columns.values()]
    for k in range(count):
        name = file.stem if ending == "shp" else f"layer {k}"
        pyogrio.raw.write(
            file, shapely.to_wkb(np.array(shapes)), fields, list(columns), layer=name, driver=driver,
            geometry_type="Unknown" if ending == "gpkg" else shapes[0].geom_type, crs=crs, append=k > 0,
        )  # fmt: skip
    return file


@pytest.mark.parametrize(
    ("curve", "says"),
    [
        ([[0.0, 1.0]], "at least two pairs"),
        ([1.0, 2.0], "at least two pairs"),
        ([[0.0, 1.0], [np.nan, 2.0]], "not finite"),
        ([[0.0, 1.0], [400.0, 2.0]], "aspect of 400 degrees, expected -180 to 360"),
        ([[0.0, 1.0], [90.0, 3.0], [360.0, 2.0]], "aspect 360 degrees twice"),
        ([[0.0, 1.0], [90.0, 5000.0]], "cross-section of 5000, expected -100 to 70 dBsm"),
    ],
)
def test_wrong_curves(curve, says):
    assert says in str(check_curve(curve))
    assert check_curve(CURVE) is None


# --- tables


def test_tables_that_lead_elsewhere_or_tell_of_too_much(tmp_path):
    path = hdf5(tmp_path, x_m=[1.0], y_m=[2.0], rcs_dbsm=[3.0])
    path.rename(tmp_path / "other.h5")
    with h5py.File(path, "w") as file:
        file["objects"] = h5py.ExternalLink("other.h5", "/objects")
    with pytest.raises(SceneError, match=r"objects\.h5\) is not read: 'objects' is a link to another file"):
        read_objects(path, MAP)
    with h5py.File(path, "w") as file:
        file.create_dataset("objects/x_m", (4_000_000_000,), "f8", chunks=(1000,))
    with pytest.raises(SceneError, match="x_m has 4000000000 entries, expected at most 30000000"):
        read_objects(path, MAP)
    with h5py.File(path, "w") as file:
        file["objects/x_m"] = np.zeros(3, dtype=[("a", "f4")])
    with pytest.raises(SceneError, match="objects/x_m is not a list of one number or text"):
        read_objects(path, MAP)


@pytest.mark.parametrize("write", [csv, hdf5])
def test_a_table_is_read_as_it_is(write, tmp_path):
    found = read_objects(write(tmp_path), LOCAL)
    assert len(found) == 3
    for name in ("x_m", "y_m", "length_m", "width_m", "heading_deg", "height_m", "rcs_dbsm"):
        assert getattr(found, name).tolist() == ROWS[name]
    assert found.extended.tolist() == [False, True, True]
    np.testing.assert_allclose(found.cross_section_m2(270.0), [10.0, 10**2.55, 10**1.5])
    smallest = read_objects(write(tmp_path, length_m=None, width_m=None, heading_deg=None, kind=None), LOCAL)
    assert not smallest.extended.any()
    classes = {"aspect": ["", "b", "a"], "rcs_dbsm": [1.0, np.nan, np.nan]}
    made = read_objects(write(tmp_path, **classes), LOCAL, curves={"b": CURVE, "a": CURVE[:3]})
    assert (made.aspect.tolist(), [*made.curves]) == ([-1, 0, 1], ["b", "a"])


def test_coordinates_of_the_map_become_those_of_the_scene(tmp_path):
    east, north = np.array(ROWS["x_m"]) + 600_000.0, np.array(ROWS["y_m"]) + 5_780_000.0
    on_map = read_objects(hdf5(tmp_path, x_m=east, y_m=north, crs=UTM), MAP)
    assert same(on_map, read_objects(csv(tmp_path), LOCAL))


def test_polygons_of_a_layer_are_rectangles(tmp_path):
    def box(x, y, length, width, heading):
        b = np.radians(heading)
        along, across = np.array([np.sin(b), np.cos(b)]), np.array([np.cos(b), -np.sin(b)])
        corners = [(i * length / 2 * along + j * width / 2 * across) for i, j in ((1, 1), (1, -1), (-1, -1), (-1, 1))]
        return shapely.Polygon(np.array(corners) + [600_000.0 + x, 5_780_000.0 + y])

    shapes = [
        shapely.Point(600_010.0, 5_780_020.0),
        box(60.0, 40.0, 12.0, 8.0, 30.0),
        shapely.MultiPolygon([box(100.0, 50.0, 20.0, 4.0, 200.0)]),
        shapely.Point(600_030.0, 5_780_020.0),
    ]
    columns = {
        "height_m": [2, 9, 5, 3], "rcs_dbsm": [10.0, 20.0, 30.0, 5.0], "heading_deg": [90.0, 10.0, 190.0, 45.0],
        "length_m": [0.0, np.nan, np.nan, 6.0], "width_m": [0.0, np.nan, np.nan, 2.0],
    }  # fmt: skip
    found = read_objects(layers(tmp_path, shapes, columns), MAP)
    np.testing.assert_allclose(found.x_m, [10.0, 60.0, 100.0, 30.0], atol=1e-3)  # of GEOS at such coordinates
    np.testing.assert_allclose(found.y_m, [20.0, 40.0, 50.0, 20.0], atol=1e-3)
    np.testing.assert_allclose(found.length_m, [0.0, 12.0, 20.0, 6.0], atol=1e-3)
    np.testing.assert_allclose(found.width_m, [0.0, 8.0, 4.0, 2.0], atol=1e-3)
    # of the rectangle's two ends the one that the column's heading is nearer to
    np.testing.assert_allclose(found.heading_deg, [90.0, 30.0, 200.0, 45.0], atol=0.01)


def refused(path, place=LOCAL, **keys):
    with pytest.raises(SceneError) as caught:
        read_objects(path, place, **keys)
    text = str(caught.value)
    assert str(path) in text
    assert text.endswith(".")
    assert "\n" not in text
    return text


@pytest.mark.parametrize(
    ("columns", "says"),
    [
        ({"height_m": None}, "has no column 'height_m', found "),
        ({"speed_mps": [0.0, -3.0, 0.0]}, "row 2: speed_mps is -3, expected 0 to 200 m/s"),
        ({"height_m": [1.0, np.nan, 2.0]}, "row 2: height_m is empty, expected a finite number"),
        ({"height_m": ["1", "high", "2"]}, "row 2: height_m is 'high', expected a finite number"),
        ({"rcs_dbsm": [10.0, 20.0, 25_000.0]}, "row 3: rcs_dbsm is 25000, expected -100 to 70 dBsm (10 log10 of"),
        ({"width_m": [0.0, 0.0, 1.0]}, "row 2: width_m is 0, expected length_m and width_m both positive"),
        ({"length_m": [0.0, 5.0, 0.0]}, "row 3: length_m is 0, expected length_m and width_m both positive"),
        ({"x_m": [10.0, 60.0, 201.0]}, "row 3: x_m is 201, expected 0 to 200, the scene's extent"),
        ({"y_m": [-0.5, 60.0, 20.0]}, "row 1: y_m is -0.5, expected 0 to 100, the scene's extent"),
        ({"aspect": ["", "", "lorry"], "rcs_dbsm": [1.0, 2.0, np.nan]}, "row 3: aspect is 'lorry', expected a class"),
        ({"aspect": ["", "", "car"]}, "row 3: rcs_dbsm is 15, expected it empty where the row has an aspect class"),
        ({"aspect": ["", "", "car"], "rcs_dbsm": [1.0, np.nan, np.nan]}, "row 2: rcs_dbsm is empty"),
        ({"length_m": None, "lenght_m": [0.0, 1.0, 2.0]}, "unknown column 'lenght_m' (did you mean 'length_m'?)"),
        (WALLS | {"wall_sigma0_db": [np.nan] * 3}, "row 2: wall_sigma0_db is empty, expected the sigma0 of the walls"),
        (WALLS | {"roof": [""] * 3, "rcs_dbsm": [1.0] * 3},
         "row 2: wall_sigma0_db is given, expected a roof beside it"),
        (WALLS | {"roof": [""] * 3, "wall_sigma0_db": [np.nan] * 3}, "row 2: rcs_dbsm is empty"),
        (WALLS | {"rcs_dbsm": [1.0] * 3}, "row 2: rcs_dbsm is given, expected it empty where the row has a roof"),
        (WALLS | {"aspect": ["", "car", ""]}, "row 2: has a roof and an aspect class, expected one of them"),
        (WALLS | {"bounce": [0.0, 0.5, 0.0]}, "row 2: bounce is not 0 or 1"),
        (WALLS | {"bounce": [1.0, 0.0, 0.0]},
         "row 1: has a roof or a bounce, expected length_m and width_m beside them"),
        (WALLS | {"wall_sigma0_db": [np.nan, 60.0, np.nan]}, "row 2: wall_sigma0_db is 60, expected -60 to 30 dB"),
    ],
)  # fmt: skip
def test_wrong_rows(columns, says, tmp_path):
    text = refused(csv(tmp_path, **columns), curves={"car": CURVE})
    assert says in text
    assert text.startswith("scene.objects.path")


@pytest.mark.parametrize("write", [csv, hdf5])
def test_rows_with_a_roof_have_walls(write, tmp_path):
    made = read_objects(write(tmp_path, **WALLS), LOCAL)
    assert made.walls.roofs == ("tiles",)
    np.testing.assert_array_equal(made.walls.roof, [-1, 0, -1])
    np.testing.assert_array_equal(made.walls.sigma0_db, [np.nan, -4.0, np.nan])
    np.testing.assert_array_equal(made.walls.bounce, [False, True, False])
    # a row says whether a bounce is added
    made = read_objects(write(tmp_path, **WALLS, bounce=[np.nan, 0.0, 1.0]), LOCAL, permittivity=(5.0, 12.0))
    np.testing.assert_array_equal(made.walls.bounce, [False, False, True])
    assert made.walls.permittivity == (5.0, 12.0)
    alone = read_objects(write(tmp_path, bounce=[0.0, np.nan, 1.0]), LOCAL)
    assert alone.walls.roofs == ()
    np.testing.assert_array_equal(alone.walls.roof, -1)
    assert read_objects(write(tmp_path, bounce=[0.0, np.nan, 0.0]), LOCAL).walls is None


def test_wrong_files(tmp_path):
    for name, content, says in [
        ("a.csv", "", "cannot be read as CSV"),
        ("b.csv", "x_m,y_m,height_m,rcs_dbsm\n", "has no rows"),
        ("c.csv", "x_m,y_m,height_m,rcs_dbsm, x_m\n1,2,3,4,5\n", "has the column 'x_m' twice, expected once"),
        ("j.csv", "x_m,y_m,height_m,rcs_dbsm\n1,2,3,4,5\n1,2,3,4\n", "row 1 has more fields than the 4 columns of the"),
        ("d.h5", "no HDF5", "cannot be read as HDF5"),
        ("e.gpkg", "<OGRVRTDataSource></OGRVRTDataSource>", "does not begin as one of GPKG"),
        ("f.gpkg", "SQLite format 3\0 and nothing more", "cannot be read as a vector file"),
        ("h.geojson", '{"type": "gdal_streamed_alg", "command_line": "gdal vector pipeline"}', "vector file"),
        ("i.txt", "x", "expected a file ending with .csv, .gpkg, .shp, .geojson, .h5 or .hdf5"),
    ]:
        (tmp_path / name).write_text(content)
        assert says in refused(tmp_path / name)
    with h5py.File(tmp_path / "g.h5", "w") as file:
        file["x_m"] = [1.0]
    assert "has no group 'objects'" in refused(tmp_path / "g.h5")
    assert "x_m has 2 entries" in refused(hdf5(tmp_path, x_m=[1.0, 2.0]))
    wrong = hdf5(tmp_path, curves={"car": [[0.0, 1e6], [90.0, 1.0]]})
    assert "aspect/car has a cross-section of 1e+06" in refused(wrong)
    with pytest.raises(SceneError, match=r"scene\.objects\.aspect\.car: .* has a class of that name, too"):
        read_objects(hdf5(tmp_path, curves={"car": CURVE}), LOCAL, curves={"car": CURVE})


@pytest.mark.parametrize("ending", ["shp", "geojson"])
def test_layers_of_other_formats(tmp_path, ending):
    columns = {"height_m": [2.0, 9.5], "rcs_dbsm": [10.0, 25.5], "heading_deg": [30.0, 0.0], "kind": ["mast", "car"]}
    shapes = [shapely.Point(600_010.0, 5_780_020.0), shapely.Point(600_030.5, 5_780_021.0)]
    file = layers(tmp_path, shapes, columns, ending=ending)
    assert same(read_objects(file, MAP), read_objects(layers(tmp_path, shapes, columns), MAP))
    files = input_files(case_from({"scene": {"source": "builtin", "objects": {"path": str(file)}}}))
    others = ["shp", "shx", "dbf", "prj", "cpg"] if ending == "shp" else [ending]
    assert [path.name for path in files.values()] == [f"objects.{other}" for other in others]


@pytest.mark.parametrize(
    ("name", "columns"),
    [("layer 0", "moved.*"), ("gpkg_contents", "moved.*"), ("layer 0", "*, zeroblob(900000000) AS b")],
)
def test_a_geopackage_that_computes_without_end(tmp_path, monkeypatch, name, columns):
    """A few bytes of SQL may take any time and memory."""
    monkeypatch.setattr(vectors, "_LONGEST_S", 1)
    file = layers(tmp_path, [shapely.Point(600_010.0, 5_780_020.0)] * 2, {"height_m": [2.0] * 2})
    with sqlite3.connect(file) as db:
        for (trigger,) in db.execute("SELECT name FROM sqlite_master WHERE type = 'trigger'").fetchall():
            db.execute(f"DROP TRIGGER '{trigger}'")
        db.execute(f"ALTER TABLE '{name}' RENAME TO moved")
        endless = "WITH RECURSIVE c(x) AS (SELECT 1 UNION ALL SELECT x + 1 FROM c)"
        db.execute(f"CREATE VIEW '{name}' AS {endless} SELECT {columns} FROM moved, c")
    db.close()
    assert "cannot be read as a vector file" in refused(file, MAP)


def test_wrong_crs_and_layers(tmp_path):
    attributes = {"height_m": [2.0], "rcs_dbsm": [10.0]}
    here = [shapely.Point(600_010.0, 5_780_020.0)]

    def written(**keys):
        return layers(tmp_path, keys.pop("shapes", here), attributes, **keys)

    says = refused(written(crs="EPSG:32632"), MAP)
    assert "is in EPSG:32632 (WGS 84 / UTM zone 32N), the scene in EPSG:32631" in says
    assert "the scene has no CRS" in refused(written(), LOCAL)
    assert "layer 'layer 0' has no CRS, expected EPSG:32631" in refused(written(crs=None), MAP)
    assert "is in EPSG:4326" in refused(hdf5(tmp_path, crs="EPSG:4326"), MAP)
    assert "not a known CRS" in refused(hdf5(tmp_path, crs="nowhere"), MAP)
    assert "has the layers layer 0, layer 1: name one as scene.objects.layer" in refused(written(count=2), MAP)
    assert "layer 0, layer 1, scene.objects.layer is 'cars'" in refused(written(count=2), MAP, layer="cars")
    assert len(read_objects(written(count=2), MAP, layer="layer 1")) == 1
    line = shapely.LineString([(0, 0), (1, 1)])
    assert "row 1 is 'LINESTRING (0 0, 1 1)', expected a point or a polygon" in refused(written(shapes=[line]), MAP)
    assert "row 1 is without a geometry, expected a point or a polygon" in refused(written(shapes=[None]), MAP)
    assert "is in EPSG:4326" in refused(layers(tmp_path, here, attributes, ending="geojson", crs=None), MAP)
    assert len(read_objects(written(crs=None, shapes=[shapely.Point(3.0, 4.0)]), LOCAL)) == 1


# --- scene and configuration


def test_a_speed_makes_a_mover_and_none_changes_nothing(tmp_path):
    still, moving = (read_objects(csv(tmp_path, speed_mps=speed), LOCAL) for speed in ([0, 0, 0], [0, 7.5, 0]))
    assert still.identity == read_objects(csv(tmp_path), LOCAL).identity != moving.identity
    assert still.speed_mps is None
    assert moving.moving.tolist() == [False, True, False]
    # some of the objects keep their own walls and speed
    some = replace(moving, walls=read_objects(csv(tmp_path, **WALLS), LOCAL).walls).some(moving.moving)
    assert (len(some), some.speed_mps[0], some.x_m[0]) == (1, 7.5, moving.x_m[1])
    assert (some.walls.roof.tolist(), some.walls.sigma0_db.tolist(), some.walls.bounce.tolist()) == (
        [0],
        [-4.0],
        [True],
    )
    assert not still.moving.any()


def test_identity_knows_all_that_an_image_depends_on(tmp_path):
    made = read_objects(csv(tmp_path), LOCAL)
    others = [
        replace(made, **{name: getattr(made, name) + 1}) for name in ("x_m", "height_m", "rcs_dbsm", "heading_deg")
    ]
    others.append(replace(made, curves={"a": np.array(CURVE)}))
    walls = read_objects(csv(tmp_path, **WALLS), LOCAL).walls
    others.append(replace(made, walls=walls))
    others.append(replace(made, walls=replace(walls, sigma0_db=walls.sigma0_db + 1.0)))
    assert len({made.identity, *(other.identity for other in others)}) == 8
    assert made.identity == "92e43b43c1a33ae653fe"  # runs of objects without walls keep their keys


def configured(objects):
    return case_from({"scene": {"source": "builtin", "objects": objects}}).scene


def test_a_configured_scene_has_its_objects(tmp_path):
    materials = ["dyke", "water", "grass", "forest", "crops", "bare_soil", "road"]
    bare = make_scene(case_from({}).scene, materials)
    scene = make_scene(configured({"path": str(csv(tmp_path))}), materials)
    assert len(scene.objects) == 3
    assert scene.identity != bare.identity
    assert scene.findings[-1].numbers == {"objects": 3, "points": 1}
    np.testing.assert_array_equal(scene.material, bare.material)
    assert len(make_scene(configured({"generate": {"trees": 5, "cars": 2, "seed": 3}}), materials).objects) == 7
    keys = {"path": str(csv(tmp_path, **WALLS)), "permittivity": {"wall": 5, "ground": 12}}
    with_roofs = make_scene(configured(keys), [*materials, "tiles"])
    assert with_roofs.names == (*bare.names, "tiles")
    assert with_roofs.objects.walls.permittivity == (5.0, 12.0)
    assert [(one.code, one.numbers) for one in with_roofs.findings[-1:]] == [("walls", {"walls": 1, "bounce": 1})]
    del keys["permittivity"]
    assert make_scene(configured(keys), [*materials, "tiles"]).findings[-1].code == "walls_reflect_all"
    with pytest.raises(SceneError, match="the scene's 'tiles' has no law; add materials.tiles"):
        make_scene(configured(keys), materials)
    with pytest.raises(ConfigError, match=r"scene\.objects\.path: the file .*no\.csv does not exist"):
        make_scene(configured({"path": str(tmp_path / "no.csv")}), materials)


@pytest.mark.parametrize(
    ("objects", "says"),
    [
        ({}, "scene.objects: has neither path and generate, expected one of them"),
        ({"path": "a.csv", "generate": {"trees": 1}}, "scene.objects: has both path and generate"),
        ({"generate": {}}, "scene.objects.generate: has no object, expected a number of trees"),
        ({"generate": {"trees": 1}, "aspect": {"a": CURVE}}, "aspect is for a table"),
        ({"generate": {"trees": 1}, "permittivity": {"wall": 5, "ground": 12}}, "permittivity is for a table"),
        ({"path": "a.csv", "permittivity": {"wall": 0.5, "ground": 12}}, "scene.objects.permittivity.wall is 0.5"),
        ({"path": "a.csv", "aspect": {"a": [[0, 1], [90, 90]]}}, "aspect.a has a cross-section of 90"),
        ({"pth": "a.csv"}, "unknown key scene.objects.pth (did you mean 'path'?)"),
    ],
)
def test_wrong_configurations(objects, says):
    with pytest.raises(ConfigError) as caught:
        configured(objects)
    assert says in str(caught.value)


# --- generator


def test_the_generator_is_that_of_its_seed():
    keys = {"trees": 300, "cars": 50, "buildings": 60}
    first, again, other = (generate_objects((900.0, 700.0), seed, **keys) for seed in (4, 4, 5))
    assert same(first, again)
    assert not np.isin(first.x_m, other.x_m).any()
    more = generate_objects((900.0, 700.0), 4, **(keys | {"cars": 70}))
    np.testing.assert_array_equal(more.x_m[:360], first.x_m[:360])  # kinds have streams of their own


def corners(objects):
    bearing = np.radians(objects.heading_deg)[:, None]
    along = np.array([1, 1, -1, -1]) * objects.length_m[:, None] / 2
    across = np.array([1, -1, -1, 1]) * objects.width_m[:, None] / 2
    x = objects.x_m[:, None] + along * np.sin(bearing) + across * np.cos(bearing)
    y = objects.y_m[:, None] + along * np.cos(bearing) - across * np.sin(bearing)
    return np.stack([x, y], axis=-1)


@pytest.mark.parametrize("seed", [1, 2])
def test_buildings_do_not_overlap_and_nothing_stands_in_them(seed):
    made = generate_objects((600.0, 400.0), seed, trees=3000, cars=500, buildings=250)
    assert len(made) == 3750
    assert (made.height_m[-500:] <= CAR.height_m[1]).all()
    shapes = shapely.polygons(corners(made))
    houses, others = shapes[:250], shapely.points(made.x_m[250:], made.y_m[250:])
    pairs = shapely.STRtree(houses).query(houses, predicate="intersects")
    assert (pairs[0] == pairs[1]).all()
    assert not shapely.STRtree(houses).query(others, predicate="within").size
    assert shapely.box(0, 0, 600, 400).buffer(1e-6).contains(houses).all()
    assert (made.width_m <= made.length_m).all()
    assert made.height_m.min() > 1.0


def test_cross_sections_are_of_the_footprints_area():
    made = generate_objects((3000.0, 2000.0), 1, trees=4000, cars=4000, buildings=4000)
    per_area = made.rcs_dbsm - 10.0 * np.log10(made.length_m * made.width_m)
    for k, kind in enumerate((BUILDING, TREE, CAR)):
        own = per_area[4000 * k : 4000 * (k + 1)]
        # normal: four standard errors of the mean and of the standard deviation
        assert own.mean() == pytest.approx(kind.rcs_db_per_m2, abs=4 * kind.spread_db / np.sqrt(4000))
        assert own.std() == pytest.approx(kind.spread_db, rel=4 / np.sqrt(8000))


def test_a_crowd_of_buildings_is_refused():
    with pytest.raises(SceneError, match=r"generate\.buildings is 99, expected at most 9: one for each 28 m x 28 m"):
        generate_objects((100.0, 100.0), 1, buildings=99)
    assert len(generate_objects((10.0, 10.0), 1, trees=3)) == 3
