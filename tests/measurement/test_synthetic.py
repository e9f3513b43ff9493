"""Synthetic measurements made by other settings than the runs'."""

from dataclasses import replace

import numpy as np
import pytest

from radcal.errors import ConfigError, MeasurementError
from radcal.measurement.sources import make_measurement
from radcal.measurement.synthetic import check_synthetic, relabelled, roughened, textured, varied
from radcal.radar.projection import make_geometry
from radcal.sections.measurement import Synthetic
from radcal.simulators.builtin import BuiltinSimulator

TRUTH = [6.1, 14.2, 21.5, 3.3]


@pytest.fixture(scope="module")
def make(geometry, scene, build_case):
    def made(**keys):
        hidden = {"parameters": {"dyke": TRUTH}} if "laws" not in keys else {"parameters": {}}
        case = build_case(measurement={"synthetic": {**hidden, "warp_px": 0, **keys}})
        return make_measurement(case, geometry, BuiltinSimulator(geometry, case.radar, case.laws), scene)

    return made


@pytest.fixture(scope="module")
def plain(make):
    return make()


def mean_db(measurement, pixels):
    return float(10 * np.log10(np.mean(10 ** (measurement.image_db.ravel()[pixels].astype(float) / 10))))


def correlation(measurement, axis, pixels):
    """Correlation of the power of neighbours."""
    power = 10 ** (measurement.image_db.astype(float) / 10)
    here = np.zeros(power.shape, bool)
    here.ravel()[pixels] = True
    both = here & np.roll(here, -1, axis)
    return float(np.corrcoef(power[both], np.roll(power, -1, axis)[both])[0, 1])


@pytest.mark.parametrize(
    "keys",
    [
        {"relief_m": 0.2},
        {"texture_db": 1.0},
        {"fields_db": {"dyke": 1.0}},
        {"wrong_labels": 0.05},
    ],
    ids=lambda keys: next(iter(keys)),
)
def test_a_mismatch_changes_the_image_and_not_its_grid(make, plain, keys):
    image = make(**keys)
    assert image.image_db.shape == plain.image_db.shape
    assert np.isfinite(image.image_db).all()
    assert not np.array_equal(image.image_db, plain.image_db)
    np.testing.assert_array_equal(make(**keys).image_db, image.image_db)


def test_looks_noise_and_resolution_are_those_of_the_measurement(make, plain, geometry):
    pixels = geometry.pixels("grass", 3)
    # log-variance of speckle: K^2 trigamma(2) is 12.2 dB^2, trigamma(4) 5.35 dB^2
    gained = np.var(make(looks=2).image_db.ravel()[pixels]) - np.var(plain.image_db.ravel()[pixels])
    assert gained == pytest.approx(12.16 - 5.35, rel=0.2)
    coarse = make(resolution_factor=1.5)
    assert correlation(coarse, 0, pixels) > 1.3 * correlation(plain, 0, pixels)
    assert correlation(coarse, 1, pixels) > 1.3 * correlation(plain, 1, pixels)
    level = 10 ** (mean_db(plain, pixels) / 10) + 10**2.0
    assert mean_db(make(nesz_db=20.0), pixels) == pytest.approx(10 * np.log10(level), abs=0.15)


def test_a_hidden_law_of_another_kind(make, plain, geometry):
    flat = {"law": "tabulated", "angles_deg": [10.0, 70.0], "parameters": [30.0, 30.0]}
    image = make(laws={"dyke": flat})
    assert mean_db(image, geometry.pixels("dyke", 3)) == pytest.approx(30.0, abs=0.2)
    assert mean_db(image, geometry.pixels("grass", 3)) == pytest.approx(
        mean_db(plain, geometry.pixels("grass", 3)), abs=0.01
    )
    # X of another law means nothing in the calibrated one
    assert (image.hidden, plain.hidden) == ({}, {"dyke": tuple(TRUTH)})


