"""Cross-sections of classes from tables of an external code, against the closed form of a trihedral."""

from dataclasses import replace

import h5py
import numpy as np
import pandas as pd
import pytest

from radcal.config import Radar, case_from
from radcal.config.inputs import input_files
from radcal.errors import ConfigError, SceneError
from radcal.radar.projection import make_geometry
from radcal.scene.model import Scene
from radcal.scene.objects import Objects
from radcal.standing.cross_sections import cross_sections, towards

ASPECTS, ELEVATIONS = np.arange(-15.0, 16.0, 5.0), np.array([30.0, 33.0, 36.0, 45.0])
NX, NY, ALTITUDE = 160, 60, 500.0


def trihedral_dbsm(aspect_deg, elevation_deg, edge_m=0.8, wavelength_m=0.031):
    """Triangular trihedral near its axis, by the sum of the direction cosines (Knott, "Radar cross section", ch. 6)."""
    azimuth, elevation = np.radians(np.asarray(aspect_deg) + 45.0), np.radians(elevation_deg)
    total = np.sin(elevation) + np.cos(elevation) * (np.sin(azimuth) + np.cos(azimuth))
    return 10.0 * np.log10(4.0 * np.pi * edge_m**4 / wavelength_m**2 * (total - 2.0 / total) ** 2)


def rows(**changes):
    """One row for each node, of class and bands that differ by known levels."""
    aspect, elevation = (grid.ravel() for grid in np.meshgrid(ASPECTS, ELEVATIONS))
    of_x = {
        "class": "corner", "band": "X", "polarisation": "HH", "aspect_deg": aspect, "elevation_deg": elevation,
        "rcs_dbsm": trihedral_dbsm(aspect, elevation),
    }  # fmt: skip
    of_c = of_x | {"band": "C", "polarisation": "VV", "rcs_dbsm": of_x["rcs_dbsm"] - 5.0}
    other = of_x | {"class": "plate", "rcs_dbsm": of_x["rcs_dbsm"] * 0.0 - 7.0}
    table = pd.concat([pd.DataFrame(one) for one in (of_x, of_c, other)], ignore_index=True)
    return table.sample(frac=1.0, random_state=1, ignore_index=True).assign(**changes)


def written(folder, table, ending="csv"):
    path = folder / f"cross_sections.{ending}"
    if ending == "csv":
        table.to_csv(path, index=False)
        return path
    with h5py.File(path, "w") as file:
        for name, values in table.items():
            file[name] = values.to_list()
    return path


def one_object(heading_deg, depression_deg, tables, name=0, **keys):
    """Cross-section of a point in the middle of a flat scene, as its amplitude has it [dBsm], in beta0."""
    one = np.zeros(1)
    point = Objects(
        np.array([NX / 2]), np.array([NY / 2]), one, one, np.array([heading_deg]), one, one + np.nan,
        np.full(1, name, np.int16), tables=tables,
    )  # fmt: skip
    scene = Scene("flat", ("ground",), np.ones((NY, NX), np.uint8), np.zeros((NY, NX)), 1.0, objects=point)
    radar = Radar(
        altitude_m=ALTITUDE, depression_deg=depression_deg, range_spacing_m=1.0, azimuth_spacing_m=1.3,
        range_resolution_m=2.0, azimuth_resolution_m=2.0, radiometry="beta0", **keys,
    )  # fmt: skip
    geometry = make_geometry(scene, radar)
    return 20.0 * np.log10(geometry.point_amplitude[0]) + 10.0 * np.log10(1.3)


@pytest.mark.parametrize("ending", ["csv", "h5"])
@pytest.mark.parametrize("look_side", ["right", "left"])
def test_a_trihedral_has_its_closed_form_at_the_nodes(ending, look_side, tmp_path):
    tables = cross_sections(str(written(tmp_path, rows(), ending)), "scene.objects.cross_sections")
    bearing = 270.0 if look_side == "right" else 90.0
    for aspect, elevation in ((0.0, 36.0), (-15.0, 30.0), (15.0, 45.0), (5.0, 33.0)):
        found = one_object(bearing - aspect, elevation, tables, look_side=look_side)
        assert found == pytest.approx(trihedral_dbsm(aspect, elevation), abs=0.01)
        of_c = one_object(bearing - aspect, elevation, tables, look_side=look_side, band="C", polarisation="VV")
        assert of_c == pytest.approx(trihedral_dbsm(aspect, elevation) - 5.0, abs=0.01)
    assert one_object(bearing, 36.0, tables, 1, look_side=look_side) == pytest.approx(-7.0, abs=0.01)


