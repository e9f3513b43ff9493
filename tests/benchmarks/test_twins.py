"""The figures of ``benchmarks/twins.py``."""

import numpy as np
import pytest
from twins import ANGLES, figures, longest

ANGLES_DEG = np.linspace(15.0, 42.0, ANGLES)  # steps of 1.5 degrees


def row(outside, determined, half_db=1.0, **changed):
    """Twin whose band leaves the truth out at the first angles, and which determines some of the first angles."""
    truth = np.linspace(-8.0, -14.0, ANGLES)
    median = np.where(np.arange(ANGLES) < outside, truth + 1.5 * half_db, truth + 0.5 * half_db)
    told = np.isin(np.arange(ANGLES), determined)
    return {
        "angles_deg": ANGLES_DEG.tolist(), "truth_db": truth.tolist(), "median_db": median.tolist(),
        "p05_db": (median - half_db).tolist(), "p95_db": (median + half_db).tolist(), "determined": told.tolist(),
        "refuted": False, "sampled": True, "codes": [], **changed,
    }  # fmt: skip


def test_a_band_excludes_the_truth_at_more_than_half_of_the_angles():
    found = figures([row(9, range(19)), row(10, range(19)), row(0, [])])
    assert (found["excluded"], found["excluded_determined"]) == (1, 1)
    assert found["coverage_90"] == pytest.approx((10 + 9 + 19) / 57)
    assert found["coverage_error"] == pytest.approx(np.std([10, 9, 19], ddof=1) / 19 / np.sqrt(3))


def test_determined_angles_are_counted_alone():
    assert figures([row(5, range(8))])["excluded_determined"] == 1
    assert figures([row(5, range(8))])["excluded"] == 0
    assert figures([row(12, range(14, 19))])["excluded_determined"] == 0
    assert figures([row(19, [])])["excluded_determined"] == 0


def test_five_degrees_are_determined_without_a_gap():
    assert figures([row(0, range(4, 8))])["determined_5_deg"] == 0  # 4.5 degrees
    assert figures([row(0, range(4, 9))])["determined_5_deg"] == 1  # 6 degrees
    assert figures([row(0, [0, 1, 2, 4, 5, 6])])["determined_5_deg"] == 0
    assert longest(np.array([True, True, False, True])) == 2


def test_a_refused_twin_has_no_band():
    refused = {"kind": "feet", "seed": 1, "refused": "no pixels"}
    found = figures([refused, row(0, range(19), half_db=0.8, codes=["radiometry"])])
    assert (found["n"], found["no_band"], found["excluded"], found["sampled"]) == (2, 1, 0, 1)
    assert found["half_width_db"] == pytest.approx(0.8)
    assert found["error_db"] == pytest.approx(0.4)
    assert found["codes"] == {"radiometry": 1}
    assert figures([refused])["coverage_90"] is None
