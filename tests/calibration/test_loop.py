"""Calibration of the small case: runs and X that no change outside of search and simulator may move."""

import pytest

KEYS = ["6e37bbb2745d0674f82e", "6205631f8940c7894f68", "2d9a330666d2c3131dea"]
FOUND = {
    "field": [-15.080138885986507, 0.0, 16.194253690848313, 3.8529057430447224],
    "lake": [-27.79884547385644, 0.0, 25.835336332531167, 4.174750185409824],
}


def test_runs_and_laws_of_the_small_case_stay(calibrated):
    history, decision = calibrated
    assert decision.converged
    assert [run.kind for run in history.runs] == ["reference", "design", "design", "infill"]
    assert [run.keys[0] for run in history.runs[:3]] == KEYS
    # sums of other libraries may round differently, by which the key of a proposal would be another
    for name, x in FOUND.items():
        assert history.best(name).parameters == pytest.approx(x, rel=1e-6, abs=1e-6)
