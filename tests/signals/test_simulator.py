"""Runs of the simulator of focused images against images that are focused in one piece."""

import numpy as np
import pytest

from radcal.config import case_from
from radcal.config.stages import STAGES
from radcal.errors import ConfigError
from radcal.radar.radiometry import noise_floor_db
from radcal.signals import simulator as made_by
from radcal.signals.focus import focused
from radcal.signals.history import RawSignal
from radcal.signals.platform import collection
from radcal.signals.scatterers import scatterers
from radcal.simulators.runner import Runner, make_simulator
from radcal.storage.runs import RunStore

X = {"dyke": [-11.0], "grass": [-14.0]}
FOCUSED = {"kind": "builtin", "product": "focused"}


@pytest.fixture
def of(forward_of, with_point):
    """Simulator of the rough scene with a bright point, as a case configures it, and the pass."""

    def made(path, **radar):
        flown = forward_of(
            with_point(131.0, 92.3, 20.0, 4.0), simulator=FOCUSED, radar={"nesz_db": -20.0, "looks": 1, **radar}
        )
        return make_simulator(STAGES["reference_run"].of(flown.case), flown.geometry, path, flown.scene), flown

    return made


@pytest.mark.parametrize("looks", [1, 2])
def test_an_image_in_parts_is_that_of_all_echoes_together(of, tmp_path, looks):
    """Level, and the point, which stands in one of the two parts; the second run reads the unchanged part."""
    simulator, flown = of(tmp_path / "geometry.h5", looks=looks, nesz_db=-90.0)
    given = flown.case.materials["dyke"].model_copy(update={"start": X["dyke"]})
    case = flown.case.model_copy(update={"materials": {**flown.case.materials, "dyke": given}})
    one = collection(case, flown.scene)
    whole = focused(one, RawSignal(one, scatterers(case, flown.scene, 7, one.facet_m), 7)[:], flown)
    parts = np.array(list(simulator.looks(X, 7)))
    assert parts.shape == (looks, *flown.geometry.shape)
    assert np.abs(parts - whole).max() < 1e-4 * np.sqrt(np.mean(np.abs(whole) ** 2))
    image_db = simulator.run(X, 7)
    np.testing.assert_allclose(image_db, 10.0 * np.log10(np.mean(np.abs(parts) ** 2, axis=0)), rtol=1e-5)
    assert simulator.identity == {"kind": "builtin", "version": 3, "focused": 2}


def test_noise_is_that_of_the_pass_at_all_ranges(forward_of):
    radar = {"looks": 1, "nesz_db": [[44.0, -16.0], [46.0, -4.0]]}
    flown = forward_of(simulator=FOCUSED, radar=radar)
    simulator = make_simulator(STAGES["reference_run"].of(flown.case), flown.geometry, "", flown.scene)
    dark = {"dyke": [-90.0], "grass": [-90.0]}
    rows = np.mean([10.0 ** (simulator.run(dark, seed) / 10.0) for seed in range(12)], axis=(0, 2))
    floor = 10.0 ** (noise_floor_db(flown.case.radar, flown.geometry.flat_incidence_deg) / 10.0)
    assert floor[-1] > 3.0 * floor[0]
    for part in np.array_split(np.arange(rows.size), 4):
        assert 10.0 * np.log10(rows[part].mean() / floor[part].mean()) == pytest.approx(0.0, abs=0.15)


def test_what_does_not_change_is_focused_once_for_each_seed_and_fixed_law(of, tmp_path, monkeypatch):
    simulator, _ = of(tmp_path / "geometry.h5")
    noise = []
    monkeypatch.setattr(made_by, "focused", lambda one, *rest: noise.append(one.noise_m2) or focused(one, *rest))

    def kept_after(x, seed):
        noise.clear()
        image_db = simulator.run(x, seed)
        return sum(power > 0.0 for power in noise), len(noise), image_db

    first = kept_after(X, 7)
    again, other = kept_after(X, 7), kept_after({**X, "dyke": [-5.0]}, 7)
    assert [found[:2] for found in (first, again, other)] == [(1, 3), (0, 1), (0, 1)]
    np.testing.assert_array_equal(first[2], again[2])
    assert np.abs(first[2] - other[2]).max() > 5.0
    assert kept_after({**X, "grass": [-9.0]}, 7)[:2] == (1, 3)
    assert kept_after(X, 8)[:2] == (1, 3)
    parts = sorted((tmp_path / "focused").iterdir())
    assert len(parts) == 3
    for path in parts:
        path.write_bytes(path.read_bytes()[:-9])  # damaged, as by a full disk: made again
    np.testing.assert_array_equal(kept_after(X, 7)[2], first[2])


def test_a_run_has_a_key_of_its_own_and_the_fast_one_keeps_its_key(of, tmp_path):
    simulator, flown = of(tmp_path / "geometry.h5")
    descriptions = []
    for section in (FOCUSED, {"kind": "builtin"}):
        sections = {**flown.case.model_dump(mode="json"), "simulator": section}
        stage = STAGES["reference_run"].of(case_from(sections))
        made = make_simulator(stage, flown.geometry, "", flown.scene)
        runner = Runner(RunStore(tmp_path), made, flown.geometry, flown.scene.identity, stage)
        descriptions.append(runner.description(X, 5))
        assert ("product" in STAGES["reference_run"].params(case_from(sections))["simulator"]) == (section is FOCUSED)
    assert descriptions[0].pop("simulator") == dict(simulator.identity)
    assert descriptions[1].pop("simulator") == {"kind": "builtin", "version": 3}
    assert descriptions[0] == descriptions[1]


def test_the_same_speckle_falls_with_the_law(of):
    """A run of the dyke 6 dB darker, without noise, is 6 dB darker where there is the dyke alone."""
    simulator, flown = of("", nesz_db=-80.0)
    pixels = flown.geometry.pixels("dyke", 8)
    bright, dark = (simulator.run({**X, "dyke": [level]}, 3).ravel()[pixels] for level in (-8.0, -14.0))
    assert pixels.size > 300
    assert np.median(bright - dark) == pytest.approx(6.0, abs=0.05)


@pytest.mark.parametrize(
    ("radar", "sentence"),
    [
        ({"radiometry": "gamma0_rtc"}, r"radar\.radiometry is gamma0_rtc, expected sigma0_ref, beta0 or gamma0"),
        ({"incidence_deg": 35.0, "altitude_m": 5e5}, r"radar\.earth is curved, expected flat for raw signals"),
    ],
)
def test_a_radar_without_raw_signals_is_refused_before_the_first_run(of, radar, sentence):
    with pytest.raises(ConfigError, match=sentence):
        of("", **radar)
