"""Bands, where a law is known, combinations of X and modes."""

from __future__ import annotations

import numpy as np
import pytest

from radcal.assessment.curves import GRID_DEG, Curves
from radcal.assessment.known import Band, band_of, degrees, directions, known_between, modes_of, why_unknown
from radcal.radar.laws import LAWS, law_for

ANGLES = np.arange(0.0, 85.25, 0.25)


def band(half_width_db: np.ndarray | float) -> Band:
    half = np.broadcast_to(half_width_db, ANGLES.shape)
    return Band(ANGLES, np.zeros_like(ANGLES), -half, half)


WIDE = band(12.0)


def test_a_band_has_the_quantiles_of_its_curves():
    rng = np.random.default_rng(2)
    curves = -9.0 + rng.normal(0.0, 0.7, (20_000, 1)) * np.ones(GRID_DEG.size)
    found = band_of(curves)
    assert found.incidence_deg == pytest.approx(np.arange(86.0))
    assert found.median_db == pytest.approx(-9.0, abs=0.03)
    assert found.half_width_db == pytest.approx(1.645 * 0.7, rel=0.03)


def test_known_is_the_incidence_seen_where_the_band_is_narrow():
    assert known_between(band(1.4), WIDE, [(20.1, 31.6)], 1.5) == (20.25, 31.5)
    # a half-width of exactly the limit is known
    assert known_between(band(1.5), WIDE, [(20.1, 31.6)], 1.5) == (20.25, 31.5)
    assert known_between(band(1.6), WIDE, [(20.1, 31.6)], 1.5) is None
    # from 0.1 dB per degree on: 1.5 dB at 15 degrees
    assert known_between(band(0.1 * ANGLES), WIDE, [(10.0, 40.0)], 1.5) == (10.0, 15.0)


def test_a_prior_that_is_as_narrow_says_that_the_pixels_add_nothing():
    assert known_between(band(1.0), band(1.9), [(20.0, 30.0)], 1.5) is None
    assert known_between(band(1.0), band(2.1), [(20.0, 30.0)], 1.5) == (20.0, 30.0)


def test_only_what_keeps_a_law_unknown_is_named():
    def why(half: np.ndarray | float, prior: float, seen: tuple[float, float] = (20.0, 30.0)) -> str:
        one, other = band(half), band(prior)
        return why_unknown(ANGLES, one.half_width_db, other.half_width_db, [seen], 1.5)

    of_band = "its 90 % band is nowhere narrower than +-1.8 dB, wider than uncertainty.known_db (+-1.5 dB)"
    assert why(0.09 * ANGLES, 12.0) == of_band
    of_prior = "the priors alone leave +-1.7 dB, so that the pixels do not even halve it"
    assert why(1.0, 1.7) == of_prior
    assert why(1.8, 1.7) == f"{of_band} and {of_prior}"
    assert why(1.0, 12.0) == "its 90 % band is narrow enough only over less than half a degree"
    # three digits: a half-width next to the limit is not shown as the limit
    assert "than +-1.53 dB, wider than uncertainty.known_db (+-1.5 dB)" in why(1.53, 12.0)
    # at an angle between those of the grid
    assert why(2.0, 12.0, (24.1, 24.2)).startswith("its 90 % band is nowhere narrower than +-2 dB")
    ones = np.ones(ANGLES.size)
    assert why_unknown(ANGLES, ones, 9.0 * ones, [(20.0, 30.0)], 1.5, "it does not fit") == "it does not fit"


@pytest.mark.parametrize(
    ("low", "high", "said"),
    [
        (10.0, 25.0, "10 and 25"),
        (10.25, 25.75, "11 and 25"),
        (14.75, 15.25, "14.75 and 15.25"),
        (14.9, 16, "15 and 16"),
    ],
)
def test_degrees_are_rounded_into_the_interval(low, high, said):
    assert degrees(low, high) == f"between {said} degrees"


def test_the_largest_of_several_intervals_is_known():
    half = np.where((ANGLES > 24.0) & (ANGLES < 26.0), 3.0, 1.0)
    assert known_between(band(half), WIDE, [(20.0, 36.0)], 1.5) == (26.0, 36.0)
    # passes at other angles
    assert known_between(band(1.0), WIDE, [(20.0, 24.0), (50.0, 60.0)], 1.5) == (50.0, 60.0)
    assert known_between(band(1.0), WIDE, [(20.0, 20.2)], 1.5) is None


