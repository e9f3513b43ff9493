"""Interactive figures: valid for plotly, small, with the numbers of the archive."""

import base64
import gzip
import json
from dataclasses import replace

import numpy as np
import plotly.graph_objects as go
import pytest
from archives import changed_material, configured, posterior

from radcal.page.plots import PLOTS, embedded_library, interactive, script
from radcal.posterior.result import KeptDraws, LevelPoints
from radcal.results.archive import BinStatistics

RNG = np.random.default_rng(5)
BINS = BinStatistics(
    in_pass=np.array([1, 1]),
    incidence_deg=np.array([24.0, 37.5]),
    measured=np.array([[-8.0, 0.9, -0.3], [-11.0, 1.1, -0.5]]),
    error=np.array([[0.5, 0.1, 0.4], [0.8, 0.2, 0.3]]),
    calibrated=np.array([[-7.0, 1.0, -0.1], [-11.8, 0.9, -0.2]]),
    start=np.array([[-4.0, 0.8, -0.2], [-9.0, 0.7, -0.4]]),
    sensitivity=RNG.normal(size=(2, 3, 4)),
)
X = np.array([11.0, 21.0, 31.0, 4.0]) + RNG.normal(size=(400, 4)) * [1.0, 2.0, 3.0, 0.5]
DRAWS = KeptDraws(X, np.ones(400), np.ones(400), np.zeros((400, 91)), np.zeros(400))
POINTS = LevelPoints(
    np.array([25.5, 31.0]), np.array([-9.0, -10.5]), np.array([0.4, 0.3]),
    np.array([[-9.9, -9.2, -8.3], [-11.0, -10.1, -9.6]]), 0.37,
)  # fmt: skip


@pytest.fixture(scope="module")
def figures(made):
    return {one.name: one for one in interactive(made.archive)}


@pytest.fixture(scope="module")
def whole(made):
    """All figures of a material with bins and a sampled posterior."""
    found = posterior(draws=DRAWS, points=POINTS, r_hat=1.0123)
    prior = RNG.uniform(0.0, 50.0, (2000, 4))
    archive = changed_material(configured(made.archive, objective="classes"), "dyke", bins=BINS, posterior=found)
    archive = changed_material(archive, "dyke", prior=prior)
    return archive, {one.name: one for one in interactive(archive)}


def named(figure):
    """First trace of each name in the legend, of others the last one."""
    traces = sorted(figure.spec["data"], key=lambda one: one.get("showlegend", True))
    return {one["name"]: one for one in traces if "name" in one}


def test_every_figure_is_valid_for_plotly_and_json(figures, whole):
    assert {f"{kind}-dyke" for kind, *_ in PLOTS} <= set(whole[1])
    assert {"law-stem_beans", "cost-stem_beans", "parallel-stem_beans"} <= set(figures)
    for one in (*figures.values(), *whole[1].values()):
        text = json.dumps(one.spec, allow_nan=False)
        go.Figure(json.loads(text))
        assert one.caption
        assert one.alt
        assert one.material in ("dyke", "stem beans")
    # 14 materials together below 2 MB
    assert len(json.dumps([one.spec for one in whole[1].values() if one.material == "dyke"])) < 2e6 / 14


def test_a_figure_without_data_is_left_out(figures):
    missing = {"bins", "one_to_one", "misfit", "sensitivity", "corner", "predictive"}
    assert {kind for kind, *_ in PLOTS if f"{kind}-dyke" not in figures} == missing


