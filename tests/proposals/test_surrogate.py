from dataclasses import replace

import numpy as np
import pytest
from calibration_samples import make_material, make_target

from radcal.config import SurrogateConfig
from radcal.errors import SurrogateError
from radcal.inference.moments import to_dp
from radcal.objectives import objective_class
from radcal.proposals.kriging import JITTER, Kriging, baseline_factor
from radcal.proposals.smt_kriging import train_smt
from radcal.proposals.surrogate import Surrogate, Training, Trainings, train_surrogate

BOUNDS = np.array([[0.0, 2.0], [-1.0, 1.0]])
POSTERIOR, DIRECT = SurrogateConfig(), SurrogateConfig(outputs="direct")
TARGET = make_target(np.random.default_rng(0).normal(-10.0, 3.0, 200), np.full(200, 45.0))


def objective(baseline=None, bounds=BOUNDS, integer=None):
    """The box of two parameters, and what is known of the statistics before any run."""
    found = objective_class("density")(make_material(TARGET, bounds, integer=integer))
    if baseline is not None:
        found.baseline = lambda x: np.stack([baseline(one) for one in x])
    return found


def truth(x):
    """A smooth map from X to the statistics of two bins, shape (..., 2, 3)."""
    a, b = np.moveaxis(np.asarray(x), -1, 0)
    mean = 3.0 * a - b**2
    log_sd = 0.5 + 0.3 * b + 0.1 * np.sin(2.0 * a)
    skewness = 0.6 * np.tanh(a * b)
    first = np.stack([mean, log_sd, skewness], axis=-1)
    return np.stack([first, first * [0.5, 1.0, 2.0] + [4.0, 0.2, 0.1]], axis=-2)


def points(n, seed=0):
    low, high = BOUNDS.T
    return low + np.random.default_rng(seed).random((n, 2)) * (high - low)


def surrogate(n, baseline=None, config=POSTERIOR, **keys):
    x, of = points(n), objective(baseline)
    return Surrogate(train_surrogate(of, x, truth(x), config, **keys), of)


@pytest.fixture(scope="module")
def trained():
    return surrogate(25)


def test_predicts_unseen_points_and_knows_what_it_knows(trained):
    x = points(50, seed=1)
    error = np.abs(trained.predict(trained.unit(x)) - truth(x))
    assert error.max() < 0.05
    assert (trained.training.q2 > 0.99).all()
    assert trained.training.status == ("trained",) * 3
    assert not trained.training.baseline.any()
    np.testing.assert_allclose(trained.predict(trained.unit(points(25))), truth(points(25)), atol=1e-3)
    few = surrogate(4)
    at, away = few.standard_error(few.unit(points(4))), few.standard_error([[0.999, 0.001]])
    assert at.shape == (4, 2, 3)
    assert (at.max(axis=0) < 0.05 * away[0]).all()


def test_one_run_is_wrong_elsewhere_by_its_own_difference_from_the_baseline():
    """A process of this mean square and a length scale of one width: 1 - exp(-d^2) of it is unknown at a distance d."""
    shift = np.array([[0.7, -0.1, 0.2], [-1.2, 0.3, 0.0]])
    found = surrogate(1, lambda x: truth(x) - shift)
    at = found.unit(points(1)) + [[0.0, 0.0], [0.3, -0.4], [0.0, 0.2]]
    wanted = np.outer(1.0 - np.exp([-0.0, -0.25, -0.04]), (shift**2).mean(axis=0))
    np.testing.assert_allclose(found.error(at) ** 2, wanted, atol=1e-15)
    # by which the draws of a batch differ, after the first run of a search, too
    off = (found.drawn(3).predict(at) - found.predict(at)) / np.random.default_rng(3).standard_normal(3)
    np.testing.assert_allclose(off, np.repeat(np.sqrt(wanted)[:, None], 2, axis=1), atol=1e-12)


def test_errors_of_runs_that_leave_one_out_finds_larger_are_larger():
    """Points that scatter at a length scale that is far too long for them."""
    x, values = points(9), np.random.default_rng(4).normal(size=(9, 2, 3))
    made = train_surrogate(objective(), x, values, POSTERIOR)
    found = Surrogate(replace(made, scales=np.full((3, 2), 2.0), nugget=np.full(3, 1e-4)), objective())
    unit, new = found.unit(x), np.array([[0.2, 0.9], [0.5, 0.4]])
    each = [Kriging(unit, values[..., k], [2.0, 2.0], 1e-4) for k in range(3)]
    ratio = found.error(new) / found.standard_error(new)[:, 0]
    np.testing.assert_allclose(ratio**2, np.tile([model.excess for model in each], (2, 1)))
    assert ratio.min() > 1.05
    # and those of verified predictions, where they are larger; those that were good make nothing better known
    surprise = np.array([4.0 * each[0].excess, 0.1, 9.0 * each[2].excess])
    told = Surrogate(found.training, objective(), surprise)
    np.testing.assert_allclose(told.error(new) / found.error(new), [[2.0, 1.0, 3.0]] * 2)
    np.testing.assert_array_equal(told.standard_error(new), found.standard_error(new))


