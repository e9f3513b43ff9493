"""Names of material ids."""

import json
from pathlib import Path

import pytest

from radcal.errors import SceneError
from radcal.scene.names import by_id, landcover_names, read_names


def test_ids_without_a_name_keep_their_place(tmp_path):
    assert by_id({4: "dyke", 1: "grass"}) == ("grass", "id 2", "id 3", "dyke")
    path = tmp_path / "names.json"
    path.write_text('{"0": "none", "1": "grass", "255": "dyke"}')
    assert read_names(path, [0, 255], Path("ids.tif")) == {1: "grass", 255: "dyke"}


@pytest.mark.parametrize(
    ("names", "said"),
    [
        ({"1": "grass", "3": "grass"}, "gives the name 'grass' to more than one material id"),
        ({"1": "grass", "7": "dyke"}, "has no name for material id 3 of ids.tif"),
        ({"0": "nothing"}, "names no material"),
        ({"one": "grass"}, "is not a JSON object of id and name"),
        ({"1": "grass", "256": "dyke"}, "names the material id 256, expected 1 to 255"),
        ({"-1": "dyke"}, "names the material id -1, expected 1 to 255"),
        ({"1": "grass" * 200_000}, "has 1000009 bytes, expected at most 1000000"),
    ],
)
def test_wrong_names(tmp_path, names, said):
    path = tmp_path / "names.json"
    path.write_text(json.dumps(names))
    with pytest.raises(SceneError, match=rf"^scene\.names: .*names\.json {said}"):
        read_names(path, [0, 1, 3, 9], Path("ids.tif"))


@pytest.mark.parametrize("text", ["not json", "3", '{"1": ' + "[" * 100_000 + "]" * 100_000 + "}"], ids=len)
def test_a_file_of_no_names_is_refused(tmp_path, text):
    path = tmp_path / "names.json"
    path.write_text(text)
    with pytest.raises(SceneError, match=r"^scene\.names: .*names\.json is not a JSON object of id and name"):
        read_names(path, [1], Path("ids.tif"))


def test_names_of_a_land_cover_map(tmp_path):
    raster = tmp_path / "cover.tif"
    assert landcover_names("esa_worldcover", None, [0, 80, 10], raster) == {
        10: "tree_cover",
        80: "permanent_water_bodies",
    }
    assert landcover_names("corine", None, [44, 12], raster) == {12: "non-irrigated_arable_land", 44: "sea_and_ocean"}
    own = tmp_path / "names.json"
    own.write_text('{"80": "lake", "17": "orchard"}')
    assert landcover_names("esa_worldcover", own, [10, 17, 80], raster) == {10: "tree_cover", 17: "orchard", 80: "lake"}
    with pytest.raises(SceneError, match=r"scene\.landcover is nlcd, which has no code 17 of .*cover\.tif: name it in"):
        landcover_names("nlcd", None, [17, 11], raster)
    own.write_text('{"80": "tree_cover"}')
    with pytest.raises(SceneError, match="more than one code of .* has the name 'tree_cover'"):
        landcover_names("esa_worldcover", own, [10, 80], raster)
