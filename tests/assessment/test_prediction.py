"""Predicted means of cells and blocks, against closed forms and differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from radcal.assessment.constant import Constant

from radcal.assessment.prediction import Prediction, predict
from radcal.calibration.grounds import GroundLaw
from radcal.calibration.law_fit import LawFit
from radcal.calibration.misfit import Method
from radcal.measurement.classes import make_classes
from radcal.measurement.ground import Ground
from radcal.measurement.patches import Spread
from radcal.radar.laws import LAWS

LAW = LAWS["mangia"]
X = np.array([-30.0, 18.0, 6.0, 4.0])
SPREAD = Spread(0.9, 0.4)


def ground(seed: int, patches: list[int]) -> Ground:
    """Fields of two blocks of 40 pixels each."""
    rng = np.random.default_rng(seed)
    patch = np.repeat(patches, 80)
    block = np.tile(np.repeat([0, 1], 40), len(patches))
    incidence = rng.uniform(25.0, 45.0, patch.size) + 0.5 * patch
    values = LAW(np.radians(incidence), X) + 0.3 * patch + 10.0 * np.log10(rng.gamma(3.0, 1.0 / 3.0, patch.size))
    return Ground(values, incidence, patch, block)


def law_of(seen: Ground) -> GroundLaw:
    rng = np.random.default_rng(3)
    root = rng.normal(size=(5, 5)) * [0.5, 0.4, 0.3, 0.2, 0.1]
    fit = LawFit(X, 3.0, 0.0, root.T @ root, np.eye(5))
    classes = make_classes(seen.values_db, seen.incidence_deg, 3)
    return GroundLaw(
        seen, Method(LAW, [[-60.0, 0.0], [0.0, 40.0], [0.0, 25.0], [0.0, 20.0]], 4.0), classes, SPREAD, fit
    )


@pytest.fixture(scope="module")
def parts():
    """Law and constant of fields 2, 3 and 7; predicted are fields 3 and 5, of which 5 is unknown."""
    seen, out = ground(1, [2, 3, 7]), ground(2, [3, 5])
    law, constant = law_of(seen), Constant(seen, Spread(1.1, 0.5))
    return law, constant, out, predict(law, constant, out)


def test_effects_of_fields_are_added_where_they_are_known(parts):
    law, constant, out, found = parts
    assert found.patch.tolist() == [3, 3, 5, 5]
    np.testing.assert_allclose(found.mean_db, [out.values_db[k : k + 40].mean() for k in (0, 40, 80, 120)])
    np.testing.assert_allclose(
        found.law_db, [law.levels_db(out.incidence_deg[k : k + 40]).mean() for k in (0, 40, 80, 120)]
    )
    effect = law.effects.effect_db[1]
    np.testing.assert_allclose(found.law_patch_db - found.law_db, [effect, effect, 0.0, 0.0], atol=1e-12)
    own = constant.effects.effect_db[1]
    np.testing.assert_allclose(found.constant_patch_db - found.constant_db, [own, own, 0.0, 0.0], atol=1e-12)
    assert abs(effect) > 0.05
    assert abs(own) > 0.05


def test_slopes_are_those_of_the_prediction_with_the_effects_that_residuals_give(parts):
    """An error of the law moves the effects of the fields, too: differences of whole predictions."""
    law, constant, out, found = parts
    for k, step in enumerate((0.01, 0.01, 0.01, 0.001)):
        each = []
        for sign in (1.0, -1.0):
            moved = replace(law, fit=replace(law.fit, parameters=X + sign * step * np.eye(4)[k]))
            each.append(predict(moved, constant, out).law_patch_db)
        np.testing.assert_allclose(found.slope[:, k], (each[0] - each[1]) / (2.0 * step), rtol=1e-3, atol=1e-5)


def test_errors_are_those_of_field_law_and_cell(parts):
    law, _, out, found = parts
    of_law = np.einsum("kd,de,ke->k", found.slope, law.fit.covariance, found.slope)
    known = law.effects.variance[1]
    np.testing.assert_allclose(found.effect_variance, [known, known, SPREAD.between**2, SPREAD.between**2])
    np.testing.assert_allclose(found.common, found.effect_variance + of_law)
    np.testing.assert_allclose(found.own, SPREAD.within**2 + out.sampling)
    np.testing.assert_allclose(found.sd_db**2, found.common + found.own)
    assert known < 0.7 * SPREAD.between**2


def test_blocks_are_means_of_their_cells_by_their_pixels():
    """Thirty and ten pixels of two fields in a block, and twenty alone in another one."""
    values = np.array([1.0, 5.0, -2.0])
    slope = np.array([[1.0, 2.0], [3.0, -1.0], [0.5, 0.25]])
    keys = ("mean_db", "incidence_deg", "law_db", "law_patch_db", "constant_db", "constant_patch_db")
    cells = Prediction(
        patch=np.array([4, 6, 4]), block=np.array([8, 8, 9]), count=np.array([30, 10, 20]),
        **{key: values + n for n, key in enumerate(keys)}, common=np.zeros(3), own=np.array([0.4, 1.2, 0.6]),
        slope=slope, effect_variance=np.array([0.5, 0.7, 0.2]),
    )  # fmt: skip
    covariance = np.array([[0.3, 0.1], [0.1, 0.2]])
    found = cells.in_blocks(covariance)
    assert (found.block.tolist(), found.count.tolist()) == ([8, 9], [40, 20])
    for n, key in enumerate(keys):
        np.testing.assert_allclose(getattr(found, key), [2.0 + n, -2.0 + n])
    np.testing.assert_allclose(found.slope, [[1.5, 1.25], [0.5, 0.25]])
    effects = np.array([0.75**2 * 0.5 + 0.25**2 * 0.7, 0.2])
    np.testing.assert_allclose(found.effect_variance, effects)
    np.testing.assert_allclose(found.common, effects + [one @ covariance @ one for one in found.slope])
    np.testing.assert_allclose(found.own, [0.75**2 * 0.4 + 0.25**2 * 1.2, 0.6])
