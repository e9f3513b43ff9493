"""The whole case: its defaults, wrong values, and one section against another."""

import pytest
from config_samples import (
    COMMAND,
    GAMMA,
    NO_TRUTH,
    OH,
    TABLE,
    X,
    dyke,
    flat,
    focused,
    mapped,
    measured,
    message,
    synthetic,
    truth,
)

from radcal.config import Case, FileMeasurement, case_from


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
    assert (case.objective, case.design.sampler, case.design_size) == ("classes", "sobol", 2)
    assert case.has_baseline


OTHER_START = {"law": "constant_gamma", "parameters": [-9]}
MANGIA_AT, OH_AT = {"law": "mangia", "parameters": X}, {"law": "oh1992", "parameters": [8, 1, 2]}

TWO_PASSES = {
    "radar": [{"depression_deg": 45}, {"depression_deg": 30, "polarisation": "VV"}],
    "measurement": [{}, {"synthetic": {"seed": 5}}],
}


def of_both(**keys):
    """Measurement of the second of two passes with some keys."""
    return {"measurement": [{}, measured(**keys)["measurement"]]}


def external(parameters):
    """A case of a law that only the simulator knows."""
    names, bounds = [f"p{k}" for k in range(parameters)], [[0, 1]] * parameters
    soil = {"calibrate": True, "law": "external", "names": names, "bounds": bounds, "start": [0.5] * parameters}
    return {"simulator": COMMAND, "materials": {"soil": soil}, "measurement": NO_TRUTH}