def unrelated(x):
    """Of another law: steep where the simulator is flat."""
    a, b = x
    return np.full((2, 1), 1.0) * [20.0 * np.sin(9.0 * b + 3.0 * a), np.cos(11.0 * a), np.sin(8.0 * b * a)]


def exaggerated(x):
    """The runs vary by 0.6 of this baseline, and lie elsewhere."""
    return truth(x) / 0.6 + 1.0


def test_a_baseline_that_exaggerates_is_multiplied_by_the_factor_that_the_runs_show():
    """With a single bin, from four runs on; the library's kriging is left as it is."""

    def made(runs, baseline, training="posterior"):
        x, of = points(runs), objective(baseline and (lambda x: baseline(x)[:1]))
        return Surrogate(train_surrogate(of, x, truth(x)[:, :1], SurrogateConfig(training=training)), of)

    x = points(50, seed=1)
    assert made(3, exaggerated).training.baseline.tolist() == [1.0] * 3
    found, alone = made(6, exaggerated), made(6, None)
    np.testing.assert_allclose(found.training.baseline, 0.6, atol=0.06)
    error = [np.abs(one.predict(one.unit(x)) - truth(x)[:, :1]).mean(axis=(0, 1)) for one in (found, alone)]
    assert (error[0] < 0.3 * error[1]).all()
    assert "; baseline multiplied: mean by 0.6" in found.training.sentence()
    assert "without baseline" not in found.training.sentence()
    for other in (made(6, exaggerated, "smt"), surrogate(6, exaggerated)):
        assert set(other.training.baseline) <= {0.0, 1.0}


def test_the_factor_of_a_baseline():
    """Known runs beat the prior; runs that do not depend on the baseline leave little of it."""
    x, rng = np.random.default_rng(3).random((12, 2)), np.random.default_rng(4)
    base = np.sin(7.0 * x[:, 0]) + np.cos(5.0 * x[:, 1])
    for factor in (0.5, 0.8, 1.0, 1.5):
        assert baseline_factor(x, factor * base + 3.0, base) == pytest.approx(factor, abs=0.1)
    assert abs(baseline_factor(x, 1e-3 * rng.standard_normal(12), base)) < 0.1
    # two runs are one equation: the prior keeps a part
    assert 0.75 < baseline_factor(x[:2], 0.5 * base[:2], base[:2]) < 0.95


def test_each_statistic_keeps_or_drops_its_own():
    found = surrogate(8, lambda x: np.stack([truth(x)[:, 0] + 0.3, *unrelated(x).T[1:]], axis=-1))
    assert found.training.baseline.tolist() == [True, False, False]
    assert found.training.sentence().endswith("without baseline: log sd, skewness")
    assert not surrogate(3, unrelated, SurrogateConfig(baseline=False)).training.baseline.any()
    x = points(30, seed=2)
    np.testing.assert_allclose(found.predict(found.unit(x))[..., 0], truth(x)[..., 0], atol=1e-9)


@pytest.mark.parametrize("baseline", [None, lambda x: truth(x) + 0.1 * np.sin(x[0])])
def test_stored_as_data_and_rebuilt(baseline, tmp_path):
    made = surrogate(7, baseline)
    Trainings({"wheat 2": made.training, "soil": surrogate(1, baseline).training}).write(tmp_path / "s.h5")
    again = Trainings.read(tmp_path / "s.h5").materials
    assert list(again) == ["wheat 2", "soil"]
    unit = np.random.default_rng(3).random((20, 2))
    rebuilt = Surrogate(again["wheat 2"], objective(baseline))
    np.testing.assert_array_equal(rebuilt.predict(unit), made.predict(unit))
    np.testing.assert_array_equal(rebuilt.standard_error(unit), made.standard_error(unit))
    assert again["wheat 2"].status == made.training.status
    assert np.isnan(again["soil"].q2).all()


def test_direct_outputs():
    x = points(40)
    centred, direct = truth(x)[:, :1] * [1.0, 1.0, 0.5], objective(lambda x: unrelated(x)[:1])
    found = Surrogate(train_surrogate(direct, x, centred, DIRECT), direct)
    assert found.training.direct
    assert not found.training.baseline.any()
    np.testing.assert_allclose(found.predict(found.unit(x)), centred, atol=1e-3)
    # xi, omega and alpha are what kriging sees
    new = found.unit(points(10, seed=1))
    model = Kriging(found.unit(x), to_dp(centred)[..., 2], found.training.scales[2], found.training.nugget[2])
    np.testing.assert_allclose(to_dp(found.predict(new))[..., 2], model.mean(new), rtol=1e-6)
    np.testing.assert_array_equal(found.standard_error(new), 0.0)


