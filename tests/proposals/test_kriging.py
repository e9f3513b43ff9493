"""Kriging of several outputs, against smt and the formulas written out."""

import numpy as np
import pytest
from scipy.optimize import approx_fprime
from scipy.stats import multivariate_normal

from radcal.errors import SurrogateError
from radcal.proposals import kriging
from radcal.proposals.kriging import JITTER, Kriging, _minus_log_posterior, train


def example(n=15, d=2, seed=None):
    rng = np.random.default_rng(n if seed is None else seed)
    x = rng.random((n, d))
    return x, np.stack([3.0 * np.sin(4.0 * x[:, 0]) - x[:, -1] ** 2, 1.0 + np.exp(x[:, 0] - 2.0 * x[:, -1])], axis=-1)


NEW = np.random.default_rng(5).random((40, 2))


def test_one_point_gives_its_own_value_everywhere():
    model = Kriging([[0.3, 0.4]], [[2.0, -1.0, 7.0]], [1.0, 1.0])
    np.testing.assert_allclose(model.mean(NEW), np.tile([2.0, -1.0, 7.0], (len(NEW), 1)), atol=1e-9)
    np.testing.assert_array_equal(model.variance(NEW), 0.0)


def test_a_singular_correlation_ends_in_a_sentence():
    x, y = example(13, 4)
    with pytest.raises(SurrogateError, match="kriging of 14 points is impossible"):
        Kriging(np.vstack([x, x[:1]]), np.vstack([y, y[:1]]), np.ones(4), 0.0)


def test_points_too_near_for_their_nugget_have_the_least_that_gives_a_factor():
    """Two points closer than the correlation resolves in double precision."""
    x, y = example(13, 4)
    near = np.vstack([x, x[:1] + 1e-11])
    model = Kriging(near, np.vstack([y, y[:1]]), np.full(4, 0.7), 1e-17)
    assert model.nugget > 1e-17
    np.testing.assert_allclose(model.mean(x), y, atol=1e-4)
    assert Kriging(x, y, np.full(4, 0.7), 1e-17).nugget == 1e-17


@pytest.mark.parametrize("free", [False, True])
def test_the_gradient_is_that_of_finite_differences(free):
    x, y = example(9, 3)
    squares = (x[:, None] - x[None]) ** 2
    for log in ([0.2, -0.5, 0.9, -3.0], [-1.0, 0.4, -0.2, -1.0]):
        at = np.array(log if free else log[:3])
        value, gradient = _minus_log_posterior(at, squares, y, 0.02)
        numeric = approx_fprime(at, lambda p: _minus_log_posterior(p, squares, y, 0.02)[0], 1e-6)
        assert np.isfinite(value)
        assert np.abs(gradient).min() > 0.01
        np.testing.assert_allclose(gradient, numeric, rtol=1e-3, atol=1e-3)


def test_the_posterior_is_restricted_likelihood_times_prior():
    """Likelihood of the contrasts of each output, in closed form with the best variance, and the log-normal prior."""
    x, y = example(8)
    squares, k = (x[:, None] - x[None]) ** 2, len(x)
    contrasts = np.linalg.svd(np.ones((1, k)))[2][1:]  # orthogonal to the constant

    def direct(log, nugget):
        correlation = np.exp(-0.5 * (squares / np.exp(2.0 * np.asarray(log))).sum(axis=-1)) + nugget * np.eye(k)
        inside, seen = contrasts @ correlation @ contrasts.T, contrasts @ y
        variance = np.trace(seen.T @ np.linalg.solve(inside, seen)) / seen.size
        likelihood = multivariate_normal(np.zeros(k - 1), variance * inside).logpdf(seen.T).sum()
        return -likelihood + 0.5 * (np.asarray(log) ** 2).sum()

    places = [([0.0, 0.0], 0.01), ([-0.7, 0.3], 0.01), ([-0.7, 0.3], 0.1), ([0.5, -1.0], 0.01)]
    found = [_minus_log_posterior(np.array(log), squares, y, nugget)[0] for log, nugget in places]
    wanted = [direct(log, nugget) for log, nugget in places]
    assert np.ptp(wanted) > 3.0
    np.testing.assert_allclose(np.diff(found), np.diff(wanted), rtol=1e-6, atol=1e-8)
    # with a free nugget the same value
    again = _minus_log_posterior(np.array([-0.7, 0.3, np.log(0.1)]), squares, y, 0.5)[0]
    assert again == pytest.approx(found[2], rel=1e-12)


def test_a_run_or_few_leave_length_scales_at_the_width_of_the_box():
    scales, nugget = train(np.array([[0.2, 0.7]]), np.array([[3.0]]))
    np.testing.assert_array_equal(scales, 1.0)
    assert nugget == JITTER
    rng = np.random.default_rng(2)
    for k in (2, 3):
        for _ in range(4):
            scales, _ = train(rng.random((k, 4)), rng.normal(size=(k, 2)))
            assert (scales > 0.1).all()
            assert (scales < 5.0).all()


def noisy(n, sd, outputs=1):
    rng = np.random.default_rng(2)
    x = rng.random((n, 2))
    truth = 10.0 * np.sin(2.0 * x[:, [0]]) + 5.0 * x[:, [1]] ** 2
    return x, truth + sd * rng.standard_normal((n, outputs)), truth


