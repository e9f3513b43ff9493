"""Two passes compared together, against the sum of what each says alone."""

from dataclasses import replace

import numpy as np
import pytest
from config_samples import flat

from radcal.calibration.scoring import score, with_texture
from radcal.config import Optimiser, case_from
from radcal.inference.misfit import together
from radcal.measurement.sources import make_measurement
from radcal.objectives import make_objectives, objective_class
from radcal.objectives.base import PredictedPoints
from radcal.objectives.history import Front, History, read_proposals, read_runs, write_proposals, write_runs
from radcal.objectives.joint import Joint
from radcal.proposals.search import Search
from radcal.proposals.surrogate import Surrogate, train_surrogate
from radcal.radar.projection import make_geometry
from radcal.registration.registered import register
from radcal.results.results import search_fronts
from radcal.scene.model import Scene
from radcal.scene.slant_range import flat_incidence_deg
from radcal.simulators.builtin import BuiltinSimulator
from radcal.speckle.texture import equal_texture, log_speckle_cumulants
from radcal.storage.runs import Record
from radcal.targets.target_fit import make_targets

TRUTH = {"field": [-9.0, 4.0, 12.0, 3.0], "lake": [-20.0, 3.0, 15.0, 5.0]}
BOUNDS = [[-30, 10], [-5, 15], [0, 30], [0, 15]]
ANGLES = ((20.0, 40.0), (35.0, 60.0))
X = [-8.0, 3.0, 10.0, 4.0]


def two_passes(objective, looks=(4, 4)):
    """Case, targets and record of two passes; in the second one there is no lake."""
    case = case_from(
        {
            **flat(),
            "objective": objective,
            "simulator": {"draws": 1},
            "materials": {name: {"calibrate": True, "bounds": BOUNDS} for name in TRUTH},
            "measurement": [{"synthetic": {"parameters": TRUTH, "seed": seed, "warp_px": 0}} for seed in (3, 8)],
            "registration": {"method": "none"},
            "radar": [{"looks": number, "nesz_db": -60} for number in looks],
            "target": {"pixels": 600, **({"incidence_classes": 3} if objective == "classes" else {})},
        }
    )
    targets, records = [], []
    for number, (one, angles) in enumerate(zip(case.passes, ANGLES, strict=True)):
        material = np.ones((60, 70), dtype=np.uint8)
        material[:, 35:] = 1 if number else 2
        scene = Scene("tiny", ("field", "lake"), material, None, 1.0, flat_incidence_deg(*angles, 60))
        geometry = make_geometry(scene, one.radar)
        simulator = BuiltinSimulator(geometry, one.radar, one.laws)
        image = simulator.run({"field": X, "lake": X}, 5)
        registered = register(
            image, make_measurement(one, geometry, simulator, scene, partly=bool(number)), one.registration
        )
        misfit = objective_class(objective).misfit
        targets.append(make_targets(one, geometry, registered, image, misfit, partly=bool(number)))
        records.append(
            Record(f"run{number}", {name: image.ravel()[geometry.pixels(name)] for name in TRUTH}, None, 1.5)
        )
    return case, targets, records


@pytest.fixture(scope="module", params=["classes", "density"])
def found(request):
    case, targets, record = two_passes(request.param)
    objectives = make_objectives(case, targets)
    run = score("design", 0, record, dict.fromkeys(TRUTH, X), targets, objectives, 1)
    return case, targets, record, objectives, run


def points_of(objective, run, looks):
    statistics = np.array(run.scores["field"].statistics)[None] + 0.02
    return PredictedPoints(statistics, np.array([X]), np.array([looks]), np.full((1, len(objective.scale), 3), 0.01))


@pytest.mark.slow
def test_cost_and_residuals_are_those_of_the_passes(found):
    case, _, _, objectives, run = found
    joint = objectives["field"]
    parts = joint.passes
    points = points_of(joint, run, 3.2)
    n = len(parts[0].scale)
    each = [
        replace(points, statistics=points.statistics[:, at], slack=points.slack[:, at])
        for at in (slice(None, n), slice(n, None))
    ]
    residuals = [part.residuals(at) for part, at in zip(parts, each, strict=True)]
    data = [r[:, : 3 * len(part.scale)] for r, part in zip(residuals, parts, strict=True)]
    priors = residuals[0][:, 3 * n :]
    if case.objective == "classes":
        # both passes show the same field: differences of all bins by the covariance that its effect gives them
        fields = together([part.moments for part in parts])
        away = np.concatenate([part.moments.differences(r) for part, r in zip(parts, data, strict=True)], axis=1)
        flat = away[0].T.ravel()
        wanted = [flat @ np.linalg.solve(fields.covariance, flat), (priors**2).sum()]
        assert (joint.residuals(points) ** 2).sum() == pytest.approx(sum(wanted), rel=1e-9)
        assert wanted[0] > 1.4 * sum((r**2).sum() for r in data)  # the passes differ on the same field
    else:
        np.testing.assert_array_equal(joint.residuals(points), np.concatenate(residuals, axis=1))
    np.testing.assert_allclose(joint.parts(points)[0], [(r**2).sum() for r in residuals])
    assert joint.part_names == ["pass 1", "pass 2"]
    costs = [part.cost(at)[0] for part, at in zip(parts, each, strict=True)]
    assert min(costs) > 0.0
    wanted = 0.5 * sum(wanted) if case.objective == "classes" else np.sqrt(np.mean(np.square(costs)))
    assert joint.cost(points)[0] == pytest.approx(wanted, rel=1e-12)
    alone = np.concatenate([part.baseline(np.array(X)) for part in parts])
    np.testing.assert_allclose(joint.baseline(np.array(X)), alone)
    np.testing.assert_array_equal(joint.baseline(np.array([X, X])), [joint.baseline(np.array(X))] * 2)
    first, second = np.array([-9.0, 2.0, 14.0, 2.0]), np.array(X)
    assert joint.moved_db(first, second) == max(part.moved_db(first, second) for part in parts)


