"""Scenes from databases that a writer of its own makes from the standard."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import shapely
import yaml
from cdb_database import (
    elements,
    file_of,
    tile_of,
    write_features,
    write_heights,
    write_imagery,
    write_materials,
    write_raster,
)
from pyproj import Geod, Transformer

from radcal.cdb.mosaic import POST, Lattice, Log, heights
from radcal.cdb.source import CdbSource
from radcal.checking.case_check import check_case
from radcal.config import Radar, load_forward
from radcal.errors import SceneError
from radcal.radar.projection import make_geometry
from radcal.reading.cdb import cdb_files, step_deg
from radcal.scene.builtin import builtin_scene
from radcal.scene.sources import make_scene
from radcal.sections.materials import Material
from radcal.sections.scene import CdbScene
from radcal.storage.dataclass_groups import same
from radcal.words import sentence

PLACE = (-70.3, -33.4)  # in Chile: south and west
BOUNDS = (-70.31, -33.412, -70.29, -33.392)
TO_UTM = Transformer.from_crs("EPSG:4326", "EPSG:32719", always_xy=True)
MAPPING = """
composites: {SOIL: soil, GRASS: grass, WATER: water}
features:
  AL015: {kind: house, rcs_db_per_m2: 3}
  EC030: {kind: tree, rcs_db_per_m2: -6}
