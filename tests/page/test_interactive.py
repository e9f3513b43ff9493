"""Interactive figures: valid for plotly, small, with the numbers of the archive."""

from __future__ import annotations

import base64
import gzip
import json

import numpy as np
import plotly.graph_objects as go
import pytest

from radcal.page.interactive import embedded_library, interactive, script


@pytest.fixture(scope="module")
def figures(made):
    return {one.name: one for one in interactive(made.archive)}


def test_every_figure_is_valid_for_plotly_and_json(figures):
    assert {"law-dyke", "cost-dyke", "law-stem_beans", "cost-stem_beans"} <= set(figures)
    for one in figures.values():
        go.Figure(json.loads(json.dumps(one.spec, allow_nan=False)))
        assert one.caption
        assert one.alt
        assert one.material in ("dyke", "stem beans")


def test_cost_of_each_run_stands_beside_its_prediction(made, figures):
    material = made.archive.materials["dyke"]
    traces = {one["name"]: one for one in figures["cost-dyke"].spec["data"]}
    assert traces["design"]["x"] == [1, 2, 3, 4]
    assert traces["design"]["y"] == pytest.approx(material.rms[1:5], rel=1e-4)
    assert traces["predicted"]["x"] == [5, 6]
    assert traces["predicted"]["y"] == pytest.approx(material.fidelity.cost, rel=1e-4)


def test_band_of_the_law_is_that_of_the_archive(made, figures):
    curve = made.archive.materials["dyke"].posterior.curve
    median = next(one for one in figures["law-dyke"].spec["data"] if one["name"] == "median")
    low, high = np.transpose(median["customdata"])
    assert median["y"] == pytest.approx(np.interp(median["x"], curve.incidence_deg, curve.median_db), rel=1e-4)
    assert low == pytest.approx(np.interp(median["x"], curve.incidence_deg, curve.p05_db), rel=1e-4)
    assert high == pytest.approx(np.interp(median["x"], curve.incidence_deg, curve.p95_db), rel=1e-4)


def test_library_unpacks_to_plotly_and_is_the_same_every_time():
    packed = embedded_library()
    assert b"plotly.js v" in gzip.decompress(base64.b64decode(packed))[:200]
    assert packed == embedded_library()
    assert "DecompressionStream" in script()
