"""What is known of a law, in archive, summary, terminal and figure."""

from dataclasses import replace

import numpy as np
import pytest
from archives import changed_findings, changed_material, determined, posterior, without_curve

from radcal.figures.law_figures import law
from radcal.findings import Finding
from radcal.results.archive import read_archive
from radcal.results.law_notes import found_words
from radcal.results.summary import sentences, summarise


def test_the_summary_holds_curve_intervals_and_where_the_law_is_determined(made, tmp_path):
    changed_material(made.archive, "dyke", posterior=posterior()).write(tmp_path / "calibration.h5")
    archive = read_archive(tmp_path / "calibration.h5")
    found = summarise(archive)["materials"]["dyke"]
    assert (found["known_between_deg"], found["identified"]) == ([22.25, 39.5], True)
    assert found["sigma0_curve"]["incidence_deg"] == list(range(86))
    for key, at_10 in {"median_db": -6.0, "p05_db": -7.1, "p95_db": -5.0, "field_p05_db": -6.65}.items():
        assert found["sigma0_curve"][key][10] == pytest.approx(at_10)
    assert list(found["parameters_p05"].values()) == [1.0, 2.0, 3.0, 4.0]
    assert found["parameters_p95"]["X4"] == pytest.approx(5.9)
    assert found["parameters_model"]["X2"] == pytest.approx(2.8)
    assert found["misfit"] == {
        "form_rms_db": [0.06, 0.25, 0.7], "noticed": False, "refuted": False, "noticed_db": 1.4,
    }  # fmt: skip
    assert found["posterior"]["field_sd_db"] == [0.21, 0.3, 0.39]
    assert found["fits"] is True
    # determined nowhere, and no curve
    nowhere = changed_material(archive, "dyke", posterior=posterior(known_between_deg=None))
    assert summarise(nowhere)["materials"]["dyke"]["identified"] is False
    found = summarise(changed_material(archive, "dyke", posterior=without_curve()))["materials"]["dyke"]
    assert [found[key] for key in ("known_between_deg", "sigma0_curve", "identified", "fits", "misfit")] == [None] * 5


def test_a_refuted_law_does_not_fit(made):
    form = replace(posterior().form, refuted=True)
    archive = changed_material(made.archive, "dyke", posterior=posterior(form=form))
    summary = summarise(archive)
    assert (summary["materials"]["dyke"]["fits"], summary["fits"]) == (False, False)
    assert summarise(changed_material(archive, "dyke", posterior=posterior(form=None)))["fits"] is None


def test_the_difference_from_the_truth_is_that_of_both_laws(made):
    """Without a sign: the law of the search lies 2.5 dB above it, the other one 2.1 dB below."""
    dyke = made.archive.materials["dyke"]
    hidden = dyke.parameters[dyke.best] - [2.5, 0.0, 0.0, 0.0]
    known = posterior(parameters_model=hidden - [2.1, 0.0, 0.0, 0.0])
    archive = changed_material(made.archive, "dyke", posterior=known, hidden=hidden)
    found = summarise(archive)["materials"]["dyke"]
    assert (found["law_difference_db"], found["law_difference_model_db"]) == pytest.approx((2.5, 2.1))
    assert "law_difference_model_db" not in summarise(archive)["materials"]["stem beans"]


def test_the_summary_holds_the_level_of_a_material_seen_at_one_incidence(made):
    seen = posterior(known_between_deg=None, seen_deg=np.array([[30.0, 31.0], [30.1, 30.92], [40.0, 40.4]]))
    archive = changed_material(made.archive, "dyke", posterior=seen, level_only=True)
    found = summarise(archive)["materials"]["dyke"]
    assert found["level_only"] is True
    assert found["levels"] == [
        pytest.approx({"incidence_deg": 30.5, "median_db": -10.1, "p05_db": -11.405, "p95_db": -8.69}),
        pytest.approx({"incidence_deg": 40.2, "median_db": -12.04, "p05_db": -13.442, "p95_db": -10.436}),
    ]
    without = summarise(changed_material(archive, "dyke", posterior=replace(seen, curve=None)))["materials"]["dyke"]
    assert without["levels"] == []
    other = summarise(changed_material(archive, "dyke", level_only=False))["materials"]["dyke"]
    assert (other["level_only"], other["levels"]) == (False, None)


