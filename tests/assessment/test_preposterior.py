"""Expected narrowing of a band by a further pass: against Gaussian formulas worked out by hand."""

from dataclasses import replace

import numpy as np
import pytest
from geometry_samples import of_pixels
from scipy.special import polygamma

from radcal.assessment.preposterior import (
    View,
    _equivalent_sd,
    _normal_scores,
    half_widths_after,
    half_widths_now,
    view_of,
)
from radcal.config import Radar, Uncertainty
from radcal.laws import law_for
from radcal.posterior.curves import GRID_DEG
from radcal.posterior.result import WHOLE_DEG, KeptDraws

EXACT = Uncertainty(level_db=0.0, noise_db=0.0)
FLAT = law_for("tabulated", angles_deg=(20.0, 60.0))
AT_50 = np.array([200])  # place of 50 degrees in the grid
LOOKS = 4.0
MANY = 10**9  # independent pixels
KEYS = ("patch", "independent", "noise_db")


def speckle_db2(independent):
    """Variance of the mean power of independent pixels of 4 looks [dB^2]: (10 / ln 10)^2 trigamma(4 n)."""
    return float(18.861169701161387 * polygamma(1, LOOKS * independent))


def view(angle=120, independent=MANY, noise_db=-300.0, number=1):
    """One cell of one field, whose pixels all have the incidence of one place of the grid."""
    cell, middle = np.zeros(9, dtype=np.int64), GRID_DEG[[angle]]
    count, noise = np.array([float(independent)]), np.array([noise_db])
    return View(np.arange(9), np.repeat(middle, 9), cell, np.array([number]), middle, count, noise)


def joined(*cells):
    """All cells as cells of one pass."""
    each = {key: np.concatenate([getattr(one, key) for one in cells]) for key in vars(cells[0])}
    return View(**each)


def lines(count=900, level_sd=0.8, slope_sd=0.06, **more):
    """Draws of curves -10 + a + b (phi - 30 deg), a and b normal and independent [dB]."""
    rng = np.random.default_rng(4)
    a, b = rng.normal(0.0, level_sd, (count, 1)), rng.normal(0.0, slope_sd, (count, 1))
    nothing = np.zeros(count)
    curves = -10.0 + a + b * (WHOLE_DEG - 30.0)
    return replace(KeptDraws(np.zeros((count, 2)), nothing, nothing, curves, nothing), **more)


def sd(values):
    """Standard deviation of a normal distribution with the 90 % interval of the values."""
    return float(half_widths_now(values[:, None])[0] / 1.6448536269514722)


def sd_left(draws, seen, at, config=EXACT, own=(), same=False):
    return float(half_widths_after(draws, FLAT, own, seen, LOOKS, config, at, same)[0] / 1.6448536269514722)


@pytest.mark.parametrize("same", [False, True])
def test_several_passes_over_common_fields_agree_with_the_covariance_of_all_cells(same):
    """Two own passes and one further pass: normal distribution of curve and means, conditioned on means in turn."""
    rng, config = np.random.default_rng(8), Uncertainty(level_db=0.3, noise_db=2.0)
    draws = lines(200, field_db=np.full(200, 0.5), cell_db=np.full(200, 0.2))
    passes = [
        joined(
            *(view(int(rng.integers(90, 230)), float(rng.integers(2, 30)), noise, int(rng.choice(few))) for _ in few)
        )
        for noise, few in ((-22.0, [1, 2, 2, 7]), (-16.0, [2, 3, 7]), (-19.0, [1, 3, 3, 4, 7]))
    ]
    means = [one.means_db(draws.laws_db(FLAT)) for one in passes]
    of, scores = np.repeat([0, 1, 2], [4, 3, 5]), _normal_scores(np.hstack(means))
    patch, count, noise = (np.concatenate([getattr(one, key) for one in passes]) for key in KEYS)
    share = 10.0 ** (0.1 * (noise - np.hstack(means).mean(axis=0)))
    pass_alike = np.equal(of[:, None], of)
    errors = np.diag([speckle_db2(n) + 0.04 for n in count]) + 0.25 * np.equal(patch[:, None], patch)
    errors += 0.09 * (pass_alike | same) + 4.0 * np.outer(share, share) * pass_alike
    own, new = of < 2, of == 2
    given = errors[np.ix_(new, own)] @ np.linalg.inv(errors[np.ix_(own, own)])
    innovation = scores[:, new] - scores[:, own] @ given.T
    total = innovation.T @ innovation / 200 + errors[np.ix_(new, new)] - given @ errors[np.ix_(own, new)]
    curve = _normal_scores(draws.curves_db(FLAT)[:, AT_50])[:, 0]
    across = curve @ innovation / 200
    expected = np.sqrt(curve @ curve / 200 - across @ np.linalg.solve(total, across))
    assert sd_left(draws, passes[2:], AT_50, config, passes[:2], same) == pytest.approx(expected, rel=1e-6)


