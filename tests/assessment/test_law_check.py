"""What is said of a law after a calibration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from calibration_samples import make_target

from radcal.assessment import law_check, validation
from radcal.assessment.constant import Constant, constants
from radcal.assessment.law_check import (
    _held_sentences,
    _levels_asked,
    _noise_sentences,
    _start_db,
    check_laws,
    texture_note,
)
from radcal.assessment.validation import CrossValidation, HeldOut, _against, cross_validate
from radcal.calibration.expected import LawForward
from radcal.calibration.history import History, Run, Score
from radcal.calibration.moments import from_cumulants, from_dp
from radcal.calibration.objectives import make_objectives
from radcal.config import case_from
from radcal.measurement.class_target import ClassTarget
from radcal.measurement.classes import make_classes
from radcal.measurement.ground import Ground
from radcal.measurement.patches import Spread
from radcal.measurement.pixels import IN_THE_NOISE
from radcal.measurement.target import Targets
from radcal.radar.laws import LAWS
from radcal.skewnormal import centred, fit

LAW = LAWS["mangia"]
TRUTH = np.array([6.1, 14.2, 21.5, 3.3])
LOOKS = 4.0
PATCHES = 6


def made_ground(seed: int, sd_deg: float, blocks: tuple[int, ...], truth: np.ndarray = TRUTH) -> Ground:
    rng = np.random.default_rng(seed)
    n = 3000
    incidence = np.clip(rng.normal(45.0, sd_deg, n), 2.0, 85.0)
    values = LAW(np.radians(incidence), truth) + 10.0 * np.log10(rng.gamma(LOOKS, 1.0 / LOOKS, n))
    # each block has an incidence of its own: what a constant cannot predict
    order = np.argsort(incidence)
    block = np.empty(n, dtype=np.int64)
    block[order] = np.asarray(blocks)[np.arange(n) * len(blocks) // n]
    return Ground(values, incidence, rng.integers(1, PATCHES + 1, n), block)


def made(
    sd_deg: float = 8.0, truth: np.ndarray = TRUTH, kept: tuple[int, ...] = (0, 1, 4, 5, 8, 9), **changes: object
) -> tuple[dict, Targets, History]:
    ground, out = made_ground(1, sd_deg, kept, truth), made_ground(2, sd_deg, (2, 3, 6, 7, 10), truth)
    dp = fit(ground.values_db).dp
    classes = make_classes(ground.values_db, ground.incidence_deg, 5)
    settings = {"materials": {"area": {"calibrate": True, "bounds": [[0, 50]] * 4}}, "objective": "classes"}
    case = case_from(
        {
            "measurement": {"source": "synthetic", "synthetic": {"parameters": {"area": TRUTH.tolist()}}},
            "validation": {"rows": 20, "means": 10},
            **settings,
            **changes,
        }
    )
    target = make_target(
        ground.values_db,
        ground.incidence_deg,
        dp=dp,
        patch=ground.patch,
        block=ground.block,
        kept_out=out,
        classes=ClassTarget(classes, Spread(0.1, 0.05), 1, True, True, 0.0, truth, LOOKS)
        if case.objective == "classes"
        else None,
    )
    targets = Targets({"area": target})
    statistics, looks, cost = from_dp(dp)[None], LOOKS, 0.0
    if case.objective == "classes":
        statistics = from_cumulants(LawForward(LAW, classes.nodes_deg, LOOKS)(truth))
        looks, cost = make_objectives(case, targets)["area"].worth(truth, statistics)
    score = Score(truth.tolist(), dp.tolist(), 0.0, statistics.tolist(), looks, cost)
    return case, targets, History([Run("design", 0, "0", 1.0, {"area": score})])


@pytest.fixture(scope="module")
def right():
    """The true law in bins."""
    return check_laws(*made())["area"]


@pytest.mark.slow
def test_a_right_law_in_classes_is_identified_and_predicts(right):
    check = right
    assert check.identified is True
    assert check.held is not None
    assert check.held.n_blocks == 5
    assert check.held.rmse_law_db < 0.3 < check.held.rmse_constant_db
    assert check.looks == pytest.approx(LOOKS, rel=0.1)
    assert not any("no better" in sentence or "not identified" in sentence for sentence in check.sentences)
    # the law passes where the classes ask it to
    level = LAW(np.radians(check.class_deg), TRUTH)
    assert (np.abs(check.class_db - level) < 4.0 * check.class_error_db + 0.05).all()


def test_a_flat_law_is_no_better_than_a_constant():
    flat = np.array([20.0, 0.0, 0.0, 1.0])
    check = check_laws(*made(truth=flat))["area"]
    assert check.identified is False
    assert any("area: the law is not identified" in sentence for sentence in check.sentences)


@pytest.mark.parametrize(("masked", "share"), [(10, None), (19, 5), (200, 35)])
def test_pixels_in_the_noise_are_told_from_one_in_twenty_on(masked, share):
    target = make_target(
        np.linspace(-20.0, -10.0, 400), np.full(400, 40.0), left_out={IN_THE_NOISE: masked, "layover": 500}
    )
    target = replace(target, eligible=361 if masked == 19 else 371)
    said = _noise_sentences("water", target)
    assert said == [] if share is None else said[0].startswith(f"water: {share} % of its pixels are masked")


@pytest.mark.slow
def test_one_density_does_not_identify_the_law():
    case, targets, history = made(objective="density", sd_deg=1.5)
    check = check_laws(case, targets, history)["area"]
    assert check.identified is False
    assert "objective: classes can tell more" in check.sentences[0]
    assert (check.looks, check.looks_nominal) == (LOOKS, LOOKS)
    # X is the truth here, and predicts; the correction brings its mean to the run's
    assert check.held is not None
    assert check.held.rmse_law_db < 0.3
    assert not check.class_deg.size
    assert centred(history.runs[0].scores["area"].dp)[0] == pytest.approx(targets["area"].values_db.mean(), abs=0.1)


@pytest.mark.slow
def test_a_wrong_law_of_one_density_is_found_out_by_its_own_ground():
    """A slope that the ground does not have: blocks of it are told from one another by nothing."""
    flat = np.array([20.0, 0.0, 0.0, 1.0])
    wrong = np.array([2.0, 25.0, 3.0, 1.0])
    case, targets, history = made(objective="density", truth=flat, kept=tuple(range(10)), validation=None)
    run = history.runs[0]
    run = replace(run, scores={"area": replace(run.scores["area"], parameters=wrong.tolist())})
    check = check_laws(case, targets, History([run]))["area"]
    assert check.identified is False
    assert "area: blocks of its own ground, each predicted from the others" in check.sentences[0]
    assert "objective: classes can tell more" in check.sentences[0]
    # a right law passes
    assert check_laws(*made(objective="density", kept=tuple(range(10)), validation=None))["area"].identified is True


@pytest.mark.slow
def test_both_halves_predict_each_other():
    case, targets, history = made(kept=tuple(range(10)), validation={"rows": 20, "means": 10, "keep": "both"})
    held = check_laws(case, targets, history)["area"].held
    assert held is not None
    assert held.n_blocks == len(np.unique(targets["area"].block))
    assert set(held.block) == set(targets["area"].block)


@pytest.mark.slow
def test_a_material_without_held_out_pixels_is_named():
    case, targets, history = made()
    target = targets["area"]
    nothing = target.kept_out.part(np.zeros(target.kept_out.values_db.size, dtype=bool))
    check = check_laws(case, Targets({"area": replace(target, kept_out=nothing)}), history)["area"]
    assert check.held is None
    assert any("area: validation checks nothing: no held-out block" in line for line in check.sentences)


@pytest.mark.slow
def test_an_error_of_the_incidence_is_not_put_down_to_the_law(right):
    case, targets, history = made()
    told = replace(targets["area"].classes, incidence_error_deg=4.0)
    check = check_laws(case, Targets({"area": replace(targets["area"], classes=told)}), history)["area"]
    # the same pixels ask for a steeper law where the map is known to be off
    slope = [np.polyfit(c.class_deg, c.class_db, 1)[0] for c in (check, right)]
    assert slope[0] < 1.1 * slope[1] < 0.0


def test_nothing_is_held_out_without_validation():
    case, targets, history = made(validation=None)
    assert check_laws(case, targets, history)["area"].held is None


def test_pooled_grounds_count_each_block_once():
    def part(error: float, n: int) -> HeldOut:
        zeros = np.zeros(n)
        errors, shares = (error,) * 6, (1.0 / n,) * 3
        cells = [np.arange(n), zeros, zeros, zeros, zeros]
        # two fields, of which the first is in both parts
        field, gain = np.array([4, 5 + n]), np.array([error, 2.0])
        unknown = (float("nan"),) * 4
        return HeldOut(*errors, *shares, *shares, 1.0 / n, n, 2, *unknown, *cells, field, gain, gain - 1.0)

    found = HeldOut.pooled([part(1.0, 2), part(3.0, 6)])
    assert found is not None
    # the root mean square over eight blocks, two of 1 and six of 3
    assert found.rmse_law_db == pytest.approx(np.sqrt((2 * 1.0 + 6 * 9.0) / 8))
    assert found.coverage_90 == pytest.approx(2 / 8)
    assert found.n_blocks == found.mean_db.size == 8
    # fields 4 (mean of 1 and 3), 7 and 11: each counts once
    assert found.n_fields == 3
    assert found.law_gain == pytest.approx(2.0)
    assert found.law_gain_error == pytest.approx(0.0)
    assert found.patch_gain == pytest.approx(1.0)
    assert HeldOut.pooled([]) is None


def test_texture_is_said(right):
    found = right
    said = texture_note({"area": replace(found, looks=2.5), "other": replace(found, looks=4.2)})
    assert "has 4 looks" in said
    assert "found fewer effective looks (area 2.50). Values above about 0.9 of the sensor's looks" in said
    assert texture_note({"area": replace(found, looks=4.0)}) == ""


@pytest.mark.slow
def test_whole_fields_are_predicted_from_the_others():
    """All ground is calibrated on; each fold of fields is predicted without any effect of them."""
    case, targets, history = made(kept=tuple(range(10)), validation={"rows": 20, "means": 10, "keep": "fields"})
    assert not case.validation.holds_out
    check = check_laws(case, targets, history)["area"]
    held = check.held
    assert held is not None
    assert held.n_fields == PATCHES
    assert held.field.tolist() != sorted(held.field)  # fold by fold
    assert sorted(held.field) == list(range(1, PATCHES + 1))
    # no effect is known: with and without, both predictions are the same
    np.testing.assert_array_equal(held.predicted_db, held.law_db)
    assert held.rmse_constant_patch_db == held.rmse_constant_db
    assert held.patch_gain == held.law_gain
    assert check.left_out.gain.fields == PATCHES
    assert check.recommended == "average"
    assert check.law_weight == check.left_out.weight > 0.8
    refused = check_laws(case, targets, history, withheld={"area": "the law does not fit"})["area"]
    assert (refused.recommended, refused.law_weight) == ("constant", 0.0)


@pytest.mark.slow
def test_cross_validation_is_silent_where_folds_hold_all_angles_alike():
    """Blocks dealt in the order of the incidence: a right law and a constant predict their means alike."""
    case, targets, history = made(kept=tuple(range(10)), validation=None, objective="density")
    target = targets["area"]
    block = np.empty(target.block.size, dtype=np.int64)
    block[np.argsort(target.incidence_deg)] = np.arange(block.size) % 40
    alike = Targets({"area": replace(target, block=block)})
    check = check_laws(case, alike, history)["area"]
    assert check.identified is True
    assert not any("blocks of its own ground" in sentence for sentence in check.sentences)
    law = make_objectives(case, alike)["area"].law(history.runs[0].scores["area"])
    constant = constants({"area": law.ground})["area"]
    silent, told = (
        cross_validate(replace(law, ground=replace(law.ground, block=places)), constant, places // 2)
        for places in (block, target.block)
    )
    assert silent.power < 2.0 < told.power
    assert not CrossValidation(0.5, 0.4, silent.power).no_better
    assert CrossValidation(0.5, 0.4, told.power).no_better


def test_blocks_are_dealt_to_five_folds_in_turn(monkeypatch):
    """One field of ten equal blocks: each is predicted by the mean of the others but the one five further."""
    case, targets, history = made()
    law = make_objectives(case, targets)["area"].law(history.runs[0].scores["area"])
    block, rng = np.repeat(np.arange(10), 60), np.random.default_rng(4)
    values = rng.normal(0.0, 3.0, 10)[block] + rng.normal(size=600)
    ground = Ground(values, rng.uniform(30.0, 50.0, 600), np.ones(600, dtype=np.int64), block)
    law = replace(law, ground=ground, classes=make_classes(values, ground.incidence_deg, 4))
    asked = []
    monkeypatch.setattr(validation, "power", lambda *values: asked.append(values) or 1.0)
    found = cross_validate(law, Constant(ground, Spread(100.0, 1.0)), block)
    mean = values.reshape(10, 60).mean(axis=1)
    errors = [mean[k] - np.delete(mean, [k, (k + 5) % 10]).mean() for k in range(10)]
    assert found.rmse_constant_patch_db == pytest.approx(np.sqrt(np.mean(np.square(errors))), rel=1e-3)
    # the variance of a block's error is that of the better predictor, none of it shared
    ((_, _, common, own),) = asked
    assert not common.any()
    np.testing.assert_allclose(own, min(found.rmse_law_patch_db, found.rmse_constant_patch_db) ** 2)


def test_expected_levels_lie_a_standard_deviation_on_both_sides():
    """Without speckle: a half of the pixels at -3 dB, a half at 3 dB, and a sample that is even from -6 to 6 dB."""
    distance, excess = _against(np.linspace(-6.0, 6.0, 10_001), np.zeros(500), 1e5, 3.0)
    assert distance == pytest.approx(0.25, abs=0.01)
    assert excess == pytest.approx(3.0 - 5.88, abs=0.1)


def test_what_held_out_ground_says():
    """Worse than a constant is said beyond the standard error, and a band that is too narrow of each material."""
    case, targets, history = made()
    held = check_laws(case, targets, history)["area"].held
    assert held is not None
    worse = replace(held, patch_gain=-0.5, patch_gain_error=0.2)
    (sentence,) = _held_sentences(case, "area", worse)
    assert "worse by law and field effects than by a constant with field effects" in sentence
    assert "1.65 times the constant's" in sentence
    assert _held_sentences(case, "area", replace(worse, patch_gain_error=0.6)) == []
    # 17 of 22 and fewer lie inside of a right band in 5 % of the cases, 15 of 22 in 0.4 %
    assert _held_sentences(case, "area", replace(held, n_blocks=22, coverage_90=17 / 22)) == []
    (narrow,) = _held_sentences(case, "area", replace(held, n_blocks=22, coverage_90=15 / 22))
    assert "68 % of 22 held-out means lie inside" in narrow
    # all of 100 are more than expected, and no band too narrow
    assert _held_sentences(case, "area", replace(held, n_blocks=100, coverage_90=1.0)) == []


def test_the_level_asked_is_the_laws_where_bins_hold_what_is_expected():
    """Measured cumulants are those of the law at 2.5 looks, as the run shows it with speckle of 4: nothing is asked."""
    case, targets, history = made()
    objective = make_objectives(case, targets)["area"]
    law = objective.law(history.runs[0].scores["area"])
    nodes = law.classes.nodes_deg
    shown = LawForward(LAW, nodes, 2.5)(TRUTH)
    law = replace(law, classes=replace(law.classes, cumulants=shown), fit=replace(law.fit, looks=2.5))
    score = replace(
        history.runs[0].scores["area"], statistics=from_cumulants(LawForward(LAW, nodes, 4.0)(TRUTH)).tolist()
    )
    angle, level, error = _levels_asked(law, score, 4.0)
    np.testing.assert_allclose(angle, nodes.mean(axis=1))
    np.testing.assert_allclose(level, LAW(np.radians(nodes), TRUTH).mean(axis=1))
    np.testing.assert_allclose(error, np.sqrt(shown[:, 1] / law.classes.effective))
    # an error of the incidence bends what is expected, and is taken off again: the law at the mapped angles is asked
    method = replace(law.method, incidence_error_deg=3.0)
    there = law_check.law_cumulants(LAW, TRUTH, law_check.true_angles(law.ground, law.classes, method, nodes))
    bent = shown.copy()
    bent[:, 0] += there[:, 0] - LAW(np.radians(nodes), TRUTH).mean(axis=1)
    told = replace(law, method=method, classes=replace(law.classes, cumulants=bent))
    np.testing.assert_allclose(_levels_asked(told, score, 4.0)[1], level)


def test_the_start_is_expected_with_the_speckle_of_the_sensor():
    case, targets, _ = made(materials={"area": {"calibrate": True, "bounds": [[0, 50]] * 4, "start": [9, 8, 7, 2]}})
    ground = targets["area"].kept_out
    speckle = 10.0 * np.log10(np.random.default_rng(1).gamma(4.0, 0.25, 400_000)).mean()
    wanted = LAW(np.radians(ground.incidence_deg), [9.0, 8.0, 7.0, 2.0]) + speckle
    np.testing.assert_allclose(_start_db(case, "area", ground), wanted, atol=0.02)
    assert speckle < -0.5


def test_folds_of_a_few_pixels_predict_nothing():
    """Ten pixels in the odd blocks: neither half can be left out."""
    case, targets, history = made(kept=(0, 1, 4, 5), validation={"rows": 20, "means": 10, "keep": "both"})
    target = targets["area"]
    block = target.block.copy()
    block[:10] = 2
    check = check_laws(case, Targets({"area": replace(target, block=block)}), history)["area"]
    assert check.held is None
    assert any("validation checks nothing" in said for said in check.sentences)


@pytest.mark.slow
def test_looks_that_a_level_pressed_down_are_not_said_of_the_pixels():
    """Looks of 0.3, the fewest that the search allows, for pixels of 4 looks, and looks of pixels that do spread so."""
    case, targets, history = made()
    target = targets["area"]

    def said(values: np.ndarray, looks: float) -> str:
        run = history.runs[0]
        pressed = replace(run, scores={"area": replace(run.scores["area"], looks=looks)})
        classes = replace(target.classes, classes=make_classes(values, target.incidence_deg, 5))
        other = replace(target, values_db=values, classes=classes)
        return "".join(check_laws(case, Targets({"area": other}), History([pressed]))["area"].sentences)

    assert "its pixels spread as those of" not in said(target.values_db, 0.3)
    rough = target.values_db + 10.0 * np.log10(np.random.default_rng(3).gamma(1.5, 1.0 / 1.5, target.values_db.size))
    assert "its pixels spread as those of 1.1 looks" in said(rough, 1.1)
