"""Laws of a calibration on another image: the interval of each bin, and what is said of it."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from archives import changed_material
from archives import posterior as calibrated_posterior

from radcal.assessment.curves import GRID_DEG
from radcal.assessment.posterior import KeptDraws
from radcal.assessment.preposterior import Sight
from radcal.config import RegistrationConfig, load_forward, load_measured
from radcal.errors import ConfigError, StoreError
from radcal.measurement.model import Measurement
from radcal.measurement.registration import Registered, registered_as, write_registered
from radcal.radar.laws import LAWS, law_for
from radcal.radar.texture import log_speckle_cumulants
from radcal.report import drawing
from radcal.report.applied import _conclusion, _table, _unfit, apply, predictions, where_seen, with_laws
from radcal.report.applied_figures import Prediction, draw_predictions
from radcal.report.archive import write_archive

LAW = law_for("tabulated", angles_deg=(20.0, 60.0))
X = np.array([-6.0, -16.0])
QUANTILE = 1.6449


def sight(pixels: int = 400, noise_db: float = -300.0) -> Sight:
    """Two bins about 30 and 50 degrees, in one field, each with as many independent pixels."""
    angles = np.repeat([30.0, 50.0], pixels)
    weights = np.zeros((2, GRID_DEG.size))
    weights[[0, 1], [120, 200]] = 1.0
    one, count = np.ones((2, 2)), np.full(2, float(pixels))
    edges = np.array([30.0, 40.0, 50.0])
    return Sight(np.arange(angles.size), angles, edges, weights, one, np.eye(2), count, np.full(2, noise_db))


def drawn(level_sd: float = 0.0, slope_sd: float = 0.0, fields: tuple[float, float] = (0.0, 0.0)) -> SimpleNamespace:
    rng = np.random.default_rng(3)
    a, b = rng.normal(0.0, level_sd, 4000), rng.normal(0.0, slope_sd, 4000)
    x = X + np.stack([a - 10.0 * b, a + 30.0 * b], axis=1)  # the slope turns about 30 degrees
    draws = KeptDraws(x, np.full(4000, 4.0), np.tile(fields, (4000, 1)))
    return SimpleNamespace(draws=draws, known_between_deg=(25.0, 35.0), seen_deg=np.array([[22.0, 52.0]]))


def found(posterior: SimpleNamespace, seen: Sight, level_db: float = 0.0, **more: float) -> list[Prediction]:
    image = LAW(np.radians(seen.incidence_deg), X) + more.pop("off_db", 0.0)
    measured = image - 0.4
    return predictions("dyke", posterior, LAW, X, seen, image, level_db, more.pop("looks", 4.0), 5, measured)


def half(one: Prediction) -> float:
    return 0.5 * (one.p95_db - one.p05_db)


def test_the_interval_is_that_of_law_speckle_level_and_fields() -> None:
    many = sight(10**6 // 1000)
    speckle = float(log_speckle_cumulants(4.0)[1])
    alone = found(drawn(), many)
    # of measured and simulated pixels
    assert half(alone[0]) == pytest.approx(QUANTILE * np.sqrt(2.0 * speckle / 1000.0), rel=0.05)
    law = found(drawn(level_sd=0.5, slope_sd=0.05), many)
    rest = 2.0 * speckle / 1000.0
    assert half(law[0]) == pytest.approx(QUANTILE * np.sqrt(0.25 + rest), rel=0.05)
    assert half(law[1]) == pytest.approx(QUANTILE * np.sqrt(0.25 + 1.0 + rest), rel=0.05)  # 20 degrees further
    assert half(found(drawn(), many, level_db=0.7)[1]) == pytest.approx(QUANTILE * np.sqrt(0.49 + rest), rel=0.05)
    for fields in ((0.6, 0.0), (0.0, 0.6)):
        assert half(found(drawn(fields=fields), many)[0]) == pytest.approx(QUANTILE * np.sqrt(0.36 + rest), rel=0.05)
    # a bin of four fields, and of two blocks
    several = replace(many, patches=0.25 * many.patches, cells=0.5 * many.cells)
    for fields, variance in (((0.6, 0.0), 0.36 / 4.0), ((0.0, 0.6), 0.36 / 2.0)):
        expected = QUANTILE * np.sqrt(variance + rest)
        assert half(found(drawn(fields=fields), several)[0]) == pytest.approx(expected, rel=0.05)


def test_the_middle_is_the_image_moved_to_the_looks_of_the_draws() -> None:
    first, second = found(drawn(), sight(), off_db=1.5)
    assert first.predicted_db == pytest.approx(float(LAW(np.radians(30.0), X)) + 1.5, abs=0.02)
    assert (first.measured_db, first.pixels) == (pytest.approx(float(LAW(np.radians(30.0), X)) + 1.1), 400)
    assert second.incidence_deg == 50.0
    # an image of 2 looks has a lower mean in dB than the draws' 4
    more = float(log_speckle_cumulants(4.0)[0] - log_speckle_cumulants(2.0)[0])
    assert more > 0.4
    assert found(drawn(), sight(), looks=2.0)[0].predicted_db - first.predicted_db == pytest.approx(
        more - 1.5, abs=0.03
    )


def test_ground_in_the_noise_moves_less_with_its_law() -> None:
    clear, noisy = (found(drawn(level_sd=0.4), sight(10**4, noise))[0] for noise in (-300.0, -8.5))
    # signal and noise have the same level at 30 degrees
    assert half(noisy) == pytest.approx(0.5 * half(clear), rel=0.1)


def test_angles_are_called_what_they_are() -> None:
    first, second = found(drawn(), sight())
    assert (first.known, second.known) == ("known", "not known")
    posterior = drawn()
    posterior.seen_deg = np.array([[22.0, 45.0]])
    assert [one.known for one in found(posterior, sight())] == ["known", "not seen"]
    for ends in ((30.0, 35.0), (25.0, 30.0)):
        posterior.known_between_deg = ends
        assert found(posterior, sight())[0].known == "known"
    posterior.known_between_deg = None
    assert [one.known for one in found(posterior, sight())] == ["not known", "not seen"]


def one(known: str, measured: float) -> tuple[int, Prediction]:
    return 1, Prediction("dyke", (20.0, 24.5), 22.0, 310, known, -7.0, -8.25, -6.5, measured)


def test_table_and_conclusion_say_only_what_was_shown() -> None:
    rows = [one("known", -8.0), one("known", -8.5), one("not seen", -6.9), one("not known", float("nan"))]
    lines = list(_table(rows, several=False))
    assert lines[1].split("  ")[0] == "dyke"
    assert "20.0-24.5 deg" in lines[1]
    assert "-7.00 (-8.25 to -6.50) dB  -8.00 dB  yes" in lines[1]
    assert lines[2].endswith("-8.50 dB  no")
    assert lines[4].endswith("-         -")
    assert list(_table(rows, several=True))[1].startswith("1     dyke")
    said = list(_conclusion(rows))
    assert said[0] == "dyke: 1 of 2 bins lie inside of their 90 % interval where sigma0 is known."
    assert said[1].startswith("dyke: 1 bin is predicted at angles that the calibration has seen, where sigma0 is not")
    assert said[2].startswith(
        "dyke: 1 of 1 bin lies inside of its 90 % interval at angles that the calibration has not"
    )


def test_a_law_that_does_not_fit_is_told(made) -> None:
    assert _unfit(made.archive, [one("known", -8.0)]) == []
    fitted = replace(made.archive.materials["dyke"].fitted, fits=False, verdict="dyke: does not fit: a cause.")
    archive = changed_material(made.archive, "dyke", fitted=fitted)
    assert _unfit(archive, [one("known", -8.0)] * 2) == [
        "dyke: does not fit: a cause. Its intervals do not contain the error of a wrong law."
    ]


def test_bins_of_different_knowledge_have_markers_of_their_own(tmp_path, monkeypatch) -> None:
    legends = []
    monkeypatch.setattr(drawing, "add_legend", lambda canvas, entries, columns: legends.append(entries))
    rows = [row for known in ("known", "not known", "not seen") for _, row in (one(known, -8.0),)]
    draw_predictions(tmp_path / "a.png", rows, "a", "b")
    ((handles, labels),) = legends
    markers = {
        label.rpartition(": ")[2]: handle.lines[0].get_marker()
        for handle, label in zip(handles, labels, strict=True)
        if label.startswith("law of a")
    }
    assert list(markers) == ["known", "not known", "not seen"]
    assert len(set(markers.values())) == 3
    assert not {".", "None"} & set(markers.values())


def test_the_legend_names_only_knowledge_that_some_material_has(tmp_path, monkeypatch) -> None:
    legends = []
    monkeypatch.setattr(drawing, "add_legend", lambda canvas, entries, columns: legends.append(entries))
    first, second = one("known", -8.0)[1], replace(one("not seen", -6.9)[1], material="of the second panel")
    draw_predictions(tmp_path / "a.png", [first, second], "a", "b")
    ((_, labels),) = legends
    laws = [label.rpartition(": ")[2] for label in labels if label.startswith("law of a")]
    assert laws == ["known", "not seen"], "the legend is that of the first panel, and serves all panels"


def test_figure(tmp_path) -> None:
    draw_predictions(tmp_path / "a.png", [row for _, row in (one("known", -8.0), one("not seen", -6.9))], "a", "b")
    assert (tmp_path / "a.png").read_bytes()[:4] == b"\x89PNG"


def test_calibrated_materials_replace_those_of_the_other_case(made, tmp_path) -> None:
    path = tmp_path / "other.yaml"
    path.write_text("case: other\nmaterials: {dyke: {parameters: [1, 2, 3, 4]}, lake: {parameters: [4, 3, 2, 1]}}\n")
    other, source = load_forward([path]), made.case.sections("materials")["materials"]
    changed = with_laws(made.archive, source, other)
    assert list(changed.materials) == ["dyke", "lake"]
    assert changed.materials["dyke"].parameters == made.archive.laws["dyke"].values.tolist()
    assert changed.materials["lake"] == other.materials["lake"]
    path.write_text("case: other\nmaterials: {lake: {parameters: [4, 3, 2, 1]}}\n")
    with pytest.raises(ConfigError, match="calibrated dyke, stem beans, of which other has no material: it has lake"):
        with_laws(made.archive, source, load_forward([path]))
    assert load_measured([path]) is None
    with pytest.raises(StoreError, match=r"the calibration is not finished, expected calibration.h5"):
        apply(tmp_path, load_forward([path]), None, tmp_path / "out", tmp_path / "runs")


@pytest.mark.parametrize("config", ["no JSON", "[1]", "{}", '{"materials": {"dyke": {"law": "none"}}}'])
def test_other_contents_under_a_right_checksum_are_one_sentence(made, tmp_path, config) -> None:
    write_archive(tmp_path / "calibration.h5", replace(made.archive, config=config))
    other = tmp_path / "other.yaml"
    other.write_text("case: other\nmaterials: {dyke: {parameters: [1, 2, 3, 4]}}\n")
    with pytest.raises(StoreError, match=r"calibration\.h5: holds other contents than radcal writes"):
        apply(tmp_path, load_forward([other]), None, tmp_path / "out", tmp_path / "runs")


def test_the_law_at_each_angle_is_taken_over_the_bin() -> None:
    """A bin of two angles moves by the mean of the law's changes at both."""
    seen = sight()
    weights = seen.weights.copy()
    weights[0] = 0.0
    weights[0, [100, 140]] = 0.5
    posterior = drawn()
    mangia, x = LAWS["mangia"], np.array([-20.0, 8.0, 12.0, 4.0])
    moved = np.tile(x + [0.0, 0.0, 0.0, 1.5], (4000, 1))
    posterior.draws = replace(posterior.draws, parameters=moved)
    image = np.full(800, -5.0)
    found = predictions("dyke", posterior, mangia, x, replace(seen, weights=weights), image, 0.0, 4.0, 5)
    phi = np.radians(GRID_DEG[[100, 140]])
    expected = float(np.mean(mangia(phi, moved[0]) - mangia(phi, x)))
    assert found[0].predicted_db == pytest.approx(-5.0 + expected, abs=0.03)
    assert found[0].inside is None