def test_smt_trains_where_the_paper_asks_for_it():
    x = points(2)
    training = train_surrogate(objective(), x, truth(x)[:, :1], SurrogateConfig(training="smt"))
    assert training.scales.shape == (3, 2)
    np.testing.assert_array_equal(training.scales[0], train_smt((x - BOUNDS[:, 0]) / 2.0, truth(x)[:, 0, 0])[0])
    assert (training.nugget < JITTER).all()
    np.testing.assert_allclose(
        Surrogate(training, objective()).predict((x - BOUNDS[:, 0]) / 2.0), truth(x)[:, :1], atol=1e-4
    )


def test_bad_training_data_is_refused():
    values = truth(points(5))
    values[3, 1, 1] = np.nan
    with pytest.raises(SurrogateError, match="training statistics hold values that are not finite"):
        train_surrogate(objective(), points(5), values, POSTERIOR)
    x = points(5)
    x[2, 0] = np.inf
    with pytest.raises(SurrogateError, match="training parameters"):
        train_surrogate(objective(), x, truth(points(5)), POSTERIOR)


def test_whole_parameters_are_rounded_in_x_and_in_the_box():
    of = objective(bounds=[[0.0, 2.0], [1.0, 9.0]], integer=[False, True])
    scales, at = np.ones((3, 2)), np.array([[0.3, 5.0]])
    training = Training(at, np.zeros((1, 1, 3)), scales, np.full(3, 1e-9), np.zeros(3, bool), np.zeros(3), ("",) * 3)
    found = Surrogate(training, of)
    np.testing.assert_allclose(found.scaled([[0.3, 0.43], [0.3, 0.45]]), [[0.6, 4.0], [0.6, 5.0]])
    np.testing.assert_allclose(found.snapped([[0.3, 0.43]]), [[0.3, 0.375]])


NOISE = np.array([[0.5**2, 0.02**2, 0.05**2]])


def noisy_runs(n):
    x, scatter = points(n), np.random.default_rng(2).standard_normal((n, 1, 3))
    return x, truth(x)[:, :1] + scatter * np.sqrt(NOISE)


def test_a_measured_noise_is_part_of_the_surrogate(tmp_path):
    """Six runs pass for exact ones: only what was measured says otherwise."""
    x, y = noisy_runs(6)
    exact = Surrogate(train_surrogate(objective(), x, y, POSTERIOR), objective())
    training = train_surrogate(objective(), x, y, POSTERIOR, NOISE, noisy=True)
    told = Surrogate(training, objective())
    unit = told.unit(x)
    for k in range(3):
        process = Kriging(unit, y[..., k], training.scales[k], training.nugget[k]).process
        if training.nugget[k] < 9.99:  # no more than ten variances of the process
            assert training.nugget[k] * process == pytest.approx(NOISE[0, k], rel=0.05)
    assert (training.nugget < 9.99).any()
    assert np.abs(exact.predict(unit) - y)[..., 0].max() < 1e-3 < 0.05 < np.abs(told.predict(unit) - y)[..., 0].max()
    assert exact.standard_error(unit)[..., 0].max() < 0.01 < 0.1 < told.standard_error(unit)[..., 0].min()
    # bins share it: the mean of their variances counts
    pairs = [np.concatenate([share * NOISE, (2.0 - share) * NOISE]) for share in (0.5, 1.0)]
    both, equal = (
        train_surrogate(objective(), x, np.repeat(y, 2, axis=1), POSTERIOR, pair, noisy=True) for pair in pairs
    )
    np.testing.assert_allclose(both.scales, equal.scales, rtol=1e-9)
    np.testing.assert_allclose(both.nugget, equal.nugget, rtol=1e-9)


def test_a_noise_measured_of_the_moments_is_not_that_of_direct_outputs():
    """Of xi, omega and alpha it is unknown, and estimated as such."""
    x, y = noisy_runs(7)
    told, unknown = (train_surrogate(objective(), x, y, DIRECT, noise, noisy=True) for noise in (NOISE, None))
    np.testing.assert_array_equal(told.nugget, unknown.nugget)
    np.testing.assert_array_equal(told.scales, unknown.scales)
    assert (told.nugget > JITTER).any()


def test_runs_that_repeat_have_no_noise_whatever_was_measured():
    x, y = noisy_runs(6)
    exact, measured = (train_surrogate(objective(), x, y, POSTERIOR, noise) for noise in (None, NOISE))
    np.testing.assert_array_equal(exact.nugget, JITTER)
    np.testing.assert_array_equal(measured.scales, exact.scales)
    assert replace(measured, q2=exact.q2).status == exact.status
