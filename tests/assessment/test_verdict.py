"""Sentences on the fit of each material, and the first line."""

from __future__ import annotations

from dataclasses import replace

import pytest

from radcal.assessment.conclusion import without_angles
from radcal.assessment.fit_test import FitTest
from radcal.assessment.known import Level
from radcal.assessment.verdict import Known, all_fit, first_line, verdict


def fit_of(fits=True, **changes):
    values = {
        "residual_sum": 14.2,
        "expected": 21.4,
        "p": 0.6,
        "worst_deg": 33.6,
        "worst_mean_db": 0.3,
        "worst_spread": 1.04,
        "mean_db": 0.1,
        "sd_db": 2.2,
        "measured_sd_db": 2.1,
        "looks_limit": "",
        "bounds": (),
        "distance": 0.4,
    }
    return FitTest(fits=fits, **{**values, **changes})


def test_a_law_that_fits_is_known_somewhere():
    known = Known((10.2, 24.9), 0.68)
    assert verdict("dyke", fit_of(), known=known) == (
        "dyke fits (residuals 14 of 21): sigma0 known to +-0.7 dB between 11 and 24 degrees; "
        "outside that it is not called known."
    )
    assert verdict("dyke", fit_of()) == "dyke fits (residuals 14 of 21)."
    assert verdict("dyke", fit_of(), known=Known(None, None)) == (
        "dyke fits (residuals 14 of 21), but sigma0 is known well enough at no angle."
    )


def test_a_law_that_does_not_fit_is_not_called_known():
    test = fit_of(False, sd_db=14.5, measured_sd_db=2.1)
    said = verdict("crops", test, "mangia's bounds cannot reach -9 dB", Known((10.0, 25.0), 0.7))
    assert said == (
        "crops: does not fit: the simulated spread is 14.5 dB, the measured 2.1; mangia's bounds cannot reach -9 dB."
    )


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (
            {"residual_sum": 160.0, "mean_db": -1.3},
            "residuals 160 of 21, the simulated mean is 1.3 dB below the measured",
        ),
        (
            {"worst_mean_db": 1.26, "residual_sum": 60.0},
            "residuals 60 of 21, at 34 degrees the simulated mean is 1.3 dB above the measured",
        ),
        (
            {"worst_spread": 1.3, "residual_sum": 60.0},
            "residuals 60 of 21, at 34 degrees the simulated spread is 1.30 times the measured",
        ),
        ({"sd_db": 1.7}, "the simulated spread is 1.7 dB, the measured 2.1"),
        (
            {"sd_db": 1.7, "mean_db": -8.5, "residual_sum": 6026.0},
            "residuals 6026 of 21, the simulated mean is 8.5 dB below the measured, and the simulated spread is 1.7 "
            "dB, the measured 2.1",
        ),
        ({"looks_limit": "upper"}, "residuals 14 of 21, and the pixels ask for more looks than the search allows"),
        (
            {"looks_limit": "lower", "worst_spread": 0.8},
            "residuals 14 of 21, at 34 degrees the simulated spread is 0.80 times the measured",
        ),
    ],
)
def test_the_largest_misfit_is_said_and_an_unknown_cause(changes, said):
    assert verdict("crops", fit_of(False, **changes)) == f"crops: does not fit: {said}; cause unknown."


def test_a_cause_that_is_a_question_ends_with_one_mark():
    asked = "the image has 9.0 looks, radar.looks is 4: speckle-filtered?"
    assert verdict("a", fit_of(False), asked).endswith(" speckle-filtered?")
    assert verdict("a", fit_of(False), asked, doubt="a doubt").endswith(" speckle-filtered?; a doubt.")
    off = without_angles(fit_of(False, mean_db=-3.0))
    assert verdict("a", off, asked, level_only=True).endswith(" speckle-filtered?")


