"""Second registration: the better of two simulated images decides, and the sentence says which."""

from dataclasses import replace

import numpy as np
import pytest
from registration_samples import speckled
from scipy.ndimage import gaussian_filter

from radcal.config import RegistrationConfig
from radcal.findings import Finding
from radcal.image.model import Measurement
from radcal.registration import registered as registration
from radcal.registration.displacement import invert, warp
from radcal.registration.registered import register, register_again
from radcal.storage.dataclass_groups import same

pytestmark = pytest.mark.slow

SHAPE = (120, 150)
CONFIG = RegistrationConfig()


def relief(seed):
    return gaussian_filter(np.random.default_rng(seed).standard_normal(SHAPE), 6.0) * 30.0


RIGHT = relief(1)
# half of the pattern of the real law, half of another one
START, FOUND, OTHER = speckled(0.5 * RIGHT + relief(2), 3), speckled(RIGHT, 4), speckled(relief(5), 6)
OF_FIRST = Finding("place", "note", "pass 1", {"correlation": 0.5})


@pytest.fixture(scope="module")
def moved():
    rows, columns = np.indices(SHAPE)
    return np.stack([1.5 + np.sin(columns / 60.0), -2.0 + 0.5 * np.cos(rows / 50.0)])


@pytest.fixture(scope="module")
def first(moved):
    image = warp(speckled(RIGHT, 7), invert(moved)).astype(np.float32)
    return register(
        START, Measurement(image, "a.tif", findings=(Finding("polarisation_unknown", "note", "a.tif"),)), CONFIG
    )


@pytest.fixture(scope="module")
def alone(first):
    return register(FOUND, replace(first.measurement, image_db=first.unregistered_db), CONFIG)


def error_px(registered, moved):
    return np.sqrt(np.mean(np.sum((registered.displacement_px - moved) ** 2, axis=0)[20:-20, 20:-20]))


def test_a_run_that_is_more_like_the_image_takes_the_place_of_the_reference_run(first, alone, moved):
    again = register_again(FOUND, replace(first, findings=(OF_FIRST,)), CONFIG)
    assert again.findings == (OF_FIRST,)
    assert error_px(again, moved) < 0.6 * error_px(first, moved)
    assert same(replace(again, verdict=alone.verdict, findings=()), alone)
    assert again.correlation > first.correlation
    assert again.verdict.startswith(f"{alone.verdict} This is the second registration, ")


def test_a_run_that_is_less_like_the_image_changes_nothing_but_the_sentence(first, alone):
    again = register_again(START, alone, CONFIG)
    assert again.verdict.startswith(f"{alone.verdict} A second one, onto a run with laws fitted ")
    assert f"{first.correlation:.3f}; of the first registration {alone.correlation:.3f})" in again.verdict
    assert same(replace(again, verdict=alone.verdict), alone)


def test_a_run_that_has_nothing_in_common_with_the_image_is_not_used(first, monkeypatch):
    # the first registration has compared the image with mirrored ones
    monkeypatch.setattr(registration, "_mirrored", None)
    again = register_again(OTHER, first, CONFIG)
    assert "agrees less and is not used (mean local correlation 0.0" in again.verdict
    assert same(replace(again, verdict=first.verdict), first)