def test_unknown_noise_is_found_out():
    x, y, truth = noisy(40, 0.5, outputs=2)
    scales, nugget = train(x, y, None)
    model = Kriging(x, y, scales, nugget)
    assert np.sqrt(nugget * model.process) == pytest.approx(0.5, rel=0.25)
    # it leaves about the noise between itself and the runs, and is nearer to the truth than they are
    assert (y - model.mean(x)).std() == pytest.approx(0.5, rel=0.3)
    error = np.sqrt(np.mean((model.mean(x) - truth) ** 2))
    assert error < 0.3
    # and says so
    assert 0.4 * error < np.sqrt(model.variance(x).mean()) < 2.5 * error


def test_excess_is_the_mean_square_of_standardised_leave_one_out_errors():
    """Points that scatter, at a length scale that is far too long: each left out in turn."""
    x, y = example(10)[0], np.random.default_rng(8).normal(size=(10, 2))
    scales, nugget = [1.5, 2.0], 0.01
    whole, squares = Kriging(x, y, scales, nugget), []
    for i in range(len(x)):
        keep = np.arange(len(x)) != i
        rest = Kriging(x[keep], y[keep], scales, nugget)
        variance = whole.process * (rest.variance(x[[i]])[0] / rest.process + nugget)
        squares.append((y[i] - rest.mean(x[[i]])[0]) ** 2 / variance)
    assert whole.excess == pytest.approx(np.mean(squares), rel=1e-6)
    assert whole.excess > 1.05
    # smooth outputs at a short length scale are predicted better than expected
    assert Kriging(*example(15), [0.2, 0.2], nugget).excess == 1.0


@pytest.mark.parametrize(("seed", "n"), [(39, 10), (50, 14), (10, 10)])
def test_of_several_maxima_the_largest_posterior_is_taken(seed, n):
    """Waves with noise: all of it noise of a slow process, or all of it a fast process."""
    rng = np.random.default_rng(seed)
    x = rng.random((n, 1))
    y = (np.sin(16.0 * x[:, 0]) + 0.5 * x[:, 0] + 0.15 * rng.normal(size=n))[:, None]
    squares, logs = (x[:, None] - x[None]) ** 2, np.linspace(np.log(0.02), np.log(50.0), 400)
    every = [_minus_log_posterior(np.array([log]), squares, y, JITTER)[0] for log in logs]
    (scale,), _ = train(x, y)
    found = _minus_log_posterior(np.log([scale]), squares, y, JITTER)[0]
    assert found == pytest.approx(min(every), abs=0.1)
    inner = np.array(every[1:-1])
    minima = inner[(inner < every[:-2]) & (inner < every[2:])]
    assert len(minima) > 1
    assert minima.max() > minima.min() + 5.0


def trained(output, seed=3):
    """Kriging of 420 points, its nugget, and rms of its errors at unseen points."""
    rng = np.random.default_rng(seed)
    x, unseen = rng.random((420, 4)), rng.random((300, 4))
    scales, nugget = train(x, output(x))
    model = Kriging(x, output(x), scales, nugget)
    return model, nugget, np.sqrt(np.mean((model.mean(unseen) - output(unseen)) ** 2))


def smooth(u):
    return np.exp(-u @ [1.0, 0.5, 0.3, 0.2])[:, None]


def test_many_points_predict_a_smooth_output_better_than_a_nugget_of_few_allows():
    _, nugget, error = trained(smooth, 5)
    assert nugget < JITTER
    assert error < 1.5e-6  # 8.9e-6 with the nugget of few points


def test_a_nugget_against_rounding_alone_does_not_smooth(monkeypatch):
    """The prediction at the points themselves is nearer to the outputs, that elsewhere to the function."""
    rng = np.random.default_rng(6)
    x, new, given = rng.random((410, 4)), rng.random((40, 4)), ([0.9, 1.7, 2.8, 4.1], 1e-11)
    refined = Kriging(x, smooth(x), *given)
    monkeypatch.setattr(kriging, "_REFINEMENTS", 0)
    plain = Kriging(x, smooth(x), *given)
    for points, most in ((x, 0.6), (new, 0.85)):
        ours, theirs = (np.sqrt(np.mean((one.mean(points) - smooth(points)) ** 2)) for one in (refined, plain))
        assert ours < most * theirs


def test_many_points_tell_a_rough_output_from_a_smooth_one():
    """Waves so short that they are noise for the points: their variance is nugget times variance of the process."""
    model, nugget, error = trained(
        lambda u: (np.sin(3.0 * u[:, 0]) + u[:, 1] ** 2 + 0.01 * np.sqrt(2.0) * np.sin(4e4 * u[:, 2]))[:, None]
    )
    assert [np.sqrt(nugget * model.process), error] == pytest.approx([0.01, 0.01], rel=0.15)


def test_many_points_of_a_nearly_linear_output_have_long_scales():
    _, _, error = trained(
        lambda u: (50.0 * u[:, 0] + 40.0 * u[:, 1] + 50.0 * u[:, 2] * np.exp(-15.0 * u[:, 3]))[:, None]
    )
    assert error < 9e-3  # 1.9e-2 with scales of at most 5


def test_a_nugget_without_a_factor_is_raised(monkeypatch):
    monkeypatch.setattr(kriging, "_LEAST_NUGGET", 1e-20)
    monkeypatch.setattr(kriging, "_NUGGETS", (1e-17,))
    model, nugget, error = trained(lambda u: u[:, :1])
    assert nugget < 1e-16 < model.nugget < JITTER
    assert error < 1e-6
