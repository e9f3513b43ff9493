"""Levels of the bins that a calibrated law is compared with, and looks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from calibration_samples import make_target

from radcal.assessment import law_check
from radcal.assessment.law_check import LawCheck, _levels_asked, check_laws, texture_note
from radcal.calibration.expected import LawForward
from radcal.calibration.history import History, Run, Score
from radcal.calibration.moments import from_cumulants, from_dp
from radcal.calibration.objectives import make_objectives
from radcal.config import case_from
from radcal.measurement.class_target import ClassTarget
from radcal.measurement.classes import make_classes
from radcal.measurement.patches import Spread
from radcal.measurement.target import Targets
from radcal.radar.laws import LAWS
from radcal.skewnormal import fit

LAW = LAWS["mangia"]
TRUTH = np.array([6.1, 14.2, 21.5, 3.3])
LOOKS = 4.0


def made(**changes: object) -> tuple:
    """Case, targets, history and objectives of 3000 pixels of the true law."""
    rng, n = np.random.default_rng(1), 3000
    incidence = np.clip(rng.normal(45.0, 8.0, n), 2.0, 85.0)
    values = LAW(np.radians(incidence), TRUTH) + 10.0 * np.log10(rng.gamma(LOOKS, 1.0 / LOOKS, n))
    case = case_from(
        {
            "measurement": {"source": "synthetic", "synthetic": {"parameters": {"area": TRUTH.tolist()}}},
            "materials": {"area": {"calibrate": True, "bounds": [[0, 50]] * 4}},
            "objective": "classes",
            **changes,
        }
    )
    dp, binned = fit(values).dp, case.objective == "classes"
    classes = make_classes(values, incidence, 5)
    target = make_target(
        values, incidence, dp=dp, patch=rng.integers(1, 7, n),
        classes=ClassTarget(classes, Spread(0.1, 0.05), 1, True, True, 0.0, TRUTH, LOOKS) if binned else None,
    )  # fmt: skip
    targets = Targets({"area": target})
    objectives = make_objectives(case, targets)
    statistics, looks, cost = from_dp(dp)[None], LOOKS, 0.0
    if binned:
        statistics = from_cumulants(LawForward(LAW, classes.nodes_deg, LOOKS)(TRUTH))
        looks, cost = objectives["area"].worth(TRUTH, statistics)
    score = Score(TRUTH.tolist(), dp.tolist(), 0.0, statistics.tolist(), looks, cost)
    return case, targets, History([Run("design", 0, "0", 1.0, {"area": score})]), objectives


def test_bins_of_the_true_law_ask_for_it():
    check = check_laws(*made())["area"]
    assert check.looks == pytest.approx(LOOKS, rel=0.1)
    assert (check.looks_nominal, check.incidence_error_deg) == (LOOKS, 0.0)
    level = LAW(np.radians(check.class_deg), TRUTH)
    assert check.class_deg.size == 5
    assert (np.abs(check.class_db - level) < 4.0 * check.class_error_db + 0.05).all()


def test_one_density_has_no_bins():
    check = check_laws(*made(objective="density"))["area"]
    assert check.class_deg.size == check.class_db.size == check.class_error_db.size == 0
    assert (check.looks, check.looks_nominal) == (LOOKS, LOOKS)


def test_the_level_asked_is_the_laws_where_bins_hold_what_is_expected():
    """Measured cumulants are those of the law at 2.5 looks, as the run shows it with speckle of 4: nothing is asked."""
    _, _, history, objectives = made()
    law = objectives["area"].law(history.runs[0].scores["area"])
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


def test_texture_is_said():
    nothing = np.empty(0)
    found = LawCheck(4.2, 4.0, 0.0, nothing, nothing, nothing)
    said = texture_note({"area": replace(found, looks=2.5), "other": found})
    assert "has 4 looks" in said
    assert "found fewer effective looks (area 2.50). Values above about 0.9 of the sensor's looks" in said
    assert texture_note({"area": replace(found, looks=4.0)}) == ""
