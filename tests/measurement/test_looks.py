"""The looks estimated against the ones that speckle was made with."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import special

from radcal.config import Radar
from radcal.measurement.looks import estimate_looks, looks_of_log_variance
from radcal.radar.image import ImageFormation, decibels
from radcal.radar.reflectivity import uniform

SHAPE = (400, 400)
ONE = np.ones(SHAPE, dtype=np.uint8)


def speckle_db(looks: int, level: np.ndarray | float = 10.0, seed: int = 1) -> np.ndarray:
    sigma0 = np.broadcast_to(np.asarray(level, dtype=np.float32), SHAPE)
    return decibels(ImageFormation(Radar(looks=looks), SHAPE, -20.0).intensity(uniform(sigma0), seed))


@pytest.mark.parametrize("looks", [0.5, 1.0, 2.5, 4.0, 40.0, 5000.0])
def test_looks_of_a_variance_are_those_of_the_gamma_law(looks: float) -> None:
    variance = (10 / np.log(10)) ** 2 * special.polygamma(1, looks)
    assert looks_of_log_variance(float(variance)) == pytest.approx(looks, rel=1e-6)


@pytest.mark.parametrize("looks", [1, 4, 9])
def test_looks_of_the_simulators_speckle(looks: int) -> None:
    found = estimate_looks(speckle_db(looks), ONE, Radar(looks=looks))
    assert found is not None
    # about 400 windows of 64 pixels, whose log variance scatters by a fifth: the mode to some percent
    assert found.looks == pytest.approx(looks, rel=0.1)
    assert found.low <= found.looks <= found.high
    assert found.high / found.low < 1.3


def test_looks_do_not_depend_on_the_level_or_on_slopes() -> None:
    image = speckle_db(4)
    flat = estimate_looks(image, ONE, Radar())
    rows, columns = np.indices(SHAPE)
    tilted = estimate_looks((image - 30 + 0.05 * rows - 0.03 * columns).astype(np.float32), ONE, Radar())
    assert flat is not None
    assert tilted is not None
    assert tilted.looks == pytest.approx(flat.looks, rel=1e-3)


def test_homogeneous_areas_count_where_others_are_textured() -> None:
    rng = np.random.default_rng(3)
    texture = np.ones(SHAPE)
    texture[:, 200:] = rng.gamma(0.3, 1 / 0.3, size=(SHAPE[0], 200))
    found = estimate_looks(speckle_db(4, 10.0 * texture), ONE, Radar())
    assert found is not None
    assert found.looks == pytest.approx(4.0, rel=0.12)


def test_windows_of_several_materials_or_without_data_are_left_out() -> None:
    image = speckle_db(4)
    whole = estimate_looks(image, ONE, Radar())
    material = ONE.copy()
    material[:, 200:] = 0
    half = estimate_looks(image, material, Radar())
    assert whole is not None
    assert half is not None
    assert half.windows <= 0.6 * whole.windows
    image[:, 200:] = np.nan
    assert estimate_looks(image, ONE, Radar()) == half


def test_too_small_materials_give_none() -> None:
    material = np.zeros(SHAPE, dtype=np.uint8)
    material[:40, :40] = 1
    assert estimate_looks(speckle_db(4), material, Radar()) is None