BAD = [
    # laws
    (truth([-1, -2], GAMMA), ["measurement.synthetic.parameters.dyke has 2 numbers, law 'constant_gamma' takes 1"]),
    (dyke(**GAMMA), ["synthetic.parameters.dyke is missing", "'constant_gamma'", "default is for law 'mangia'"]),
    (truth([-1], {"law": "constant_gamma"}), ["materials.dyke: bounds is missing", "no default", "gamma"]),
    (truth(X + X[:2], {"law": "ulaby_dobson"}), ["materials.dyke: bounds is missing", "P1, P2, P3, P4, P5, P6"]),
    (dyke(law="ulaby_dobson", bounds=[[0, 1]] * 2 + [[0, 101]] + [[0, 1]] * 3), ["P3", "is 101", "-100 to 100"]),
    ({"materials": {"dyke": {"law": "ulaby_dobson"}}}, ["materials.dyke", "6 numbers", "P6)"]),
    (dyke(law="tabulated", bounds=[[-30, 0]] * 3), ["materials.dyke: angles_deg is missing", "'tabulated'"]),
    (dyke(**{**TABLE, "angles_deg": [20, 20, 60]}), ["materials.dyke: angles_deg is [20.0, 20.0, 60.0]", "increasing"]),
    (dyke(angles_deg=[20, 40]), ["materials.dyke: angles_deg is given, law is 'mangia', which does not take it"]),
    (truth([8, 1, 1], OH), ["radar.frequency_ghz is missing: law 'oh1992' of materials.dyke depends on it"]),
    (truth([2], {"law": "nrl_sea"}, frequency_ghz=9.6, polarisation="HV"), ["polarisation is HV, expected HH or VV"]),
    (truth([8, 1, 0], OH, frequency_ghz=9.6), ["rms_height of law 'oh1992' is 0, expected 0.01 to 100"]),
    (truth([8, 1, 1], {**OH, "bounds": [[5, 9], [-1, 1], [1, 2]]}, frequency_ghz=9.6), ["bounds", "permittivity_imag"]),
    ({"radar": {"frequency_ghz": 5.4}}, ["radar: frequency_ghz is 5.4, which is not in band 'X'"]),
    # starts of another law
    (dyke(start={"law": "constant_gamma", "parameters": [1, 2]}), ["materials.dyke.start", "2 numbers", "takes 1"]),
    (dyke(start={"law": "gamma", "parameters": [1]}), ["materials.dyke.start: law is 'gamma', expected one of"]),
    (dyke(law="x" * 10_000), ["materials.dyke: law is 'xxx", "xxx', expected one of constant_gamma"]),
    (dyke(start={"low": "mangia", "parameters": X}), ["materials.dyke.start.low", "did you mean 'law'?"]),
    (dyke(start={"law": "mangia", "parameters": [60, 1, 1, 1]}), ["materials.dyke", "X1 is 60", "inside its bounds"]),
    ({**dyke(start=OH_AT), **synthetic(parameters={"dyke": X})}, ["frequency_ghz is missing", "dyke.start depends"]),
    ({**dyke(start=OTHER_START), **synthetic(parameters={})}, ["parameters.dyke is missing", "of another law"]),
    ({**dyke(start=OTHER_START), **synthetic(parameters={"dyke": X}), "design": {"size": 0}}, ["design.size is 0"]),
    (dyke(start=5), ["materials.dyke.start is 5"]),
    (dyke(start=[1, 2, 3, "x"]), ["materials.dyke.start.3 is 'x'"]),
    # top level
    ({"case": "a b"}, ["case", "'a b'", "a letter"]),
    ({"case": "a" * 101}, ["case", "has 101 letters", "at most 100"]),
    ({"case": "1st"}, ["case", "'1st'"]),
    ({"case": "new\n"}, ["case"]),
    ({"seed": 1.5}, ["seed is 1.5"]),
    ({"seed": None}, ["seed is empty"]),
    ({1: 2}, ["1"]),
    # radar
    ({"radar": {"frequency_ghz": 435, "band": "P"}}, ["not in band 'P': correct one of them (in MHz? 0.435 GHz)"]),
    ({"radar": {"altitude_m": 0}}, ["radar.altitude_m is 0", "greater than or equal to 1"]),
    ({"radar": {"heading_deg": 192}}, ["radar.heading_deg is 192, expected none with scene.source: builtin"]),
    ({"radar": {"incidence_deg": 35, "depression_deg": 50}}, ["depression_deg (50) and incidence_deg (35) are both"]),
    ({"radar": {"incidence_deg": 35, "earth": "flat"}}, ["is 35 and earth is flat", "depression_deg: 55"]),
    ({"radar": {"incidence_deg": 38.5, "altitude_m": 693}}, ["altitude_m is 693", "expected metres: 693000"]),
    ({"radar": {"earth": "curved", "altitude_m": 693e3, "depression_deg": 25}}, ["depression_deg is 25", "larger"]),
    ({"radar": {"sensor": "sentinel2"}}, ["radar.sensor is 'sentinel2'", "'sentinel1_iw_grdh'"]),
    ({"radar": {"sensor": "sentinel1_iw_grdh", "polarisation": "VV"}}, ["incidence_deg and nesz_db are missing"]),
    ({"radar": {"nesz_db": [[30, -20], [20, -18]]}}, ["radar.nesz_db", "[30.0, 20.0], expected increasing angles"]),
    ({"radar": {"nesz_db": [[30, -20], [40]]}}, ["radar.nesz_db.1.1 is missing"]),
    # scene
    ({"scene": {"source": "buitlin"}}, ["scene.source is 'buitlin'", "'builtin'", "'slant_range'"]),
    (flat(near_incidence_deg=50), ["scene", "near_incidence_deg (50)", "far_incidence_deg (40)"]),
    ({"scene": {"source": "raster"}}, ["scene.elevation is missing"]),
    (mapped(bounds=[0, 2, 1, 1]), ["scene", "bounds: are [0, 2, 1, 1]", "south < north"]),
    # materials
    ({"materials": {"dyke": None}}, ["materials.dyke is empty"]),
    ({"materials": {"a/b": {"calibrate": True}}}, ["materials", "'a/b'"]),
    ({"materials": {"ploughed" * 8: {"calibrate": True}}}, ["materials", "has 64 letters, expected at most 60"]),
    ({"materials": {"fen" + "ab" * 20: {"calibrate": True}}}, ["materials", "ends with 20 times 'ab', expected"]),
    ({"materials": {"grass": {"parameters": X}}}, ["materials", "calibrate: true"]),
    ({"materials": {"grass": {}}}, ["materials.grass", "needs parameters", "X1"]),
    (dyke(parameters=X), ["materials.dyke", "start and bounds, not parameters"]),
    (dyke(bounds=[[0, 1]] * 3), ["materials.dyke", "3 intervals", "takes 4"]),
    (dyke(bounds=[[0, 1]] * 3 + [[2, 1]]), ["materials.dyke", "X4", "[2, 1]", "lower < upper"]),
    (dyke(start=[1, 2, 3]), ["materials.dyke", "start has 3 numbers", "takes 4"]),
    (dyke(start=[1, 2, 3, 51]), ["materials.dyke", "start of X4 is 51", "[0, 50]"]),
    # measurement
    (mapped() | measured(path="./a.tif", band=1), ["measurement.path and scene.elevation", "a.tif"]),
    (mapped() | measured(path="b.tif"), ["measurement.path and scene.materials are the same file b.tif, expected"]),
    (flat() | measured(path="ids.tif"), ["measurement.path and scene.labels", "ids.tif"]),
    ({"measurement": {"source": "file", "path": "a.tif"}}, ["measurement.scale is missing"]),
    (measured(radiometry=None), ["measurement.radiometry is missing: a.tif", "sigma0_ref"]),
    (measured(polarisation="HV"), ["measurement.polarisation is HV, radar.polarisation is HH", "never mixed"]),
    (measured(carrier_band="C"), ["measurement.carrier_band is C, radar.band is X", "never mixed"]),
    (synthetic(parameters={"dyke": [1, 2]}), ["measurement.synthetic.parameters.dyke", "2 numbers", "takes 4"]),
    (synthetic(laws={"dkye": MANGIA_AT}), ["synthetic.laws.dkye", "'dyke'"]),
    (synthetic(parameters={"dyke": X}, laws={"dyke": MANGIA_AT}), ["synthetic.laws.dyke and measurement", "both"]),
    (synthetic(laws={"dyke": OH_AT}), ["radar.frequency_ghz is missing", "synthetic.laws.dyke"]),
    (synthetic(laws={"dyke": {**MANGIA_AT, "parameters": X[:3]}}), ["laws.dyke: parameters has 3", "takes 4"]),
    (synthetic(laws={"dyke": {**MANGIA_AT, "law": "external"}}), ["laws.dyke: law is 'external'", "one of"]),
    ({**synthetic(texture_db=1.0), "simulator": COMMAND}, ["synthetic.texture_db", "kind: command"]),
    (synthetic(fields_db={"dike": 0.5}), ["measurement.synthetic.fields_db.dike: no such material", "'dyke'"]),
    ({**synthetic(relief_m=0.3), **flat()}, ["synthetic.relief_m is 0.3, expected 0"]),
    ({**focused(), **synthetic(), **flat()}, ["scene.source is slant_range, expected a scene with elevation"]),
    (focused(radar={"looks": 2.5}), ["radar.looks is 2.5, expected a whole number with simulator.product: focused"]),
    (focused(signals={"squint_deg": 3}), ["signals.squint_deg is 3, expected 0", "zero Doppler"]),
    ({"simulator": {"product": "focused", "strips": 3}}, ["simulator.strips is 3, expected 1 with simu"]),
    ({"simulator": {**COMMAND, "product": "focused"}}, ["unknown key simulator.product"]),
    ({"radar": {"azimuth_resolution_m": 1e4}}, ["azimuth_resolution_m is 10000", "at most 1000 times"]),
    ({"radar": {"range_resolution_m": 1.7, "range_spacing_m": 1.5}}, ["resolution_m is 1.7", "at least 1.78", "1.44"]),
    # other shapes than those expected
    ({"radar": None}, ["some.yaml: radar is empty, expected keys and values."]),
    ({"radar": [4]}, ["radar is 4, expected keys and values."]),
    ({"materials": {}}, ["materials is {}, expected at least 1 item, not 0."]),
    (dyke(bounds=[0, 1]), ["bounds.0 is 0, expected a list (and 1 more"]),
    (dyke(bounds=[[0, 1, 2]] * 4), ["bounds.0 is [0, 1, 2], expected at most 2 items, not 3 (and 3 more"]),
    ({"\x1b[31mred\n": 1}, ["unknown key \\x1b[31mred\\n (known: "]),
    ({"stop": {"[rms": 1}}, ["unknown key stop.[rms (did you mean 'rms'?)"]),
    ({"seed": [0] * 9000}, ["seed is [" + "0, " * 18 + "0,..., expected an integer."]),
    # yes and no are no numbers
    ({"seed": True}, ["some.yaml: seed is true, expected a number"]),
    ({"radar": {"looks": True}}, ["some.yaml: radar.looks is true, expected a number"]),
    (dyke(bounds=[[True, 50.0], *[[0.0, 50.0]] * 3]), ["materials.dyke.bounds.0.0 is true, expected a number"]),
    # objectives
    ({"objective": "entropy"}, ["objective is 'entropy', expected 'classes', 'density' or 'likelihood'"]),
    ({"objective": "density", "target": {"incidence_classes": 4}}, ["target.incidence_classes is 4", ": classes"]),
    ({"objective": "classes", "target": {"normalisation": "image"}}, ["normalisation is image", "none or offset"]),
    ({"validation": {}, "target": {"normalisation": "image"}}, ["validation is", "is image", "none or offset"]),
    ({"validation": {"rows": 20, "means": 3}}, ["means is 3, expected a divisor of rows (20)"]),
    ({**external(1), "objective": "likelihood"}, ["materials.soil.law is external, whose curve only the simulator"]),
    ({**external(1), "validation": {}}, ["materials.soil.law is external, whose curve only the simulator"]),
    # passes
    ({**TWO_PASSES, "radar": [{"heading_deg": 1}, {"heading_deg": 2}]}, ["radar.*.heading_deg are 1, 2, expected the"]),
    (
        {**TWO_PASSES, "measurement": {}},
        ["found radar of 2 and measurement of 1, expected lists of equal"],
    ),
    ({**TWO_PASSES, "radar": [{}, {"depresion_deg": 2}]}, ["unknown key radar.2.depresion_deg (did you mean 'depre"]),
    ({**TWO_PASSES, "measurement": [{}, {"source": "fil"}]}, ["measurement.2.source is 'fil', expected 'synthetic'"]),
    ({**TWO_PASSES, **of_both(polarisation="HH")}, ["measurement.2.polarisation is HH, radar.polarisation is VV"]),
    ({**TWO_PASSES, "design": {"reuse": "other"}}, ["design.reuse is 'other' in a case of 2 passes, expected one"]),
    ({**TWO_PASSES, "further_radar": [{}]}, ["unknown key further_radar"]),
    # the rest
    (synthetic(parameters={"lake": X}), ["no such material"]),
    (flat(near_incidence_deg=40), ["near_incidence_deg"]),
    ({"registration": {"method": "magic"}}, ["registration.method is 'magic'", "'none'"]),
    ({"case": "dune", "design": {"reuse": "dune"}}, ["design.reuse is 'dune', this case itself"]),
    ({"surrogate": {"training": "smt"}}, ["surrogate.training smt, which objective: classes does not use"]),
    ({"surrogate": {"baseline": False}, "stop": {"max_runs": 7}}, ["stop.max_runs is 7", "design.size (8)"]),
]


