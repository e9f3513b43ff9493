import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from radcal.config import Case, case_from
from radcal.config.stages import STAGES
from radcal.errors import ConfigError
from radcal.laws import LAWS, Law, law_for
from radcal.laws.curves import constant_gamma, mangia
from radcal.laws.soil import oh1992

X = (6.1, 14.2, 21.5, 3.3)
FREQUENCY_GHZ = 9.5
BUILTIN = {name: one.model_dump(exclude_none=True) for name, one in Case().materials.items()}
KNOTS = [20.0, 35.0, 60.0]
# one set of parameters inside of what each law was made for
ORDINARY = {
    "mangia": list(X),
    "ulaby_dobson": [-20.0, 15.0, 2.5, 3.0, 2.0, -1.0],
    "oh1992": [6.28, 1.53, 0.302],
    "constant_gamma": [-12.0],
    "tabulated": [-3.0, -9.0, -11.0],
    "nrl_sea": [2.7],
}


def ready(name, polarisation="VV", frequency_ghz=FREQUENCY_GHZ):
    law = law_for(name, angles_deg=KNOTS if name == "tabulated" else None)
    return law.bound(frequency_ghz=frequency_ghz, polarisation=polarisation)


def at(law, degrees, x):
    return float(law(math.radians(degrees), x))


def test_constant_gamma_at_grazing_stops_at_a_cosine_of_1e_6():
    # the cosine of pi/2 in single precision is negative
    assert float(constant_gamma(np.float32(np.pi / 2), [-12.0])) == pytest.approx(-72.0)


def test_tabulated_goes_through_its_knots_and_is_constant_beyond():
    values = [-3.0, -9.0, -11.0]
    law = ready("tabulated")
    np.testing.assert_allclose(law(np.radians(KNOTS), values), values, atol=1e-12)
    assert at(law, 0.0, values) == at(law, 20.0, values) == pytest.approx(-3.0)
    assert at(law, 90.0, values) == pytest.approx(-11.0)
    assert law.names == ("sigma0_20deg", "sigma0_35deg", "sigma0_60deg")
    assert law.valid_deg == (20.0, 60.0)


@pytest.mark.parametrize(
    ("degrees", "vv", "hh", "hv"),
    # example of code 10.5 (PRISM-1) of Ulaby and Long, "Microwave Radar and Radiometric Remote Sensing":
    # eps = 6.28 - j 1.53, s = 3.02 mm, 9.5 GHz; it takes the speed of light as 0.3 m GHz
    [
        (10.0, -12.2325, -12.3403, -25.6389),
        (40.0, -14.8225, -16.0839, -28.2289),
        (70.0, -22.4980, -26.3105, -35.9044),
    ],
)
def test_oh1992_is_the_authors_prism_1(degrees, vv, hh, hv):
    for polarisation, expected in {"VV": vv, "HH": hh, "HV": hv, "VH": hv}.items():
        assert at(ready("oh1992", polarisation), degrees, ORDINARY["oh1992"]) == pytest.approx(expected, abs=0.01)


def test_oh1992_says_where_its_parameters_are_doubtful():
    law = ready("oh1992")
    assert law.doubt(ORDINARY["oh1992"]) is None
    for frequency_ghz, height_cm in ((1.5, 0.32), (9.5, 3.02)):  # the smoothest and roughest surface measured
        edge = ready("oh1992", frequency_ghz=frequency_ghz).doubt
        assert edge([10.0, 2.0, height_cm]) is None
        assert "ks is" in str(edge([10.0, 2.0, height_cm * (1.1 if height_cm > 1 else 0.9)]))
    assert "ks is 8" in str(law.doubt([6.0, 1.0, 4.02]))
    assert "permittivity is 25" in str(law.doubt([25.0, 1.0, 0.3]))


@pytest.mark.parametrize("name", sorted(LAWS))
def test_every_law_keeps_the_shape_and_takes_single_precision(name):
    phi = np.linspace(0.0, np.pi / 2, 12, dtype=np.float32)
    law = ready(name)
    values = law(phi.reshape(3, 4), ORDINARY[name])
    assert values.shape == (3, 4)
    assert values.dtype == np.float64
    np.testing.assert_array_equal(values.ravel(), [float(law(p, ORDINARY[name])) for p in phi])
    assert law(0.5, ORDINARY[name]).shape == ()


@pytest.mark.parametrize("name", sorted(LAWS))
def test_every_law_is_described(name):
    law = ready(name)
    assert len(law.names) == len(law.units) == len(set(law.names)) == len(ORDINARY[name])
    assert law.needs == ()
    assert law.source
    low, high = law.valid_deg
    assert 0 <= low < high <= 90
    for intervals in (law.bounds, law.limits):
        if intervals is not None:
            assert len(intervals) == len(law.names)
            assert all(low < high for low, high in intervals)
    if law.bounds is not None and law.limits is not None:
        assert all(a <= x < y <= b for (x, y), (a, b) in zip(law.bounds, law.limits, strict=True))


def box_of(name):
    law = ready(name)
    default = [(-1000.0, 1000.0)] * len(law.names)
    return list(law.limits or law.bounds or default)


