"""What a right case will meet, on small scenes."""

from dataclasses import replace

import numpy as np
import pytest

from radcal.checking.outlook import hidden_ground, outlook, start_contrast
from radcal.radar.projection import make_geometry

LEVEL = [10.0, 14.0, 6.0, 4.0]


def test_pixels_without_ground_are_no_contrast(build_scene, build_case):
    """Ground 40 dB above the noise, of two materials that start alike, beside no ground."""
    material = np.ones((40, 40), dtype=np.uint8)
    material[20:] = 2
    material[:, :12] = 0
    scene = build_scene(lambda east, north: 0 * east, names=("dyke", "grass"), material=material)
    for start, told in ((LEVEL, True), ([0.0, *LEVEL[1:]], False)):
        materials = {"dyke": {"calibrate": True, "start": start}, "grass": {"parameters": LEVEL}}
        case = build_case(materials=materials, registration={"method": "ilk"})
        geometry = make_geometry(scene, case.radar)
        angle = np.where(geometry.material > 0, geometry.incidence_deg, np.nan).astype(np.float32)
        found = start_contrast(case, replace(geometry, incidence_deg=angle))
        assert [(one.code, one.severity) for one in found] == [("no_contrast", "warning")] * told


def of_level(case):
    """Half-width that the level alone gives [dB], if it is told."""
    # without registration and image, the geometry is not used
    found = outlook(case, None, None)
    return [float(one.numbers["half_width_db"]) for one in found if one.code == "level_counted"]


def test_the_error_of_the_level_is_told_where_no_level_is_removed(build_case):
    file = {"source": "file", "path": "a.tif", "scale": "db", "radiometry": "sigma0_local"}
    materials = {"dyke": {"calibrate": True, "start": LEVEL}, "grass": {"parameters": LEVEL}}
    keys = {"measurement": file, "materials": materials, "objective": "density", "registration": {"method": "none"}}
    keys["radar"] = {"heading_deg": 0, "radiometry": "sigma0_local"}
    for normalisation, told in (("none", True), ("offset", False), ("image", False)):
        case = build_case(**keys, target={"normalisation": normalisation})
        assert of_level(case) == [pytest.approx(1.645 * 0.33, rel=1e-3)] * told
    # an external law has no sigma0 of which a band could be known
    command = {"kind": "command", "command": ["sim"], "input": {}, "output": {"file": "i.npy", "scale": "db"}}
    law = {"calibrate": True, "law": "external", "names": ["mv"], "bounds": [[0, 1]]}
    external = build_case(**keys | {"materials": {"dyke": law}, "simulator": command})
    assert of_level(external) == []
    both = build_case(**keys | {"materials": {"dyke": law, "grass": materials["dyke"]}, "simulator": command})
    assert len(of_level(both)) == 1


@pytest.mark.parametrize(
    ("factor", "steep", "units"),
    [
        (1.0, None, ""),
        (3.281, 45, "feet or decimetres"),
        (10.0, 72, "decimetres or centimetres"),
        (100.0, 88, "centimetres"),
    ],
)
def test_heights_in_another_unit_are_told(
    build_scene,
    build_case,
    factor,
    steep,
    units,
):
    """Hills of 18 m on 250 m of ground, with slopes of up to 24 degrees, multiplied by a factor."""
    scene = build_scene(lambda east, _: factor * 18.0 * np.sin(np.pi * east / 125.0), cells=(20, 50))
    radar = build_case(radar={"altitude_m": 9000.0}).radar
    found = hidden_ground(scene, make_geometry(scene, radar))
    assert [(one.code, round(float(one.numbers["slope_deg"])), one.numbers["units"]) for one in found] == [
        ("ground_hidden", steep, units)
    ] * bool(units)