def test_combinations_that_the_data_fix_come_first():
    rng = np.random.default_rng(3)
    prior = rng.standard_normal((20_000, 2)) * [10.0, 0.5]
    # the sum, in standard deviations of the prior, is known to a tenth
    total, difference = rng.normal(0.0, 0.1, 20_000), rng.normal(0.0, 1.0, 20_000)
    posterior = np.stack([total + difference, total - difference], axis=1) / np.sqrt(2.0) * [10.0, 0.5]
    found = directions(posterior, prior)
    assert found.ratio == pytest.approx([0.1, 1.0], rel=0.05)
    assert np.abs(found.weights[0]) == pytest.approx(np.sqrt([0.5, 0.5]), abs=0.03)
    assert found.weights[0].prod() > 0.0 > found.weights[1].prod()
    said = found.sentence(["X1", "X2"])
    assert "fixed by the pixels: +0.7" in said
    assert "not fixed: +0.7" in said
    each = found.sentence(["X1", "X2"]).partition("not fixed")
    assert each[0].count("-0.7") == 0
    assert each[2].count("-0.7") == 1


def test_curves_that_keep_apart_are_modes_with_their_shares():
    rng = np.random.default_rng(4)
    x = np.where(rng.random(3000) < 0.7, 4.0, -4.0) + rng.normal(0.0, 0.3, 3000)
    curves = x[:, None] * np.ones(GRID_DEG.size)
    found = modes_of(curves, x[:, None], [(20.0, 30.0)])
    assert found.share == pytest.approx([0.7, 0.3], abs=0.06)
    assert found.parameters[:, 0] == pytest.approx([4.0, -4.0], abs=0.2)
    assert modes_of(curves[x > 0], x[x > 0, None], [(20.0, 30.0)]).share == pytest.approx([1.0])
    # nearer to each other than 1 dB they are one
    for apart, groups in ((1.6, 2), (0.8, 1)):
        near = np.where(np.arange(3000) % 10 < 7, 0.5 * apart, -0.5 * apart)
        found = modes_of(near[:, None] * np.ones(GRID_DEG.size), near[:, None], [(20.0, 30.0)])
        assert len(found.share) == groups
    # apart only where nothing is seen
    bent = np.where(GRID_DEG > 40.0, curves, 0.3 * rng.standard_normal((3000, 1)))
    assert len(modes_of(bent, x[:, None], [(20.0, 30.0)]).share) == 1


@pytest.mark.parametrize(
    ("law", "parameters"),
    [
        (LAWS["mangia"], [[-20.0, 14.0, 6.0, 3.0], [-25.0, 10.0, 12.0, 8.0]]),
        (law_for("tabulated", angles_deg=(10.0, 25.0, 60.0)), [[3.0, -4.0, -11.0], [1.0, -9.0, -10.0]]),
        (law_for("oh1992", frequency_ghz=5.4, polarisation="VV"), [[8.0, 1.0, 0.6], [15.0, 3.0, 1.8]]),
    ],
)
def test_curves_of_many_parameters_are_those_of_each(law, parameters):
    x = np.array(parameters)
    curves = Curves(law, x)
    angles = np.array([[13.3, 41.17, 58.0]])
    found = Curves.at(curves(x), angles)
    assert found == pytest.approx(np.stack([law(np.radians(angles[0]), one) for one in x]), abs=0.01)
    # between two angles of the grid a curve is straight
    straight = Curves.at(np.stack([GRID_DEG, -2.0 * GRID_DEG]), np.array([[0.0, 13.3, 41.17, 90.0]]))
    assert straight == pytest.approx(np.outer([1.0, -2.0], [0.0, 13.3, 41.17, 90.0]))
    each = Curves.at(curves(x), np.array([[20.0], [50.0]]))
    assert each[:, 0] == pytest.approx(
        [float(law(np.radians(a), one)) for a, one in zip((20.0, 50.0), x, strict=True)], abs=0.01
    )
