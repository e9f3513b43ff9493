"""Laws in classes of incidence, end to end on the built-in simulator."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from radcal.calibration.class_search import ClassSearch, class_searches, class_targets
from radcal.calibration.class_surrogate import ClassRuns, Corrected

from radcal.calibration.expected import LawForward
from radcal.calibration.history import History
from radcal.calibration.loop import calibrate
from radcal.calibration.steps import noise_seed, propose_all, train_all
from radcal.calibration.surrogate import read_surrogates, write_surrogates
from radcal.config import case_from
from radcal.measurement.registration import Registered
from radcal.measurement.sources import make_measurement
from radcal.measurement.target import Targets, read_targets, write_targets
from radcal.measurement.target_fit import HELD_OUT, make_targets
from radcal.radar.laws import LAWS
from radcal.radar.projection import make_geometry
from radcal.radar.texture import texture_db, texture_order
from radcal.scene.model import Scene
from radcal.scene.slant_range import flat_incidence_deg
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.layout import same
from radcal.storage.runs import RunStore

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
            "objective": "classes",
            "materials": {name: {"calibrate": True, "bounds": BOUNDS} for name in TRUTH},
            "measurement": {"source": "synthetic", "synthetic": {"parameters": TRUTH}},
            "registration": {"method": "none"},
            "radar": {"looks": 4, "nesz_db": -40},
            "target": {"pixels": 1000, "incidence_classes": 3},
            "validation": {"rows": 20, "means": 10, "keep": "even"},
            "design": {"size": 2},
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
    registered = Registered(
        measurement=replace(measurement, image_db=image),
        unregistered_db=image,
        displacement_px=np.zeros((2, *image.shape), dtype=np.float32),
        uncertainty_px=np.zeros(image.shape, dtype=np.float32),
        correlation=np.ones(image.shape, dtype=np.float32),
        method="none",
        applied=False,
        verdict="",
    )
    targets = class_targets(case, make_targets(case, geometry, registered, image), geometry, registered)
    return case, simulator, geometry, scene, targets


@pytest.fixture(scope="module")
def runner(parts, tmp_path_factory):
    case, simulator, geometry, scene, _ = parts
    return Runner(RunStore(tmp_path_factory.mktemp("runs")), simulator, geometry, scene.identity, case)


@pytest.fixture(scope="module")
def calibrated(parts, runner):
    case, _, _, _, targets = parts
    return calibrate(case, runner, targets)


def laws_are_right(case, targets, history):
    """Within three standard errors of their own, which are small enough to mean something."""
    angle = np.linspace(21.5, 43.5, 40)
    searches = class_searches(case, targets)
    for name, truth in TRUTH.items():
        best = history.best(name)
        x = best.parameters[name]
        error = LAWS["mangia"](np.radians(angle), x) - LAWS["mangia"](np.radians(angle), truth)
        # a single patch says nothing of how its level differs from that of others, the shape is its own
        law = searches[name].law(x, best.looks[name], best.cumulants[name])
        slopes = law.slopes(angle)
        shape = slopes - slopes.mean(axis=0)
        sd = np.sqrt(np.einsum("kd,de,ke->k", shape, law.fit.covariance, shape))
        assert sd.max() < 1.0, name
        assert (np.abs(error - error.mean()) < 3.0 * sd).all(), name
        assert abs(error.mean()) < 1.0, name


def test_it_settles_on_the_laws_in_a_few_runs(parts, calibrated):
    case, _, _, _, targets = parts
    history, decision = calibrated
    assert decision.reason == "settled"
    assert decision.converged
    assert len(history.infill) <= 5
    laws_are_right(case, targets, history)


def test_looks_are_those_of_each_material(calibrated):
    history, _ = calibrated
    assert history.best("field").looks["field"] > 3.0
    assert history.best("lake").looks["lake"] == pytest.approx(2.5, rel=0.2)


def test_texture_brings_the_spread_to_the_measured_one(parts, calibrated):
    """The density of a run has the material's looks: its spread is the target's, though the speckle's is less."""
    _, _, _, _, targets = parts
    history, _ = calibrated
    best = history.best("lake")
    sd = np.sqrt(np.array(best.cumulants["lake"])[:, 1])
    measured = np.sqrt(targets["lake"].classes.classes.cumulants[:, 1])
    assert (sd < 0.9 * measured).all()
    assert best.rms["lake"] < 0.01


def test_the_best_run_is_that_of_the_smallest_cost(calibrated):
    history, _ = calibrated
    for name in TRUTH:
        costs = [run.cost[name] for run in history.runs]
        assert history.best(name).cost[name] == min(costs)
        assert history.best(name).left[name] < 0.5