def test_an_image_lies_where_its_own_case_has_registered_it(tmp_path) -> None:
    image = np.random.default_rng(2).normal(-12.0, 2.0, (30, 40)).astype(np.float32)
    image[3, 5] = np.nan
    moved, zero = np.roll(image, 1, axis=0), np.zeros((2, 30, 40), np.float32)
    verdict = "registered with gefolki."
    own = Registered(Measurement(moved, "a.tif"), image, zero + 1, zero[0] + 0.5, zero[0], "gefolki", True, verdict)
    path = tmp_path / "registered.h5"
    write_registered(path, own)
    found, by = registered_as(path, image, Measurement(image, "a.tif"), RegistrationConfig())
    assert np.array_equal(found.measurement.image_db, moved, equal_nan=True)
    assert (found.verdict, by) == (verdict, f"as in {tmp_path}")
    # another image, another method, and no results of the other case
    none = RegistrationConfig(method="none")
    (tmp_path / "broken.h5").write_bytes(b"not HDF5")
    for place, values, why in (
        (path, image, f", not as in {tmp_path}, whose registration.method was gefolki"),
        (tmp_path / "gone.h5", image, ""),
        (tmp_path / "broken.h5", image, f", because the registration of its case cannot be used: {tmp_path}/broken.h5"),
    ):
        found, by = registered_as(place, image, Measurement(values, "a.tif"), none)
        assert np.array_equal(found.measurement.image_db, values, equal_nan=True)
        assert not found.applied
        assert by.startswith(f"onto the predicted image{why}")
        assert why or by == "onto the predicted image"
    write_registered(path, replace(own, method="none"))
    _, by = registered_as(path, image, Measurement(image + 1, "a.tif"), none)
    assert by == f"onto the predicted image, not as in {tmp_path}, which has registered another image"


def test_a_level_is_predicted_where_it_is_known_alone(made) -> None:
    seen = calibrated_posterior(seen_deg=np.array([[38.9, 39.1]]))
    fitted = replace(made.archive.materials["dyke"].fitted, level_only=True)
    archive = changed_material(made.archive, "dyke", posterior=seen, fitted=fitted)
    bins = [
        (1, Prediction("dyke", (x - 0.5, x + 0.5), x, 90, "not seen", -9.0, -10.0, -8.0)) for x in (37.5, 40.0, 45.0)
    ]
    kept, (said,) = where_seen(archive, bins)
    assert [one.incidence_deg for _, one in kept] == [40.0]
    assert said == (
        "dyke: 2 bins left out, more than 1 degree from the one incidence at which the calibration has seen it: its "
        "level is known there alone."
    )
    law = changed_material(archive, "dyke", fitted=replace(fitted, level_only=False))
    assert where_seen(law, bins) == (bins, [])