def test_the_figure_shows_both_bands_and_where_sigma0_is_determined(made):
    archive = changed_findings(changed_material(made.archive, "dyke", posterior=posterior()), determined())
    canvas, caption, _ = law(archive, "dyke")
    upper, middle, _ = canvas.axes
    for axes, of_law in ((upper, 0.0), (middle, 1.0)):
        bands = {one.get_label(): one.get_paths()[0].vertices for one in axes.collections}
        truth = archive.configured.laws["dyke"](np.radians([30.0]), [6.1, 14.2, 21.5, 3.3])[0]
        drawn = {"90 % band of the material": (-11.3, -8.6), "its fields in this image": (-10.75, -9.4)}
        for label, edges in drawn.items():
            there = bands[label][np.isclose(bands[label][:, 0], 30.0, atol=0.1), 1]
            assert (there.min(), there.max()) == pytest.approx(np.array(edges) - of_law * truth, abs=0.1)
    lines = {line.get_label(): line for line in upper.lines}
    assert tuple(lines["determined"].get_xdata()) == (22.25, 39.5)
    model = lines["law nearest to the median"]
    expected = archive.configured.laws["dyke"](np.radians(model.get_xdata()), [1.8, 2.8, 3.8, 4.8])
    np.testing.assert_allclose(model.get_ydata(), expected)
    assert upper.get_title().replace("\n", " ") == "dyke: determined to +-1.5 dB between 23 and 39 degrees"
    assert "(violet bar): +-1.5 dB for the material, +-0.9 dB for its fields in this image, and +-0.4 dB" in caption
    nowhere = changed_material(archive, "dyke", posterior=posterior(known_between_deg=None))
    lost = Finding("undetermined", "warning", "dyke", {"narrowest_db": 2.4, "known_db": 1.5})
    canvas, caption, _ = law(changed_findings(nowhere, lost), "dyke")
    assert "determined" not in [line.get_label() for line in canvas.axes[0].lines]
    assert "(violet bar)" not in caption
    assert "determined at no angle" in canvas.axes[0].get_title()


def test_the_figure_shows_the_incidence_of_all_passes(made):
    seen = np.array([[21.0, 33.0], [44.0, 57.0]])
    archive = changed_material(made.archive, "dyke", posterior=posterior(seen_deg=seen))
    # the values of passes are not used: they are there, or not
    canvas, caption, _ = law(replace(archive, passes={"1": None, "2": None}), "dyke")
    assert (
        "the incidence seen, 21.0 to 33.0 and 44.0 to 57.0 deg, where 90 % of the material's pixels lie in" in caption
    )
    assert "Over the incidence of pass 1 the hidden truth differs" in caption
    thick = next(line.get_xdata() for line in canvas.axes[0].lines if line.get_linewidth() == 2.6)
    assert (thick[0], thick[40], thick[42], thick[82]) == (21.0, 33.0, 44.0, 57.0)
    assert np.flatnonzero(np.isnan(thick)).tolist() == [41, 83]
    assert "Over the incidence seen" in law(made.archive, "dyke")[1]


def test_parameters_are_told_with_their_intervals(build_archive, tmp_path):
    """At the end of the terminal those of laws without a curve, of which nothing else is known."""
    external = build_archive(tmp_path / "made", external=True).archive
    x = external.materials["dyke"].parameters[external.materials["dyke"].best]
    each = zip(("mv", "s", "l", "t"), x, ("1 to 2.9", "2 to 3.9", "3 to 4.9", "4 to 5.9"), strict=True)
    words = ", ".join(f"{name} {value:.4g} (5 to 95 %: {ends})" for name, value, ends in each)
    words = words.replace("mv 50 (5", "mv 50 (at its upper bound; 5")
    assert f"dyke: {words}." in sentences(external)
    at_bound = found_words({"a": 1.0, "b": 0.0}, [[0, 1], [0, 4]], {"a": 0.8, "b": 0.1}, {"a": 0.99, "b": 2.0})
    assert at_bound == "a 1 (at its upper bound; 5 to 95 %: 0.8 to 0.99), b 0 (at its lower bound; 5 to 95 %: 0.1 to 2)"
