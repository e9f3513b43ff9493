"""Range of incidence at which a material is seen, with the error of the map taken out."""

import numpy as np
import pytest

from radcal.ground.one_incidence import incidence_span_deg, seen_at_one_incidence


def test_span_is_that_of_the_true_incidence():
    rng = np.random.default_rng(2)
    true = rng.normal(35.0, 1.5, 20_000)
    span = 2 * 1.6449 * 1.5  # between the 5 % and 95 % quantiles
    assert incidence_span_deg(true) == pytest.approx(span, rel=0.03)
    mapped = true + rng.normal(0.0, 2.0, true.size)
    assert incidence_span_deg(mapped) == pytest.approx(span * 2.5 / 1.5, rel=0.03)
    assert incidence_span_deg(mapped, 2.0) == pytest.approx(span, rel=0.05)


@pytest.mark.parametrize(
    ("low", "high", "error_deg", "expected"),
    [
        (38.9, 39.05, 0.0, True),  # the swath of a Sentinel-1 chip
        (30.0, 31.0, 0.0, True),
        (30.0, 31.3, 0.0, False),
        (30.0, 31.3, 0.2, True),  # a third of that range is error
        (10.0, 25.0, 2.5, False),
        (10.0, 25.0, 5.0, True),  # nothing but error
    ],
)
def test_a_range_below_a_degree_is_one_incidence(low, high, error_deg, expected):
    assert seen_at_one_incidence(np.linspace(low, high, 500), error_deg) is expected
