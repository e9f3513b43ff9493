from __future__ import annotations

import pickle

import numpy as np
import pytest

from radcal import skewnormal
from radcal.calibration.surrogate import Surrogate, read_surrogates, to_direct, write_surrogates
from radcal.errors import SurrogateError

BOUNDS = np.array([[0.0, 2.0], [-1.0, 1.0]])


def truth(x):
    """A smooth map from X to the density, as (xi, omega, alpha)."""
    mean = 3.0 * x[:, 0] - x[:, 1] ** 2
    log_sd = 0.5 + 0.3 * x[:, 1] + 0.1 * np.sin(2 * x[:, 0])
    skewness = 0.6 * np.tanh(x[:, 0] * x[:, 1])
    return skewnormal.direct(np.stack([mean, np.exp(log_sd), skewness], axis=-1))


def points(n, seed=0):
    low, high = BOUNDS.T
    return low + np.random.default_rng(seed).random((n, 2)) * (high - low)


@pytest.fixture(scope="module")
def trained():
    x = points(30)
    return Surrogate(BOUNDS, x, truth(x)).train()


def test_predicts_unseen_points(trained):
    x = points(50, seed=1)
    predicted = skewnormal.centred(to_direct(trained.predict(trained.unit(x))))
    expected = skewnormal.centred(truth(x))
    np.testing.assert_allclose(predicted, expected, atol=0.05)
    assert (trained.q2 > 0.95).all()
    assert all(status in ("converged", "evaluations used up") for status in trained.status)


@pytest.fixture(scope="module")
def fixed():
    """Length scales given, short enough for a well-conditioned correlation matrix."""
    x = points(30)
    return Surrogate(BOUNDS, x, truth(x)).restore(np.full((3, 2), 5.0), np.full(3, 1e-10), np.zeros(3), ["given"] * 3)


def test_interpolates_and_knows_what_it_knows(fixed):
    unit = fixed.unit(fixed.parameters)
    np.testing.assert_allclose(
        skewnormal.centred(to_direct(fixed.predict(unit))), skewnormal.centred(fixed.dp), atol=1e-6
    )
    at = fixed.standard_error(unit).max(axis=0)
    away = fixed.standard_error([[0.999, 0.001]])[0]
    assert (at < 1e-3 * away).all()


def test_stored_as_data_and_rebuilt(trained, tmp_path):
    write_surrogates(tmp_path / "s.h5", {"wheat 2": trained})
    again = read_surrogates(tmp_path / "s.h5")["wheat 2"]
    unit = np.random.default_rng(3).random((20, 2))
    np.testing.assert_array_equal(again.predict(unit), trained.predict(unit))
    np.testing.assert_array_equal(again.theta, trained.theta)
    assert again.status == trained.status
    sent = pickle.loads(pickle.dumps(trained))  # from process to process, never from a file
    np.testing.assert_array_equal(sent.predict(unit), trained.predict(unit))


def test_warm_start_is_as_good(trained):
    x = points(34)
    warm = Surrogate(BOUNDS, x, truth(x)).train(trained.theta)
    assert (warm.q2 > 0.95).all()


def test_direct_outputs(trained):
    x = points(30)
    direct = Surrogate(BOUNDS, x, truth(x), "direct").train()
    unit = direct.unit(x)
    np.testing.assert_allclose(direct.predict(unit), truth(x), atol=1e-4)
    np.testing.assert_allclose(direct.centred(direct.predict(unit)), trained.predict(unit), atol=1e-3)


def test_a_useless_fit_is_not_silent(caplog):
    """Noise has no structure: Q2 says so."""
    rng = np.random.default_rng(0)
    x = points(20)
    dp = skewnormal.direct(np.stack([rng.normal(size=20), np.ones(20), 0.1 * rng.normal(size=20)], axis=-1))
    assert Surrogate(BOUNDS, x, dp).train().q2[0] < 0.5


def test_bad_training_data_is_refused():
    x = points(10)
    dp = truth(x)
    dp[3, 1] = np.nan
    with pytest.raises(SurrogateError, match="densities"):
        Surrogate(BOUNDS, x, dp)
    with pytest.raises(SurrogateError, match="at least 3 runs, found 2"):
        Surrogate(BOUNDS, x[:2], truth(x[:2]))


def test_unit_box_round_trip_stays_inside(trained):
    unit = np.array([[0.0, 1.0], [1.0, 0.0], [0.1, 0.7]])
    x = trained.scaled(unit)
    np.testing.assert_allclose(trained.unit(x), unit, atol=1e-15)
    assert (x >= BOUNDS[:, 0]).all()
    assert (x <= BOUNDS[:, 1]).all()


