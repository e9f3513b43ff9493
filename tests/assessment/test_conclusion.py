"""Conclusion of a calibration: which pixels, densities, images and runs it shows."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from archives import posterior
from calibration_samples import make_run, make_target
from two_materials import X, geometry

from radcal.assessment import conclusion
from radcal.assessment.budget import level_contradicted
from radcal.assessment.conclusion import _known, _unknown, conclude, not_to_be_used
from radcal.assessment.fit_test import FitTest
from radcal.assessment.registration_check import Moved
from radcal.calibration.history import History
from radcal.config import Stop, Uncertainty, case_from
from radcal.measurement.levels import Levels
from radcal.measurement.target import Targets
from radcal.radar.texture import log_speckle_cumulants
from radcal.skewnormal import centred
from radcal.storage.runs import Record, RunStore


@pytest.fixture(scope="module")
def parts(tmp_path_factory):
    """Arguments of a conclusion; images at -5 (reference), -10 (calibrated) and -8 dB (another seed)."""
    seen = geometry()
    rng = np.random.default_rng(4)

    def record(key: str, level_db: float) -> Record:
        image = (level_db + rng.normal(0.0, 2.0, seen.shape)).astype(np.float32)
        return Record(key, {"area": image.ravel()[seen.pixels("area")]}, image, 0.1)

    case = case_from(
        {
            "objective": "density",
            "materials": {"area": {"calibrate": True}, "rest": {"parameters": [1, 2, 3, 4]}},
            "measurement": {"synthetic": {"parameters": {"area": X}}},
            "radar": {"looks": 4},
        }
    )
    visible = seen.pixels("area")
    order = np.sort(rng.choice(visible.size, 900, replace=False))
    target = make_target(
        rng.normal(-10.0, 2.0, 900), seen.incidence_deg.ravel()[visible[order]], pixels=visible[order], order=order,
        rms_sampling=0.004,
    )  # fmt: skip
    reference, *final = record("start", -5.0), record("best", -10.0), record("fresh", -8.0)
    runs = [
        replace(make_run("reference", 0, {"area": 0.3}, x=X), key="start"),
        replace(make_run("design", 0, {"area": 0.01}, x=X, looks=2.5), key="best"),
        replace(make_run("design", 1, {"area": 0.2}, x=X, looks=1.5), key="other"),
    ]
    folder = tmp_path_factory.mktemp("runs")
    RunStore(folder).put(reference, {"simulator": {"kind": "made up"}})
    arguments = (case, Stop(rms=1e-3), History(runs), Targets({"area": target}), seen, folder, tuple(final))
    return arguments, reference


@pytest.fixture(scope="module")
def found(parts):
    return conclude(*parts[0])


def test_pixels_are_those_of_reference_and_final_runs_with_the_texture_of_each(parts, found):
    """Of 4 looks, as the reference run suits best, there is none; the best run suits 2.5."""
    (*_, final), reference = parts
    shown, order = found.materials["area"], parts[0][3]["area"].order
    np.testing.assert_array_equal(shown.start, reference.pixels_db["area"][order])
    wanted = log_speckle_cumulants(2.5)[1] - log_speckle_cumulants(4.0)[1]
    added = [
        values - record.pixels_db["area"][order]
        for values, record in zip((shown.calibrated, shown.fresh), final, strict=True)
    ]
    for texture in added:
        assert texture.var() == pytest.approx(wanted, rel=0.2)  # of 900 pixels: four standard errors
    assert abs(np.corrcoef(*added)[0, 1]) < 0.15


def test_densities_are_those_of_all_pixels_of_the_final_runs(found):
    shown = found.materials["area"]
    texture = log_speckle_cumulants(2.5) - log_speckle_cumulants(4.0)
    for dp, level in ((shown.calibrated_dp, -10.0), (shown.fresh_dp, -8.0)):
        mean, sd, _ = centred(dp)
        assert mean == pytest.approx(level + texture[0], abs=0.2)
        assert sd == pytest.approx(np.sqrt(4.0 + texture[1]), rel=0.05)


def test_the_picture_is_the_fresh_run_with_the_texture_of_the_calibrated_material(parts, found):
    (*_, seen, _, final), reference = parts
    np.testing.assert_array_equal(found.reference_db, reference.image_db)
    same = found.calibrated_db == final[1].image_db
    assert same[:, 50:].all()
    assert not same[:, :50].any()
    pixels, order = found.calibrated_db.ravel()[seen.pixels("area")], parts[0][3]["area"].order
    np.testing.assert_array_equal(pixels[order], found.materials["area"].fresh)


def test_a_final_run_that_the_search_has_made_is_no_new_one(parts, found):
    assert found.new_runs == 1
    assert found.simulator == {"kind": "made up"}
    assert found.materials["area"].differ
    *rest, final = parts[0]
    again = conclude(*rest, (final[0], replace(final[0], key="fresh")))
    assert not again.materials["area"].differ
    assert any("another seed gives the same pixels" in note for note in again.notes)


def test_a_doubtful_level_is_a_warning_among_the_notes(parts, found):
    assert not any(note.startswith("warning: ") for note in found.notes)
    case, stop, history, targets, *rest = parts[0]
    doubtful = Targets(targets, Levels("none", offset_db=1.4, offset_error_db=0.2, references=("rest",)))
    notes = conclude(case, stop, history, doubtful, *rest).notes
    assert [note for note in notes if note.startswith("warning: ")] == doubtful.level_warnings()
    assert doubtful.level_warnings()[0].startswith(
        "warning: the measured image is taken at its own level, but the meas"
    )


def test_a_level_that_the_budget_does_not_cover_leaves_nothing_known(parts):
    """Offset and posterior of a measured image 2.93 dB above the run of right fixed laws."""
    case, stop, history, targets, *rest = parts[0]
    high = Levels("none", offset_db=2.93, offset_error_db=0.12, references=("wood", "water"))
    known = {"area": posterior(known_between_deg=(20.0, 40.0), known_half_width_db=0.8)}
    found = conclude(case, stop, history, Targets(targets, high), *rest, posteriors=known)
    assert found.posteriors["area"].known_between_deg is None
    assert found.checks["area"].identified is False
    why = (
        "the measured image lies +2.93 +- 0.12 dB from the reference run on wood, water: set target.normalisation: "
        "offset, or mend level or laws"
    )
    assert found.verdicts["area"].endswith(f", but sigma0 is called known at no angle: {why}.")
    assert f"area: sigma0 is called known nowhere over the incidence seen: {why}." in found.checks["area"].sentences
    # the law may be used all the same: a level is common to all fields
    before = conclude(*parts[0], posteriors=known)
    assert before.posteriors["area"].known_between_deg == (20.0, 40.0)
    assert found.checks["area"].recommended_why == before.checks["area"].recommended_why


@pytest.mark.parametrize(
    ("levels", "level_db", "contradicted"),
    [
        (Levels("none", 2.93, 0.12, references=("a",)), 0.33, True),
        (Levels("none", 2.93, 0.12, references=("a",)), 2.0, False),  # in the budget
        (Levels("none", -0.56, 0.1, references=("a",)), 0.33, True),
        (Levels("none", -0.53, 0.1, references=("a",)), 0.33, False),
        (Levels("none", 0.42, 0.19, references=("a",)), 0.0, False),  # not doubtful: the default case
        (Levels("none", -12.8, 4.4, references=("a", "b")), 0.33, False),  # the fixed laws contradict each other
        (Levels("offset", 2.93, 0.12, references=("a",)), 0.33, False),
        (Levels(), 0.33, False),
    ],
)
def test_a_level_is_contradicted_beyond_doubt_and_budget(levels, level_db, contradicted):
    config = Uncertainty(level_db=level_db)
    assert bool(level_contradicted(config, [levels])) is contradicted
    assert (
        level_contradicted(config, [Levels(), levels]).startswith("the measured image of pass 2 lies") is contradicted
    )


def test_a_program_of_another_law_leaves_nothing_known(parts, monkeypatch):
    """Also of a law that does not fit, whose verdict says it beside the misfit."""
    case, *rest = parts[0]
    why = "the program's backscatter differs from law mangia"
    asked = []
    monkeypatch.setattr(conclusion, "another_law", lambda *given: asked.append(given[:2]) or why)
    known = {"area": posterior(known_between_deg=(20.0, 40.0), known_half_width_db=0.8)}
    assert conclude(case, *rest, posteriors=known).posteriors["area"].known_between_deg == (20.0, 40.0)
    assert not asked
    program = case.model_copy(update={"simulator": case.simulator.model_copy(update={"kind": "command"})})
    found = conclude(program, *rest, posteriors=known)
    assert asked == [("area", "mangia")]
    assert found.posteriors["area"].known_between_deg is None
    assert found.verdicts["area"].endswith(f", but sigma0 is called known at no angle: {why}.")
    assert (found.checks["area"].recommended, found.checks["area"].recommended_why) == ("constant", why)
    wrong = FitTest(False, 90.0, 20.0, 0.001, 30.0, 2.0, 1.0, 0.0, 2.0, 2.0, "", (), 1.0)
    monkeypatch.setattr(conclusion, "check_fit", lambda *_: wrong)
    misfit = conclude(program, *rest, posteriors=known)
    assert misfit.verdicts["area"].startswith("area: does not fit: ")
    assert misfit.verdicts["area"].endswith(f"; {why}.")
    assert misfit.checks["area"].recommended_why == "the law does not fit"


def test_the_distance_is_the_rms_over_that_of_sampling(found):
    assert found.fits["area"].distance == pytest.approx(0.01 / 0.004)
    assert "its rms is 2.5 times the sampling error" in found.verdicts["area"]


def test_a_registration_in_doubt_is_said_in_the_verdict(parts, found, monkeypatch):
    """The image of the final run with fresh random numbers is the one that is registered onto."""
    *arguments, final = parts[0]
    asked = []

    def check(laws, targets, seen, registered, image):
        asked.append((list(laws), registered, image))
        return {"area": Moved(*moves)}

    monkeypatch.setattr(conclusion, "check_registration", check)
    for moves, doubtful in (((0.8, 0.3, 1.4, 0.7), True), ((0.2, 0.3, 0.4, 0.7), False)):
        said = conclude(*arguments, final, registered="registered")
        assert ("the registration is in doubt" in said.verdicts["area"]) is doubtful
        assert f"area {moves[0]:.2f} (stated error 0.30" in said.notes[-1]
    assert asked[0] == (["area"], "registered", final[1].image_db)
    assert said.notes[-1].startswith("Check of the registration")
    assert not any("Check of the registration" in note for note in found.notes)


@pytest.mark.parametrize(("fits", "known"), [(True, (20.0, 40.0)), (None, (20.0, 40.0)), (False, None)])
def test_a_law_that_does_not_fit_is_known_nowhere(fits, known):
    """One that cannot be tested keeps what is known of it."""
    before = posterior(known_between_deg=(20.0, 40.0), known_half_width_db=0.8)
    test = FitTest(fits, 20.0, 20.0, 0.5, 30.0, 0.1, 1.0, 0.0, 2.0, 2.0, "", (), 1.0)
    withheld = not_to_be_used(test)
    assert withheld == ("the law does not fit" if fits is False else "")
    after = _unknown(before) if withheld else before
    assert after.known_between_deg == known
    assert (after.known_half_width_db is None) is (known is None)

    def known_of(one, levels=None, level_only=False, further=()):
        targets = SimpleNamespace(levels=levels or Levels(), level_only=lambda _: level_only, further=further)
        return _known(one, targets, Uncertainty(), "area")

    said = known_of(after)
    assert said is not None
    assert (said.between_deg, said.linear) == (known, False)
    assert (said.levels, said.level_error_db) == ((), pytest.approx(1.645 * 0.33, rel=1e-3))
    assert known_of(replace(after, sampled=False)).linear
    assert known_of(replace(after, curve=None)) is None
    removed = known_of(after, Levels("offset", 0.4, 0.7), level_only=True)
    assert (removed.level_key, removed.level_error_db) == ("the removed offset", pytest.approx(1.645 * 0.7, rel=1e-3))
    assert removed.levels == after.levels()
    assert known_of(after, further=("pass 2",)).level_error_db == 0.0
    # a density that is not matched tells nothing of the law
    nan = float("nan")
    assert not_to_be_used(replace(test, fits=None, residual_sum=nan, distance=3.5)) == "the density is not matched"
