"""Runs that another process makes meanwhile, and what a record keeps."""

import contextlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from runner_samples import Counting, X
from scipy.special import polygamma

from radcal.config import load
from radcal.errors import ConfigError
from radcal.radar import SIMULATOR_VERSION
from radcal.scene.sources import make_scene
from radcal.seeds import noise_seed
from radcal.simulators import runner as module
from radcal.simulators.runner import Runner
from radcal.simulators.runner import textured as pixels_with_texture
from radcal.speckle.texture import texture_order
from radcal.storage.files import digest
from radcal.storage.runs import RunStore


class Builtin(Counting):
    @property
    def identity(self):
        return {"kind": "builtin", "version": SIMULATOR_VERSION}


def keys_of(case, scene, geometry, folder):
    """Keys of the reference run with the random numbers of the search and with others."""
    runner = Runner(RunStore(folder), Builtin(geometry.shape), geometry, scene.identity, case)
    return [digest(runner.description(case.start_parameters, noise_seed(case, fresh))) for fresh in (False, True)]


def test_runs_of_the_default_case_keep_their_keys(tmp_path, geometry):
    case = load([Path(__file__).parents[2] / "config" / "config.yaml"])
    scene = make_scene(case.scene, list(case.materials))
    assert keys_of(case, scene, geometry, tmp_path) == ["e91b09b2e2d173ad7909", "9a165fef32249ff5418e"]


@pytest.mark.parametrize("name", ["dyke_published", "paper", "paper_small"])
def test_runs_of_the_published_dyke_keep_their_keys(tmp_path, geometry, name):
    """Scene, pass and laws written out in full: no default changes the keys of the runs that stand behind figures."""
    case = load([Path(__file__).parents[2] / "config" / f"{name}.yaml"])
    scene = make_scene(case.scene, list(case.materials))
    assert keys_of(case, scene, geometry, tmp_path) == ["9a111f839eed409c2869", "b9921bb5d6ffdea09b39"]
    assert case.measurement.synthetic.disturbed == ()
    assert case.measurement.synthetic.parameters == {"dyke": [6.1, 14.2, 21.5, 3.3]}


def test_the_pass_of_an_orbit_has_the_earths_radius(tmp_path, geometry, build_case):
    """The radius depends on the latitude of the scene, of which nothing else in a run's key knows."""
    orbit = {"altitude_m": 7e5, "incidence_deg": 33.0}
    keys = set()
    for radius in (6.36e6, 6.37e6, None):
        one = replace(geometry, earth_radius_m=radius)
        case = build_case(radar=orbit) if radius else build_case()
        found = Runner(RunStore(tmp_path), Counting(geometry.shape), one, "scene", case).description(X, 1)
        assert found["pass"].get("earth_radius_m") == radius
        assert ("earth" in found["pass"], "incidence_deg" in found["pass"]) == (bool(radius), bool(radius))
        keys.add(digest(found))
    assert len(keys) == 3


def test_a_run_that_another_process_makes_meanwhile_is_taken(tmp_path, geometry, case, monkeypatch):
    """The claim is granted once the other process has written its record: nothing is left to simulate."""
    own, others = Counting(geometry.shape), Counting(geometry.shape)
    claimed = module.claimed

    @contextlib.contextmanager
    def granted_later(folder, key):
        with monkeypatch.context() as other_process:
            other_process.setattr(module, "claimed", claimed)
            Runner(RunStore(folder), others, geometry, "scene", case).run(X, 7)
        with claimed(folder, key):
            yield

    monkeypatch.setattr(module, "claimed", granted_later)
    found = Runner(RunStore(tmp_path), own, geometry, "scene", case).run(X, 7)
    assert (own.calls, others.calls) == (0, 1)
    np.testing.assert_array_equal(found.pixels_db["dyke"], own.run(X, 7).ravel()[geometry.pixels("dyke")])


def test_a_simulator_of_intensity_gives_no_complex_looks(tmp_path, geometry, case):
    runner = Runner(RunStore(tmp_path), Counting(geometry.shape), geometry, "scene", case)
    with pytest.raises(ConfigError, match=r"the product complex is not one of simulator\.kind: counting"):
        runner.require_looks("complex")


@pytest.mark.parametrize(("asked", "keeps"), [(False, False), (True, False), (False, True), (True, True)])
def test_whole_images_are_kept_where_asked_for_or_configured(tmp_path, geometry, build_case, asked, keeps):
    case = build_case(simulator={"keep_images": keeps})
    store = RunStore(tmp_path)
    key = Runner(store, Counting(geometry.shape), geometry, "scene", case).run(X, 7, image=asked).key
    assert (store.get(key, ["dyke"]).image_db is not None) is (asked or keeps)


def test_texture_of_a_fixed_material_changes_its_pixels_and_the_key_alone(tmp_path, geometry, case):
    def runner(name, looks, further=None):
        grass = case.materials["grass"].model_copy(update={"looks": looks})
        one = case.model_copy(update={"materials": {**case.materials, "grass": grass}})
        return Runner(RunStore(tmp_path / name), Counting(geometry.shape), geometry, "scene", one, first=further)

    plain, none, textured = (runner(name, looks) for name, looks in (("a", None), ("b", 50.0), ("c", 0.8)))
    images = [one.run(X, 7, image=True) for one in (plain, none, textured, runner("d", 0.8))]
    values = [record.image_db for record in images]
    assert all(value is not None for value in values)
    np.testing.assert_array_equal(values[0], values[1])  # more looks than the image's need no texture
    np.testing.assert_array_equal(values[2], values[3])
    difference = np.subtract(values[2], values[0])
    pixels = geometry.pixels("grass")
    assert np.count_nonzero(difference) == np.count_nonzero(difference.ravel()[pixels])
    # variance of the logarithm: trigamma(0.8) - trigamma(looks of the image), in dB^2
    expected = (10 / np.log(10)) ** 2 * (polygamma(1, 0.8) - polygamma(1, case.radar.looks))
    assert np.var(difference.ravel()[pixels]) == pytest.approx(expected, rel=0.15)
    assert len({record.key for record in images[:3]}) == 3
    assert images[2].key == images[3].key
    # of another pass, whose looks the key does not state
    assert runner("e", 0.8, case.radar.model_copy(update={"looks": 9})).run(X, 7).key != images[2].key
    # the random numbers are those with which runs are scored: the same for every seed but that of the final check
    for seed, fresh in ((7, False), (8, False), (noise_seed(case, fresh=True), True)):
        before, after = (one.run(X, seed, image=True).image_db.ravel()[pixels] for one in (plain, textured))
        order = texture_order(case.radar.looks, 0.8)
        np.testing.assert_array_equal(after, pixels_with_texture(before, order, case.seed, "grass", fresh))