@pytest.mark.parametrize(("data", "words"), BAD, ids=lambda value: None if isinstance(value, list) else str(value)[:60])
def test_bad_values_are_refused_in_a_sentence(data, words):
    text = message(data)
    for word in words:
        assert word in text, text


def test_measurement_of_the_same_pass():
    declared = case_from(
        {"radar": {"polarisation": "VV", "band": "L"}} | measured(polarisation="VV", carrier_band="l-band")
    )
    assert (declared.measurement.polarisation, declared.measurement.carrier_band) == ("VV", "l-band")
    assert case_from(measured(band=2)).measurement == FileMeasurement(
        path="a.tif", scale="db", radiometry="sigma0_ref", band=2
    )


def test_the_default_truth_does_not_bind_other_materials():
    case = case_from({"materials": {"grass": {"calibrate": True}}})
    assert case.calibrated == ["grass"]


def test_a_low_track_is_no_orbit():
    assert case_from({"radar": {"depression_deg": 40, "altitude_m": 693}}).radar.altitude_m == 693
    assert case_from({"radar": {"incidence_deg": 50, "altitude_m": 2100}}).radar.altitude_m == 2100
    assert case_from({"radar": {"incidence_deg": 50, "altitude_m": 150}}).radar.altitude_m == 150


@pytest.mark.parametrize("path", ["a.nitf", "a.NTF", "b/a.sicd", "${IMAGE}"])
def test_a_file_that_may_say_its_radiometry_is_not_asked_for_it(path):
    assert case_from(measured(path=path, radiometry=None)).measurement.radiometry is None