@pytest.mark.parametrize("length_m", [4.0, 12.0])
def test_relief_has_its_height_and_its_slope(build_scene, length_m):
    level = build_scene(lambda east, north: 0 * east + 7.0, cells=(80, 120))
    rough = roughened(level, 0.3, length_m, 5, np.random.default_rng(1))
    assert (rough.material.shape, rough.cell_m) == ((400, 600), 1.0)
    assert rough.elevation_m.mean() == pytest.approx(7.0, abs=1e-9)
    assert rough.elevation_m.std() == pytest.approx(0.3, rel=1e-9)
    for axis in (0, 1):
        slope = np.gradient(rough.elevation_m, 1.0, axis=axis).std()
        assert slope == pytest.approx(np.sqrt(2) * 0.3 / length_m, rel=0.12)  # central differences of 1 m smooth


def test_no_relief_on_divided_cells_is_the_same_ground(scene, radar, geometry):
    divided = roughened(scene, 0.0, 5.0, 3, np.random.default_rng(1))
    seen = make_geometry(divided, radar, onto=geometry)
    assert seen.shape == geometry.shape
    np.testing.assert_allclose(seen.flat_incidence_deg, geometry.flat_incidence_deg, atol=1e-6)
    np.testing.assert_allclose(seen.incidence_deg, geometry.incidence_deg, atol=0.05)
    np.testing.assert_array_equal(seen.material, geometry.material)


@pytest.mark.parametrize("share", [0.02, 0.1])
def test_wrong_labels_are_as_many_as_configured(scene, share):
    empty = scene.material.copy()
    empty[:3] = 0
    part = replace(scene, material=empty)
    wrong = relabelled(part, share, np.random.default_rng(2)).material
    assert wrong.dtype == np.uint8
    changed = wrong != empty
    assert changed.sum() == round(share * np.count_nonzero(empty))
    assert (wrong[:3] == 0).all()
    assert set(np.unique(wrong)) == {0, 1, 2}
    away = np.abs(np.arange(40) - 21.5) > 1  # columns that do not lie on the border between the two materials
    assert changed[:, away].any()
    assert changed[:, ~away].any()


def test_one_material_cannot_be_mislabelled(build_scene):
    alone = build_scene(lambda east, north: 0 * east)
    assert relabelled(alone, 0.2, np.random.default_rng(2)) is alone


def test_texture_has_its_spread_its_mean_and_its_length(build_scene, radar):
    flat = make_geometry(build_scene(lambda east, north: 0 * east, cells=(160, 160)), radar)
    weights = {
        length_m: textured(flat, radar, 1.7, length_m, np.random.default_rng(4)).facet_weight / flat.facet_weight
        for length_m in (5.0, 20.0)
    }
    first = flat.facet_start[flat.cell_start[:-1]]
    for length_m, weight in weights.items():
        image = weight[first].reshape(flat.shape)
        assert (10 * np.log10(image)).std() == pytest.approx(1.7, rel=0.12)
        assert image.mean() == pytest.approx(1.0, abs=0.08)
        # after one correlation length the correlation is exp(-1), in both directions on the ground
        for axis, pixel_m in ((0, radar.range_spacing_m * np.sqrt(2)), (1, radar.azimuth_spacing_m)):
            steps = round(length_m / pixel_m)
            a, b = np.delete(image, range(steps), axis), np.delete(image, range(-steps, 0), axis)
            expected = np.exp(-((steps * pixel_m / length_m) ** 2))
            assert np.corrcoef(a.ravel(), b.ravel())[0, 1] == pytest.approx(expected, abs=0.13)


def test_fields_have_levels_of_their_own(build_scene, radar):
    material = np.ones((160, 160), dtype=np.uint8)
    for east in range(0, 160, 8):
        material[:, east : east + 6] = 2
    material[50:53], material[110:113] = 1, 1  # three fields in each strip
    names = ("grass", "dyke")
    scene = build_scene(lambda east, north: 0 * east, cells=material.shape, names=names, material=material)
    flat = make_geometry(scene, radar)
    first, shown = flat.facet_start[flat.cell_start[:-1]], flat.material.ravel()
    calibrated = shown == 2
    for sd in (0.7, 1.4):
        weight = varied(flat, scene, {"dyke": sd}, 5).facet_weight
        gain_db = 10 * np.log10(weight[first] / flat.facet_weight[first])
        assert np.abs(gain_db[~calibrated]).max() == 0.0
        levels, count = np.unique(gain_db[calibrated].round(3), return_counts=True)
        assert 55 < len(levels[count > 20]) <= 60  # the radar does not see all
        assert levels[count > 20].std() == pytest.approx(sd, rel=0.15)
    assert not np.array_equal(varied(flat, scene, {"dyke": sd}, 6).facet_weight, weight)
    assert varied(flat, scene, {}, 5) is flat


