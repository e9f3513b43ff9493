"""Laws of a calibration on another image: the interval of each bin, and what is said of it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import polygamma

from radcal.assessment.preposterior import View
from radcal.config import RegistrationConfig, TargetConfig, Uncertainty, case_from, load_forward
from radcal.config.loading import load_measured
from radcal.errors import ConfigError, StoreError
from radcal.figures.applied_figures import Prediction
from radcal.ground.bins import class_of, incidence_edges
from radcal.image.model import Measurement
from radcal.laws import LAWS, law_for
from radcal.posterior.result import WHOLE_DEG, Constant, KeptDraws, Predicted
from radcal.products import applied
from radcal.products.applied import (
    PredictionBins,
    _conclusion,
    _few_pixels,
    _is_level_known,
    _of_pass,
    _table,
    apply,
    by_constant_db,
    members_of,
    predictions,
    predictive_db,
    with_laws,
)
from radcal.registration.registered import Registered, registered_as

LAW = law_for("tabulated", angles_deg=(20.0, 60.0))
X = [-6.0, -16.0]
QUANTILE = 1.6449
LOOKS = 4.0


def bins_of(pixels=400, noise_db=-300.0):
    """Two bins about 30 and 50 degrees, in one field, each of one cell and with as many independent pixels."""
    middles = np.array([30.0, 50.0])
    cell, count, noise = np.repeat([0, 1], pixels), np.full(2, float(pixels)), np.full(2, noise_db)
    parts = View(np.arange(2 * pixels), middles[cell], cell, np.array([1, 1]), middles, count, noise)
    return PredictionBins(np.array([30.0, 40.0, 50.0]), parts, np.eye(2))


def divided(bins, shares, patch):
    """Bins of which each consists of parts of cells with these shares of its pixels, in these fields."""
    n, one = len(shares), bins.parts
    parts = replace(
        one,
        cell=np.repeat(np.arange(2 * n), np.rint(shares * np.tile(one.pixels.size // 2, n)).astype(int).tolist() * 2),
        patch=np.tile(patch, 2),
        middle_deg=np.repeat(one.middle_deg, n),
        independent=np.outer(one.independent, shares).ravel(),
        noise_db=np.repeat(one.noise_db, n),
    )
    return replace(bins, parts=parts, weights=np.kron(np.eye(2), shares))


def drawn(level_sd=0.0, slope_sd=0.0, field=0.0, cell=0.0):
    """Posterior in which the law has an uncertain level, and its form error an uncertain slope about 30 degrees."""
    rng = np.random.default_rng(3)
    a, b = rng.normal(0.0, level_sd, (4000, 1)), rng.normal(0.0, slope_sd, (4000, 1))
    every = np.ones(4000)
    draws = KeptDraws(X + a, field * every, cell * every, b * (WHOLE_DEG - 30.0), 0.0 * every)
    return SimpleNamespace(draws=draws, looks=LOOKS, known_between_deg=(25.0, 35.0), seen_deg=np.array([[22.0, 52.0]]))


def by_law(draws):
    return Predicted(draws.mean(axis=0), *np.quantile(draws, [0.05, 0.95], axis=0))


def predicted(posterior, seen, **config):
    """Predictions by the law of an image simulated at X and 1.5 dB brighter, of which 0.4 dB less are measured."""
    image = LAW(np.radians(seen.parts.incidence_deg), X) + 1.5
    uncertainty = Uncertainty(**{"level_db": 0.0, "noise_db": 0.0, **config})
    moved = by_law(predictive_db(posterior, LAW, X, seen, uncertainty, np.random.default_rng(5)))
    return list(predictions("dyke", posterior, seen, image, moved, image - 0.4))


def half(one):
    return 0.5 * (one.p95_db - one.p05_db)


def test_the_interval_is_that_of_law_form_speckle_level_noise_and_fields():
    many = bins_of(1000)
    # of measured and simulated pixels: (10 / ln 10)^2 trigamma(looks n)
    rest = 2.0 * 18.861170 * float(polygamma(1, LOOKS * 1000.0))

    def has(variance, one):
        assert half(one) == pytest.approx(QUANTILE * np.sqrt(variance + rest), rel=0.05)

    has(0.0, predicted(drawn(), many)[0])
    law = predicted(drawn(level_sd=0.5, slope_sd=0.05), many)
    has(0.25, law[0])
    has(0.25 + 1.0, law[1])  # 20 degrees further
    has(0.49, predicted(drawn(), many, level_db=0.7)[1])
    has(0.36, predicted(drawn(field=0.6), many)[0])
    has(0.36, predicted(drawn(cell=0.6), many)[0])
    # a bin of three parts in two fields
    three = divided(many, [0.5, 0.3, 0.2], [4, 7, 4])
    has(0.36 * (0.7**2 + 0.3**2), predicted(drawn(field=0.6), three)[0])
    has(0.36 * (0.5**2 + 0.3**2 + 0.2**2), predicted(drawn(cell=0.6), three)[0])
    has(0.49, predicted(drawn(), three, level_db=0.7)[1])
    # noise as strong as the signal is half of the power
    loud = replace(many, parts=replace(many.parts, noise_db=np.full(2, float(LAW(np.radians(30.0), X)))))
    has(1.0, predicted(drawn(), loud, noise_db=2.0)[0])


def test_the_interval_of_the_constant_is_that_of_its_mean_fields_cells_speckle_level_and_noise():
    """In noise as strong as the constant, its level is raised by 3 dB, and an error of the noise counts by half.

    The cells of a bin differ from a constant alike, those of different fields do not.
    """
    constant, exact = Constant(-12.0, 0.09, 0.6, 0.3), Uncertainty(level_db=0.0, noise_db=0.0)
    clear = bins_of(1000)
    law = np.asarray(LAW(np.radians([30.0, 50.0]), X))
    rest = 2.0 * 18.861170 * float(polygamma(1, LOOKS * 1000.0))
    level, sd = by_constant_db(constant, LOOKS, LAW, X, clear, exact)
    assert level == pytest.approx(-12.0 - law)
    assert sd**2 == pytest.approx(np.full(2, 0.09 + 0.36 + 0.09 + rest), rel=0.02)
    three = divided(clear, [0.5, 0.3, 0.2], [4, 7, 4])
    _, sd = by_constant_db(constant, LOOKS, LAW, X, three, exact)
    assert sd**2 == pytest.approx(np.full(2, 0.09 + 0.36 * 0.58 + 0.09 + rest), rel=0.01)
    noisy = replace(clear, parts=replace(clear.parts, noise_db=np.full(2, -12.0)))
    level, sd = by_constant_db(constant, LOOKS, LAW, X, noisy, Uncertainty(level_db=0.4, noise_db=2.0))
    raised = 10.0 * np.log10(10.0 ** (law / 10.0) + 10.0**-1.2)
    assert level == pytest.approx(-12.0 + 10.0 * np.log10(2.0) - raised)
    assert sd**2 == pytest.approx(np.full(2, 0.09 + 0.36 + 0.09 + 0.16 + 1.0 + rest), rel=0.02)


def test_law_and_constant_count_alike(monkeypatch):
    """A material without a constant, of a law without a curve, is not predicted."""
    seen, x = bins_of(1000), np.array([30.0, 50.0])
    law = np.asarray(LAW(np.radians(x), X))
    posterior = drawn(level_sd=0.5)
    posterior.constant = Constant(-12.0, 0.01, 0.2, 0.1)
    monkeypatch.setattr(applied, "view_of", lambda *_: seen.parts)
    monkeypatch.setattr(PredictionBins, "of", lambda _: seen)
    image = np.asarray(LAW(np.radians(seen.parts.incidence_deg), X)).astype(np.float32)
    materials = {"dyke": posterior, "program": SimpleNamespace(constant=None), "other": posterior}
    configured = SimpleNamespace(target=TargetConfig(), uncertainty=Uncertainty(level_db=0.3, noise_db=0.0))
    results = {k: SimpleNamespace(posterior=one, level_only=False) for k, one in materials.items()}
    archive = SimpleNamespace(materials=results, configured=configured)
    known = SimpleNamespace(start_parameters=X)
    changed = SimpleNamespace(
        passes=[SimpleNamespace(radar=None, laws={"dyke": LAW})],
        materials={"dyke": known, "program": known},
        seed=3,
    )
    found = list(_of_pass(archive, changed, 1, SimpleNamespace(geometry=None, image_db=image), None))
    assert [one.material for one in found] == ["dyke", "dyke"]
    assert [one.predicted_db for one in found] == pytest.approx(0.5 * (law - 12.0), abs=0.03)
    sds = np.sqrt(0.5**2 + 0.3**2) + np.sqrt(0.01 + 0.04 + 0.01 + 0.3**2)
    assert [half(one) for one in found] == pytest.approx([0.5 * QUANTILE * sds] * 2, rel=0.05)
    assert list(_few_pixels(archive, ["dyke", "program"], {"other"})) == [
        "dyke: not predicted, because no pass has 50 usable pixels of it."
    ]


def test_cells_are_divided_at_the_edges_of_the_bins():
    """Three cells of 400 pixels each, of which the middle one reaches over three bins."""
    angle = np.concatenate([np.linspace(20.0, 24.0, 400), np.linspace(23.0, 29.0, 400), np.linspace(29.5, 33.0, 400)])
    cell, patch = np.repeat([0, 1, 2], 400), np.array([5, 8, 5])
    middle, noise = np.bincount(cell, angle) / 400.0, np.array([-20.0, -21.0, -23.0])
    bins = PredictionBins.of(View(np.arange(1200), angle, cell, patch, middle, np.array([200.0, 100.0, 50.0]), noise))
    assert bins.edges_deg.tolist() == incidence_edges(angle, "auto").tolist()
    member = class_of(angle, bins.edges_deg)
    pairs = np.unique(np.stack([cell, member]), axis=1)
    assert len(bins.edges_deg) - 1 == 6
    assert pairs.shape[1] == bins.parts.patch.size == 8
    for k, (of, bin_) in enumerate(pairs.T):
        own = (cell == of) & (member == bin_)
        assert (bins.parts.cell[own] == k).all()
        assert bins.parts.middle_deg[k] == pytest.approx(angle[own].mean())
        assert (bins.parts.patch[k], bins.parts.noise_db[k]) == (patch[of], noise[of])
        assert bins.parts.independent[k] == pytest.approx([0.5, 0.25, 0.125][of] * own.sum())
        assert bins.weights[:, k] == pytest.approx(
            np.where(np.arange(6) == bin_, own.sum() / (member == bin_).sum(), 0)
        )


def test_the_level_of_a_bin_is_the_mean_power_of_its_parts_averaged_in_db():
    seen = bins_of(3)
    # two parts of cells in the first bin, of two pixels and one
    seen = replace(seen, parts=replace(seen.parts, cell=np.array([0, 0, 1, 2, 3, 3])))
    image = 10.0 * np.log10([2.0, 6.0, 1.0, 9.0, 3.0, np.nan])
    assert seen.levels_db(image) == pytest.approx([10.0 * np.log10(4.0) * 2.0 / 3.0, 5.0 * np.log10(27.0)])
    none = seen.levels_db(np.where(np.arange(6) < 3, np.nan, image))
    assert np.isnan(none[0])
    assert none[1] == pytest.approx(5.0 * np.log10(27.0))


def test_angles_are_called_what_they_are():
    first, second = predicted(drawn(), bins_of())
    assert (first.known, second.known) == ("known", "not known")
    posterior = drawn()
    posterior.seen_deg = np.array([[22.0, 45.0]])
    assert [one.known for one in predicted(posterior, bins_of())] == ["known", "not seen"]
    for ends in ((30.0, 35.0), (25.0, 30.0)):
        posterior.known_between_deg = ends
        assert predicted(posterior, bins_of())[0].known == "known"
    posterior.known_between_deg = None
    assert [one.known for one in predicted(posterior, bins_of())] == ["not known", "not seen"]


def one(known, measured):
    return 1, Prediction("dyke", (20.0, 24.5), 22.0, 310, known, -7.0, -8.25, -6.5, measured)


def test_table_and_conclusion_say_only_what_was_shown():
    rows = [one("known", -8.0), one("known", -8.5), one("not seen", -6.9), one("not known", float("nan"))]
    lines = list(_table(rows, several=False))
    assert lines[1].split("  ")[0] == "dyke"
    assert "20.0-24.5 deg" in lines[1]
    assert "-7.00 (-8.25 to -6.50) dB  -8.00 dB  yes" in lines[1]
    assert lines[2].endswith("-8.50 dB  no")
    assert lines[4].endswith("-         -")
    assert list(_table(rows, several=True))[1].startswith("1     dyke")
    said = list(_conclusion(rows))
    assert said[0] == "dyke: 1 of 2 bins lie inside of their 90 % interval where sigma0 is determined."
    assert len(said) == 2
    assert said[1].startswith(
        "dyke: 1 of 1 bin lies inside of its 90 % interval at angles that the calibration has not"
    )


def archive_of(**dyke):
    """Archive of two calibrated materials, of which the dyke has effective looks."""
    values = {"parameters_model": None, "seen_deg": np.array([[38.9, 39.1]])}
    posterior = SimpleNamespace(**{**values, **dyke.pop("posterior", {})})
    result = {"posterior": posterior, "level_only": False, "looks": np.array([4.0, 2.5]), "best": 1, **dyke}
    other = SimpleNamespace(posterior=posterior, level_only=False, looks=np.array([4.0]), best=0)
    laws = {name: np.array([6.0, 14.0, 21.0, 3.0]) for name in ("dyke", "stem beans")}
    materials = {"dyke": SimpleNamespace(**result), "stem beans": other}
    case = case_from({"case": "small", "materials": {name: {"calibrate": True} for name in laws}})
    return SimpleNamespace(configured=case, laws=laws, materials=materials)


def written(folder, materials, **overrides):
    """File of another case, and the case."""
    path = folder / "other.yaml"
    path.write_text(f"case: other\nmaterials: {{{materials}}}\n")
    return path, load_forward([path], overrides)


def test_calibrated_materials_replace_those_of_the_other_case(tmp_path):
    path, other = written(tmp_path, "dyke: {parameters: [1, 2, 3, 4]}, lake: {parameters: [4, 3, 2, 1]}")
    changed = with_laws(archive_of(), other)
    assert list(changed.materials) == ["dyke", "lake"]
    assert changed.materials["dyke"].parameters == [6.0, 14.0, 21.0, 3.0]
    assert changed.materials["dyke"].looks == 2.5
    assert changed.materials["lake"] == other.materials["lake"]
    # the law nearest to the band's median, if there is a band
    nearest = archive_of(posterior={"parameters_model": np.array([5.0, 13.0, 20.0, 2.0])})
    assert with_laws(nearest, other).materials["dyke"].parameters == [5.0, 13.0, 20.0, 2.0]
    path, other = written(tmp_path, "lake: {parameters: [4, 3, 2, 1]}")
    with pytest.raises(ConfigError, match="calibrated dyke, stem beans, of which other has no material: it has lake"):
        with_laws(archive_of(), other)
    assert load_measured([path]) is None
    with pytest.raises(StoreError, match=r"the calibration is not finished, expected calibration.h5"):
        apply(tmp_path, other, None, tmp_path / "out", tmp_path / "runs")


def test_members_have_the_levels_of_the_draws(tmp_path):
    """Each has a draw of law and error of its form, raised to mean power by the spreads of fields and cells."""
    _, other = written(tmp_path, "dyke: {parameters: [1, 2, 3, 4]}, lake: {parameters: [4, 3, 2, 1]}")
    rng = np.random.default_rng(3)
    x = np.array([-20.0, 8.0, 12.0, 4.0]) + rng.normal(0.0, 2.0, (60, 4))
    form, field, cell = rng.normal(0.0, 0.5, (60, 91)), rng.uniform(0.5, 2.0, 60), rng.uniform(0.5, 2.0, 60)
    archive = archive_of(posterior={"draws": KeptDraws(x, field, cell, form, np.zeros(60)), "curve": ()})
    found = members_of(archive, other, 60)
    curves = np.array([one.laws["dyke"](np.radians(WHOLE_DEG), one.start_parameters["dyke"]) for one in found])
    right = np.array([LAWS["mangia"](np.radians(WHOLE_DEG), each) for each in x]) + form
    more = (np.log(10.0) / 20.0 * (field**2 + cell**2))[:, None]
    order = np.argsort(curves[:, 40])
    np.testing.assert_allclose(curves[order], (right + more)[np.argsort((right + more)[:, 40])], atol=1e-9)
    assert not np.array_equal(order, np.argsort((right + more)[:, 40]))
    assert found[0].materials["dyke"].looks == 2.5
    assert found[0].materials["lake"] == other.materials["lake"]
    assert members_of(archive, other, 2)[1].materials == found[1].materials
    with pytest.raises(ConfigError, match="--draws is 61, expected at most 60, the draws of sigma0 of dyke in small"):
        members_of(archive, other, 61)
    with pytest.raises(ConfigError, match="expected at most 0"):
        members_of(archive_of(posterior={"draws": None}), other, 1)


def test_members_of_a_law_that_depends_on_the_pass_need_its_pass(tmp_path):
    draws = KeptDraws(np.ones((9, 4)), np.ones(9), np.ones(9), np.ones((9, 91)), np.ones(9))
    found = archive_of(posterior={"draws": draws, "curve": ()})
    oh = {"calibrate": True, "law": "oh1992"}
    hidden = {"synthetic": {"parameters": {"dyke": [9.0, 1.5, 1.0]}}}
    sections = {"radar": {"frequency_ghz": 9.6}, "materials": {"dyke": oh}, "measurement": hidden}
    found.configured = case_from({"case": "small", **sections})
    found.laws["dyke"] = np.array([9.0, 1.5, 1.0])
    radar = {"polarisation": "VV", "frequency_ghz": 9.6}
    _, other = written(tmp_path, "dyke: {parameters: [1, 2, 3, 4]}", radar=radar)
    with pytest.raises(ConfigError, match=r"radar.polarisation: --draws has laws of dyke at HH of small alone"):
        members_of(found, other, 2)


@pytest.mark.parametrize("config", ["no JSON", '{"materials": {"dyke": {"law": "none"}}}'])
def test_other_contents_under_a_right_checksum_are_one_sentence(made, tmp_path, config):
    replace(made.archive, config=config).write(tmp_path / "calibration.h5")
    _, other = written(tmp_path, "dyke: {parameters: [1, 2, 3, 4]}")
    with pytest.raises(StoreError, match=r"calibration\.h5: holds other contents than radcal writes"):
        apply(tmp_path, other, None, tmp_path / "out", tmp_path / "runs")


def test_an_image_lies_where_its_own_case_has_registered_it(tmp_path):
    image = np.random.default_rng(2).normal(-12.0, 2.0, (30, 40)).astype(np.float32)
    image[3, 5] = np.nan
    moved, zero = np.roll(image, 1, axis=0), np.zeros((2, 30, 40), np.float32)
    verdict = "registered with gefolki."
    own = Registered(Measurement(moved, "a.tif"), image, zero + 1, zero[0] + 0.5, 0.0, "gefolki", True, verdict)
    path = tmp_path / "registered.h5"
    own.write(path)
    found, by = registered_as(path, image, Measurement(image, "a.tif"), RegistrationConfig())
    assert np.array_equal(found.measurement.image_db, moved, equal_nan=True)
    assert (found.verdict, by) == (verdict, f"as in {tmp_path}")
    # another image, another method, and no results of the other case
    none = RegistrationConfig(method="none")
    (tmp_path / "broken.h5").write_bytes(b"not HDF5")
    other = tmp_path / "other.h5"
    replace(own, method="none").write(other)
    gone, broken = tmp_path / "gone.h5", tmp_path / "broken.h5"
    for place, values in ((path, image), (gone, image), (broken, image), (other, image + 1.0)):
        found, by = registered_as(place, image, Measurement(values, "a.tif"), none)
        assert np.array_equal(found.measurement.image_db, values, equal_nan=True)
        assert (found.applied, by) == (False, "onto the predicted image")


def test_a_level_is_predicted_where_it_is_known_alone():
    archive = archive_of(level_only=True)
    angles = (37.5, 40.0, 45.0)
    assert [_is_level_known(archive.materials["dyke"], angle) for angle in angles] == [False, True, False]
    assert all(_is_level_known(archive_of(level_only=False).materials["dyke"], angle) for angle in angles)
    archive.materials["dyke"].posterior.constant = Constant(-12.0, 0.01, 0.2, 0.1)
    (text,) = _few_pixels(archive, ["dyke"], set())
    assert text.endswith("no pass has 50 usable pixels of it within 1 degree of the one incidence of the calibration.")
