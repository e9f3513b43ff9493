from __future__ import annotations

import math

import numpy as np
import pytest

from radcal.radar.laws import LAWS, mangia

X = (6.1, 14.2, 21.5, 3.3)


@pytest.mark.parametrize("degrees", [0.0, 10.0, 17.0, 45.0, 60.0, 90.0])
def test_mangia_is_equation_1_in_radians(degrees: float) -> None:
    phi = math.radians(degrees)
    expected = X[0] + X[1] * math.cos(phi) + X[2] * math.exp(-X[3] * phi * phi)
    assert float(mangia(phi, X)) == pytest.approx(expected, rel=1e-14)


def test_mangia_at_nadir_is_the_sum_of_its_levels() -> None:
    assert float(mangia(0.0, X)) == pytest.approx(X[0] + X[1] + X[2])


def test_mangia_keeps_the_shape_and_takes_single_precision() -> None:
    phi = np.linspace(0, 1, 6, dtype=np.float32).reshape(2, 3)
    values = mangia(phi, list(X))
    assert values.shape == (2, 3)
    assert values.dtype == np.float64


@pytest.mark.parametrize("name", sorted(LAWS))
def test_every_law_names_its_parameters_and_is_finite_in_its_box(name: str) -> None:
    law = LAWS[name]
    assert len(law.names) == len(law.units) == len(law.bounds) == len(set(law.names))
    low, high = np.array(law.bounds).T
    assert (low < high).all()
    rng = np.random.default_rng(0)
    for x in [low, high, *rng.uniform(low, high, (20, len(low)))]:
        assert np.isfinite(law(np.linspace(0, np.pi / 2, 20), x)).all()


def test_mangia_default_box_is_the_papers() -> None:
    assert LAWS["mangia"].bounds == ((0.0, 50.0),) * 4
