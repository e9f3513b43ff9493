"""Sentences about keys."""

import pytest
from config_samples import X, dyke, flat, mapped, measured, message, synthetic


@pytest.mark.parametrize(
    ("data", "key", "near"),
    [
        ({"sede": 1}, "sede", "seed"),
        ({"material": {}}, "material", "materials"),
        ({"radar": {"lokos": 4}}, "radar.lokos", "looks"),
        ({"radar": {"look": 4}}, "radar.look", "looks"),
        ({"radar": {"altitude": 4000}}, "radar.altitude", "altitude_m"),
        ({"radar": {"polarization": "HH"}}, "radar.polarization", "polarisation"),
        ({"simulator": {"knd": "builtin"}}, "simulator.knd", "kind"),
        ({"simulator": {"keep_image": True}}, "simulator.keep_image", "keep_images"),
        ({"registration": {"methd": "none"}}, "registration.methd", "method"),
        ({"target": {"pixel": 100}}, "target.pixel", "pixels"),
        ({"target": {"normalization": "none"}}, "target.normalization", "normalisation"),
        ({"design": {"sizes": 8}}, "design.sizes", "size"),
        ({"surrogate": {"output": "direct"}}, "surrogate.output", "outputs"),
        ({"optimiser": {"polsh": True}}, "optimiser.polsh", "polish"),
        ({"stop": {"max_run": 20}}, "stop.max_run", "max_runs"),
        ({"scene": {"source": "builtin", "sed": 1}}, "scene.sed", "seed"),
        (flat(near_incidence=20), "scene.near_incidence", "near_incidence_deg"),
        (mapped(vertical_dtum="EGM96"), "scene.vertical_dtum", "vertical_datum"),
        (measured(radiometri="x"), "measurement.radiometri", "radiometry"),
        (synthetic(offset=1.0), "measurement.synthetic.offset", "offset_db"),
        (dyke(bound=[]), "materials.dyke.bound", "bounds"),
        (dyke(strat=X), "materials.dyke.strat", "start"),
        (synthetic(parameters={"dkye": X}), "measurement.synthetic.parameters.dkye", "dyke"),
    ],
)
def test_misspelt_keys_are_refused_with_the_nearest(data, key, near):
    text = message(data)
    assert key in text
    assert f"did you mean {near!r}?" in text


def test_key_like_no_other_is_refused_with_all_known():
    text = message({"stop": {"xyzzy": 1}})
    assert "unknown key stop.xyzzy" in text
    assert "known: at_sampling_error, law_db, max_hours, max_runs, rms, stagnation_runs" in text


def test_keys_of_another_source_are_not_known():
    assert "unknown key scene.labels" in message({"scene": {"source": "builtin", "labels": "a.tif"}})
    assert "unknown key measurement.synthetic" in message(measured(synthetic={}))