def test_no_simulator_knows_less_than_the_best_looks_say(parts, calibrated):
    """The score of a run is the smallest cost over the looks."""
    case, _, _, _, targets = parts
    history, _ = calibrated
    search = class_searches(case, targets)["lake"]
    run = history.runs[0]
    x, cumulants = np.array(run.parameters["lake"]), np.array(run.cumulants["lake"])
    grid = [search.cost(x, float(looks), cumulants) for looks in np.geomspace(0.3, 4.4, 200)]
    assert run.cost["lake"] <= min(grid) + 1e-6
    assert run.cost["lake"] == pytest.approx(min(grid), rel=1e-3)


def test_the_maximum_of_runs_ends_it(parts, runner):
    case, _, _, _, targets = parts
    case = case.model_copy(update={"stop": case.stop.model_copy(update={"max_runs": 2})})
    history, decision = calibrate(case, runner, targets)
    assert (decision.reason, decision.converged) == ("max_runs", False)
    assert not history.infill
    assert "stop criterion not met at the maximum of 2 runs" in decision.materials["lake"].sentence


def test_steps_from_files_are_those_from_memory(parts, calibrated, tmp_path):
    case, _, _, _, targets = parts
    history, _ = calibrated
    write_targets(tmp_path / "target.h5", targets)
    again = read_targets(tmp_path / "target.h5")
    start = History([run for run in history.runs if run.kind != "infill"])
    surrogates = train_all(start, case, 0, None)
    write_surrogates(tmp_path / "surrogate.h5", surrogates)
    read = read_surrogates(tmp_path / "surrogate.h5")
    assert all(isinstance(item, ClassRuns) for item in read.values())
    proposals = propose_all(read, again, start, case, 0, case.stop)
    assert proposals == dict(history.infill[0].proposals)
    assert all(target.kept_out is not None and target.classes is not None for target in targets.values())
    assert same(dict(again), dict(targets))


def test_proposals_do_not_depend_on_the_number_of_processes(parts, calibrated):
    case, _, _, _, targets = parts
    history, _ = calibrated
    start = History([run for run in history.runs if run.kind != "infill"])
    found = [
        propose_all(train_all(start, case, 0, None), targets, start, case, 0, case.stop, processes)
        for processes in (1, 2)
    ]
    assert found[0] == found[1]


def test_noise_is_part_of_what_is_expected_without_any_run(parts, runner):
    """Of a law far below the noise: law, noise and speckle, within what speckle leaves."""
    case, _, _, _, targets = parts
    deep = {"field": [-70.0, 5.0, 5.0, 5.0], "lake": TRUTH["lake"]}
    record = runner.run(deep, noise_seed(case))
    search = class_searches(case, targets)["field"]
    shown = targets["field"].classes.cumulants(record.pixels_db["field"][targets["field"].order])
    expected = search.surrogate([], [])(np.array(deep["field"]))
    assert search.classes.noise_db == pytest.approx(-40.0)
    np.testing.assert_allclose(shown[:, 0], expected[:, 0], atol=0.6)
    alone = LawForward(LAWS["mangia"], search.classes.classes.nodes_deg, 4.0)(np.array(deep["field"]))
    assert alone[:, 0].max() < -60.0


def test_where_there_is_infill_it_alone_corrects(calibrated):
    history, _ = calibrated
    assert len(history.class_training("field").parameters) <= len(history.infill)
    design = type(history)([run for run in history.runs if run.kind != "infill"])
    assert len(design.class_training("field").parameters) == len(design.runs)


def test_a_fresh_run_has_texture_of_its_own(parts):
    case, _, _, _, targets = parts
    search = class_searches(case, targets)["lake"]
    values = np.zeros(5000, dtype=np.float32)
    drawn = [search.textured(values, 2.5, fresh) for fresh in (False, True)]
    assert abs(np.corrcoef(*drawn)[0, 1]) < 0.05
    assert drawn[0].std() == pytest.approx(drawn[1].std(), rel=0.05)