def test_one_incidence_is_a_level_only():
    assert verdict("water", fit_of(), level_only=True) == "water: level only, seen at one incidence."
    level = Known(None, None, levels=(Level(38.9, -18.24, -19.34, -17.08),), level_error_db=0.54)
    assert verdict("water", fit_of(None), known=level, level_only=True) == (
        "water: level only, seen at one incidence: -18.2 dB (90 %: -19.3 to -17.1)."
    )
    narrow = replace(level, levels=(Level(38.9, -18.24, -18.89, -17.54),))
    assert verdict("water", fit_of(None), known=narrow, level_only=True) == (
        "water: level only, seen at one incidence: -18.2 dB (90 %: -18.9 to -17.5), +-0.5 dB of it by "
        "uncertainty.level_db alone."
    )
    # a level that is off shows at one incidence, too; what differs from bin to bin there is no misfit of a law
    off = without_angles(fit_of(False, mean_db=-3.0))
    assert off.fits is False
    assert verdict("water", off, level_only=True) == (
        "water: level only, seen at one incidence, and does not fit: its simulated mean is 3.0 dB below the measured; "
        "cause unknown."
    )
    assert verdict("water", off, known=level, level_only=True).endswith(
        "; cause unknown; level found -18.2 dB (90 %: -19.3 to -17.1) (not to be used: does not fit)."
    )
    for test in (fit_of(), fit_of(False, mean_db=0.3, worst_mean_db=1.2), fit_of(None)):
        assert without_angles(test).fits is None
    # a level that is off by chance, or because the search has not ended, is said
    assert verdict("water", without_angles(fit_of(mean_db=0.7)), known=level, level_only=True) == (
        "water: level only, seen at one incidence: -18.2 dB (90 %: -19.3 to -17.1); its simulated mean is 0.7 dB above "
        "the measured."
    )
    two = replace(level, levels=(level.levels[0], Level(30.0, -16.0, -16.9, -15.1)))
    assert verdict("water", fit_of(None), known=two, level_only=True, passes=2).startswith(
        "water: level only, seen at one incidence in each pass: -18.2 dB (90 %: -19.3 to -17.1) at 38.9 degrees, -16.0"
    )
    wide = without_angles(fit_of(False, sd_db=4.0, measured_sd_db=4.7))
    assert verdict("bare", wide, level_only=True) == (
        "bare: level only, seen at one incidence; the simulated spread is 4.0 dB, the measured 4.7."
    )
    assert all_fit([True, without_angles(fit_of()).fits]) is None


def test_one_density_is_not_tested():
    nan = float("nan")
    said = verdict("dyke", fit_of(None, residual_sum=nan, expected=nan, p=nan))
    assert said == (
        "dyke: one density leaves no degree of freedom to test the law, and its rms is 0.4 times the sampling error."
    )
    near = fit_of(None, residual_sum=nan, expected=nan, p=nan, distance=0.003)  # a search that ends at its tolerance
    assert verdict("dyke", near).endswith(", and its rms is less than 0.1 times the sampling error.")
    far = fit_of(None, residual_sum=nan, expected=nan, p=nan, distance=3.1)
    assert far.unmatched
    assert not replace(far, distance=2.9).unmatched
    assert not replace(far, residual_sum=14.0).unmatched
    assert verdict("dyke", far, passes=2, known=Known(None, None), between_db=3.2) == (
        "dyke: the law is not tested, because only densities were compared, and its rms is 3.1 times the sampling "
        "error, so that the density is not matched and sigma0 is called known at no angle; fields differ by 3.2 dB "
        "(sd), which can hide a misfit."
    )
    full = fit_of(None, expected=0.0, p=nan)
    assert verdict("ice", full) == (
        "ice: the bins have no more values than the law has parameters, so that the law cannot be tested."
    )


@pytest.mark.parametrize(("between", "said"), [(3.1, True), (3.0, False), (float("nan"), False)])
def test_fields_that_differ_much_are_said(between, said):
    assert (
        "fields differ by 3.1 dB (sd), which can hide a misfit" in verdict("a", fit_of(), between_db=between)
    ) is said


def test_a_registration_in_doubt_ends_every_verdict_and_is_counted():
    doubt = "the registration is in doubt: onto the calibrated image, it moves these pixels by 0.8 pixels"
    both = (
        verdict("dyke", fit_of(), known=Known(None, None), doubt=doubt),
        verdict("dyke", fit_of(False), doubt=doubt),
    )
    assert both[0] == (f"dyke fits (residuals 14 of 21), but sigma0 is known well enough at no angle; {doubt}.")
    assert both[1].endswith(f"; cause unknown; {doubt}.")
    line = first_line({"dyke": both[0], "road": "road fits."}, {"dyke": True, "road": True}, True)
    assert line == "Of 2 materials 2 fit; sigma0 is known at some angles for none; the registration is in doubt for 1."