def test_between_nodes_decibels_are_linear(tmp_path):
    tables = cross_sections(str(written(tmp_path, rows())), "key")
    corners = trihedral_dbsm([[5.0, 5.0], [10.0, 10.0]], [[36.0, 45.0], [36.0, 45.0]])
    expected = np.array([0.7, 0.3]) @ corners @ [0.6, 0.4]
    corner = [one for one in tables.values() if one.name == "corner"]
    assert towards(corner, np.array([6.5 + 720.0]), np.array([39.6]), "x-band", "HH")[0] == pytest.approx(expected)


@pytest.mark.parametrize(
    ("aspect", "keys", "says"),
    [
        (20.0, {}, "an object has an aspect of 20 degrees, expected -15 to 15"),
        (0.0, {"depression_deg": 55.0}, "an object has an elevation angle of 55 degrees, expected 30 to 45"),
        (0.0, {"polarisation": "HV"}, "the pass is of X HV, expected one of C VV, X HH"),
        (0.0, {"band": "L"}, "the pass is of L HH, expected one of C VV, X HH"),
    ],
)  # fmt: skip
def test_outside_of_the_table_a_pass_is_refused(aspect, keys, says, tmp_path):
    tables = cross_sections(str(written(tmp_path, rows())), "key")
    depression = keys.pop("depression_deg", 35.0)
    with pytest.raises(SceneError) as caught:
        one_object(270.0 - aspect, depression, tables, **keys)
    assert "cross-sections of class 'corner': " + says in str(caught.value)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"elevation_deg": None}, "has no column 'elevation_deg', found "),
        ({"rcs_dbsm": 95.0}, "row 1: rcs_dbsm is 95.0, expected -100 to 70"),
        ({"aspect_deg": "north"}, "row 1: aspect_deg is north, expected -180 to 360"),
        ({"elevation_deg": 100.0}, "row 1: elevation_deg is 100.0, expected -90 to 90"),
        (
            {"band": "X", "polarisation": "HH"},
            "has 56 rows of corner X HH with 7 aspects and 4 elevation angles, expected one for each",
        ),
    ],
)
def test_wrong_tables(changes, says, tmp_path):
    table = rows(**{name: value for name, value in changes.items() if value is not None})
    table = table.drop(columns=[name for name, value in changes.items() if value is None])
    for ending in ("csv", "h5"):
        with pytest.raises(SceneError) as caught:
            cross_sections(str(written(tmp_path, table, ending)), "scene.objects.cross_sections")
        text = str(caught.value)
        assert text.startswith("scene.objects.cross_sections (")
        assert says in text
        assert text.endswith(".")


def test_damaged_files(tmp_path):
    (tmp_path / "a.h5").write_text("no HDF5")
    (tmp_path / "b.csv").write_text("")
    for name in ("a.h5", "b.csv"):
        with pytest.raises(SceneError, match=r"key \(.*\) cannot be read as"):
            cross_sections(str(tmp_path / name), "key")
    with pytest.raises(ConfigError, match=r"key: the file .*none.csv does not exist"):
        cross_sections(str(tmp_path / "none.csv"), "key")


def test_tables_are_in_the_scenes_file_and_in_its_identity(tmp_path):
    tables = cross_sections(str(written(tmp_path, rows())), "key")
    one = np.zeros(1)
    some = Objects(one, one, one, one, one, one, one + np.nan, np.zeros(1, np.int16), tables=tables)
    scene = Scene("flat", ("ground",), np.ones((8, 8), np.uint8), np.zeros((8, 8)), 1.0, objects=some)
    scene.write(tmp_path / "scene.h5")
    found = Scene.read(tmp_path / "scene.h5").objects
    assert found.identity == some.identity
    assert found.classes == ("corner", "plate")
    first = next(iter(tables))
    moved = tables | {first: replace(tables[first], dbsm=tables[first].dbsm + 1.0)}
    assert replace(some, tables=moved).identity != some.identity


def test_the_file_is_an_input_of_the_case(tmp_path):
    (tmp_path / "objects.csv").write_text("x_m,y_m,height_m,aspect\n10,20,1,corner\n")
    table = written(tmp_path, rows())
    objects = {"path": str(tmp_path / "objects.csv"), "cross_sections": str(table)}
    case = case_from({"scene": {"source": "builtin", "objects": objects}})
    assert input_files(case)["scene.objects.cross_sections"] == table
