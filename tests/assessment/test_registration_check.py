"""Registration onto the calibrated image: a shift that the first registration missed, and what it does to sigma0."""

from dataclasses import replace

import numpy as np
import pytest
from calibration_samples import make_target
from geometry_samples import X, two_materials
from scipy.ndimage import gaussian_filter

from radcal.assessment import conclusion
from radcal.assessment.conclusion import check_registration, moved_again, moved_finding
from radcal.findings import Finding
from radcal.image.model import Measurement
from radcal.laws import LAWS, law_for
from radcal.registration.registered import Registered

LAW = LAWS["mangia"]


def registered(unregistered_db, displacement_px=(0.0, 0.0), uncertainty_px=0.3, **changes):
    shape = unregistered_db.shape
    field = np.broadcast_to(np.array(displacement_px, dtype=np.float32)[:, None, None], (2, *shape)).copy()
    made = Registered(
        Measurement(unregistered_db, "made up"), unregistered_db, field,
        np.full(shape, uncertainty_px, dtype=np.float32), 0.0, "gefolki", True, "moved",
    )  # fmt: skip
    return replace(made, **changes)


@pytest.mark.parametrize(
    ("values", "doubtful"),
    [
        ((0.76, 0.5, 0.76, 0.5), True),
        ((0.75, 0.5, 0.76, 0.5), False),
        ((0.76, 0.5, 0.75, 0.5), False),
        ((0.76, 0.5, 0.5, 0.25), False),
    ],
)
def test_a_doubt_needs_a_change_beyond_its_errors_that_matters(values, doubtful):
    """More than 1.5 standard errors of displacement and sigma0, and more than half a decibel."""
    assert (moved_finding("dyke", *values).severity == "warning") is doubtful


def test_a_doubt_names_the_change_and_the_key_that_repairs_it():
    numbers = {"moved_px": 0.81, "stated_px": 0.34, "moved_db": 1.42, "stated_db": 0.7}
    assert moved_finding("dyke", **numbers) == Finding(
        "registration_moved", "warning", "dyke", numbers, "materials.dyke.start"
    )
    small = numbers | {"moved_px": 0.3}
    assert moved_finding("dyke", **small) == Finding("registration_moved", "note", "dyke", small)


@pytest.mark.slow
@pytest.mark.parametrize("present", [(0.0, 0.0), (1.0, -2.0), (5.0, 0.0)])
def test_the_change_is_the_shift_that_is_left(present):
    """A pattern that lies two rows below and one column left of its place: d(x) = (2, -1), less what was known."""
    rng = np.random.default_rng(3)
    pattern = 40.0 * gaussian_filter(rng.normal(size=(140, 150)), 3.0)
    image, moved = pattern[5:133, 5:133], pattern[3:131, 6:134]
    noisy = [(one + rng.normal(0.0, 1.0, one.shape)).astype(np.float32) for one in (image, moved)]
    change = moved_again(registered(noisy[1], present), noisy[0])
    np.testing.assert_allclose(np.median(change, axis=(1, 2)), np.array([2.0, -1.0]) - present, atol=0.1)


def test_sigma0_changes_by_the_laws_slope_along_the_gradient_of_the_incidence(monkeypatch):
    """Incidence rises by 25 / 59 degrees a row: of a move by (0.6, -0.8) only 0.6 rows count."""
    seen = two_materials()
    shape, pixels = seen.shape, seen.pixels("area")[::7]
    angle = seen.incidence_deg.ravel()[pixels]
    targets = {"area": make_target(np.linspace(-12.0, -8.0, pixels.size), angle, pixels=pixels)}
    field = np.broadcast_to(np.array([0.6, -0.8])[:, None, None], (2, *shape))
    monkeypatch.setattr(conclusion, "moved_again", lambda *_: field)
    image = np.zeros(shape, dtype=np.float32)
    laws = {"area": (LAW, X), "rest": (LAW, X), "program": (law_for("external", names=["p"]), [1.0])}
    (found,) = check_registration(laws, targets, seen, registered(image), image)
    assert found.about == "area"
    phi = np.radians(angle.astype(np.float64))
    slope = (-X[1] * np.sin(phi) - 2.0 * X[2] * X[3] * phi * np.exp(-X[3] * phi**2)) * np.pi / 180.0
    per_row = np.sqrt(np.mean(slope**2)) * 25.0 / 59.0
    wanted = {"moved_db": 0.6 * per_row, "stated_db": 0.3 * per_row / np.sqrt(2.0)}
    assert found.numbers == pytest.approx({"moved_px": 1.0, "stated_px": 0.3, **wanted}, rel=1e-4)
    for unmoved in (registered(image, applied=False), registered(image, method="ilk")):
        assert list(check_registration(laws, targets, seen, unmoved, image)) == []