surfaces: {BH140: water, AP030: road}
"""


def plane(longitude, latitude):
    """Height [m] of a place, linear in UTM."""
    x, y = TO_UTM.transform(longitude, latitude)
    return 700.0 + 0.06 * (np.asarray(x) - 379_000.0) - 0.11 * (np.asarray(y) - 6_303_000.0)


def stripes(longitude, latitude):
    """Material of a place: 0 soil and 1 grass in stripes to the east, 2 water in the south."""
    east = np.floor((np.asarray(longitude) - BOUNDS[0]) / 0.003).astype(int) % 2
    return np.where(np.asarray(latitude) < -33.407, 2, east)


def tables(root, place=PLACE, lod=2):
    """Tile whose indices are its own: soil 7, grass 3, water 200."""
    index = np.array([7, 3, 200])[stripes(*elements(place, lod, 0.5))]
    return write_materials(root, place, lod, [index], {7: "SOIL", 3: "GRASS", 200: "WATER"})


@pytest.fixture
def build(tmp_path):
    def make(mapping=MAPPING, **keys):
        (tmp_path / "mapping.yaml").write_text(mapping)
        given = {"root": str(tmp_path), "bounds": BOUNDS, "materials": str(tmp_path / "mapping.yaml"), "cell_m": 20.0}
        return CdbScene.model_validate({"source": "cdb"} | given | keys)

    return make


@pytest.fixture
def root(tmp_path):
    write_heights(tmp_path, PLACE, 3, plane)
    tables(tmp_path)
    return tmp_path


def centres(scene):
    """Longitude and latitude of all cell centres."""
    a, _, c, _, e, f = scene.transform
    row, column = np.indices(scene.material.shape) + 0.5
    return Transformer.from_crs(scene.crs, "EPSG:4326", always_xy=True).transform(c + a * column, f + e * row)


def found(scene, code):
    return [one for one in scene.findings if one.code == code]


@pytest.mark.parametrize(
    ("place", "lod", "name"),
    [
        ((45.2, -5.2), 2, "S06E045_D001_S001_T001_L02_U3_R0.tif"),  # the standard's own examples
        ((-160.4, 62.3), 7, "N62W162_D001_S001_T001_L07_U38_R102.tif"),
        ((-161.9, 70.5), -4, "N70W162_D001_S001_T001_LC04_U0_R0.tif"),
        ((178.3, -75.01), 5, "S76E176_D001_S001_T001_L05_U31_R18.tif"),
        ((7.7, -75.0), 3, "S75E006_D001_S001_T001_L03_U0_R4.tif"),
        ((-13.4, 89.3), 1, "N89W024_D001_S001_T001_L01_U0_R1.tif"),
        ((3.4, -49.9), 1, "S50E003_D001_S001_T001_L01_U0_R0.tif"),
        ((3.4, -50.1), 1, "S51E002_D001_S001_T001_L01_U1_R1.tif"),
    ],
)
def test_a_name_gives_the_tile_of_a_place(tmp_path, place, lod, name):
    path = file_of(tmp_path, place, 1, lod, "tif")
    path.touch()
    assert path.name == name
    x, y = place
    (one,) = cdb_files(tmp_path, (x - 1e-6, y - 1e-6, x + 1e-6, y + 1e-6))
    *_, (west, south, height) = tile_of(*place, lod)
    assert (one.path, one.level, one.fault) == (path, lod, "")
    assert one.box == pytest.approx((west, south, west + height * one.width, south + height), abs=1e-12)
    assert cdb_files(tmp_path, (one.box[2], y, one.box[2] + 0.001, y + 1e-6)) == []


def test_posts_lie_where_the_standard_says_at_every_level(tmp_path):
    def height(x, y):
        return 40.0 + 300.0 * (x - 2.0) - 170.0 * (y - 50.0)

    # the fine level has one tile; around it, coarser posts in a zone of width 2, and of width 1 below 50 degrees
    fine, coarse, other = (2.2, 50.1), (2.2, 50.6), (2.2, 49.9)
    write_heights(tmp_path, fine, 2, height)
    write_heights(tmp_path, coarse, -1, height)
    write_heights(tmp_path, other, -1, height)
    bounds = (2.1, 49.98, 2.6, 50.3)
    to = Lattice.around(bounds, step_deg(2, 2), POST)
    log = Log(tmp_path)
    values, levels = heights(cdb_files(tmp_path, to.box), to, log)
    longitude, latitude = np.meshgrid(to.longitude, to.latitude)
    inside = np.isfinite(values)
    assert inside.mean() > 0.98  # between the last post below 50 degrees and the next zone there is no height
    assert np.abs(values - height(longitude, latitude))[inside].max() < 1e-3
    in_fine = (longitude >= 2.0) & (longitude < 2.5 - 1e-9) & (latitude >= 50.0) & (latitude < 50.25 - 1e-9)
    assert (levels[in_fine] == 2).all()
    assert set(np.unique(levels[~in_fine & inside])) == {-1}
    assert log == []


def test_integer_heights_of_fine_levels_are_scaled(tmp_path):
    write_heights(tmp_path, PLACE, 3, lambda x, _: np.full_like(x, 5003.0), dtype=np.int16)
    to = Lattice.around(BOUNDS, step_deg(3, 1), POST)
    values, _ = heights(cdb_files(tmp_path, BOUNDS), to, Log(tmp_path))
    assert np.nanmax(values) == np.nanmin(values) == 5003.0 / 8


@pytest.mark.parametrize("heading", [0.0, 57.0])
def test_a_scene_has_the_heights_and_materials_of_its_cells(root, build, heading):
    scene = make_scene(build(), ["soil", "grass", "water"], heading)
    longitude, latitude = centres(scene)
    assert BOUNDS[0] < longitude.min() < longitude.max() < BOUNDS[2]
    assert BOUNDS[1] < latitude.min() < latitude.max() < BOUNDS[3]
    # resampling follows the posts to a thousandth of their distance, on a slope of 0.13
    assert np.abs(scene.elevation_m - plane(longitude, latitude)).max() < 2e-3
    # away from borders of materials, by a cell of the raster of materials
    step = 0.25 / 1024
    around = [stripes(longitude + i * step, latitude + j * step) for i in (-1, 1) for j in (-1, 1)]
    pure = np.all([one == around[0] for one in around], axis=0)
    names = np.array(["", *scene.names])[scene.material]
    assert pure.mean() > 0.7
    assert (names == np.array(["soil", "grass", "water"])[around[0]])[pure].all()
    assert found(scene, "cdb_posts")[0].numbers["post_m"] == pytest.approx(12.4, abs=0.1)


def test_a_level_with_too_many_elements_is_sampled(root, monkeypatch):
    monkeypatch.setattr("radcal.cdb.mosaic.LARGEST_CELLS", 9_000)
    to = Lattice.sampled(BOUNDS, step_deg(3, 1), POST)
    assert to.step == step_deg(2, 1)
    values, levels = heights(cdb_files(root, to.box, (1,)), to, Log(root))
    assert (levels == 3).all()
    assert np.abs(values - plane(*np.meshgrid(to.longitude, to.latitude))).max() < 1e-3


def test_the_size_is_that_of_the_scene(root, build):
    scene, size = make_scene(build(cell_m=None), None), CdbSource.size(build(cell_m=None))
    geod = Geod(ellps="WGS84")
    step = 0.25 / 1024
    sides = geod.inv(*PLACE, PLACE[0] + step, PLACE[1])[2], geod.inv(*PLACE, PLACE[0], PLACE[1] + step)[2]
    assert size.cells == scene.material.size
    assert size.cell_m == scene.cell_m == pytest.approx(np.sqrt(np.prod(sides)), rel=3e-3)


def test_indices_are_joined_by_name_and_the_largest_share_counts(tmp_path, build):
    write_heights(tmp_path, PLACE, -1, plane)
    # two tiles of level 4 whose border lies in the scene, with other indices each; and a coarse level around them
    west, east = (-70.315, -33.4), (-70.305, -33.4)
    border = tile_of(*east, 4)[-1][0]
    write_materials(tmp_path, PLACE, -1, [np.full((512, 512), 9)], {9: "WATER"})
    # layers 1 and 3 are both soil: together they are more than grass
    layers = [np.full((1024, 1024), k) for k in (1, 2, 4)]
    shares = [np.full((1024, 1024), v, dtype=np.uint8) for v in (76, 102)]  # 0.3, 0.4, the rest 0.3
    write_materials(tmp_path, west, 4, layers, {1: "SOIL", 2: "GRASS", 4: "SOIL"}, shares)
    shares = [np.full((1024, 1024), v, dtype=np.float32) for v in (0.05, 0.85)]
    write_materials(tmp_path, east, 4, layers, {1: "SOIL", 2: "GRASS", 4: "WATER"}, shares)
    scene = make_scene(build(bounds=(-70.325, -33.45, -70.3, -33.4), cell_m=25.0), None)
    longitude, latitude = centres(scene)
    _, _, _, _, (left, south, height) = tile_of(*west, 4)
    fine = (latitude > south) & (latitude < south + height) & (longitude > left) & (longitude < border + height)
    expected = np.where(~fine, "water", np.where(longitude < border, "soil", "grass"))
    names = np.array(["", *scene.names])[scene.material]
    assert (names == expected).mean() > 0.98  # cells on the borders
    assert {*np.unique(names)} == {"soil", "grass", "water"}
    assert (scene.mixed == (fine & (longitude < border))).mean() > 0.98
    (mixed,) = found(scene, "cdb_mixed")
    assert mixed.numbers["percent"] == pytest.approx(100 * (fine & (longitude < border)).mean(), rel=0.05)


def test_a_large_cell_has_the_most_frequent_material_whether_mixed_or_not(tmp_path, build):
    write_heights(tmp_path, PLACE, 3, plane)
    # of four columns one is grass and three soil, of which one is a mixture; and one of two columns of soil is mixed
    column = np.broadcast_to(np.arange(1024) % 4, (1024, 1024))
    index = np.where(column < 2, 1, np.where(column == 2, 2, 1))
    share = np.where(column == 1, 130, 250).astype(np.uint8)
    write_materials(tmp_path, PLACE, 4, [index, np.full((1024, 1024), 4)], {1: "SOIL", 2: "GRASS", 4: "WATER"}, [share])
    scene = make_scene(build(cell_m=24.0), None)  # some 4 x 4 elements
    assert (np.array(["", *scene.names])[scene.material] == "soil").mean() > 0.99
    assert scene.mixed.mean() < 0.01


def test_a_mixture_is_the_mean_of_fixed_laws_in_power(tmp_path):
    bases = "BM_SOIL: {law: constant_gamma, parameters: [-10]}, BM_WATER: {law: constant_gamma, parameters: [-20]}"
    path = tmp_path / "mapping.yaml"
    path.write_text(MAPPING + f"bases: {{{bases}}}\n")
    tables(tmp_path)
    table = file_of(tmp_path, PLACE, 6, 2, "xml")
    parts = "".join(
        f"<Material><Name>BM_{name}</Name><Weight>{weight}</Weight></Material>"
        for name, weight in (("SOIL", 30), ("WATER", 50), ("MOISTURE", 20))
    )
    old = "<Material><Name>BM_SOIL</Name><Weight>100</Weight></Material>"
    table.write_text(table.read_text().replace(old, parts))
    words = [sys.executable, "-m", "radcal.cdb", path, tmp_path, *BOUNDS]
    done = subprocess.run([*map(str, words)], capture_output=True, text=True, check=True)
    assert "# SOIL: 0.375 BM_SOIL + 0.625 BM_WATER; BM_MOISTURE is left out" in done.stdout
    assert "# GRASS: 1 BM_GRASS: no mixture, without a law of BM_GRASS in bases" in done.stdout
    found = yaml.safe_load(done.stdout)["materials"]
    assert set(found) == {"soil", "water"}
    law = Material.model_validate(found["soil"])
    assert not law.calibrate
    at = np.radians([7.0, 33.3, 61.0])
    expected = 10 * np.log10((0.375 * 0.1 + 0.625 * 0.01) * np.cos(at))
    assert law.unbound_law(at, law.parameters) == pytest.approx(expected, abs=0.005)
    write_materials(tmp_path, PLACE, 2, [np.full((1024, 1024), 7)], {7: "SOIL", 8: "OTHER"})
    path.write_text(path.read_text().replace("{SOIL: soil,", "{SOIL: soil, OTHER: soil,"))
    done = subprocess.run([*map(str, words)], capture_output=True, text=True)
    assert done.returncode == 1
    assert "mixes OTHER of 'soil' in two ways" in done.stderr


def test_pixels_of_mixtures_belong_to_no_material():
    whole = builtin_scene(1)
    mixed = np.zeros(whole.material.shape, dtype=bool)
    mixed[120:260, 90:200] = True
    radar = Radar()
    plain, masked = make_geometry(whole, radar), make_geometry(replace(whole, mixed=mixed), radar)
    row, column = np.nan_to_num(plain.ground, nan=-1e3)
    wide = 2.0 + max(radar.azimuth_spacing_m, 2 * radar.range_spacing_m) / whole.cell_m

    def within(reach):
        rows, columns = (row >= 120 - reach) & (row < 260 + reach), (column >= 90 - reach) & (column < 200 + reach)
        return rows & columns

    assert (plain.material[within(-0.5)] > 0).mean() > 0.3
    assert (masked.material[within(-0.5)] == 0).all()
    assert (masked.material[~within(wide)] == plain.material[~within(wide)]).all()
    assert np.array_equal(masked.facet_incidence, plain.facet_incidence)


def colours(longitude, latitude):
    """Red that grows to the east and green that grows to the north, by 1 in 2.4e-4 degrees."""
    east, north = (np.asarray(longitude) - BOUNDS[0]) * 4200.0, (np.asarray(latitude) - BOUNDS[1]) * 4200.0
    return np.clip([60 + east, 50 + north, np.full_like(east, 90.0)], 0, 255)


def without_imagery(scene):
    return replace(scene, imagery=None, findings=())


@pytest.mark.parametrize("heading", [0.0, 57.0])
def test_the_picture_has_the_imagery_of_its_places_and_no_effect(root, build, heading):
    names = ["soil", "grass", "water"]
    plain = make_scene(build(), names, heading)
    assert plain.imagery is None
    # tiles of levels that the picture needs (6) and does not need (7), in part of the scene; and a coarse one, blue
    write_imagery(root, PLACE, -4, lambda x, y: np.stack([0 * x, 0 * x, 0 * x + 250]))
    write_imagery(root, PLACE, 6, colours)
    write_imagery(root, PLACE, 7, lambda x, y: np.stack([0 * x + 255] * 3))
    scene = make_scene(build(), names, heading)
    assert same(without_imagery(scene), without_imagery(plain))
    assert len(build().files_in(root)) == 5
    longitude, latitude = centres(scene)
    *_, (west, south, height) = tile_of(*PLACE, 6)
    fine = (longitude > west) & (longitude < west + height) & (latitude > south) & (latitude < south + height)
    assert 0.3 < fine.mean() < 0.8
    expected = np.where(fine, colours(longitude, latitude), np.reshape([0, 0, 250], (3, 1, 1)))
    assert np.abs(np.moveaxis(scene.imagery, -1, 0) - expected).max() <= 1.1
    assert str(found(scene, "cdb_levels")[2].numbers["levels"]).startswith("L06 (")


@pytest.mark.parametrize(
    ("damage", "text"),
    [
        (lambda path: path.write_bytes(b""), "cannot be read as a raster"),
        (lambda path: path.write_bytes(path.read_bytes()[:3000]), "cannot be read as a raster"),
        (lambda path: path.rename(path.with_name(path.name.replace("R", "R9"))), "no row"),
        (lambda path: write_imagery(path.parents[6], PLACE, 2, lambda x, y: [x]), "1 bands of uint8, expected 3"),
    ],
)
def test_damaged_imagery_is_said_and_left_out(root, build, damage, text):
    plain = make_scene(build(), None)
    damage(write_imagery(root, PLACE, 2, colours))
    scene = make_scene(build(), None)
    assert same(without_imagery(scene), without_imagery(plain))
    assert scene.imagery is None
    assert any(text in sentence(one) for one in found(scene, "cdb_left_out")), scene.findings


def test_equal_shares_without_a_layer_of_shares(tmp_path, build):
    write_heights(tmp_path, PLACE, 3, plane)
    layers = [np.full((1024, 1024), k) for k in (1, 2, 2)]
    write_materials(tmp_path, PLACE, 2, layers, {1: "SOIL", 2: "GRASS"})
    scene = make_scene(build(), None)
    assert {scene.names[k - 1] for k in np.unique(scene.material)} == {"grass"}


def test_points_are_boxes_at_their_places(root, build):
    rng = np.random.default_rng(3)
    x, y = rng.uniform(-70.308, -70.292, 40), rng.uniform(-33.41, -33.394, 40)
    z = np.where(np.arange(40) < 20, 2.0, plane(x, y) + 5.0)
    shapes = [shapely.Point(*at) for at in zip(x, y, z, strict=True)]
    columns = {
        "CNAM": ["house"] * 38 + ["lamp", "bridge"],
        "AO1": rng.uniform(0, 360, 40),
        "SCALx": [1.5] * 40,
        "SCALy": [0.5] * 40,
        "SCALz": [3.0] * 40,
        "AHGT": [0] * 20 + [1] * 20,
    }
    classes = {
        "CNAM": ["house", "lamp", "bridge"],
        "FACC": ["AL015", "GB030", "AL015"],
        "BBH": [4.0, 1.0, 5.0],
        "BBW": [10.0, 1.0, 8.0],
        "BBL": [30.0, 1.0, 401.0],
    }
    write_features(root, PLACE, 2, shapes, columns, classes)
    scene = make_scene(build(), None)
    objects = scene.objects
    east, north = TO_UTM.transform(x[:38], y[:38])
    assert np.abs(objects.x_m + scene.transform[2] - east).max() < 0.01
    assert np.abs(objects.y_m + scene.transform[5] - north).max() < 0.01
    assert (objects.width_m == 15.0).all()
    assert (objects.length_m == 15.0).all()
    assert objects.height_m[:20] == pytest.approx(14.0)
    assert objects.height_m[20:] == pytest.approx(17.0, abs=2.0)  # the ground is that of the cell, on a slope of 0.13
    assert objects.rcs_dbsm == pytest.approx(3.0 + 10 * np.log10(225.0))
    # a feature code may name a class of cross-sections
    rows = [f"house,X,HH,{aspect},{e},{e / 2}" for aspect in (0, 360) for e in (10, 80)]
    (root / "rcs.csv").write_text("\n".join(["class,band,polarisation,aspect_deg,elevation_deg,rcs_dbsm", *rows]))
    named = MAPPING.replace("rcs_db_per_m2: 3", "cross_section: house")
    by_class = make_scene(build(named, cross_sections=str(root / "rcs.csv")), None).objects
    found_dbsm = 10 * np.log10(by_class.cross_section_m2(270.0, np.full(38, 33.0), "X", "HH"))
    assert found_dbsm == pytest.approx(16.5)
    # the meridian's direction in the grid from two points of it
    ahead = TO_UTM.transform(x[:38], y[:38] + 1e-4)
    turn = np.degrees(np.arctan2(ahead[0] - east, ahead[1] - north))
    assert np.abs(turn).min() > 0.1
    assert objects.heading_deg == pytest.approx((columns["AO1"][:38] + turn) % 360, abs=1e-3)
    assert found(scene, "features_unmapped")[0].numbers == {"features": 1, "codes": "GB030 (1)"}
    assert found(scene, "features_large")[0].numbers == {"features": 1, "codes": "AL015 (1)"}


def test_lines_and_areas_are_drawn(root, build):
    middle = TO_UTM.transform(*PLACE)
    back = Transformer.from_crs("EPSG:32719", "EPSG:4326", always_xy=True)

    def line(dx, dy, shift=0.0):
        at = [back.transform(middle[0] + shift + k * dx, middle[1] + k * dy) for k in (-1, 1)]
        return shapely.LineString([(*one, 0.0) for one in at])

    names = {"CNAM": ["wide", "narrow"], "WGP": [90.0, 5.0]}
    shapes = [line(0.0, 400.0), line(0.0, 400.0, 300.0)]
    write_features(root, PLACE, 2, shapes, names, {"CNAM": ["wide", "narrow"], "FACC": ["AP030"] * 2}, 201, 3)
    square = [back.transform(middle[0] + dx, middle[1] + dy) for dx, dy in ((-200, -200), (500, -200), (500, 0))]
    area = shapely.Polygon([(*one, 0.0) for one in square])
    write_features(root, PLACE, 2, [area], {"CNAM": ["lake"]}, {"CNAM": ["lake"], "FACC": ["BH140"]}, 100, 5)
    scene = make_scene(build(), None)
    a, _, c, _, e, f = scene.transform
    row, column = np.indices(scene.material.shape) + 0.5
    x, y = c + a * column - middle[0], f + e * row - middle[1]
    road = scene.material == 1 + scene.names.index("road")
    along = np.abs(y) < 380.0
    assert (road[along] == ((np.abs(x) < 45.0) | (np.abs(x - 300.0) <= 10.0))[along]).mean() > 0.999
    lake = (y < 0) & (y > -200) & (x < 500) & (y > -200) & ((x + 200) / 700 > (y + 200) / 200)
    assert (scene.material[lake & ~road] == 1 + scene.names.index("water")).mean() > 0.97
    assert found(scene, "features_burnt")[0].numbers == {"features": 3}
    assert found(scene, "features_narrow")[0].numbers == {"features": 1, "codes": "AP030 (1)"}


def test_unmapped_names_are_refused_above_one_percent(root, build):
    with pytest.raises(SceneError, match=r"no material for 2\d\.\d% of the cells.*WATER \(0\.2"):
        make_scene(build(MAPPING.replace(", WATER: water", "")), None)


@pytest.mark.parametrize(
    ("dataset", "ending", "told"),
    [
        (
            1,
            "tif",
            r"scene\.root: .* only no-data; left out: Tiles/.*_D001_.*\.tif \(cannot be read as a raster.*\)\.$",
        ),
        (6, "xml", r"add these names to composites; left out: Tiles/.*_D006_.*\.xml \(cannot be read as XML.*\)\.$"),
    ],
)
def test_an_error_names_the_damaged_file_that_is_its_cause(root, build, dataset, ending, told):
    next(root.glob(f"Tiles/**/*_D{dataset:03d}_*.{ending}")).write_text("<")
    with pytest.raises(SceneError, match=told):
        make_scene(build(), None)


@pytest.mark.parametrize(("beyond_deg", "severity"), [(1.9e-4, "note"), (6e-4, "warning")])
def test_missing_tiles_are_a_warning_above_one_percent(root, build, beyond_deg, severity):
    east = tile_of(*PLACE, 2)[-1][0] + 0.25  # border of the only tiles
    bounds = (east + beyond_deg - 0.02, BOUNDS[1], east + beyond_deg, BOUNDS[3])
    scenes = [make_scene(build(bounds=bounds, cell_m=5.0), None)]
    write_heights(root, PLACE, -1, plane)
    scenes.append(make_scene(build(bounds=bounds, cell_m=5.0), None))
    lacking = (centres(scenes[1])[0] > east).mean()
    # without coarse heights, the cells beyond the last post, 12 m from the border, are bare, too
    for scene, codes, beyond in zip(scenes, (["no_elevation", "no_material"], ["no_material"]), (7e-3, 0), strict=True):
        bare = [one for one in scene.findings if one.code.startswith("no_")]
        assert [(one.code, one.severity) for one in bare] == [(code, severity) for code in codes]
        assert bare[-1].numbers["cells"] / bare[-1].numbers["of"] == pytest.approx(lacking, abs=beyond)


def fine_heights(root):
    return write_heights(root, PLACE, 4, plane)


def cut(path, size=0):
    path.write_bytes(path.read_bytes()[:size])


def small_heights(root):
    write_heights(root, PLACE, 4, lambda x, y: plane(x, y)[:512, :512])


def text_for_table(root):
    tables(root, lod=-1)
    file_of(root, PLACE, 6, 2, "xml").write_text("<Composite_Material_Table><Com")


def indices_of_another_type(root):
    tables(root, lod=-1)
    write_raster(root, PLACE, 5, 2, np.full((1024, 1024), 7, dtype=np.float32))


def no_data_undeclared(root):
    write_heights(root, PLACE, 4, lambda x, y: np.where(x < PLACE[0] - 0.01, -32767.0, plane(x, y)))


def classes_cut_off(root):
    path = feature(root)
    cut(path.with_name(path.name.replace("T001", "T002")).with_suffix(".dbf"), 40)


def tags_of_centres(root):
    write_heights(root, PLACE, 3, plane, shift=0.5)


def no_table(root):
    tables(root, lod=-1)
    file_of(root, PLACE, 6, 2, "xml").unlink()


def large_index(root):
    tables(root, lod=-1)
    path = file_of(root, PLACE, 6, 2, "xml")
    path.write_text(path.read_text().replace("200", "300"))


def unknown_index(root):
    index = np.full((1024, 1024), 7)
    index[::16, ::16] = 8
    write_materials(root, PLACE, 2, [index], {7: "SOIL"})


def missing_share(root):
    layers = [np.full((1024, 1024), k) for k in (7, 7, 7)]
    write_materials(root, PLACE, 2, layers, {7: "SOIL"}, [np.full((1024, 1024), 99, dtype=np.uint8)])


def missing_index(root):
    tables(root, lod=-1)
    layers = [np.full((1024, 1024), k) for k in (7, 3, 200)]
    shares = [np.full((1024, 1024), 85, dtype=np.uint8)] * 2
    write_materials(root, PLACE, 2, layers, {7: "SOIL", 3: "GRASS", 200: "WATER"}, shares)
    file_of(root, PLACE, 5, 2, "tif", t=2).unlink()


def broken_area(root):
    square = shapely.Polygon([(*PLACE, 0), (PLACE[0] + 1e-3, PLACE[1], 0), (PLACE[0], PLACE[1] + 1e-3, 0)])
    path = write_features(root, PLACE, 2, [square], {"CNAM": ["a"]}, {"CNAM": ["a"], "FACC": ["BH140"]}, 100, 5)
    data = bytearray(path.read_bytes())
    data[100 + 8 + 40 : 100 + 8 + 44] = (1).to_bytes(4, "little")  # its ring has one point
    path.write_bytes(data)


def unknown_base(root):
    (root / "Metadata").mkdir()
    known = "<Base_Material><Name>BM_SOIL</Name></Base_Material>"
    (root / "Metadata/Materials.xml").write_text(f"<Base_Material_Table>{known}</Base_Material_Table>")


def feature(root):
    shapes = [shapely.Point(*PLACE, 0.0)]
    return write_features(root, PLACE, 2, shapes, {"CNAM": ["a"], "AO1": [0.0]}, {"CNAM": ["a"], "FACC": ["AL015"]})


def text_for_shapes(root):
    feature(root).write_text("text")


def no_class(root):
    path = feature(root)
    path.with_name(path.name.replace("T001", "T002")).with_suffix(".dbf").unlink()


def renamed(root, old, new):
    path = fine_heights(root)
    path.rename(path.with_name(path.name.replace(old, new)))


@pytest.mark.parametrize(
    ("damage", "code", "text"),
    [
        (lambda root: cut(fine_heights(root)), "cdb_left_out", "L04"),
        (lambda root: cut(fine_heights(root), 99_999), "cdb_left_out", "cannot be read as a raster"),
        (no_data_undeclared, "cdb_left_out", "heights, which are not from -1000 to 9000 m"),
        (text_for_table, "cdb_left_out", "cannot be read as XML"),
        (indices_of_another_type, "cdb_left_out", "it holds float32, expected uint8"),
        (classes_cut_off, "cdb_left_out", "D100_S001_T002"),
        (small_heights, "cdb_left_out", "512 x 512 elements, expected 1024 x 1024"),
        (tags_of_centres, "cdb_tags", "1 tiles of elevation lie up to 6 m"),
        (no_table, "cdb_left_out", "no table of composite materials"),
        (large_index, "cdb_left_out", "'WATER' of index 300"),
        (unknown_index, "cdb_unmapped", "index without a name"),
        (missing_share, "cdb_left_out", "equal shares"),
        (missing_index, "cdb_left_out", "layers of indices are [1, 3], expected 1, 2"),
        (broken_area, "cdb_left_out", "D100_S001_T005"),
        (unknown_base, "cdb_base_materials", "BM_GRASS, BM_WATER"),
        (text_for_shapes, "cdb_left_out", "D100_S001_T001"),
        (no_class, "cdb_left_out", "1 of its features"),
        (feature, "features_without_size", "AL015 (1)"),
        (lambda root: renamed(root, "W071", "W070"), "cdb_left_out", "contradicts its folders"),
        (lambda root: renamed(root, ".tif", ".TIF"), "cdb_left_out", "ends with .TIF, expected .tif"),
        (lambda root: renamed(root, "_R", "_R9"), "cdb_left_out", "no row"),
        (lambda root: renamed(root, "S34", "copy of S34"), "cdb_left_out", "not one of a tile"),
    ],
    ids=lambda one: one.__name__ if callable(one) else None,
)
def test_what_is_damaged_is_said_and_the_rest_is_read(root, build, damage, code, text):
    whole = make_scene(build(), None)
    damage(root)
    scene = make_scene(build(), None)
    assert any(text in sentence(one) for one in found(scene, code)), [sentence(one) for one in scene.findings]
    assert np.abs(scene.elevation_m - whole.elevation_m).max() < 2e-3  # resampled from other posts
    assert (scene.material > 0).mean() > 0.99


def test_a_geocell_of_a_wrong_zone_is_named(tmp_path):
    path = file_of(tmp_path, (-160.4, 62.3), 1, 2, "tif")
    path.touch()
    (tmp_path / "Tiles/N62/W162").rename(tmp_path / "Tiles/N62/W161")
    (one,) = cdb_files(tmp_path, (-161.0, 62.0, -160.0, 63.0))
    assert "2 degrees wide" in one.fault


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"mapping": "composites: {}"}, r"scene.materials: .*composites"),
        ({"mapping": "composites: {SOIL: soil}\nfeature: {}"}, r"feature.*features"),
        ({"mapping": "composites: {SOIL: soil}\nfeatures: {AL015: {rcs_db_per_m2: much}}"}, r"AL015.*much"),
        ({"bounds": (10.0, 10.0, 10.1, 10.1)}, r"scene.root: .* has no elevation \(dataset 001\)"),
        ({"bounds": (-70.5, -33.6, -70.1, -33.2), "cell_m": 0.5}, r"scene.cell_m is 0.5"),
        ({"crs": "EPSG:4326"}, r"scene.crs is 'EPSG:4326'"),
    ],
)
def test_wrong_keys_are_told(root, build, keys, text):
    with pytest.raises(SceneError, match=text):
        make_scene(build(**keys), None)


def test_the_tiles_are_inputs_of_the_case(root, build):
    files = build().files_in(root)
    assert [path.suffix for path in files] == [".tif", ".tif", ".xml"]
    files[0].with_name(files[0].name + ".aux.xml").touch()  # as GDAL writes it
    assert build().files_in(root) == files
    assert found(make_scene(build(), None), "cdb_left_out") == []
    with pytest.raises(ValueError, match=r"no tile within scene.bounds"):
        build(bounds=(10.0, 10.0, 10.1, 10.1)).files_in(root)


def test_the_mapping_may_hold_the_starting_laws(root, build, tmp_path):
    mapping = MAPPING + "materials:\n  soil: {law: constant_gamma, parameters: [-12.5]}\n"
    names = make_scene(build(mapping), None).names
    scene = build(mapping).model_dump(mode="json")
    case = tmp_path / "case.yaml"
    case.write_text(json.dumps({"scene": scene, "materials_from": scene["materials"], "materials": LAWS}))
    found = load_forward([case]).materials
    assert set(found) == set(names)
    assert found["soil"].parameters == [-12.5]
    # two tiles and a table
    lines = check_case([case]).summary()
    assert [line for line in lines if "scene.root" in line] == ["  scene.root: 3 files in all"]


LAWS = {name: {"law": "constant_gamma", "parameters": [-8.0]} for name in ("grass", "water", "road")}


def test_without_raster_material_all_cells_are_the_default(tmp_path, build):
    write_heights(tmp_path, PLACE, 3, plane)
    scene = make_scene(build("composites: {BM_LAND-MOOR: moor}"), ["moor"])
    assert (scene.material == 1).all()
    assert len(found(scene, "cdb_no_material")) == 1


DATA = os.environ.get("RADCAL_DATA")
needs_data = pytest.mark.skipif(DATA is None, reason="RADCAL_DATA is not set")


@needs_data
def test_the_piece_of_san_diego(build):
    import pyogrio
    import rasterio

    keys = {"root": f"{DATA}/cdb", "bounds": (-117.3, 32.5, -117.01, 32.8), "cell_m": 50.0}
    config = build("composites: {BM_LAND-MOOR: moor}\n" + MAPPING.split("composites")[1].partition("\n")[2], **keys)
    scene = make_scene(config, ["moor", "road"])
    assert len(scene.objects) == 47
    cell = Path(keys["root"]) / "Tiles/N32/W118"
    shapes = pyogrio.raw.read(cell / "101_GTFeature/L00/U0/N32W118_D101_S002_T001_L00_U0_R0.shp")[2]
    x, y = Transformer.from_crs("EPSG:4326", scene.crs, always_xy=True).transform(
        *shapely.get_coordinates(shapely.from_wkb(shapes)).T
    )
    assert np.abs(scene.objects.x_m + scene.transform[2] - x).max() < 0.01
    assert np.abs(scene.objects.y_m + scene.transform[5] - y).max() < 0.01
    # heights at nodes, by row and column of the file
    to = Lattice.around(config.bounds, step_deg(-1, 1), POST)
    values, _ = heights(cdb_files(Path(keys["root"]), to.box, (1,)), to, Log(Path(keys["root"])))
    with rasterio.open(cell / "001_Elevation/LC/U0/N32W118_D001_S001_T001_LC01_U0_R0.tif") as file:
        raw = file.read(1)
    for row, column in np.random.default_rng(1).integers((200, 370), (250, 500), (20, 2)):
        longitude, latitude = -118 + column / 512, 33 - (row + 1) / 512
        k, m = np.argmin(abs(to.latitude - latitude)), np.argmin(abs(to.longitude - longitude))
        assert (to.longitude[m], to.latitude[k]) == pytest.approx((longitude, latitude), abs=1e-9)
        assert values[k, m] == pytest.approx(raw[row, column], abs=1e-3)


@needs_data
def test_the_piece_of_yemen(build):
    names = ("OCEAN", "DRYGROUND", "CALCAREOUS", "SAND", "CITY", "ASPHALTROAD", "FOREST", "WETGROUND")
    mapping = "composites: {" + ", ".join(f"{name}: {name.lower()}" for name in names) + "}"
    keys = {"root": f"{DATA}/cdb_material", "bounds": (44.0, 12.5, 44.99, 12.99), "cell_m": None}
    scene = make_scene(build(mapping, **keys), None)
    ocean = scene.material == 1
    assert (scene.elevation_m[ocean] <= 0.5).mean() > 0.99
    assert np.median(scene.elevation_m[scene.material == 2]) == pytest.approx(119, abs=5)
    assert found(scene, "cdb_tags")[0].numbers["off_m"] == pytest.approx(151, abs=3)
    assert "L00 (100.0%)" in str(found(scene, "cdb_levels")[1].numbers["levels"])
