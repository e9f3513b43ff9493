"""Laws in classes of incidence, end to end on the built-in simulator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from radcal.calibration.class_surrogate import ClassSurrogate, Corrected
from radcal.calibration.expected import LawForward
from radcal.calibration.grounds import Method
from radcal.calibration.law_loop import calibrate_laws, target_ground
from radcal.config import case_from
from radcal.errors import ConfigError
from radcal.measurement.sources import make_measurement
from radcal.measurement.target import Targets, make_target
from radcal.radar.geometry import make_geometry
from radcal.radar.laws import LAWS
from radcal.radar.texture import texture_db, texture_order
from radcal.scene.model import Scene
from radcal.scene.slant_range import flat_incidence_deg
from radcal.simulators.builtin import BuiltinSimulator
from radcal.store import Runner, RunStore

TRUTH = {"field": [-30.0, 22.0, 6.0, 4.0], "lake": [-35.0, 12.0, 25.0, 6.0]}
BOUNDS = [[-60, 0], [0, 50], [0, 50], [0, 20]]


@pytest.fixture(scope="module")
def parts():
    material = np.ones((90, 110), dtype=np.uint8)
    material[:, 55:] = 2
    scene = Scene("tiny", ("field", "lake"), material, None, 1.0, flat_incidence_deg(20.0, 45.0, 90))
    case = case_from(
        {
            "scene": {
                "source": "slant_range",
                "labels": "-",
                "names": "-",
                "near_incidence_deg": 20,
                "far_incidence_deg": 45,
            },
            "materials": {name: {"calibrate": True, "bounds": BOUNDS} for name in TRUTH},
            "measurement": {"source": "synthetic", "synthetic": {"parameters": TRUTH}},
            "radar": {"looks": 4},
            "target": {"pixels": 2000},
            "design": {"size": 6},
            "surrogate": {"retrain_every": 100},
            "optimiser": {"population": 20, "evaluations": 200},
            "stop": {"max_runs": 20},
        }
    )
    geometry = make_geometry(scene, case.radar)
    simulator = BuiltinSimulator(geometry, case.radar, {name: m.law for name, m in case.materials.items()})
    measurement = make_measurement(case, geometry, simulator)
    # texture on one of them: fewer looks than the sensor has
    image = measurement.image_db.copy()
    lake = geometry.material == 2
    u = np.random.default_rng(1).random(int(lake.sum()))
    image[lake] += texture_db(u, texture_order(4.0, 2.5)).astype(np.float32)
    measurement = replace(measurement, image_db=image)
    targets = Targets({name: make_target(name, geometry, measurement, case.target, case.seed) for name in TRUTH})
    methods = {name: Method(LAWS["mangia"], BOUNDS, 4.0, classes=3) for name in TRUTH}
    return case, simulator, geometry, scene, targets, methods


@pytest.fixture(scope="module")
def calibrated(parts, tmp_path_factory):
    case, simulator, geometry, scene, targets, methods = parts
    runner = Runner(RunStore(tmp_path_factory.mktemp("runs")), simulator, geometry, scene.identity, case)
    return calibrate_laws(case, runner, targets, geometry, methods)


def test_it_settles_on_the_laws(calibrated):
    assert calibrated.reason == "settled"
    assert calibrated.runs <= 14
    phi = np.radians(np.linspace(21.5, 43.5, 40))
    for name, law in calibrated.laws.items():
        error = LAWS["mangia"](phi, law.fit.parameters) - LAWS["mangia"](phi, TRUTH[name])
        # a single patch says nothing of how its level differs from that of others, the slope is its own
        assert np.abs(error - error.mean()).max() < 0.6, name
        assert abs(error.mean()) < 1.0, name


def test_looks_are_those_of_each_material(calibrated):
    assert calibrated.laws["field"].fit.looks > 3.2
    assert calibrated.laws["lake"].fit.looks == pytest.approx(2.5, rel=0.15)


def test_the_last_proposal_is_what_its_run_says(calibrated):
    for steps in calibrated.steps.values():
        assert steps[0].moved_db == np.inf
        assert steps[-1].verified == pytest.approx(steps[-1].predicted, abs=0.1)
        assert steps[-1].moved_db < 0.05


def test_the_maximum_of_runs_ends_it(parts, tmp_path):
    case, simulator, geometry, scene, targets, methods = parts
    case = case.model_copy(update={"stop": case.stop.model_copy(update={"max_runs": 2})})
    runner = Runner(RunStore(tmp_path), simulator, geometry, scene.identity, case)
    found = calibrate_laws(case, runner, targets, geometry, methods)
    assert (found.reason, found.runs) == ("max_runs", 2)


def test_another_objective_is_a_sentence(parts):
    case, _, geometry, _, targets, methods = parts
    wrong = {**methods, "lake": replace(methods["lake"], objective="density")}
    with pytest.raises(ConfigError, match=r"materials\.lake: objective density .* expected the objective classes"):
        calibrate_laws(case, None, targets, geometry, wrong)


def test_a_targets_ground(parts):
    _, _, geometry, _, targets, _ = parts
    ground = target_ground("lake", targets["lake"], geometry)
    assert np.unique(ground.patch).tolist() == [1]
    assert np.unique(ground.block).tolist() == list(range(9))
    assert 0.0 < ground.independent <= 1.0


def test_the_class_surrogate_learns_classes():
    nodes = np.stack([np.linspace(20.0, 30.0, 12), np.linspace(30.0, 45.0, 12)])
    forward = LawForward(LAWS["mangia"], nodes, 4.0)
    x = np.random.default_rng(2).uniform(*np.array(BOUNDS).T, (30, 4))
    x = np.concatenate([x, x[:1]])  # a point twice
    surrogate = ClassSurrogate(BOUNDS, x, np.stack([forward(point) for point in x])).train([np.full((3, 4), 0.1)] * 2)
    assert surrogate.q2.shape == (2, 3)
    found, wanted = surrogate(np.array(TRUTH["field"])), forward(np.array(TRUTH["field"]))
    np.testing.assert_allclose(found[:, 0], wanted[:, 0], atol=0.5)
    np.testing.assert_allclose(np.sqrt(found[:, 1]), np.sqrt(wanted[:, 1]), rtol=0.15)


def test_a_difference_from_law_and_speckle_is_learnt_from_few_runs():
    nodes = np.stack([np.linspace(20.0, 30.0, 12), np.linspace(30.0, 45.0, 12)])
    baseline = LawForward(LAWS["mangia"], nodes, 4.0)

    def simulator(x):
        return baseline(x) + [0.5 + 0.01 * x[1], 0.1, 0.0]

    x = np.random.default_rng(3).uniform(*np.array(BOUNDS).T, (8, 4))
    truth = np.array(TRUTH["field"])
    surrogate = ClassSurrogate(BOUNDS, x, np.stack([simulator(point) for point in x]), baseline).train()
    np.testing.assert_allclose(surrogate(truth)[:, 0], simulator(truth)[:, 0], atol=0.1)


def test_a_run_corrects_law_and_speckle():
    nodes = np.linspace(20.0, 45.0, 24).reshape(2, 12)
    baseline = LawForward(LAWS["mangia"], nodes, 4.0)
    first, second = np.array(TRUTH["field"]), np.array(TRUTH["lake"])
    shift = np.array([0.7, 0.0, 0.0])
    np.testing.assert_allclose(Corrected(baseline)(first), baseline(first), rtol=1e-12)
    found = Corrected(baseline, first, baseline(first) + shift)
    np.testing.assert_allclose(found(first), baseline(first) + shift, rtol=1e-12)
    np.testing.assert_allclose(found(second)[:, 0], baseline(second)[:, 0] + 0.7, rtol=1e-12)
