"""Wrong values of all sections, each refused in a sentence."""

import pytest
from config_samples import (
    COMMAND,
    FORMULA,
    GAMMA,
    HYP3,
    NO_TRUTH,
    OH,
    SOIL,
    TABLE,
    TRUE_SOIL,
    TWO_PASSES,
    WHOLE,
    X,
    dyke,
    external,
    flat,
    focused,
    mapped,
    measured,
    message,
    outside,
    product,
    synthetic,
    truth,
)

OTHER_START = {"law": "constant_gamma", "parameters": [-9]}
MANGIA_AT, OH_AT = {"law": "mangia", "parameters": X}, {"law": "oh1992", "parameters": [8, 1, 2]}


def of_both(**keys):
    """Measurement of the second of two passes with some keys."""
    return {"measurement": [{}, measured(**keys)["measurement"]]}


def from_outside(**changes):
    """A case of an external program and law with other sections."""
    return {"simulator": COMMAND, "materials": {"soil": SOIL}, "measurement": NO_TRUTH, **changes}


def of_soil(measurement=NO_TRUTH, **keys):
    return from_outside(materials={"soil": SOIL | keys}, measurement=measurement)


def with_command(**keys):
    return from_outside(simulator=COMMAND | keys)


def whole(**keys):
    return outside(WHOLE | keys)


def formula(**keys):
    return dyke(**{**FORMULA, "bounds": [[-30, -10], [0, 20]], **keys})


BEYOND = "expected -1000 to 1000"

