"""Misfits, against simulation and direct likelihoods."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from radcal.ground.bins import make_classes
from radcal.ground.correlation import independent_pairs
from radcal.ground.ground import Ground
from radcal.ground.patches import Spread
from radcal.inference.misfit import SKEWNESS_SHAPE, BinMisfit, LawForward, LikelihoodMisfit, Method, true_angles
from radcal.inference.moments import sampling_covariance
from radcal.laws import LAWS

LAW = LAWS["mangia"]
X = np.array([-30.0, 18.0, 5.0, 5.0])
BOUNDS = [[-60.0, 0.0], [0.0, 50.0], [0.0, 50.0], [0.0, 20.0]]
METHOD = Method(LAW, BOUNDS, looks=4.0, classes=5)


def speckled(rng, incidence_deg, looks, x=X):
    n = incidence_deg.size
    return LAW(np.radians(incidence_deg), x) + 10.0 * np.log10(rng.gamma(looks, 1.0 / looks, n))


def one_patch(classes):
    n, one = classes.size, np.zeros(1, int)
    return BinMisfit(classes, np.ones((n, 1)), np.eye(n), np.zeros(n, int), 0.0, 0.0, METHOD, classes.nodes_deg, one)


def test_patches_inside_of_a_class_widen_it():
    classes = make_classes(np.random.default_rng(4).normal(size=300), np.linspace(20, 40, 300), 1)
    objective = BinMisfit(
        classes, np.full((1, 4), 0.25), np.full((1, 10), 0.1), np.arange(10) // 3, 2.0, 1.0, METHOD, classes.nodes_deg,
        np.arange(4),
    )  # fmt: skip
    assert objective.patch_variance[0] == pytest.approx(4.0 * 0.75 + 0.9)


def test_the_likelihood_is_the_pixels_own():
    rng = np.random.default_rng(5)
    incidence = np.full(4000, 40.0)
    values = speckled(rng, incidence, 3.0)
    classes = make_classes(values, incidence, 1).compared(1)  # every pixel counts for half a pixel
    objective = LikelihoodMisfit(classes, values, METHOD, classes.nodes_deg)

    def direct(level_db, looks):
        power = 10.0 ** (values / 10.0)
        return 0.5 * stats.gamma(looks, scale=10.0 ** (level_db / 10.0) / looks).logpdf(power).sum()

    level = float(LAW(np.radians(40.0), X))
    places = [(level, 3.0), (level + 0.3, 3.0), (level, 2.6), (level - 0.2, 3.4)]
    cost = [-0.5 * (objective.residuals(np.array([[at]]), looks) ** 2).sum() for at, looks in places]
    wanted = [direct(at, looks) for at, looks in places]
    np.testing.assert_allclose(np.array(cost) - cost[0], np.array(wanted) - wanted[0], rtol=0.05)


def test_residuals_of_small_and_large_bins_are_of_their_own_counts():
    """Deviance at the truth in each of two bins: about one for each 0.5 dB that holds some pixels."""
    rng = np.random.default_rng(21)
    incidence = np.repeat([30.0, 50.0], [500, 2500])
    values = speckled(rng, incidence, 3.0)
    classes = replace(make_classes(values, incidence, 2), member=(incidence > 40.0).astype(np.int64))
    classes = replace(classes, count=np.array([500, 2500]), pairs=independent_pairs(classes.member, 2))
    objective = LikelihoodMisfit(classes, values, METHOD, classes.nodes_deg)
    each = (objective.residuals(LAW(np.radians([[30.0], [50.0]]), X), 3.0) ** 2).reshape(2, -1)
    for k, part in enumerate(each):
        filled = np.histogram(values[classes.member == k], objective._bins)[0] >= 5
        assert filled.sum() > 20
        assert part[filled].mean() == pytest.approx(1.0, abs=3.0 * np.sqrt(2.0 / filled.sum()))


def test_the_covariance_is_sampling_fields_and_the_shape_of_texture():
    """Means, then log sds, then skewnesses; fields and cells by the shares of the pixels that bins have of them."""
    rng = np.random.default_rng(6)
    n = 900
    incidence = rng.uniform(30.0, 50.0, n)
    values = speckled(rng, incidence, 4.0)
    patch, block = rng.integers(1, 4, n), (incidence // 4).astype(np.int64)
    ground = Ground(values, incidence, patch, block)
    classes = make_classes(values, incidence, 3)
    found = BinMisfit.of(ground, classes, METHOD, Spread(0.7, 0.3)).covariance.reshape(3, 3, 3, 3)
    pairs, cell = np.unique(np.stack([patch, block], axis=-1), axis=0, return_inverse=True)
    cell, of_cell = cell.ravel(), pairs[:, 0]
    for i in range(3):
        for j in range(3):
            inside = classes.member == i, classes.member == j
            together = [
                sum(np.mean(label[inside[0]] == k) * np.mean(label[inside[1]] == k) for k in np.unique(label))
                for label in (patch, cell)
            ]
            wanted = np.diag([0.7**2 * together[0] + 0.3**2 * together[1], 0.1**2 * together[0], SKEWNESS_SHAPE**2])
            if i == j:
                levels = classes.cumulants[i, 1] - classes.speckle_db2[i]
                wanted = wanted + sampling_covariance(classes.speckle_db2[i], classes.effective[i], levels)
            share = [np.array([np.mean(cell[one] == c) for c in range(cell.max() + 1)]) for one in inside]
            effects = 0.3**2 * np.eye(cell.max() + 1) + 0.7**2 * np.equal.outer(of_cell, of_cell)
            about = [np.diag(one) - np.outer(one, one) for one in share]
            of_variance = 2.0 * np.trace(about[0] @ effects @ about[1] @ effects)
            wanted[1, 1] += of_variance / (4.0 * classes.cumulants[i, 1] * classes.cumulants[j, 1])
            np.testing.assert_allclose(found[:, i, :, j], wanted, rtol=1e-9, atol=1e-12)


def test_slack_draws_statistics_to_the_measured_ones():
    """Differences within it vanish, others are smaller by it."""
    rng = np.random.default_rng(8)
    incidence = rng.uniform(30.0, 50.0, 2000)
    classes = make_classes(speckled(rng, incidence, 4.0), incidence, 2)
    misfit = one_patch(classes)
    run = classes.cumulants + [[1.0, 0.0, 0.0], [-0.4, 0.0, 0.0]]
    mean = np.zeros((2, 3))
    mean[:, 0] = 0.4
    lowered = classes.cumulants + [[0.6, 0.0, 0.0], [0.0, 0.0, 0.0]]
    np.testing.assert_allclose(misfit(X, 4.0, run, mean), misfit(X, 4.0, lowered), atol=1e-9)
    np.testing.assert_allclose(misfit(X, 4.0, run, 1.1), 0.0, atol=1e-9)


def test_the_likelihood_takes_its_levels_from_the_runs_means():
    """A simulator 0.7 dB brighter than the law is the same as a law with another constant."""
    rng = np.random.default_rng(10)
    incidence = rng.uniform(30.0, 50.0, 3000)
    values = speckled(rng, incidence, 3.0)
    classes = make_classes(values, incidence, 3)
    ground = Ground(values, incidence, np.ones(3000, int), np.zeros(3000, int))
    misfit = LikelihoodMisfit.of(ground, classes, METHOD, Spread(0.0, 0.0))
    higher = X + [0.7, 0.0, 0.0, 0.0]
    runs = [LawForward(LAW, classes.nodes_deg, 4.0)(x) for x in (X, higher)]
    np.testing.assert_allclose(misfit(X, 3.0, runs[1]), misfit(higher, 3.0, runs[1]), atol=1e-9)
    assert (misfit(X, 3.0, runs[0]) ** 2).sum() + 50.0 < (misfit(X, 3.0, runs[1]) ** 2).sum()


def test_errors_of_pixels_enter_their_bins():
    """Of one size they say what one number says; where they differ, each bin has its own."""
    rng = np.random.default_rng(11)
    mapped = rng.normal(40.0, 6.0, 4000)
    values = speckled(rng, mapped, 4.0)
    classes = make_classes(values, mapped, 4)
    ground = Ground(values, mapped, np.ones(4000, int), np.zeros(4000, int))
    one = replace(METHOD, incidence_error_deg=2.0)
    same = replace(ground, error_deg=np.full(4000, 2.0))
    wanted = true_angles(ground, classes, one, classes.nodes_deg)
    np.testing.assert_allclose(true_angles(same, classes, METHOD, classes.nodes_deg), wanted, rtol=1e-12)
    run = LawForward(LAW, classes.nodes_deg, 4.0)(X)
    whole, each = (
        BinMisfit.of(g, classes, m, Spread(0.0, 0.0))(X, 4.0, run) for g, m in ((ground, one), (same, METHOD))
    )
    np.testing.assert_allclose(each, whole, rtol=1e-12)
    # an edge inside of the last bin: half of its pixels are 6 degrees off, the others 1 degree
    last = np.flatnonzero(classes.member == 3)
    error = np.ones(4000)
    error[last[::2]] = 6.0
    nodes = true_angles(
        replace(ground, error_deg=error), classes, METHOD, np.full((4, 1), 0.0) + classes.nodes_deg[:, 12:13]
    )
    rms = np.sqrt([1.0, 1.0, 1.0, 18.5])
    square = np.var(mapped) - np.mean(error**2)
    np.testing.assert_allclose(nodes.std(axis=1), rms * np.sqrt(square / (square + rms**2)), rtol=1e-3)


def test_bins_of_nearly_normal_pixels_share_powers_of_the_correlation():
    """Speckle of very many looks: covariances of normal means, variances and third moments are closed forms."""
    incidence = np.linspace(30.0, 50.0, 200)
    classes = make_classes(np.zeros(200), incidence, 2)
    variance = np.array([1e-4, 4e-4])
    pairs = np.array(
        [[[0.02, 0.012], [0.012, 0.03]], [[0.015, 0.006], [0.006, 0.02]], [[0.011, 0.002], [0.002, 0.012]]]
    )
    classes = replace(
        classes, pairs=pairs, speckle_db2=variance, cumulants=np.stack([0.0 * variance, variance, 0.0 * variance], -1)
    )
    found = one_patch(classes).sampling.reshape(3, 2, 3, 2)
    sd = np.sqrt(variance)
    for k, wanted in enumerate([np.outer(sd, sd) * pairs[0], 0.5 * pairs[1], 6.0 * pairs[2]]):
        np.testing.assert_allclose(found[k, :, k], wanted, rtol=0.01)
    # the skewed speckle of few looks correlates a bin's mean with another's log sd, as much the other way round
    few = np.array([5.0, 5.0])
    found = one_patch(
        replace(classes, speckle_db2=few, cumulants=np.stack([0.0 * few, few, 0.0 * few], -1))
    ).sampling.reshape(3, 2, 3, 2)
    alone = sampling_covariance(5.0, 1.0)
    np.testing.assert_allclose(found[0, 0, 1, 1], alone[0, 1] * pairs[0, 0, 1], rtol=1e-9)
    np.testing.assert_allclose(found[1, 0, 0, 1], alone[0, 1] * pairs[0, 0, 1], rtol=1e-9)
