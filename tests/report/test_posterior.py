"""What is known of a law, in archive, summary, checks and figure."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from archives import changed_material, posterior

from radcal.assessment.known import level_words
from radcal.assessment.law_check import check_laws
from radcal.config import stages
from radcal.report.archive import read_archive, write_archive
from radcal.report.law_figures import law
from radcal.report.law_notes import found_words, outside_interval
from radcal.report.showing import show
from radcal.report.summary import sentences, summarise
from radcal.storage.records import write_json


def test_the_summary_holds_curve_intervals_and_where_the_law_is_known(made, tmp_path):
    write_archive(tmp_path / "calibration.h5", changed_material(made.archive, "dyke", posterior=posterior()))
    archive = read_archive(tmp_path / "calibration.h5")
    found = summarise(archive)["materials"]["dyke"]
    assert found["known_between_deg"] == [22.25, 39.5]
    assert set(found["sigma0_curve"]) == {"incidence_deg", "median_db", "p05_db", "p95_db"}
    assert found["sigma0_curve"]["incidence_deg"] == list(range(86))
    assert found["sigma0_curve"]["p95_db"][10] == pytest.approx(-5.0)
    assert list(found["parameters_p05"].values()) == [1.0, 2.0, 3.0, 4.0]
    assert found["parameters_p95"]["X4"] == pytest.approx(5.9)
    assert found["posterior"]["mode_shares"] == [0.8, 0.2]
    # known nowhere, and no curve
    nothing = changed_material(archive, "dyke", posterior=posterior(curve=None, known_between_deg=None))
    found = summarise(nothing)["materials"]["dyke"]
    assert found["known_between_deg"] is None
    assert found["sigma0_curve"] is None


def test_a_law_is_identified_where_it_is_known_somewhere(made):
    case = stages.Archive.of(made.case)
    here, nowhere = posterior(), posterior(known_between_deg=None, sampled=False, sentences=("the sampler has not.",))
    known = check_laws(case, made.targets, made.history, posteriors={"dyke": here})["dyke"]
    lost = check_laws(case, made.targets, made.history, posteriors={"dyke": nowhere})["dyke"]
    assert (known.identified, lost.identified) == (True, False)
    assert not any("not identified" in said for said in (*known.sentences, *lost.sentences))
    # its band is narrow enough, as that of `here`
    why = "its 90 % band is narrow enough only over less than half a degree"
    assert lost.sentences[0] == f"dyke: sigma0 is called known nowhere over the incidence seen: {why}."
    refused = check_laws(
        case, made.targets, made.history, posteriors={"dyke": nowhere}, withheld={"dyke": "the law does not fit"}
    )["dyke"]
    assert refused.sentences[0].endswith("nowhere over the incidence seen: the law does not fit.")
    assert (refused.recommended, refused.recommended_why) == ("constant", "the law does not fit")
    assert lost.sentences[1] == "dyke: the sampler has not."


def test_the_words_tell_width_and_angles():
    assert posterior().sentence(1.5) == (
        "sigma0 is known to +-1.5 dB (90 %) between 23 and 39 degrees; outside that it is not called known."
    )
    narrow = posterior(known_between_deg=(12.0, 20.0), known_half_width_db=1.2)
    assert "known to +-1.2 dB (90 %) between 12 and 20" in narrow.sentence(1.5)
    nowhere = posterior(known_between_deg=None, known_half_width_db=None)
    # levels in the middle of the incidence of each pass
    once = replace(nowhere, seen_deg=np.array([[30.0, 31.0], [30.1, 30.92]]))
    assert once.sentence(1.5, level_only=True) == (
        "seen at one incidence, from which no law can be known; its level is -10.1 dB (90 %: -11.4 to -8.7)."
    )
    twice = replace(nowhere, seen_deg=np.array([[30.0, 31.0], [40.0, 40.4]]))
    assert level_words(twice.levels()) == (
        "-10.1 dB (90 %: -11.4 to -8.7) at 30.5 degrees, -12.0 dB (90 %: -13.4 to -10.4) at 40.2 degrees"
    )
    assert replace(nowhere, curve=None).levels() == ()


def test_the_summary_holds_the_level_of_a_material_seen_at_one_incidence(made):
    seen = posterior(known_between_deg=None, seen_deg=np.array([[30.0, 31.0]]))
    fitted = replace(made.archive.materials["dyke"].fitted, level_only=True)
    found = summarise(changed_material(made.archive, "dyke", posterior=seen, fitted=fitted))["materials"]["dyke"]
    assert found["level_only"] is True
    assert found["levels"] == [
        pytest.approx({"incidence_deg": 30.5, "median_db": -10.1, "p05_db": -11.405, "p95_db": -8.69})
    ]
    other = summarise(changed_material(made.archive, "dyke", posterior=seen))["materials"]["dyke"]
    assert (other["level_only"], other["levels"]) == (False, None)


@pytest.mark.slow
def test_the_figure_shows_the_band_and_where_it_is_known(made):
    archive = changed_material(made.archive, "dyke", posterior=posterior())
    canvas, caption, _ = law(archive, "dyke")
    band, known = canvas.axes[0].collections[:2]
    assert (band.get_label(), known.get_label()) == ("90 % band", "known there")
    angles = known.get_paths()[0].vertices[:, 0]
    assert (angles.min(), angles.max()) == pytest.approx((22.25, 39.5))
    assert "2 distinct laws agree with the pixels." in caption
    assert "90 % of the laws that agree with the pixels, darker where sigma0 is known; it is" in caption
    nowhere = changed_material(made.archive, "dyke", posterior=replace(posterior(), known_between_deg=None))
    bare = law(nowhere, "dyke")
    assert "known there" not in [one.get_label() for one in bare[0].axes[0].collections]
    assert "darker" not in bare[1]
    # laws that do not fit do not agree with the pixels; the linear covariance is no sample of laws
    fitted = replace(made.archive.materials["dyke"].fitted, fits=False)
    unfit = law(changed_material(nowhere, "dyke", fitted=fitted), "dyke")[1]
    assert "90 % of the laws nearest to the pixels, though the law found does not fit them; it is" in unfit
    assert "agree with the pixels" not in unfit
    linear = changed_material(made.archive, "dyke", posterior=posterior(sampled=False))
    assert "at each angle" not in law(linear, "dyke")[1]


def test_the_figure_shows_the_incidence_of_all_passes(made):
    seen = np.array([[21.0, 33.0], [44.0, 57.0]])
    archive = changed_material(made.archive, "dyke", posterior=posterior(seen_deg=seen))
    # the values of passes are not used: they are there, or not
    canvas, caption, _ = law(replace(archive, passes={"1": None, "2": None}), "dyke")
    assert (
        "Shaded, thick: 21.0 to 33.0 and 44.0 to 57.0 deg, where 90 % of the material's pixels lie in each" in caption
    )
    assert "dB from the truth over the incidence of pass 1" in canvas.axes[0].get_title().replace("\n", " ")
    thick = [line.get_xdata() for line in canvas.axes[0].lines if line.get_linewidth() == 3.2]
    assert [(one.min(), one.max()) for one in thick[:2]] == [(21.0, 33.0), (44.0, 57.0)]
    one = law(archive, "dyke")[1]
    assert "over the incidence seen" in one.lower()
    assert "57.0" not in one


def test_x_outside_of_its_own_interval_is_remarked(made, tmp_path):
    names, box = ["X1", "X2", "X3", "X4"], [[-40, 0], [0, 20], [0, 25], [0, 12]]
    interval = [[-30, -20], [0.4, 13], [3, 9], [2, 5]]
    assert outside_interval(names, [-25.0, 5.0, 3.0, 5.0], box, interval) == ""
    assert outside_interval(names, [-25.0, 1e-11, 11.25, 12.0], box, interval, 0.0) == (
        "X2 is at its lower bound 0, outside of its own 90 % interval (0.4 to 13) and X3 is 11.25, outside of its own "
        "90 % interval (3 to 9) and X4 is at its upper bound 12, outside of its own 90 % interval (2 to 5): many X "
        "give nearly this law, so that sigma0 and its band say more than X."
    )
    # without a curve nothing is known of sigma0
    lone = "X3 is 11.25, outside of its own 90 % interval (3 to 9)"
    assert outside_interval(names, [-25.0, 5.0, 11.25, 4.0], box, interval) == f"{lone}."
    assert outside_interval(names, [-25.0, 5.0, 11.25, 4.0], box, interval, 0.347) == (
        f"{lone}; sigma0 of the best run lies outside of its own 90 % band, too, by up to 0.35 dB."
    )
    # the verdict says that the bound keeps the law from fitting
    at_bound = "X2 is at its lower bound 0, outside of its own 90 % interval (0.4 to 13)"
    assert outside_interval(names, [-25.0, 1e-11, 5.0, 4.0], box, interval, 0.0, ["X2"]) == f"{at_bound}."
    assert outside_interval(names, [-25.0, 1e-11, 5.0, 4.0], box, interval, 0.0, ["X3"]).startswith(f"{at_bound}: many")
    x = made.archive.materials["dyke"].parameters.values[made.archive.materials["dyke"].best]
    low, high = x - 1.0, x + 2.0
    low[1] = x[1] + 0.5
    archive = changed_material(made.archive, "dyke", posterior=posterior(parameters_p05=low, parameters_p95=high))
    said = summarise(archive)["materials"]["dyke"]["parameters_remark"]
    begin = f"X2 is {x[1]:.4g}, outside of its own 90 % interval ({low[1]:.3g} to {high[1]:.3g})"
    # 0.25 and 0.0625 dB^2 of variance of the fields are added to the law, as in the band
    there, level_db = (
        posterior().curve,
        made.archive.materials["dyke"].parameters.curve()(np.radians(np.arange(86.0)), x),
    )
    level_db = level_db + np.log(10.0) / 20.0 * (0.3**2 + 0.15**2)
    seen = slice(21, 45)
    beyond = float((level_db - there.p95_db)[seen].max())
    assert said == f"{begin}; sigma0 of the best run lies outside of its own 90 % band, too, by up to {beyond:.2g} dB."
    inside = replace(there, p05_db=level_db - 0.01, p95_db=level_db + 0.01)
    known = posterior(parameters_p05=low, parameters_p95=high, curve=inside)
    again = summarise(changed_material(archive, "dyke", posterior=known))["materials"]["dyke"]
    assert again["parameters_remark"].startswith(f"{begin}: many X")
    assert f"dyke: {said}" in sentences(archive)
    write_json(tmp_path / "summary.json", summarise(archive), flat=True)
    for name in ("scene.h5", "reference.json", "scores.json", "final.json", "calibration.h5", "export.json"):
        (tmp_path / name).touch()
    (tmp_path / "report.json").touch()
    assert f"dyke: {said}" in show(tmp_path)


def test_parameters_are_told_with_their_intervals(made, build_archive, tmp_path):
    """At the end of the terminal those of laws without a curve, of which nothing else is known."""
    archive = changed_material(made.archive, "dyke", posterior=posterior())
    assert not any("5 to 95 %" in said for said in sentences(archive))
    external = build_archive(tmp_path / "made", external=("dyke", "unused")).archive
    assert not any(said.startswith("dyke: mv ") for said in sentences(external))
    external = changed_material(external, "dyke", posterior=posterior(curve=None, known_between_deg=None))
    x = external.materials["dyke"].parameters.values[external.materials["dyke"].best]
    each = zip(("mv", "s", "l", "t"), x, ("1 to 2.9", "2 to 3.9", "3 to 4.9", "4 to 5.9"), strict=True)
    words = ", ".join(f"{name} {value:.4g} (5 to 95 %: {ends})" for name, value, ends in each)
    words = words.replace("mv 50 (5", "mv 50 (at its upper bound; 5")
    assert f"dyke: {words}." in sentences(external)
    write_json(tmp_path / "summary.json", summarise(external), flat=True)
    for name in ("scene.h5", "reference.json", "scores.json", "final.json", "calibration.h5", "export.json"):
        (tmp_path / name).touch()
    (tmp_path / "report.json").touch()
    assert any(f"external with {words}; nothing is known of a curve" in line for line in show(tmp_path))
    at_bound = found_words({"a": 1.0, "b": 0.0}, [[0, 1], [0, 4]], {"a": 0.8, "b": 0.1}, {"a": 0.99, "b": 2.0})
    assert at_bound == "a 1 (at its upper bound; 5 to 95 %: 0.8 to 0.99), b 0 (at its lower bound; 5 to 95 %: 0.1 to 2)"