@pytest.mark.parametrize("name", sorted(LAWS))
@settings(max_examples=40, deadline=None)
@given(data=st.data(), degrees=st.floats(0.0, 90.0))
def test_every_law_is_finite_within_its_limits(name, data, degrees):
    x = [data.draw(st.one_of(st.sampled_from(interval), st.floats(*interval))) for interval in box_of(name)]
    polarisation = data.draw(st.sampled_from(LAWS[name].polarisations))
    law = ready(name, polarisation, data.draw(st.floats(0.03, 110.0)))
    phi = np.array([math.radians(degrees), 0.0, np.pi / 2, np.float32(np.pi / 2)])
    with np.errstate(all="raise", under="ignore"):
        assert np.isfinite(law(phi, x)).all()


def test_bounds_of_a_law_are_those_of_the_surfaces_it_was_made_for():
    law = ready("oh1992")
    # Topp, Davis and Annan (1980), eq. 6: permittivity of a volumetric moisture of 0.09 and of 0.31
    topp = [3.03 + 9.3 * m + 146.0 * m**2 - 76.7 * m**3 for m in (0.09, 0.31)]
    np.testing.assert_allclose(law.bounds[0], topp, atol=0.5)


def test_outside_counts_the_angles_that_are_there():
    law = LAWS["oh1992"]
    assert law.outside([9.9, 10.0, 70.0, 70.1, np.nan]) == 0.5
    assert law.outside([np.nan]) == 0.0


@pytest.mark.parametrize("missing", ["frequency_ghz", "polarisation"])
def test_a_law_without_a_condition_is_a_sentence(missing):
    known = {"frequency_ghz": 5.0, "polarisation": "VV", missing: None}
    with pytest.raises(ConfigError, match=rf"^radar.{missing} is missing: law 'oh1992' depends on it.$"):
        law_for("oh1992").bound(**known)(0.5, ORDINARY["oh1992"])


def test_an_unknown_law_is_a_sentence():
    with pytest.raises(ValueError, match="law is 'oh1993', expected one of constant_gamma, mangia, nrl_sea, oh1992"):
        law_for("oh1993")


@pytest.mark.parametrize("radar", [{"frequency_ghz": 1.5, "band": "L"}, {"frequency_ghz": 9.5, "polarisation": "HH"}])
def test_laws_of_a_case_have_the_conditions_of_its_pass(radar):
    case = case_from({"radar": radar, "materials": {**BUILTIN, "water": {"law": "oh1992", "parameters": [8, 1.5, 1]}}})
    found = case.laws["water"](0.7, [8.0, 1.5, 1.0])
    assert found == oh1992(0.7, [8, 1.5, 1], frequency_ghz=radar["frequency_ghz"], polarisation=case.radar.polarisation)


def small_perturbation(phi_rad, parameters, *, permittivity, frequency_ghz):
    """Law of another distribution, whose permittivity is known for each material."""
    return parameters[0] + 10.0 * np.log10(np.cos(phi_rad) * permittivity * frequency_ghz)


FOREIGN = Law(
    small_perturbation, ("level",), ("dB",), ((-40.0, 0.0),), needs=("permittivity", "frequency_ghz"), source="test"
)


def test_a_condition_that_only_a_law_of_another_distribution_knows(monkeypatch):
    monkeypatch.setitem(LAWS.builtin, "spm", FOREIGN)
    water = {"law": "spm", "parameters": [-20], "conditions": {"permittivity": 40}}
    case = case_from({"radar": {"frequency_ghz": 10.0}, "materials": {**BUILTIN, "water": water}})
    assert float(case.laws["water"](0.0, [-20.0])) == pytest.approx(-20.0 + 10.0 * math.log10(400.0))
    sections = STAGES["scene"].params(case)
    restored = STAGES["scene"].model.model_validate(sections)
    assert restored.materials == case.materials
    assert "conditions" not in sections["materials"]["dyke"]
    for conditions, words in (
        (None, "conditions: permittivity is missing, law 'spm' depends on it"),
        ({"permittivity": 4, "salt": 1}, "conditions: salt is given, law 'spm' needs permittivity"),
        ({"permittivity": 4, "frequency_ghz": 1}, "conditions: frequency_ghz is given, law 'spm' needs permittivity"),
    ):
        with pytest.raises(ConfigError, match=words):
            case_from({"materials": {**BUILTIN, "water": {**water, "conditions": conditions}}})


def test_the_default_case_starts_from_bare_soil():
    phi = np.radians(np.linspace(5.0, 50.0, 91))
    soil = ready("oh1992", "HH")(phi, [8.0, 1.5, 2.0])
    start = Case().materials["dyke"].start_parameters
    np.testing.assert_allclose(mangia(phi, start), soil, atol=0.25)


def test_the_largest_difference_counts_the_incidence_seen_only():
    incidence_deg = np.linspace(30.0, 50.0, 1001)  # 5 % to 95 %: 31 to 49 degrees
    found, mangia = [6.0, 14.0, 21.0, 3.0], LAWS["mangia"]
    assert mangia.largest_difference_db(found, found, incidence_deg) == 0.0
    assert mangia.largest_difference_db([7.5, 14.0, 21.0, 3.0], found, incidence_deg) == pytest.approx(1.5)
    by_hand = 2.0 * np.cos(np.radians(31.0))
    weaker = [6.0, 12.0, 21.0, 3.0]
    assert mangia.largest_difference_db(weaker, found, incidence_deg) == pytest.approx(by_hand, rel=1e-6)
