"""Two calibrations side by side."""

from dataclasses import replace

import numpy as np
import pytest
from archives import changed_material, configured, posterior
from commands import typed
from sealed import changed

from radcal.errors import ConfigError, StoreError
from radcal.posterior.result import Curve
from radcal.products.comparison import _fits, _known, compare, law_difference


def known(slope, level, seen, half=1.0, between=None):
    """Posterior of a straight curve of sigma0 [dB], with a band of twice the half-width downwards."""
    degrees = np.arange(10.0, 61.0)
    middle = level + slope * degrees
    low, high = middle - 2 * half, middle + half
    curve = Curve(degrees, middle, low, high, np.full(51, 0.3), middle, low + 0.1, high - 0.1)
    return posterior(curve=curve, known_between_deg=between, seen_deg=np.array([seen]))


@pytest.fixture
def pair(made):
    """A and B: B is 4 dB above A at 30 degrees, and falls by 0.1 dB per degree more."""
    a = changed_material(made.archive, "dyke", posterior=known(-0.3, -5.0, (20.0, 40.0), between=(21.5, 38.0)))
    b = changed_material(made.archive, "dyke", posterior=known(-0.4, 2.0, (30.0, 50.0), half=2.2))
    return a, configured(b, case="other")


def test_differences_are_those_over_the_incidence_that_both_have_seen(pair):
    found = law_difference(*pair, "dyke")
    assert found.seen_deg == ((30.0, 40.0),)
    assert found.mean_db == pytest.approx(3.5)
    assert found.largest_db == pytest.approx(4.0)
    back = law_difference(*reversed(pair), "dyke")
    assert (back.mean_db, back.largest_db) == (pytest.approx(-3.5), pytest.approx(-4.0))
    # A's upper edge lies 1 dB above it, B's lower edge 4.4 dB below B: they always meet; narrower ones from 36 deg on
    assert found.bands_meet == 1.0
    narrow = changed_material(pair[1], "dyke", posterior=known(-0.4, 2.0, (30.0, 50.0), half=1.2))
    assert law_difference(pair[0], narrow, "dyke").bands_meet == pytest.approx(0.4, abs=0.02)
    far = changed_material(pair[1], "dyke", posterior=known(-0.4, 2.0, (41.0, 50.0)))
    assert law_difference(pair[0], far, "dyke") is None


def test_all_passes_have_seen(pair):
    """Without the angles between two passes, which neither has seen."""
    seen = np.array([[45.0, 52.0], [33.0, 37.0], [28.0, 34.0]])
    several = replace(pair[1].materials["dyke"].posterior, seen_deg=seen)
    found = law_difference(changed_material(pair[0], "dyke", posterior=several), pair[1], "dyke")
    assert found.seen_deg == ((30.0, 37.0), (45.0, 50.0))
    assert found.mean_db == 0.0
    # B less A is 7 - 0.1 phi: in the mean over 7 degrees about 33.5 and 5 degrees about 47.5
    apart = changed_material(pair[0], "dyke", posterior=replace(pair[0].materials["dyke"].posterior, seen_deg=seen))
    mean_deg = (7.0 * 33.5 + 5.0 * 47.5) / 12.0
    assert law_difference(apart, pair[1], "dyke").mean_db == pytest.approx(7.0 - 0.1 * mean_deg, abs=0.02)


def test_what_is_known_is_told_only_of_a_law_with_a_band(pair):
    dyke = pair[0].materials["dyke"]
    assert _known(dyke) == "22-38 deg"  # rounded into the interval, as the verdict rounds
    narrow = replace(dyke.posterior, known_between_deg=(31.25, 31.75))
    assert _known(replace(dyke, posterior=narrow)) == "31.25-31.75 deg"
    assert _known(replace(dyke, level_only=True)) == "level only"
    assert _known(replace(dyke, posterior=replace(dyke.posterior, curve=None))) == "-"


def test_a_refuted_law_is_told_from_one_that_cannot_be_tested(pair):
    dyke = pair[0].materials["dyke"]
    refuted = replace(dyke.posterior, form=replace(dyke.posterior.form, refuted=True))
    unknown = replace(dyke, posterior=replace(dyke.posterior, form=None))
    assert _fits(replace(dyke, posterior=refuted)) == "refuted"
    assert (_fits(unknown), _fits(replace(unknown, level_only=True))) == ("unknown", "level only")


@pytest.mark.slow
def test_the_command_prints_a_table_and_draws_a_figure(pair, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for archive, name in zip(pair, ("small", "other"), strict=True):
        archive.write(tmp_path / "results" / name / "calibration.h5")
    lines = typed("compare", "small", "other").stdout.splitlines()
    assert lines[:2] == ["A: results/small", "B: results/other"]
    assert [cell.strip() for cell in lines[4].split("  ") if cell] == [
        "dyke", "30.0-40.0 deg", "+3.50 dB", "+4.00 dB", "100 %", "not refuted | not refuted", "22-38 deg | nowhere",
        "6 | 6",
    ]  # fmt: skip
    assert lines[5].startswith("stem beans")
    assert lines[-1] == "figure: results/small_and_other.png"
    assert (tmp_path / "results/small_and_other.png").read_bytes().startswith(b"\x89PNG")
    missing = typed("compare", "small", "gone", code=1)
    assert missing.stderr.startswith("radcal: gone: there is no folder results/gone")


def test_cases_that_cannot_be_compared_are_refused(pair, tmp_path):
    folders, figure = [tmp_path / "a", tmp_path / "b"], tmp_path / "figure.png"
    for folder, archive in zip(folders, pair, strict=True):
        archive.write(folder / "calibration.h5")
    with changed(tmp_path / "b/calibration.h5") as file:
        del file["materials/dyke/posterior/seen_deg"]
        file["materials/dyke/posterior/seen_deg"] = ["a", "b"]
    with pytest.raises(StoreError, match=r"b/calibration\.h5: holds other contents than radcal writes"):
        compare(folders, figure)
    only = {"stem": pair[1].materials["stem beans"]}
    replace(pair[1], materials=only).write(tmp_path / "b/calibration.h5")
    with pytest.raises(ConfigError, match="no material in common: found dyke, stem beans and stem, expected"):
        compare(folders, figure)
    assert not figure.exists()
