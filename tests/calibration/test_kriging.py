"""Kriging of one output beside smt's own model."""

from __future__ import annotations

import subprocess
import sys
import warnings

import numpy as np
import pytest

from radcal.calibration.kriging import Kriging, fixed, leave_one_out_q2, smt_krg, train_one
from radcal.errors import SurrogateError

SHAPES = ((7, 1), (30, 2), (13, 4))


def example(n, d):
    rng = np.random.default_rng(n)
    x = rng.random((n, d))
    return x, 3.0 * np.sin(4.0 * x[:, 0]) - x[:, -1] ** 2


def smts(x, y, theta, nugget):
    """smt's model of given length scales."""
    model, _ = smt_krg({"theta0": theta.tolist(), "nugget": nugget, "hyper_opt": "NoOp"})
    model.set_training_values(x, y[:, None])
    model.train()
    return model


@pytest.mark.parametrize(("n", "d"), SHAPES)
def test_it_is_smts_model_to_the_last_bit(n, d):
    x, y = example(n, d)
    theta = np.linspace(0.7, 1.9, d)
    ours, model = fixed(x, y, theta, 1e-9), smts(x, y, theta, 1e-9)
    parts = model.optimal_par
    np.testing.assert_array_equal(ours._theta, model.optimal_theta)
    np.testing.assert_array_equal(ours._gamma, parts["gamma"][:, 0])
    np.testing.assert_array_equal(ours._cholesky, parts["C"])
    np.testing.assert_array_equal(ours._ft, parts["Ft"][:, 0])
    assert ours._beta == parts["beta"].item()
    assert ours._g == parts["G"].item()
    assert ours.process == parts["sigma2"].item()
    assert ours.q2 == leave_one_out_q2(parts, model.y_norma)


def test_mean_and_error_are_smts():
    x, y = example(30, 2)
    ours, model = (make(x, y, np.array([5.0, 4.0]), 1e-10) for make in (fixed, smts))
    new = np.random.default_rng(5).random((40, 2))
    np.testing.assert_allclose(ours.mean(new), model.predict_values(new)[:, 0], rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(ours.variance(new), model.predict_variances(new)[:, 0], rtol=1e-6, atol=1e-12)


def test_length_scales_out_of_bounds_are_taken_as_smt_takes_them():
    x, y = example(13, 4)
    theta = np.array([0.3, 25.0, 0.2, 0.1])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        np.testing.assert_array_equal(fixed(x, y, theta, 1e-9)._theta, smts(x, y, theta, 1e-9).optimal_theta)


@pytest.mark.parametrize("noise", [{}, {"eval_noise": True, "hyper_opt": "Cobyla"}])
def test_training_is_smts_to_the_last_bit(noise):
    """Watching the optimiser does not move it."""
    x, y = example(13, 4)
    options = {"theta0": [1e-2], "n_start": 2, **noise}
    found = train_one(x, y, options)
    from smt.surrogate_models import KRG

    model = KRG(print_global=False, **options)
    model.set_training_values(x, y[:, None])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        model.train()
    np.testing.assert_array_equal(found.theta, model.optimal_theta)
    assert found.process == model.optimal_par["sigma2"].item()
    assert found.nugget == (model.optimal_noise if noise else model.options["nugget"])


def test_leave_one_out_equals_leaving_one_out():
    """Dubrule's closed form against kriging written out and refitted without each point."""
    points, values = example(30, 2)
    theta, nugget = np.array([5.0, 4.0]), 1e-10
    x, y = ((v - v.mean(axis=0)) / v.std(axis=0, ddof=1) for v in (points, values))
    distance = (x[:, None, :] - x[None, :, :]) ** 2
    r = np.exp(-(distance * theta).sum(axis=-1)) + nugget * np.eye(len(x))
    errors = []
    for i in range(len(x)):
        keep = np.arange(len(x)) != i
        inverse = np.linalg.inv(r[np.ix_(keep, keep)])
        one = np.ones(keep.sum())
        beta = one @ inverse @ y[keep] / (one @ inverse @ one)
        errors.append(y[i] - beta - r[i, keep] @ inverse @ (y[keep] - beta))
    q2 = 1 - np.sum(np.square(errors)) / np.sum((y - y.mean()) ** 2)
    assert Kriging(points, values, theta, nugget).q2 == pytest.approx(q2, abs=1e-6)


def test_a_singular_correlation_ends_in_a_sentence():
    x, y = example(13, 4)
    with pytest.raises(SurrogateError, match="kriging of 14 points is impossible"):
        Kriging(np.vstack([x, x[:1]]), np.append(y, y[0]), np.ones(4), 0.0)


def test_smts_class_is_imported_without_matplotlib():
    code = (
        "import sys\n"
        "from radcal.calibration.kriging import smt_krg\n"
        "model, _ = smt_krg({})\n"
        "print('matplotlib' in sys.modules)\n"
        "from smt.surrogate_models import KPLS, KRG\n"
        "print(isinstance(model, KRG), issubclass(KPLS, KRG))\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["False", "True", "False"]