def test_one_draw_far_away_changes_neither_scores_nor_the_standard_deviation_of_fields():
    values = np.random.default_rng(1).normal(3.0, 2.0, (999, 2))
    scores = _normal_scores(values)
    assert scores.mean(axis=0) == pytest.approx([0.0, 0.0], abs=1e-12)
    assert scores.std(axis=0) == pytest.approx([sd(values[:, 0]), sd(values[:, 1])])
    assert (np.argsort(scores, axis=0) == np.argsort(values, axis=0)).all()
    far = values.copy()
    far[values.argmax(axis=0), [0, 1]] = 1e3
    np.testing.assert_allclose(_normal_scores(far), scores)
    # half of the draws without an effect, half with 2 dB: 1.2816 and 1.6449 are the normal quantiles of 90 and 95 %
    half = np.repeat([0.0, 2.0], 500)
    assert _equivalent_sd(half) == pytest.approx(2.0 * 1.281552 / 1.644854, rel=0.01)
    assert _equivalent_sd(np.full(9, 0.3)) == pytest.approx(0.3, rel=1e-12)
    assert _equivalent_sd(np.zeros(9)) == 0.0
    half[-1] = 1e3
    assert _equivalent_sd(half) == pytest.approx(2.0 * 1.281552 / 1.644854, rel=0.02)


def test_what_a_pass_sees_of_a_material(geometry_of_slopes):
    geometry = geometry_of_slopes
    radar = Radar(nesz_db=-25.0)
    found = view_of("slope", geometry, radar, 0)
    usable = geometry.pixels("slope")[~geometry.layover.ravel()[geometry.pixels("slope")]]
    assert found.pixels.tolist() == usable.tolist()
    assert found.incidence_deg == pytest.approx(geometry.incidence_deg.ravel()[usable])
    # cells: fields in squares of 24 pixels and in 3 degrees
    row, column = np.divmod(usable, 24)
    each = np.stack([column >= 12, row // 24, found.incidence_deg // 3])
    _, keys, count = np.unique(each, axis=1, return_inverse=True, return_counts=True)
    keys = keys.ravel()
    assert count.size == found.patch.size == 10
    assert np.unique(np.stack([keys, found.cell]), axis=1).shape[1] == 10
    first = [int(np.flatnonzero(keys == k)[0]) for k in range(10)]
    order = found.cell[first]
    assert found.middle_deg[order] == pytest.approx(np.bincount(keys, found.incidence_deg) / count)
    # pixels of 1.5 m by 2.5 m, in resolution cells of 2 m by 3.5 m
    assert found.independent[order] == pytest.approx(count * 3.75 / 7.0)
    assert found.noise_db == pytest.approx(-25.0)
    assert np.unique(np.stack([column[first] >= 12, found.patch[order]]), axis=1).shape[1] == 2
    # one pixel less in the cell of 8 in the last row
    layover = geometry.layover.copy()
    layover[24, 23] = True
    fewer = view_of("slope", replace(geometry, layover=layover), radar, 0)
    assert fewer.patch.size == 9
    assert fewer.pixels.tolist() == usable[:-8].tolist()
    assert view_of("patch", geometry, radar, 0) is None  # 40 pixels


@pytest.fixture
def geometry_of_slopes():
    """25 rows of 24 columns: two fields of slope (12 and 8 columns) apart, a patch of 40 pixels, a row in layover."""
    material = np.zeros((25, 24), dtype=np.uint8)
    material[:, :12], material[:, 16:] = 1, 1
    material[:10, 12:16] = 2
    layover = np.zeros(material.shape, dtype=bool)
    layover[3] = True
    return of_pixels(("slope", "patch"), material, np.linspace(30.0, 40.0, 25)[:, None], layover=layover)
