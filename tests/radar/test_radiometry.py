"""Radiometries and noise floor in closed form."""

from __future__ import annotations

import numpy as np
import pytest

from radcal.config import Radar
from radcal.radar.radiometry import noise_floor_db, of_sigma0

ANGLES = np.array([20.0, 35.0, 52.0])


@pytest.mark.parametrize(
    ("radiometry", "expected"),
    [("beta0", [2.9238044, 1.7434468, 1.2690182]), ("gamma0", [1.0641778, 1.2207746, 1.6242692]),
     ("gamma0_rtc", [1.0641778, 1.2207746, 1.6242692]),
     ("sigma0_ref", [1.0, 1.0, 1.0]), ("sigma0_local", [1.0, 1.0, 1.0])],
)  # fmt: skip
def test_radiometries_of_unit_sigma0(radiometry: str, expected: list[float]) -> None:
    """Cosecants and secants from a table."""
    np.testing.assert_allclose(of_sigma0(radiometry, ANGLES), expected, rtol=1e-7)


@pytest.mark.parametrize(("radiometry", "extra_db"), [("beta0", 2.4141), ("gamma0", 0.8664), ("sigma0_local", 0.0)])
def test_noise_floor_is_a_power(radiometry: str, extra_db: float) -> None:
    """At 35 degrees: 10 log10 of the factors above; the table is straight in dB between its angles."""
    table = [(30.0, -27.0), (40.0, -21.0)]
    found = noise_floor_db(Radar(nesz_db=table, radiometry=radiometry), [35.0])
    assert found[0] == pytest.approx(-24.0 + extra_db, abs=1e-3)
    one = noise_floor_db(Radar(nesz_db=-19.0, radiometry=radiometry), [35.0])
    assert one[0] == pytest.approx(-19.0 + extra_db, abs=1e-3)