def test_a_contradicted_level_takes_the_place_of_what_is_known():
    why = "the measured image lies +2.9 +- 0.1 dB from the reference run on wood: mend level or laws"
    known = Known(None, None, linear=True, levels=(Level(38.9, -18.24, -19.34, -17.08),), withheld=why)
    said = verdict("dyke", fit_of(), known=known, between_db=3.2)
    assert said.startswith(f"dyke fits (residuals 14 of 21), but sigma0 is called known at no angle: {why}; fields dif")
    assert verdict("water", fit_of(), known=known, level_only=True).endswith(f"; {why}.")
    assert why not in verdict("road", fit_of(False), known=known)
    both = {"dyke": said, "road": verdict("road", fit_of(), known=known)}
    line = first_line(both, {"dyke": True, "road": True}, True)
    assert line == f"Of 2 materials 2 fit; sigma0 is known at some angles for none; {why}."


def test_all_fit():
    assert all_fit([True, True]) is True
    assert all_fit([True, None]) is None
    assert all_fit([None, False, True]) is False
    assert all_fit([]) is None


def test_the_first_line_counts_several():
    one = {"dyke": "dyke fits (residuals 14 of 21)."}
    assert first_line(one, {"dyke": True}, True) == "dyke fits (residuals 14 of 21)."
    assert first_line(one, {"dyke": True}, False) == (
        "dyke fits (residuals 14 of 21). The search has not met its stop criterion."
    )
    names = ["a", "b", "c", "d"]
    fits = dict(zip(names, [True, False, True, None], strict=True))
    line = first_line(dict.fromkeys(names, "-"), fits, True)
    assert (
        line
        == "Of 4 materials 2 fit, 1 does not fit (b), 1 cannot be tested (d); sigma0 is known at some angles for none."
    )


def test_a_band_without_convergence_and_a_level_are_said():
    known = Known((10.2, 24.9), 0.68, linear=True)
    assert "(linear covariance: the sampler has not converged)" in verdict("dyke", fit_of(), known=known)
    said = {name: verdict(name, fit_of(), level_only=name == "water") for name in ("dyke", "water")}
    where = "; sigma0 is known at some angles for none."
    both = {"dyke": True, "water": True}
    assert first_line(said, both, True) == f"Of 2 materials 1 fits, 1 level only (water){where}"
    there = {**said, "dyke": verdict("dyke", fit_of(), known=known)}
    assert first_line(there, both, True).endswith("; sigma0 is known at some angles for 1 (dyke).")
    # a level that is off is not known
    said["water"] = verdict("water", fit_of(False, mean_db=-3.0), level_only=True)
    assert first_line(said, {"dyke": True, "water": False}, True) == (
        f"Of 2 materials 1 fits, 1 does not fit (water){where}"
    )


def test_numbers_of_the_first_pass_are_said_to_be_its():
    said = verdict("a", fit_of(False, mean_db=-1.3), passes=2)
    assert "the simulated mean is 1.3 dB below the measured in pass 1;" in said
    assert "the simulated spread in pass 1 is 1.7 dB" in verdict("a", fit_of(False, sd_db=1.7), passes=2)


def test_a_narrow_band_is_not_given_as_zero():
    assert "known to +-0.04 dB between 11 and 24" in verdict("a", fit_of(), known=Known((10.2, 24.9), 0.04))


@pytest.mark.parametrize(
    ("half", "said"), [(0.7, " (+-0.5 dB of it by the removed offset alone)"), (0.8, ""), (0.5, "")]
)
def test_the_error_of_the_level_is_said_where_it_is_most_of_the_band(half, said):
    known = Known((10.2, 24.9), half, level_error_db=0.54, level_key="the removed offset")
    assert f"known to +-{half} dB between 11 and 24 degrees{said}; outside" in verdict("a", fit_of(), known=known)
