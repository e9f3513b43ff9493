"""Calibration of the small case: runs and X that no change outside of search and simulator may move."""

import pytest

KEYS = ["6e37bbb2745d0674f82e", "6205631f8940c7894f68", "2d9a330666d2c3131dea"]
FOUND = {
    "field": [-15.080261552579152, 0.0, 16.194159550675515, 3.852788029055727],
    "lake": [-27.79888262120675, 0.0, 25.835300622355962, 4.174724035194689],
}


def test_runs_and_laws_of_the_small_case_stay(calibrated):
    history, decision = calibrated
    assert decision.converged
    assert [run.kind for run in history.runs] == ["reference", "design", "design", "infill"]
    assert [run.keys[0] for run in history.runs[:3]] == KEYS
    # sums of other libraries may round differently, by which the key of a proposal would be another
    for name, x in FOUND.items():
        assert history.best(name).parameters == pytest.approx(x, rel=1e-6, abs=1e-6)