BAD = [
    # laws
    (truth([-1, -2], GAMMA), ["measurement.synthetic.parameters.dyke has 2 numbers, law 'constant_gamma' takes 1"]),
    (dyke(**GAMMA), ["synthetic.parameters.dyke is missing", "'constant_gamma'", "default is for law 'mangia'"]),
    (truth([-1], {"law": "constant_gamma"}), ["materials.dyke: bounds is missing", "no default", "gamma"]),
    (truth(X + X[:2], {"law": "ulaby_dobson"}), ["materials.dyke: bounds is missing", "P1, P2, P3, P4, P5, P6"]),
    (dyke(law="ulaby_dobson", bounds=[[0, 1]] * 2 + [[0, 101]] + [[0, 1]] * 3), ["P3", "is 101", "-100 to 100"]),
    (dyke(law="tabulated", bounds=[[-30, 0]] * 3), ["materials.dyke: angles_deg is missing", "'tabulated'"]),
    (dyke(**{**TABLE, "angles_deg": [20, 20, 60]}), ["materials.dyke: angles_deg is [20.0, 20.0, 60.0]", "increasing"]),
    (dyke(angles_deg=[20, 40]), ["materials.dyke: angles_deg is given, law is 'mangia', which does not take it"]),
    (truth([8, 1, 1], OH), ["radar.frequency_ghz is missing: law 'oh1992' of materials.dyke depends on it"]),
    (truth([2], {"law": "nrl_sea"}, frequency_ghz=9.6, polarisation="HV"), ["polarisation is HV, expected HH or VV"]),
    (truth([8, 1, 0], OH, frequency_ghz=9.6), ["rms_height of law 'oh1992' is 0, expected 0.01 to 100"]),
    (truth([8, 1, 1], {**OH, "bounds": [[5, 9], [-1, 1], [1, 2]]}, frequency_ghz=9.6), ["bounds", "permittivity_imag"]),
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
    (flat(near_incidence_deg=40), ["near_incidence_deg"]),
    ({"registration": {"method": "magic"}}, ["registration.method is 'magic'", "'none'"]),
    ({"case": "dune", "design": {"reuse": "dune"}}, ["design.reuse is 'dune', this case itself"]),
    ({"surrogate": {"training": "smt"}}, ["surrogate.training smt, which objective: classes does not use"]),
    ({"surrogate": {"baseline": False}, "stop": {"max_runs": 7}}, ["stop.max_runs is 7", "design.size (8)"]),
    # sections of other people's programs
    (from_outside(simulator={}), ["materials.soil.law is external, which only simulator.kind"]),
    (of_soil(bounds=None), ["law external needs names and bounds"]),
    (of_soil(names=["mv", "mv"]), ["names are", "expected each once"]),
    (of_soil(units=["cm"]), ["units has 1 entries, names 2"]),
    (from_outside(materials={"soil": {"calibrate": True, "names": ["a"]}}), ["names is given, law is 'mangia', which"]),
    (of_soil(start=[0.5]), ["start has 1 number", "names: mv, s"]),
    (
        of_soil(start={"law": "external", "parameters": [0.5, 1]}),
        ["soil.start: law is 'external', which only an"],
    ),
    (of_soil(TRUE_SOIL, start=MANGIA_AT), ["soil.start is of law 'mangia'", "a list of 2 numbers for law 'external'"]),
    (of_soil({"source": "synthetic", "synthetic": {"parameters": {"soil": [1]}}}), ["names: mv, s"]),
    (with_command(output={"file": "../i.npy", "scale": "db"}), ["simulator.output.file: ", "own f"]),
    (with_command(files=["a/i.npy"]), ["files.0 and output.file are both 'i.npy'"]),
    (with_command(version="1", version_command=["a"]), ["version and version_command are both"]),
    (with_command(output={"file": "i", "scale": "db", "format": "raw"}), ["expected dtype"]),
    (
        with_command(retries=20, retry_wait_s=3),
        ["retry_wait_s is 3 and retries 20: waits that double", "36.4 days"],
    ),
    # whole parameters
    (whole(bounds=[[0, 9], [1, 12.5]]), ["bounds: n is 12.5, expected a whole number within +-2^53: the parameter is"]),
    (whole(start=[1, 2.5]), ["start: n is 2.5, expected a whole number"]),
    (whole(bounds=[[0, 9], [1, 1e17]]), ["bounds: n is 1e+17, expected a whole number within +-2^53"]),
    (whole(integer=["m"]), ["integer: no parameter 'm'"]),
    (whole(integer=3), ["materials.soil.integer is 3, expected true or false"]),
    (
        whole(bounds=[[0, 1], [1, 4]], integer=True),
        ["design.size is 8, expected less than 8, the number of combin"],
    ),
    (whole() | synthetic(parameters={"soil": [1, 2.5]}), ["parameters.soil: n is 2.5, expected a whole number"]),
    (whole(law="mangia", names=None, bounds=[[0, 1]] * 4), ["integer is for parameters of law: external"]),
    # formulas
    (formula(formula="a.b + b"), ["materials.dyke: formula: found 'a.b' in 'a.b + b', expected numbers, names"]),
    (formula(bounds=[[0, 1], [0, 2000]]), ["materials.dyke", "bounds of b are [0, 2000], expected within +-1000"]),
    (formula(integer=True), ["materials.dyke", "integer is for parameters of law: external"]),
    (formula(formula="a + sqrt(b - 1)"), ["'a + sqrt(b - 1)' is nan at an incidence of 0 degrees and a = -30, b = 0,"]),
    (dyke(formula="a + b*cos(phi)"), ["materials.dyke", "formula is given, law is 'mangia'"]),
    (formula(law="formulae"), ["mangia, nrl_sea, oh1992, tabulated, ulaby_dobson, formula, external"]),
    # numbers that no material has
    ({"materials": {"road": {"parameters": [1001, 0, 0, 0]}}}, ["materials.road: parameters: X1", "'mangia'", BEYOND]),
    (synthetic(parameters={"dyke": [0, -1e30, 0, 0]}), ["parameters.dyke: X2 of law 'mangia' is -1e+30", BEYOND]),
    (dyke(start={"law": "constant_gamma", "parameters": [2000]}), ["gamma of law 'constant_gamma' is 2000", BEYOND]),
    (dyke(bounds=[[0, 1e30]] * 4), ["bounds of X1 are [0, 1e+30], expected within"]),
    (dyke(looks=2.5), ["looks is 2.5 and calibrate is true, expected looks only with calibrate: false"]),
    # keys
    ({"simulator": {"knd": "builtin"}}, ["simulator.knd", "did you mean 'kind'?"]),
    (flat(near_incidence=20), ["scene.near_incidence", "did you mean 'near_incidence_deg'?"]),
    (synthetic(offset=1.0), ["measurement.synthetic.offset", "did you mean 'offset_db'?"]),
    (dyke(strat=X), ["materials.dyke.strat", "did you mean 'start'?"]),
    (synthetic(parameters={"dkye": X}), ["measurement.synthetic.parameters.dkye", "did you mean 'dyke'?"]),
    (
        {"stop": {"xyzzy": 1}},
        ["known: at_sampling_error, law_db, max_hours, max_runs, rms, stagnation_runs"],
    ),
    ({"scene": {"source": "builtin", "labels": "a.tif"}}, ["unknown key scene.labels"]),
    (measured(synthetic={}), ["unknown key measurement.synthetic"]),
    # products whose name says how their numbers are read
    (product(scale="power"), ["scale is power, S1A", "tif is a HyP3 RTC product, whose scale is db: leave the key"]),
    (product(radiometry="sigma0_ref"), ["radiometry is sigma0_ref, ", " whose radiometry is gamma0_rtc"]),
    (product(polarisation="VH"), ["polarisation is VH, ", " whose polarisation is VV"]),
    (product({"polarisation": "VH"}), ["measurement.polarisation is VV, radar.polarisation is VH"]),
    (product({"radiometry": "sigma0_ref"}), ["measurement.radiometry is gamma0_rtc, radar.radiometry is sigma0_ref"]),
    (product(path=HYP3.replace("gdunem", "sdunem")), ["measurement.radiometry is missing"]),
    (product(path="other.tif"), ["measurement.scale is missing"]),
]


@pytest.mark.parametrize(("data", "words"), BAD, ids=lambda value: None if isinstance(value, list) else str(value)[:60])
def test_bad_values_are_refused_in_a_sentence(data, words):
    text = message(data)
    for word in words:
        assert word in text, text
