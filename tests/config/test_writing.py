"""The default case as YAML."""

from pathlib import Path

import numpy as np
import pytest
from config_samples import COMMAND, FIXED, synthetic

from radcal.config import Case, case_from
from radcal.config.writing import default_yaml


def test_the_default_measurement_is_made_by_other_settings_than_the_runs():
    case = Case()
    synthetic = case.measurement.synthetic
    assert synthetic.disturbed == ("relief_m", "resolution_factor")
    assert 0.3 <= synthetic.offset_db <= 0.5
    laws = case.laws
    phi = np.radians(np.linspace(20.0, 60.0, 41))
    for name, material in case.materials.items():
        if not material.calibrate:
            off = laws[name](phi, synthetic.parameters[name]) - laws[name](phi, material.start_parameters)
            assert 0.2 < np.abs(off).max() < 1.5, name


@pytest.mark.parametrize(
    "data", [{"scene": {"seed": 2}}, {"materials": FIXED}, {"simulator": COMMAND}, synthetic(seed=3)]
)
def test_a_case_of_its_own_ground_or_image_has_no_mismatch_by_default(data):
    measurement = case_from(data).measurement
    assert measurement.synthetic.disturbed == ()
    assert measurement.synthetic.offset_db == 0.0
    assert list(measurement.synthetic.parameters) == ["dyke"]


def test_levels_and_bounds_of_the_default_case_are_physical():
    case = Case()
    phi = np.radians(np.linspace(0.0, 80.0, 81))
    for name, law in case.laws.items():
        sigma0_db = law(phi, case.measurement.synthetic.parameters[name])
        assert -32.0 < sigma0_db.min() < sigma0_db.max() < 0.5, name
    (low, high), *others = case.materials["dyke"].box
    assert low < high < 0.0
    assert all(bounds[0] == 0.0 for bounds in others)
    assert case.radar.radiometry == "sigma0_ref"


def test_shipped_config_is_the_default_case():
    shipped = Path(__file__).parents[2] / "config" / "config.yaml"
    assert shipped.read_text() == default_yaml()