@pytest.mark.parametrize(
    ("changes", "objective", "baseline", "size", "twice", "draws"),
    [
        ({}, "classes", True, 2, True, 4),
        ({"objective": "density"}, "density", True, 2, True, 1),
        ({"objective": "likelihood"}, "likelihood", True, 2, True, 4),
        ({"design": {"size": 0}}, "classes", True, 0, True, 4),
        ({"objective": "density", "design": {"size": 20}}, "density", True, 20, True, 1),
        ({"surrogate": {"baseline": False}}, "classes", False, 8, False, 4),
        ({"surrogate": {"baseline": False}, "stop": {"max_runs": 8}}, "classes", False, 8, False, 4),
        ({"objective": "density", "surrogate": {"outputs": "direct"}}, "density", False, 8, False, 1),
        ({"target": {"normalisation": "image"}}, "density", False, 8, False, 1),
        ({"target": {"incidence_classes": 1}}, "density", True, 2, True, 1),
        ({"target": {"incidence_classes": 5}}, "classes", True, 2, True, 4),
        ({"registration": {"method": "none"}}, "classes", True, 2, False, 4),
        ({"registration": {"rounds": 1}}, "classes", True, 2, False, 4),
        ({"simulator": {"draws": 2}}, "classes", True, 2, True, 2),
        ({"simulator": {"keep_images": True}}, "classes", True, 2, True, 4),
        ({"objective": "density", "simulator": {"draws": 3}}, "density", True, 2, True, 3),
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
