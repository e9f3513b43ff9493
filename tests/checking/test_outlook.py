"""What a right case will meet, on small scenes."""

from dataclasses import replace

import numpy as np
import pytest
from config_samples import COMMAND, measured

from radcal.checking.outlook import bright_laws, hidden_ground, high_noise, outlook
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
        for method in ("ilk", "none"):
            case = build_case(materials=materials, registration={"method": method})
            geometry = make_geometry(scene, case.radar)
            angle = np.where(geometry.material > 0, geometry.incidence_deg, np.nan).astype(np.float32)
            found = outlook(case, replace(geometry, incidence_deg=angle), None)
            dull = [(one.severity, one.about) for one in found if one.code == "no_contrast"]
            assert dull == [("warning", "dyke")] * (told and method == "ilk")


def of_level(case):
    """Half-width that the level alone gives [dB], if it is told."""
    # without registration and image, the geometry is not used
    found = outlook(case, None, None)
    return [float(one.numbers["half_width_db"]) for one in found if one.code == "level_counted"]


def test_the_error_of_the_level_is_told_where_no_level_is_removed(build_case):
    materials = {"dyke": {"calibrate": True, "start": LEVEL}, "grass": {"parameters": LEVEL}}
    keys = {"materials": materials, "objective": "density", "registration": {"method": "none"}}
    keys |= measured(radiometry="sigma0_local")
    keys["radar"] = {"heading_deg": 0, "radiometry": "sigma0_local"}
    for normalisation, told in (("none", True), ("offset", False), ("image", False)):
        case = build_case(**keys, target={"normalisation": normalisation})
        assert of_level(case) == [pytest.approx(1.645 * 0.33, rel=1e-3)] * told
    # an external law has no sigma0 of which a band could be known
    law = {"calibrate": True, "law": "external", "names": ["mv"], "bounds": [[0, 1]]}
    external = build_case(**keys | {"materials": {"dyke": law}, "simulator": COMMAND})
    assert of_level(external) == []
    both = build_case(**keys | {"materials": {"dyke": law, "grass": materials["dyke"]}, "simulator": COMMAND})
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
def test_heights_in_another_unit_are_told(build_scene, build_case, factor, steep, units):
    """Hills of 18 m on 250 m of ground, with slopes of up to 24 degrees, multiplied by a factor."""
    scene = build_scene(lambda east, _: factor * 18.0 * np.sin(np.pi * east / 125.0), cells=(20, 50))
    radar = build_case(radar={"altitude_m": 9000.0}).radar
    found = hidden_ground(scene, make_geometry(scene, radar))
    assert [(one.code, round(float(one.numbers["slope_deg"])), one.numbers["units"]) for one in found] == [
        ("ground_hidden", steep, units)
    ] * bool(units)


@pytest.mark.parametrize(
    ("noise", "synthetic", "high"),
    [
        (24, {}, {"radar.nesz_db": 24.0}),
        ([[20, -3], [40, 3]], {}, {"radar.nesz_db": 3.0}),
        (0, {"nesz_db": 25.5}, {"measurement.synthetic.nesz_db": 25.5}),
        (0, {"nesz_db": -1.0}, {}),
    ],
)
def test_noise_above_0_db_is_asked_about(build_case, noise, synthetic, high):
    case = build_case(radar={"nesz_db": noise}, measurement={"synthetic": synthetic})
    assert {one.about: one.numbers["level_db"] for one in high_noise([case])} == high
    quiet = build_case(radar={"nesz_db": -24})
    assert [one.numbers["pass"] for one in high_noise([quiet, case])] == [2] * len(high)


@pytest.mark.parametrize(
    ("law", "parameters", "gamma_db"),
    [
        ("constant_gamma", [17.0], 17.0),
        ("constant_gamma", [6.1], 6.1),
        ("constant_gamma", [5.9], None),
        # sigma0 of 3 + 8 cos(45 degrees) = 8.66 dB
        ("mangia", [3.0, 8.0, 0.0, 4.0], 10.2),
    ],
)
def test_a_fixed_law_without_its_minus_sign_is_asked_about(build_case, law, parameters, gamma_db):
    """A case whose calibrated material starts as bright has other units."""

    def asked(bounds):
        dyke = {"calibrate": True, "bounds": bounds}
        return bright_laws(build_case(materials={"dyke": dyke, "lake": {"law": law, "parameters": parameters}}))

    found = asked([[-40, 0], [0, 30], [0, 20], [0, 20]])
    assert [one.numbers["gamma_db"] for one in found] == [pytest.approx(gamma_db, abs=0.05)] * (gamma_db is not None)
    assert all((one.severity, one.about) == ("warning", "materials.lake.parameters") for one in found)
    assert asked([[-40, 60], [0, 30], [0, 20], [0, 20]]) == []
