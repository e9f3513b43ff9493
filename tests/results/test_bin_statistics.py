"""Statistics of bins as closed forms give them, sensitivities of the surrogate, and draws from the prior of X."""

from dataclasses import replace

import numpy as np
import pytest
from calibration_samples import make_material, make_run, make_target

from radcal.config import SurrogateConfig
from radcal.ground.bins import make_classes
from radcal.ground.patches import Spread
from radcal.inference.moments import from_cumulants
from radcal.laws import LAWS
from radcal.objectives.bins import Bins
from radcal.objectives.density import Density
from radcal.objectives.history import History
from radcal.objectives.joint import Joint
from radcal.proposals.surrogate import train_surrogate
from radcal.results.results import bin_statistics, prior_draws
from radcal.speckle.texture import log_speckle_cumulants
from radcal.targets.target import ClassTarget

LAW, X = LAWS["mangia"], [-12.0, 5.0, 7.0, 3.0]
BOX = np.array([[-30.0, 10.0], [-5.0, 15.0], [0.0, 30.0], [0.0, 15.0]])


def made(kind=Bins, shift=0.0, box=BOX, priors=True, spread=(1.3, 0.4)):
    """Objective of 600 pixels in three bins between 20 and 50 degrees, of four looks."""
    rng = np.random.default_rng(3)
    angle = np.linspace(20.0, 50.0, 600)
    values = LAW(np.radians(angle), X) + shift + 10.0 * np.log10(rng.gamma(4.0, 0.25, 600))
    target = make_target(values, angle, patch=np.arange(600) // 75, block=np.arange(600) // 25)
    classes = make_classes(values, angle, 3).compared(1)
    bins = ClassTarget(classes, Spread(*spread), True, priors, 0.0, np.array(X), 4.0)
    return kind(make_material(replace(target, classes=bins), box, LAW, priors=priors))


def runs_of(objective, x=X, looks=4.0, **reference):
    """Reference run and one infill run, with the baseline's statistics 0.3 above in the mean."""
    statistics = objective.baseline(np.array([x, X])) + [0.3, 0.0, 0.0]
    runs = [
        make_run(kind, 0, {"dyke": cost}, x=at, statistics=one.tolist(), looks=looks, **more)
        for kind, cost, at, one, more in zip(
            ("reference", "infill"), (9.0, 2.0), (x, X), statistics, (reference, {}), strict=True
        )
    ]
    return History(runs), statistics


def test_expected_statistics_have_the_looks_of_the_run_and_the_variance_of_fields():
    objective = made()
    history, (of_start, of_best) = runs_of(objective, [-10.0, 5.0, 7.0, 3.0], looks=2.5)
    found = bin_statistics(objective, history)
    assert found.in_pass.tolist() == [1, 1, 1]
    np.testing.assert_allclose(found.incidence_deg, [25.0, 35.0, 45.0], atol=0.1)
    np.testing.assert_allclose(found.measured, from_cumulants(objective.bins.classes.cumulants))
    np.testing.assert_allclose(found.error, objective.scale)
    texture = log_speckle_cumulants(2.5) - log_speckle_cumulants(4.0)
    np.testing.assert_allclose(found.calibrated[:, 0], of_best[:, 0] + texture[0], rtol=1e-9)
    variance = np.exp(2.0 * of_best[:, 1]) + texture[1] + objective.moments.patch_variance
    np.testing.assert_allclose(found.calibrated[:, 1], 0.5 * np.log(variance), rtol=1e-9)
    np.testing.assert_allclose(found.start[:, 0] - found.calibrated[:, 0], of_start[:, 0] - of_best[:, 0])
    assert found.sensitivity is None


def test_start_with_another_law_and_an_objective_without_bins_are_absent():
    objective = made()
    assert bin_statistics(objective, runs_of(objective, own_law=False)[0]).start is None
    assert bin_statistics(made(Density), runs_of(objective)[0]) is None


def test_bins_of_all_passes_follow_one_another():
    first, second = made(), made(shift=-2.0, priors=False)
    joint = Joint([first, None, second])
    history, _ = runs_of(first)
    both = np.concatenate([history.best("dyke").statistics, np.asarray(history.best("dyke").statistics) - 0.7])
    score = replace(history.best("dyke"), statistics=both.tolist(), densities=[history.best("dyke").densities[0]] * 3)
    run = replace(history.runs[1], scores={"dyke": score})
    found = bin_statistics(joint, History([run]))
    assert found.in_pass.tolist() == [1, 1, 1, 3, 3, 3]
    np.testing.assert_allclose(found.measured[3:, 0] - found.measured[:3, 0], -2.0)
    np.testing.assert_allclose(found.calibrated[3:, 0] - found.calibrated[:3, 0], -0.7)


def test_sensitivity_is_the_change_over_a_hundredth_of_the_bounds():
    objective = made()
    x = np.array([X, [-10.0, 4.0, 9.0, 2.0], [-14.0, 7.0, 5.0, 4.0]])
    training = train_surrogate(objective, x, objective.baseline(x) + [0.3, 0.0, 0.0], SurrogateConfig())
    found = bin_statistics(objective, runs_of(objective)[0], training).sensitivity
    assert found.shape == (3, 3, 4)
    nodes = np.radians(objective.bins.classes.nodes_deg)
    gauss = np.exp(-3.0 * nodes**2)
    slopes = np.stack([np.ones(3), np.cos(nodes).mean(1), gauss.mean(1), (-7.0 * nodes**2 * gauss).mean(1)], axis=1)
    # the law is the same at noise far below it
    np.testing.assert_allclose(found[:, 0], slopes * np.ptp(BOX, axis=1) / 100.0, rtol=0.02)


def test_prior_is_uniform_inside_the_bounds_without_a_prior_on_the_curve():
    found = prior_draws(made(priors=False), np.random.default_rng(1))
    assert found.shape == (2000, 4)
    unit = (found - BOX[:, 0]) / np.ptp(BOX, axis=1)
    np.testing.assert_allclose(unit.mean(axis=0), 0.5, atol=0.03)
    np.testing.assert_allclose(unit.std(axis=0), 1.0 / np.sqrt(12.0), atol=0.02)


def test_draws_have_the_prior_of_the_curve():
    # one parameter is free, so that the prior can be integrated on a grid
    box = np.array([[-12.0, -12.0 + 1e-9], [5.0, 5.0 + 1e-9], [0.0, 30.0], [3.0, 3.0 + 1e-9]])
    objective = made(box=box)
    found = prior_draws(objective, np.random.default_rng(1))[:, 2]
    grid = np.linspace(0.0, 30.0, 3001)
    prior = objective.prior
    weight = np.array([np.exp(-0.5 * (prior.residuals([-12.0, 5.0, at, 3.0]) ** 2).sum()) for at in grid])
    mean = np.average(grid, weights=weight)
    sd = np.sqrt(np.average((grid - mean) ** 2, weights=weight))
    assert abs(mean - 15.0) > 1.5
    assert found.mean() == pytest.approx(mean, abs=4.0 * sd / 44.7)
    assert found.std() == pytest.approx(sd, rel=0.08)