def test_fields_keep_their_levels_on_ground_with_relief(make, plain, geometry):
    pixels, fields = geometry.pixels("dyke", 3), {"fields_db": {"dyke": 3.0}}
    change = mean_db(make(**fields), pixels) - mean_db(plain, pixels)
    assert abs(change) > 0.5
    relief = {"relief_m": 0.05, "relief_length_m": 8.0}
    rough = mean_db(make(**relief, **fields), pixels) - mean_db(make(**relief), pixels)
    assert rough == pytest.approx(change, abs=0.1)


def test_settings_that_no_image_can_have_are_refused_without_a_run(radar):
    check_synthetic(radar, Synthetic(warp_px=2.0, resolution_factor=1.3), (300, 260))
    with pytest.raises(MeasurementError, match=r"resolution_factor is 0\.4, which makes radar\.range_reso"):
        check_synthetic(radar, Synthetic(resolution_factor=0.4), (300, 260))
    with pytest.raises(MeasurementError, match=r"warp_px is 50: the displacement field folds"):
        check_synthetic(radar, Synthetic(warp_px=50.0), (220, 200))


def test_a_focused_image_has_the_level_of_the_simulator_and_speckle_of_its_own(build_scene, build_case):
    """Flat ground of two constant laws; laws, level and looks are those of the case, the displacement follows."""
    material = np.where(np.arange(40) < 20, 1, 2).astype(np.uint8) * np.ones((40, 1), dtype=np.uint8)
    flat = build_scene(lambda east, north: 0.0 * east, names=("dyke", "grass"), material=material)
    law = {"law": "constant_gamma", "parameters": [-14.0]}
    dyke = {"calibrate": True, "law": "constant_gamma", "bounds": [[-30, 0]], "start": [-20.0]}

    def made(**keys):
        hidden = {"synthetic": {"parameters": {"dyke": [-8.0]}, "warp_px": 0, "seed": 3, **keys}}
        radar = {"altitude_m": 1000.0, "nesz_db": -50.0, "looks": 2}
        case = build_case(radar=radar, materials={"dyke": dyke, "grass": law}, measurement=hidden)
        at = make_geometry(flat, case.radar)
        return at, make_measurement(case, at, BuiltinSimulator(at, case.radar, case.laws), flat)

    at, fast = made()
    _, found = made(product="focused", offset_db=0.5)
    for name, gamma in (("dyke", -8.0), ("grass", -14.0)):
        pixels = at.pixels(name, 3)
        sigma0 = gamma + 10.0 * np.log10(np.cos(np.radians(at.incidence_deg.ravel()[pixels]))).mean()
        # three pixels count as one
        error = 10.0 / np.log(10.0) * np.sqrt(3.4 / pixels.size / 2.0)
        assert mean_db(found, pixels) - 0.5 == pytest.approx(sigma0, abs=3.0 * error)
        assert 3.0 * error < 1.0
        both = np.corrcoef(fast.image_db.ravel()[pixels], found.image_db.ravel()[pixels])[0, 1]
        assert abs(both) < 3.0 * np.sqrt(3.4 / pixels.size)


def test_a_focused_image_needs_level_ground_and_no_gains_of_pixels(make, build_case):
    with pytest.raises(ConfigError, match=r"radar.radiometry is sigma0_local, expected sigma0_ref, beta0 or"):
        make(product="focused")
    for key, value in (("texture_db", 1.0), ("fields_db", {"dyke": 1.0})):
        hidden = {"synthetic": {"parameters": {"dyke": TRUTH}, "product": "focused", key: value}}
        with pytest.raises(ConfigError, match=rf"product: is focused, which has no {key}: leave that key out"):
            build_case(measurement=hidden)