def test_cost_of_each_run_stands_beside_its_prediction(made, figures, whole):
    material = made.archive.materials["dyke"]
    traces = named(figures["cost-dyke"])
    assert traces["design"]["x"] == [1, 2, 3, 4]
    assert traces["design"]["y"] == pytest.approx(material.rms[1:5], rel=6e-4)
    assert traces["predicted"]["x"] == [5, 6]
    assert traces["predicted"]["y"] == pytest.approx(material.fidelity.cost, rel=6e-4)
    # in bins, twice the cost is the sum of squared residuals, and the density has a panel of its own
    upper, lower = (one for one in whole[1]["cost-dyke"].spec["data"] if one["name"] == "design")
    assert upper["y"] == pytest.approx(2.0 * material.cost[1:5], rel=6e-4)
    assert (lower["yaxis"], lower["y"]) == ("y2", pytest.approx(material.rms[1:5], rel=6e-4))
    assert named(whole[1]["cost-dyke"])["predicted"]["y"] == pytest.approx(2.0 * material.fidelity.cost, rel=6e-4)
    # a tolerance has the density alone
    told = [any("tolerance" in name for name in named(one)) for one in (figures["cost-dyke"], whole[1]["cost-dyke"])]
    assert told == [True, False]


def test_a_run_is_told_by_its_x_or_has_another_law(build_archive, tmp_path):
    archive = build_archive(tmp_path, other_start=("dyke",)).archive
    traces = named(next(one for one in interactive(archive) if one.name == "cost-dyke"))
    assert traces["reference (start)"]["text"] == ["run 0: another law"]
    x = archive.materials["dyke"].parameters[2]
    assert traces["design"]["text"][1] == f"run 2: X1 {x[0]:.4g}, X2 {x[1]:.4g}, X3 {x[2]:.4g}, X4 {x[3]:.4g}"


def test_band_and_laws_are_those_of_the_archive(made, figures):
    curve = made.archive.materials["dyke"].posterior.curve
    bands = [one for one in figures["law-dyke"].spec["data"] if one["name"] == "90 % band of the material"][:2]
    for one, edge in zip(bands, (curve.p05_db, curve.p95_db), strict=True):
        assert one["y"] == pytest.approx(np.interp(one["x"], curve.incidence_deg, edge), rel=6e-4)
    law, material = made.archive.configured.laws["dyke"], made.archive.materials["dyke"]
    seen = named(figures["law-dyke"])["law of the search"]
    low, high = material.posterior.seen_deg[0]
    assert (seen["x"][0], seen["x"][-2]) == pytest.approx((low, high), rel=6e-4)
    wanted = law(np.radians(np.linspace(low, high, 41)), material.parameters[material.best])
    assert seen["y"][:-1] == pytest.approx(wanted, rel=6e-4)
    histogram = named(figures["law-dyke"])["pixels"]
    assert sum(histogram["y"][:-1]) == material.target.incidence_deg.size  # the last height stands twice
    gap = [
        one for one in figures["law-dyke"].spec["data"] if one["name"] == "law of the search" and one["yaxis"] == "y2"
    ]
    assert gap[1]["y"][:-1] == pytest.approx(
        wanted - law(np.radians(np.linspace(low, high, 41)), material.hidden), rel=2e-3
    )


def test_passes_are_kept_apart_in_the_law_and_named_in_the_misfit(whole):
    archive, _ = whole
    found = replace(archive, passes={"1": archive.passes["1"], "2": archive.passes["1"]})
    seen = posterior(seen_deg=np.array([[21.0, 29.0], [36.0, 44.0]]))
    found = changed_material(found, "dyke", posterior=seen, bins=replace(BINS, in_pass=np.array([1, 2])))
    figures = {one.name: one for one in interactive(found)}
    law = named(figures["law-dyke"])["law of the search"]
    assert (law["x"][0], law["x"][40:43], law["x"][82:]) == (21.0, [29.0, None, 36.0], [44.0, None])
    assert [one["x0"] for one in figures["law-dyke"].spec["layout"]["shapes"][:2]] == [21.0, 36.0]
    assert figures["misfit-dyke"].spec["data"][0]["x"] == ["24.0° (1)", "37.5° (2)"]


