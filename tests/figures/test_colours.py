"""Colours of materials: configured, usual for the name, else in the order of the palette."""

import json

import numpy as np
import pytest
from archives import configured
from skimage.color import rgb2lab

from radcal.figures.drawing import FILLS, colour_of, colours_of, head, material_colours, new_canvas
from radcal.tables.landcover import landcovers


def lab(colours):
    """CIELAB of sRGB colours."""
    return rgb2lab(np.array([[int(one[k : k + 2], 16) for k in (1, 3, 5)] for one in colours])[None] / 255.0)[0]


def deuteranopic(colour):
    """Linear RGB as a reader without green cones sees it (Vienot, Brettel and Mollon 1999)."""
    values = np.array([int(colour[k : k + 2], 16) / 255.0 for k in (1, 3, 5)]) ** 2.2
    both = 0.292750 * values[0] + 0.707250 * values[1]
    return np.clip([both, both, -0.022336 * values[0] + 0.022336 * values[1] + values[2]], 0.0, 1.0)


def test_unknown_names_keep_the_order_of_the_palette():
    names = [f"material {k}" for k in range(35)]
    assert material_colours(names) == [*FILLS, *FILLS[:3]]


def test_colours_of_the_palette_differ():
    """By more than 12 in CIELAB (CIE 1976), where 2.3 is just noticeable; white is no material, black an object."""
    found = lab([*FILLS, "#FFFFFF", "#000000"])
    apart = np.linalg.norm(found[:, None] - found, axis=2)[np.triu_indices(len(found), 1)]
    assert apart.min() > 12.0


def test_names_have_their_usual_colours():
    found = dict(zip(names := ["dyke", "water", "Mixed forest", "dike", "crops"], material_colours(names), strict=True))
    assert found["dyke"] == FILLS[0]
    assert found["dike"] == FILLS[3]
    red, green, blue = (int(found["water"][k : k + 2], 16) for k in (1, 3, 5))
    assert blue > green > red
    red, green, blue = (int(found["Mixed forest"][k : k + 2], 16) for k in (1, 3, 5))
    assert green > max(red, blue)


def test_words_count_and_not_parts_of_them():
    assert material_colours(["waterproof"]) == [FILLS[0]]
    assert material_colours(["permanent_water_bodies"]) == material_colours(["water"])
    # a wetland is no water, and woody wetlands are no forest
    assert material_colours(["woody_wetlands"]) == material_colours(["salt marsh"])


def test_configured_colours_come_first_and_are_no_one_elses():
    water = material_colours(["water"])[0]
    found = material_colours(["lake", "water", "a"], {"a": water, "water": "#010203"})
    assert found[1:] == ["#010203", water]
    assert found[0] not in found[1:]
    # a colour of the palette that is taken is passed over
    assert material_colours(["a", "b"], {"b": FILLS[0]}) == [FILLS[1], FILLS[0]]


@pytest.mark.parametrize("landcover", landcovers())
def test_covers_of_a_map_have_colours_of_their_own(landcover):
    names = [cover.name for cover in landcovers()[landcover].values()][: len(FILLS)]
    found = material_colours(names)
    assert len(set(found)) == len(found)


def test_kinds_of_ground_differ_for_colour_blind_readers():
    kinds = ["wetland", "water", "snow", "urban", "road", "forest", "shrub", "grass", "crops", "bare soil"]
    colours = material_colours(kinds)
    assert len(set(colours)) == 10
    light = lab(colours)[:, 0]
    seen = [deuteranopic(colour) ** (1 / 2.2) for colour in colours]
    for k in range(10):
        for n in range(k):
            apart = 255.0 * float(np.linalg.norm(seen[k] - seen[n]))
            assert apart > 25.0 or abs(light[k] - light[n]) > 8.0, (kinds[k], kinds[n], apart)


def test_archives_say_the_configured_colours(made, tmp_path):
    archive = made.archive
    assert colours_of(archive) == material_colours(archive.names)
    materials = json.loads(archive.config)["materials"]
    name = archive.names[1]
    materials[name]["colour"] = "#123456"
    changed = configured(archive, materials=materials)
    assert colour_of(changed, name) == "#123456"
    canvas = new_canvas(4, 3)
    axes = canvas.subplots()
    head(axes, changed, name, "a remark")
    (square,) = axes.patches
    assert np.array(square.get_facecolor()[:3]) * 255 == pytest.approx([0x12, 0x34, 0x56])
    assert name in axes.get_title("left") + axes.get_title()
