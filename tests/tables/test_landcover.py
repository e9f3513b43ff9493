"""Starting laws and names of land-cover maps."""

import numpy as np
import pytest
from config_samples import mapped, measured

from radcal.config import case_from
from radcal.errors import ConfigError
from radcal.laws import law_for
from radcal.tables.landcover import landcovers, starting_keys, starting_levels


def case(materials, landcover="esa_worldcover", **keys):
    scene = mapped(names=None, landcover=landcover, **keys)
    return case_from({**scene, **measured(path="c.tif"), "materials": materials})


def test_names_give_laws():
    found = case({"tree_cover": {}, "cropland": {"calibrate": True}}).materials
    assert (found["tree_cover"].law, found["tree_cover"].parameters) == ("constant_gamma", [-15.0])
    crops = found["cropland"]
    assert crops.law == "mangia"
    assert crops.box == [(-45.0, 0.0), (0.0, 16.0), (0.0, 22.0), (0.0, 12.0)]
    start = law_for("mangia")
    angles = np.radians(np.linspace(20.0, 60.0, 9))
    expected = -15.0 + 10.0 * np.log10(np.cos(angles))
    np.testing.assert_allclose(start(angles, crops.start_parameters), expected, atol=0.2)


def test_every_value_can_be_overridden():
    found = case(
        {
            "tree_cover": {"parameters": [-20.0, 6.0, 3.0, 2.0]},
            "built_up": {"law": "constant_gamma", "parameters": [-2.5]},
            "cropland": {"calibrate": True, "bounds": [[-40, -10], [0, 9], [0, 8], [0, 7]]},
            "grassland": {"calibrate": True, "start": [-22.0, 5.0, 3.0, 2.0]},
            "bare_sparse_vegetation": {"calibrate": True, "law": "constant_gamma", "bounds": [[-30, 0]]},
        }
    ).materials
    assert (found["tree_cover"].law, found["tree_cover"].parameters) == ("mangia", [-20.0, 6.0, 3.0, 2.0])
    assert found["built_up"].parameters == [-2.5]
    assert found["cropland"].start_parameters == [-25.0, 4.5, 4.0, 3.5]
    assert found["grassland"].start_parameters == [-22.0, 5.0, 3.0, 2.0]
    assert found["grassland"].box[0] == (-45.0, 0.0)
    assert found["bare_sparse_vegetation"].box == [(-30.0, 0.0)]


def test_other_names_and_maps_give_nothing():
    assert starting_keys("esa_worldcover", "dyke", {}) == {}
    assert starting_keys("nlcd", "tree_cover", {}) == {}
    with pytest.raises(ConfigError, match=r"materials\.dyke: a material that is not calibrated needs parameters"):
        case({"dyke": {}, "cropland": {"calibrate": True}})
    with pytest.raises(ConfigError, match="scene.landcover is 'worldcover', expected 'esa_worldcover', 'corine'"):
        case({"cropland": {"calibrate": True}}, landcover="worldcover")
    with pytest.raises(ConfigError, match="names is missing, expected a file of names, or landcover"):
        case({"cropland": {"calibrate": True, "law": "mangia"}}, landcover=None)
    with pytest.raises(ConfigError, match=r"elevation and materials are the same file b\.tif, expected heights and"):
        case({"cropland": {"calibrate": True}}, elevation="b.tif")


@pytest.mark.parametrize("landcover", landcovers())
def test_all_classes_start_inside_of_their_bounds(landcover):
    names = [cover.name for cover in landcovers()[landcover].values()]
    assert len(set(names)) == len(names)
    fixed = case({**{name: {} for name in names}, names[0]: {"calibrate": True}}, landcover=landcover)
    assert set(fixed.materials) == set(names)
    case({name: {"calibrate": True} for name in names}, landcover=landcover)


def test_colours_are_no_part_of_what_determines_runs():
    plain = case({"cropland": {"calibrate": True}})
    coloured = case({"cropland": {"calibrate": True, "colour": "#12aB9f"}})
    assert coloured.colours == {"cropland": "#12aB9f"}
    assert coloured.sections("materials") == plain.sections("materials")
    assert "colours" not in plain.sections("materials", "colours")
    assert coloured.sections("colours") == {"colours": {"cropland": "#12aB9f"}}
    with pytest.raises(ConfigError, match="materials.cropland.colour is 'green', expected"):
        case({"cropland": {"calibrate": True, "colour": "green"}})
    with pytest.raises(ConfigError, match="colours: unknown key, expected a key colour"):
        case_from({"colours": {"dyke": "#000000"}})


def test_no_two_materials_of_a_new_case_start_at_one_level():
    found = starting_levels(
        ["tree_cover", "cropland", "code_7", "open water", "industrial_or_commercial_units"], [-18.0]
    )
    # woods and farmland have the same gamma of -15 dB, as has what nothing is known of
    assert {name: level.gamma_db for name, level in found.items()} == {
        "tree_cover": -15.0, "cropland": -12.0, "code_7": -9.0, "open water": -40.0,
        "industrial_or_commercial_units": 0.0,
    }  # fmt: skip
    assert str(found["cropland"]) == "gamma -12 dB of farmland, moved apart from another material"
    assert str(found["open water"]) == "gamma -40 dB of sea state 3"
    assert str(found["code_7"]).startswith("gamma -9 dB of no known kind")
    start = law_for("mangia")(np.radians([35.0]), found["cropland"].start)
    assert start[0] == pytest.approx(-12.0 + 10.0 * np.log10(np.cos(np.radians(35.0))), abs=0.2)