def test_bins_are_shown_by_statistic_and_against_each_other(whole):
    by_panel = [one for one in whole[1]["bins-dyke"].spec["data"] if one["name"] == "calibrated"]
    assert [one["y"] for one in by_panel] == BINS.calibrated.T.tolist()
    assert [one["x"] for one in by_panel] == [[24.0, 37.5]] * 3
    against = [one for one in whole[1]["one_to_one-dyke"].spec["data"] if one["name"] == "start"]
    assert [(one["x"], one["y"]) for one in against] == list(
        zip(BINS.measured.T.tolist(), BINS.start.T.tolist(), strict=True)
    )
    assert [one["error_x"]["array"] for one in against] == BINS.error.T.tolist()
    for k in "123":
        layout = whole[1]["one_to_one-dyke"].spec["layout"]
        assert layout[f"xaxis{k}"]["range"] == layout[f"yaxis{k}"]["range"]


def test_misfit_is_in_standard_deviations(whole):
    (heat,) = whole[1]["misfit-dyke"].spec["data"]
    np.testing.assert_allclose(heat["z"], [[2.0, -1.0], [1.0, -1.0], [0.5, 1.0]], rtol=1e-2)
    assert "mean 2.5, log sd 1, skewness 0.62" in whole[1]["misfit-dyke"].caption


def test_sensitivity_is_in_standard_deviations_by_parameter(whole):
    heats = whole[1]["sensitivity-dyke"].spec["data"]
    for k, heat in enumerate(heats):
        np.testing.assert_allclose(heat["z"], (BINS.sensitivity[:, k] / BINS.error[:, k, None]).T, rtol=1e-2)
        assert heat["y"] == ["X1", "X2", "X3", "X4"]
    composite = np.sqrt(((BINS.sensitivity / BINS.error[..., None]) ** 2).mean(axis=(0, 1)))
    assert f"X1 {composite[0]:.2g}, X2 {composite[1]:.2g}" in whole[1]["sensitivity-dyke"].caption


def test_corner_has_draws_by_pairs_and_densities_on_the_diagonal(whole):
    figure = whole[1]["corner-dyke"]
    pair = next(one for one in figure.spec["data"] if one["name"] == "draw" and one["xaxis"] == "x10")  # X3 over X2
    np.testing.assert_allclose(np.array([pair["x"], pair["y"]]).T, X[:, [1, 2]], rtol=6e-4)
    bars = [one for one in figure.spec["data"] if one["name"] == "posterior"]
    priors = [one for one in figure.spec["data"] if one["name"] == "prior"]
    for bar, prior in zip(bars, priors, strict=True):
        assert sum(bar["y"]) * (bar["x"][-1] - bar["x"][0]) / 19.0 == pytest.approx(1.0, rel=3e-3)
        assert np.mean(prior["y"]) == pytest.approx(1.0 / 50.0, rel=0.2)
    assert "split R-hat 1.012" in figure.caption


def test_levels_are_shown_against_their_predictions(whole):
    traces = named(whole[1]["predictive-dyke"])
    assert traces["measured"]["y"] == pytest.approx([0.2, -0.4])
    bars = traces["other images of such ground, 90 %"]["error_y"]
    assert (bars["array"], bars["arrayminus"]) == (pytest.approx([0.9, 0.5]), pytest.approx([0.7, 0.9]))
    assert "37 % of the predicted images lie further" in whole[1]["predictive-dyke"].caption


def test_parallel_coordinates_hold_all_runs(made, figures):
    material = made.archive.materials["dyke"]
    lines = named(figures["parallel-dyke"])
    low, high = np.array(made.archive.configured.materials["dyke"].box).T
    unit = (material.parameters[1] - low) / (high - low)
    assert lines["design"]["y"][:4] == pytest.approx(unit, rel=6e-4)
    assert sum(one["x"].count(0) for name, one in lines.items() if name != "best run") == made.archive.runs.kind.size


def test_library_unpacks_to_plotly_and_is_the_same_every_time():
    packed = embedded_library()
    assert b"plotly.js v" in gzip.decompress(base64.b64decode(packed))[:200]
    assert packed == embedded_library()
    assert "DecompressionStream" in script()
