"""Length scales by smt with its defaults."""

import numpy as np
import pytest

from radcal.errors import SurrogateError
from radcal.proposals.kriging import Kriging
from radcal.proposals.smt_kriging import train_smt


def example(n=5):
    x = np.random.default_rng(n).random((n, 2))
    return x, 3.0 * np.sin(4.0 * x[:, 0]) - x[:, 1] ** 2


def test_length_scales_are_smts(capfd):
    """In widths of the box: kriging with them predicts what smt's own model does."""
    from smt.surrogate_models import KRG

    x, y = example()
    scales, nugget, status = train_smt(x, y)
    model = KRG(print_global=False)
    model.set_training_values(x, y[:, None])
    model.train()
    assert status == "trained"
    assert capfd.readouterr().out == ""
    assert nugget == model.options["nugget"]
    new = np.random.default_rng(5).random((20, 2))
    found = Kriging(x, y[:, None], scales, nugget).mean(new)
    np.testing.assert_allclose(found, model.predict_values(new), rtol=1e-4, atol=1e-4)


def test_one_run_ends_in_a_sentence():
    with pytest.raises(SurrogateError, match="smt could not train on 1 points"):
        train_smt(np.array([[0.1, 0.2]]), np.array([1.0]))