def test_skewness_out_of_reach_is_drawn_to_the_limit():
    dp = to_direct([[0.0, 0.0, 3.0], [0.0, 0.0, -3.0]])
    assert np.isfinite(dp).all()
    assert dp[0, 2] == -dp[1, 2] > 30


def smooth(x):
    return 10.0 * np.sin(2.0 * x[:, 0]) + 5.0 * x[:, 1] ** 2


def noisy_runs(n: int, noise_db: float) -> tuple[np.ndarray, np.ndarray]:
    rng = np.random.default_rng(2)
    x = rng.random((n, 2))
    mean = smooth(x) + noise_db * rng.standard_normal(n)
    log_sd, skewness = 1.0 + x[:, 0] + 0.02 * rng.standard_normal(n), 0.3 * x[:, 1] + 0.05 * rng.standard_normal(n)
    return x, skewnormal.direct(np.column_stack([mean, np.exp(log_sd), skewness]))


@pytest.fixture(scope="module")
def noisy():
    """A surrogate that has to find out by itself that its runs do not repeat."""
    x, dp = noisy_runs(40, 0.5)
    return Surrogate([[0, 1], [0, 1]], x, dp, noisy=True).train()


def test_a_noisy_surrogate_smooths_and_stays_the_same_when_rebuilt(noisy, tmp_path) -> None:
    noise_db, x = 0.5, noisy.parameters
    new = np.random.default_rng(3).random((300, 2))
    assert (noisy.nugget > 1e-6).all()
    # it leaves about the noise between itself and the runs, and is nearer to the truth than they are
    residual = noisy.predict(x)[:, 0] - skewnormal.centred(noisy.dp)[:, 0]
    assert 0.5 * noise_db < residual.std() < 1.5 * noise_db
    error = np.sqrt(np.mean((noisy.predict(new)[:, 0] - smooth(new)) ** 2))
    assert error < noise_db
    # and says so
    assert 0.3 * error < noisy.standard_error(new)[:, 0].mean() < 3.0 * error
    write_surrogates(tmp_path / "s.h5", {"a": noisy})
    rebuilt = read_surrogates(tmp_path / "s.h5")["a"]
    np.testing.assert_array_equal(rebuilt.predict(new), noisy.predict(new))
    np.testing.assert_array_equal(rebuilt.standard_error(new), noisy.standard_error(new))


def test_a_measured_noise_bounds_the_nugget_from_below() -> None:
    """Six runs pass for exact ones in the likelihood: only what was measured says otherwise."""
    x, dp = noisy_runs(6, 0.5)
    variance = np.array([0.5**2, 0.02**2, 0.05**2])
    guessed = Surrogate([[0, 1], [0, 1]], x, dp, noisy=True).train()
    told = Surrogate([[0, 1], [0, 1]], x, dp, noisy=True, noise_variance=variance).train()
    assert guessed.nugget[0] < 1e-6
    process = np.array([model.process for model in told.models()])
    inside = told.nugget < 9.99
    assert inside[0]
    assert ((told.nugget * process)[inside] > 0.95 * variance[inside]).all()
    assert (told.nugget * process)[0] == pytest.approx(variance[0], rel=0.05)
    mean = skewnormal.centred(dp)[:, 0]
    assert np.abs(guessed.predict(x)[:, 0] - mean).max() < 1e-3 < np.abs(told.predict(x)[:, 0] - mean).max()
    assert told.standard_error(x)[:, 0].min() > 0.1 > guessed.standard_error(x)[:, 0].max()


def test_a_smaller_measured_noise_changes_nothing(noisy) -> None:
    x, dp = noisy.parameters, noisy.dp
    told = Surrogate([[0, 1], [0, 1]], x, dp, noisy=True, noise_variance=[1e-6, 1e-9, 1e-9]).train()
    np.testing.assert_array_equal(told.nugget, noisy.nugget)
    np.testing.assert_array_equal(told.theta, noisy.theta)
    # nor does any where runs repeat, or where xi, omega and alpha are learnt
    exact = Surrogate([[0, 1], [0, 1]], x, dp, noise_variance=[1.0, 1.0, 1.0])
    direct = Surrogate([[0, 1], [0, 1]], x, dp, "direct", noisy=True, noise_variance=[1.0, 1.0, 1.0])
    assert not exact.noise_variance.any()
    assert not direct.noise_variance.any()