def test_priors_enter_once(found):
    case, _, _, objectives, _ = found
    parts = objectives["field"].passes
    sizes = [part._priors(np.array(X), 3.0).size for part in parts if hasattr(part, "_priors")]
    # 4 residuals on the curve and one on the looks; one density has no priors
    assert sizes == ([5, 0] if case.objective == "classes" else [])


def test_a_run_is_scored_in_all_passes(found, tmp_path):
    case, targets, records, _, run = found
    alone = [
        score("design", 0, [one], dict.fromkeys(target, X), [target], make_objectives(single, [target]), 1)
        for one, target, single in zip(records, targets, case.passes, strict=True)
    ]
    field = run.scores["field"]
    np.testing.assert_array_equal(field.statistics, np.concatenate([one.scores["field"].statistics for one in alone]))
    assert run.keys == ["run0", "run1"]
    assert run.seconds == 3.0
    if case.objective == "density":
        each_rms = [one.rms for one in field.densities]
        assert each_rms == [one.scores["field"].rms for one in alone]
        assert field.cost == pytest.approx(np.sqrt(np.mean(np.square(each_rms))), rel=1e-12)
    else:
        # the looks are a compromise of those that suit each pass
        low, high = sorted(one.scores["field"].looks for one in alone)
        assert low - 0.3 < field.looks < high + 0.3
    # the second pass says nothing of the lake
    assert run.scores["lake"].densities == [*alone[0].scores["lake"].densities, None]
    assert run.scores["lake"].statistics == alone[0].scores["lake"].statistics
    assert run.scores["lake"].cost == pytest.approx(alone[0].scores["lake"].cost, rel=1e-9)
    write_runs(tmp_path / "runs.json", [run, alone[0]])
    assert read_runs([tmp_path / "runs.json"]).runs == (run, alone[0])


def test_the_front_of_two_passes_is_kept(found, tmp_path):
    case, _, _, objectives, run = found
    joint, history = objectives["field"], History([run])
    surrogate = Surrogate(train_surrogate(joint, *history.training("field"), case.surrogate), joint)
    settings = Optimiser(population=40, evaluations=400)
    proposal = Search(joint, surrogate).propose(settings, 3, run.scores["field"])
    front = proposal.front
    x, looks, sums = (np.array(values) for values in (front.parameters, front.looks, front.objectives))
    assert len(x) > 2
    np.testing.assert_allclose(
        sums, joint.parts(PredictedPoints(surrogate.predict(surrogate.unit(x)), x, looks)), rtol=1e-9
    )
    # along a front of two objectives, the one grows where the other falls
    order = np.argsort(sums[:, 0])
    assert (np.diff(sums[order, 1]) < 0.0).all()
    assert sums.sum(axis=1).argmin() == 0
    write_proposals(tmp_path / "proposal.json", [{"field": proposal}])
    assert read_proposals(tmp_path / "proposal.json") == [{"field": proposal}]

    ended = replace(proposal, mode="ended", front=Front())
    infill = [replace(run, kind="infill", proposals={"field": one, "lake": ended}) for one in (proposal, ended)]
    kept = search_fronts(objectives, History([run, *infill]))
    assert list(kept) == ["field"]  # of the last iteration that searched
    one = kept["field"]
    assert one.objectives == ("pass 1", "pass 2")
    np.testing.assert_array_equal(one.predicted, sums)
    whole = run.scores["field"]
    alone = [
        part.parts_of(joint.in_pass(number, whole)).sum() for number, part in enumerate(joint.passes)
    ]  # the sums of each pass by itself
    np.testing.assert_allclose(one.verified, [alone] * 3, rtol=1e-9)


def test_a_pass_without_the_material_has_no_statistics(found):
    _, _, _, objectives, run = found
    joint, score_ = objectives["field"], run.scores["field"]
    three = Joint([joint.passes[0], None, joint.passes[1]])
    wide = replace(score_, densities=[score_.densities[0], None, score_.densities[1]])
    assert three.in_pass(2, wide) == joint.in_pass(1, score_)
    assert three.in_pass(0, wide) == joint.in_pass(0, score_)


@pytest.mark.slow
def test_passes_of_other_looks_share_the_texture():
    case, targets, record = two_passes("classes", (4, 8))
    joint = make_objectives(case, targets)["field"]
    run = score("design", 0, record, dict.fromkeys(TRUTH, X), targets, make_objectives(case, targets), 1)
    points = points_of(joint, run, 2.5)
    n = len(joint.passes[0].scale)
    there = equal_texture(4.0, 2.5, 8.0)
    assert there > 3.0
    # of densities and pictures, too: the same texture in both passes, on speckle of other looks
    nothing, objectives = {"field": np.zeros(5000, dtype=np.float32)}, {"field": joint}
    textures = [with_texture(nothing, objectives, {"field": 2.5}, 1, number=number)["field"] for number in (0, 1)]
    np.testing.assert_allclose(textures[1], textures[0], atol=0.01)
    wanted = log_speckle_cumulants(2.5)[1] - log_speckle_cumulants(4.0)[1]
    assert textures[0].var() == pytest.approx(wanted, rel=0.1)
    second = replace(points, statistics=points.statistics[:, n:], slack=points.slack[:, n:], looks=np.array([there]))
    assert joint.parts(points)[0, 1] == (joint.passes[1].residuals(second) ** 2).sum()
