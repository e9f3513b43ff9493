"""The whole case: its defaults, wrong values, and one section against another."""

import pytest
from config_samples import TWO_PASSES, dyke, external, measured, product

from radcal.config import Case, case_from


def test_defaults_are_a_valid_case():
    case = Case()
    assert case == case_from({})
    assert case == case_from(case.model_dump(mode="json"))
    assert case.case == "dyke"
    assert case.calibrated == ["dyke"]
    assert (case.scene.source, len(case.materials)) == ("builtin", 7)
    assert case.measurement.synthetic.parameters["dyke"] == [-24.0, 10.0, 14.0, 5.0]
    assert case.materials["dyke"].box == [(-32.0, -8.0), (0.0, 16.0), (0.0, 22.0), (0.0, 12.0)]
    assert case_from(dyke()).materials["dyke"].box == [(0.0, 50.0)] * 4  # the law's own
    assert (case.stop.rms, case.stop.max_runs, case.stop.stagnation_runs) == (1e-5, 200, 20)
    assert (case.objective, case.design.sampler, case.design_size) == ("classes", "sobol", 0)
    assert case.has_baseline


def test_measurement_of_the_same_pass():
    declared = case_from(
        {"radar": {"polarisation": "VV", "band": "L"}} | measured(polarisation="VV", carrier_band="l-band")
    )
    assert (declared.measurement.polarisation, declared.measurement.carrier_band) == ("VV", "l-band")


def test_the_default_truth_does_not_bind_other_materials():
    case = case_from({"materials": {"grass": {"calibrate": True}}})
    assert case.calibrated == ["grass"]


def test_a_low_track_is_no_orbit():
    assert case_from({"radar": {"depression_deg": 40, "altitude_m": 693}}).radar.altitude_m == 693
    assert case_from({"radar": {"incidence_deg": 50, "altitude_m": 2100}}).radar.altitude_m == 2100
    assert case_from({"radar": {"incidence_deg": 50, "altitude_m": 150}}).radar.altitude_m == 150


def test_the_name_of_a_product_replaces_three_keys():
    found = case_from(product()).measurement
    assert (found.scale, found.radiometry, found.polarisation) == ("db", "gamma0_rtc", "VV")
    assert case_from(product(scale="db", polarisation="VV")).measurement == found


@pytest.mark.parametrize("path", ["a.nitf", "a.NTF", "b/a.sicd", "${IMAGE}"])
def test_a_file_that_may_say_its_radiometry_is_not_asked_for_it(path):
    assert case_from(measured(path=path, radiometry=None)).measurement.radiometry is None


@pytest.mark.parametrize(
    ("changes", "objective", "baseline", "size", "twice", "draws"),
    [
        ({}, "classes", True, 0, True, 4),
        ({"objective": "density"}, "density", True, 0, True, 1),
        ({"objective": "likelihood"}, "likelihood", True, 0, True, 4),
        ({"design": {"size": 3}}, "classes", True, 3, True, 4),
        (dyke(start={"law": "constant_gamma", "parameters": [-9]}), "classes", True, 2, True, 4),
        ({"objective": "density", "design": {"size": 20}}, "density", True, 20, True, 1),
        ({"surrogate": {"baseline": False}}, "classes", False, 8, False, 4),
        ({"surrogate": {"baseline": False}, "stop": {"max_runs": 8}}, "classes", False, 8, False, 4),
        ({"objective": "density", "surrogate": {"outputs": "direct"}}, "density", False, 8, False, 1),
        ({"target": {"normalisation": "image"}}, "density", False, 8, False, 1),
        ({"target": {"incidence_classes": 1}}, "density", True, 0, True, 1),
        ({"target": {"incidence_classes": 5}}, "classes", True, 0, True, 4),
        ({"registration": {"method": "none"}}, "classes", True, 0, False, 4),
        ({"registration": {"rounds": 1}}, "classes", True, 0, False, 4),
        ({"simulator": {"draws": 2}}, "classes", True, 0, True, 2),
        ({"objective": "density", "simulator": {"draws": 3}}, "density", True, 0, True, 3),
        (external(3), "density", False, 8, False, 1),
        (external(7), "density", False, 14, False, 1),
        ({**external(7), "design": {"size": 3}}, "density", False, 3, False, 1),
        ({**external(1), "objective": "classes"}, "classes", False, 8, False, 1),
    ],
)
def test_what_is_not_given_follows_from_the_other_keys(changes, objective, baseline, size, twice, draws):
    """No classes and no likelihood without a curve, a larger design and one registration without a baseline."""
    case = case_from(changes)
    assert (case.objective, case.has_baseline, case.design_size) == (objective, baseline, size)
    assert (case.registers_twice, case.simulator.draws) == (twice, draws)


def test_lists_of_radar_and_measurement_are_passes():
    case = case_from(TWO_PASSES)
    assert [one.radar.depression_deg for one in case.passes] == [45, 30]
    assert [one.radar.polarisation for one in case.passes] == ["HH", "VV"]
    assert [one.measurement.synthetic.seed for one in case.passes] == [2, 5]
    assert all(one.passes == [one] for one in case.passes)
    # the first pass alone is the case without the second, in every job that looks at one pass
    alone = case_from({"radar": [TWO_PASSES["radar"][0]], "measurement": {}})
    assert case.passes[0].sections(*Case.model_fields) == alone.sections(*Case.model_fields)
    assert isinstance(alone.sections("radars")["radar"], dict)  # as in the params of jobs of a case of one pass


def test_a_dyke_of_its_own_bounds_has_a_hidden_law_inside_them():
    published, physical = [6.1, 14.2, 21.5, 3.3], [-24.0, 10.0, 14.0, 5.0]

    def hidden(**dyke):
        case = case_from(
            {"materials": {"dyke": {"calibrate": True, **dyke}}, "measurement": {"synthetic": {"seed": 5}}}
        )
        assert case.measurement.synthetic.seed == 5
        return case.measurement.synthetic.parameters["dyke"]

    assert hidden() == published
    assert hidden(bounds=[[-32, -8], [0, 16], [0, 22], [0, 12]]) == physical
    assert hidden(bounds=[[-50, 50]] * 4) == physical
    # ends of the bounds lie inside of them
    assert hidden(bounds=[[-24, 7], [10, 15], [14, 22], [3, 5]]) == physical
    assert hidden(bounds=[[6.1, 7], [10, 14.2], [21.5, 22], [3.3, 5]]) == published
    assert case_from({"materials": {"dyke": {"calibrate": True}}}).measurement.synthetic.parameters["dyke"] == published
    assert case_from({}).measurement.synthetic.parameters["dyke"] == physical


def test_fixed_materials_give_the_level_unless_some_are_named():
    assert case_from({}).reference_materials == ["water", "grass", "forest", "crops", "bare_soil", "road"]
    assert case_from({"target": {"reference_materials": ["road", "grass"]}}).reference_materials == ["road", "grass"]


@pytest.mark.parametrize("name", ["ploughed_" * 6 + "dyke-1", "fen " + "ab" * 19])
def test_long_names_of_materials(name):
    assert case_from({"materials": {name: {"calibrate": True}, "dyke": {"calibrate": True}}}).calibrated[0] == name