def test_ground_is_held_out_in_whole_blocks(parts):
    _, _, geometry, _, targets = parts
    columns = geometry.shape[1]
    for target in targets.values():
        assert set((target.pixels // columns // 20) % 2) == {0}
        assert target.left_out[HELD_OUT] == target.kept_out.values_db.size
        assert set(target.kept_out.block % 4) == {2, 3}
        assert np.unique(target.patch).tolist() == np.unique(target.kept_out.patch).tolist() == [1]


def test_another_objective_has_no_classes(parts):
    case, _, geometry, _, targets = parts
    density = case.model_copy(update={"objective": "density"})
    assert class_targets(density, targets, geometry, None) is targets


def test_errors_of_slopes_and_of_the_place_add_up(parts):
    case, _, geometry, _, targets = parts
    shape = geometry.shape
    registered = Registered(
        measurement=None,
        unregistered_db=np.empty(0),
        displacement_px=np.zeros((2, *shape), dtype=np.float32),
        uncertainty_px=np.full(shape, 2.0, dtype=np.float32),
        correlation=np.ones(shape, dtype=np.float32),
        method="gefolki",
        applied=True,
        verdict="",
    )
    errors = [
        class_targets(case, targets, geometry, registered, slope)["field"].classes.incidence_error_deg
        for slope in (0.0, 3.0)
    ]
    # a displacement of 2 pixels in any direction, on rows of which each has its incidence
    rows = targets["field"].pixels // shape[1]
    a_row = np.gradient(geometry.incidence_deg[:, 0])
    assert errors[0] == pytest.approx(np.sqrt((a_row[rows] ** 2).mean()) * 2.0 / np.sqrt(2.0), rel=1e-3)
    assert errors[1] == pytest.approx(np.hypot(errors[0], 3.0))


def test_its_own_correction_leaves_nothing_at_the_minimum(parts):
    """Where the simulator is law and speckle alone, the law found without it is the minimum."""
    case, _, _, _, targets = parts
    search: ClassSearch = class_searches(case, targets)["field"]
    x, looks = search.classes.first, search.classes.first_looks
    run = LawForward(LAWS["mangia"], search.classes.classes.nodes_deg, 4.0)(x)
    left, moved = search.left(x, looks, run)
    assert left < 1e-2
    assert moved < 0.2
    away = x + [3.0, 0.0, 0.0, 0.0]
    left, moved = search.left(away, looks, LawForward(LAWS["mangia"], search.classes.classes.nodes_deg, 4.0)(away))
    assert left > 1.0
    assert moved > 1.0


NODES = np.linspace(20.0, 45.0, 24).reshape(2, 12)


def test_runs_correct_law_and_speckle():
    baseline = LawForward(LAWS["mangia"], NODES, 4.0)
    first, second = np.array(TRUTH["field"]), np.array(TRUTH["lake"])
    shift = np.array([0.7, 0.0, 0.0])
    np.testing.assert_allclose(Corrected(baseline)(first), baseline(first), rtol=1e-12)
    found = Corrected(baseline, [first], [baseline(first) + shift])
    np.testing.assert_allclose(found(first), baseline(first) + shift, rtol=1e-9)
    np.testing.assert_allclose(found(second)[:, 0], baseline(second)[:, 0] + 0.7, rtol=1e-9)


def test_at_its_runs_the_correction_is_what_they_showed():
    baseline = LawForward(LAWS["mangia"], NODES, 4.0)
    x = np.random.default_rng(3).uniform(*np.array(BOUNDS).T, (5, 4))
    x[:, 3] += 0.1
    shown = np.stack([baseline(point) + [0.1 * k, 0.2 * k, 0.0] for k, point in enumerate(x)])
    found = Corrected(baseline, x, shown)
    for point, run in zip(x, shown, strict=True):
        np.testing.assert_allclose(found(point), run, rtol=1e-6, atol=1e-6)


def test_a_difference_that_goes_with_the_level_is_followed():
    """Noise of -20 dB lifts weak levels: two runs on either side say by how much."""
    baseline = LawForward(LAWS["mangia"], NODES, 4.0)

    def noisy(x):
        run = baseline(x)
        run[:, 0] = 10.0 * np.log10(10.0 ** (run[:, 0] / 10.0) + 0.01)
        return run

    truth = np.array(TRUTH["lake"])
    runs = [truth + [shift, 0.0, 0.0, 0.0] for shift in (-2.0, 2.0)]
    both = Corrected(baseline, runs, [noisy(x) for x in runs])
    one = Corrected(baseline, runs[:1], [noisy(runs[0])])
    wanted = noisy(truth)[:, 0]
    assert np.abs(both(truth)[:, 0] - wanted).max() < 0.25 * np.abs(one(truth)[:, 0] - wanted).max()


def test_the_likelihood_of_the_pixels_finds_the_laws_too(parts, tmp_path):
    """The objective that knows nothing of patches, through the same loop and the same runs."""
    classes, simulator, geometry, scene, targets = parts
    case = classes.model_copy(update={"objective": "likelihood"})
    targets = Targets(
        {name: replace(t, classes=replace(t.classes, objective="likelihood")) for name, t in targets.items()},
        targets.levels,
        targets.looks,
    )
    write_targets(tmp_path / "target.h5", targets)
    targets = read_targets(tmp_path / "target.h5")
    runner = Runner(RunStore(tmp_path / "runs"), simulator, geometry, scene.identity, case)
    history, decision = calibrate(case, runner, targets)
    assert decision.reason == "settled"
    laws_are_right(case, targets, history)
    # texture of the one, none of the other
    assert history.best("lake").looks["lake"] == pytest.approx(2.5, rel=0.2)
    assert history.best("field").looks["field"] > 3.0
