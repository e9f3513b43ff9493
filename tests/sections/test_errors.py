"""Sentences about keys."""

import pytest
from config_samples import X, dyke, flat, measured, message, synthetic


@pytest.mark.parametrize(
    ("data", "key", "near"),
    [
        ({"sede": 1}, "sede", "seed"),
        ({"simulator": {"knd": "builtin"}}, "simulator.knd", "kind"),
        (flat(near_incidence=20), "scene.near_incidence", "near_incidence_deg"),
        (synthetic(offset=1.0), "measurement.synthetic.offset", "offset_db"),
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
