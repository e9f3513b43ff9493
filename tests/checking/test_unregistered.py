"""Images before registration, made by the simulator from laws that differ from those of the case."""

import numpy as np
import pytest
from assessment_samples import made_cells
from scipy.ndimage import gaussian_filter

from radcal.checking.outlook import cells_of, fixed_laws, start_image, unreachable
from radcal.image.model import Measurement
from radcal.radar.projection import make_geometry
from radcal.radar.radiometry import with_noise_db
from radcal.simulators.builtin import BuiltinSimulator

DYKE, GRASS, CROPS = [-21.0, 9.0, 6.0, 4.0], [-26.0, 10.0, 9.0, 3.0], [-19.0, 7.0, 3.0, 2.0]


@pytest.fixture(scope="module")
def ground(build_scene):
    """Hills with slopes of 6 degrees (sd), in fields of 25 to 40 cells."""
    rough = gaussian_filter(np.random.default_rng(5).standard_normal((120, 130)), 4, mode="wrap")
    rough *= np.tan(np.radians(6.0)) * 5.0 / np.gradient(rough)[1].std()
    row, column = np.add.outer(np.arange(120), np.arange(130) // 9), np.add.outer(np.arange(120) // 11, np.arange(130))
    fields = (row // 32 + column // 27) % 3 + 1
    return build_scene(lambda *_: rough, cells=(120, 130), names=("dyke", "grass", "crops"), material=fields)


@pytest.fixture
def start(build_case):
    def made(bounds=((-40, 0), (0, 30), (0, 20), (0, 20)), **more):
        fixed = {"grass": {"parameters": GRASS}, "crops": {"parameters": CROPS}}
        dyke = {"calibrate": True, "bounds": bounds, "start": [x + 0.3 * (y - x) for x, y in bounds]}
        radar = {"altitude_m": 2000.0, "nesz_db": -32.0, "radiometry": "sigma0_local", "looks": 6}
        brief = {"walkers": 32, "steps": 100}
        sections = {"registration": {"method": "none"}, "radar": radar, "uncertainty": brief}
        return build_case(materials={"dyke": dyke, **fixed}, **sections | more)

    return made


def measured(case, scene, errors_db, **radar):
    """Geometry of the case, and image of six looks of its laws with other levels, or in another radiometry."""
    flown = case.radar.model_copy(update=radar)
    x = {
        name: [at[0] + errors_db.get(name, 0.0), *at[1:]]
        for name, at in {"dyke": DYKE, "grass": GRASS, "crops": CROPS}.items()
    }
    image = BuiltinSimulator(make_geometry(scene, flown), flown, case.laws).run(x, 7)
    return make_geometry(scene, case.radar), Measurement(image, "a.tif")


def found(case, scene, errors_db, **radar):
    geometry, image = measured(case, scene, errors_db, **radar)
    return fixed_laws(case, [cells_of(case, geometry, image, scene)])


def test_levels_of_fixed_laws_are_found_to_a_tenth_of_a_db(start, ground):
    case = start()
    findings = found(case, ground, {"grass": 0.8, "crops": -0.5})
    levels = {one.about: one.numbers for one in findings if one.code == "fixed_level"}
    for name, level in (("grass", 0.8), ("crops", -0.5)):
        numbers = levels[name]
        assert numbers["apart_db"] == pytest.approx(level, abs=0.12)
        assert numbers["p05_db"] < level < numbers["p95_db"]
        assert numbers["p95_db"] - numbers["p05_db"] < 1.0
    assert {one.severity for one in findings if one.code != "level"} == {"note"}
    geometry, image = measured(case, ground, {})
    assert cells_of(start(target={"normalisation": "image"}), geometry, image, ground) == {}


def test_another_radiometry_is_found_before_any_run(start, ground):
    findings = found(start(), ground, {}, radiometry="sigma0_ref")
    (one,) = (one for one in findings if one.severity == "refusal")
    assert (one.code, one.do) == ("radiometry", "radar.radiometry: sigma0_ref")


def test_one_fixed_law_far_from_the_image_is_a_warning(start, ground):
    """A law's error of 1 dB and the level's of 0.33 dB explain 1.73 dB and a little more."""
    for level, severity in ((1.3, "note"), (2.2, "warning")):
        case = start(target={"pixels": 500, "reference_materials": ["crops"]})
        first, *others = found(case, ground, {"crops": level})
        assert (first.code, first.about, first.severity) == ("fixed_level", "crops", severity)
        assert first.numbers["apart_db"] == pytest.approx(level, abs=0.12)
        assert [one.code for one in others] == ["radiometry_unchecked"]
        said, *_ = found(_offset(case), ground, {"crops": level})
        assert said.severity == "note"  # a level that is removed may be any


def test_bounds_that_reach_no_measured_level_are_refused(start, ground):
    """The dyke's law has a mean of -14.1 dB; the bounds end 3.5 dB, or 2.5 dB, below, and start in the noise."""
    for highest, count in ((-17.6, 1), (-16.6, 0)):
        case = start([[-60.0, highest], [0.0, 0.1], [0.0, 0.1], [0.0, 20.0]])
        errors = unreachable(case, *measured(case, ground, {}))
        assert len(errors) == count
        # where a level is removed, it is not known yet
        assert unreachable(_offset(case), *measured(case, ground, {})) == []
        if errors:
            said = str(errors[0])
    assert said.startswith("materials.dyke.bounds: inside them the law 'mangia' gives -60.0 to -17.4 dB at the inciden")
    assert "and the measured level is -14." in said


def _offset(case):
    return case.model_copy(update={"target": case.target.model_copy(update={"normalisation": "offset"})})


def test_before_registration_the_margin_to_other_ground_is_wider(start, ground):
    """An image that is moved by 3 pixels puts brighter ground at the edges of each field of grass."""

    def moved(image_db):
        return np.roll(image_db, (3, -3), axis=(0, 1))

    levels, pixels = [], []
    for method in ("none", "gefolki"):
        case = start(registration={"method": method})
        geometry, image = measured(case, ground, {})
        cells = cells_of(case, geometry, Measurement(moved(image.image_db), "a.tif"), ground)
        pixels.append(int(cells["grass"].pixels.sum()))
        above = cells["grass"].measured_db - cells["grass"].beside_db
        law = case.laws["grass"](np.radians(cells["grass"].incidence_deg), GRASS)
        law = with_noise_db(law, cells["grass"].noise_db)
        levels.append(float(np.average(above - law, weights=cells["grass"].pixels)))
    assert pixels[1] < 0.9 * pixels[0]
    assert levels[0] > 0.25
    assert abs(levels[1]) < 0.15


def test_the_start_image_is_that_of_the_starting_laws(start, ground):
    """Level of a fixed law with noise, in the middle of its fields."""
    case = start()
    geometry = make_geometry(ground, case.radar)
    image = start_image(case, geometry)
    inside = geometry.pixels("grass", 8)
    law = case.laws["grass"](np.radians(geometry.incidence_deg.ravel()[inside].astype(float)), GRASS)
    expected = 10.0 ** (law / 10.0) + 10.0 ** (-3.2)
    power = 10.0 ** (image.ravel()[inside].astype(float) / 10.0)
    assert 10.0 * np.log10(power.mean() / expected.mean()) == pytest.approx(0.0, abs=0.1)


def test_the_interval_of_a_level_is_that_of_its_fields_and_speckle(build_case):
    """Two fields of three cells and one cell; a law of 2 dB at all angles and noise of the same power."""
    cells = made_cells(
        [5.3, 6.1, 5.8, 9.4], [30.0, 34.0, 37.0, 31.0], beside_db=np.array([0.4, 0.0, -0.3, 0.9]),
        noise_db=np.full(4, 2.0), share=np.full(4, 0.5), variance=np.array([0.04, 0.03, 0.01, 0.09]),
        pixels=np.array([100, 300, 200, 400]), patch=np.array([1, 1, 1, 4]),
    )  # fmt: skip
    materials = {"dyke": {"calibrate": True}, "grass": {"parameters": [2.0, 0.0, 0.0, 1.0]}}
    levels = {}
    for law_db in (1.2, 0.3):
        budget = {"fixed_law_db": law_db, "level_db": 0.2, "field_db": 0.7, "walkers": 32, "steps": 100}
        case = build_case(materials=materials, uncertainty=budget)
        levels[law_db] = next(one for one in fixed_laws(case, [{"grass": cells}]) if one.code == "fixed_level")
    share = np.array([0.1, 0.3, 0.2, 0.4])
    apart = share @ (np.array([4.9, 6.1, 6.1, 8.5]) - 2.0 - 10.0 * np.log10(2.0))
    error = np.sqrt(share**2 @ cells.variance + 0.7**2 * (0.6**2 + 0.4**2))
    numbers = levels[1.2].numbers
    assert numbers["apart_db"] == pytest.approx(apart)
    assert numbers["p95_db"] - apart == pytest.approx(1.645 * error, rel=1e-3) == apart - numbers["p05_db"]
    # 1.93 dB are within 1.645 standard errors of 1.32 dB, and not of 0.63 dB
    assert apart == pytest.approx(1.93, abs=0.01)
    assert [levels[law_db].severity for law_db in (1.2, 0.3)] == ["note", "warning"]
