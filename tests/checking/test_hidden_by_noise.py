"""Materials that lie in the noise, on a scene of 40 x 40 cells."""

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from radcal.checking.outlook import hidden_by_noise, outlook
from radcal.image.model import Measurement
from radcal.radar.projection import make_geometry

NOISE = 0.01  # -20 dB


@pytest.mark.parametrize(
    ("dark", "snr_db", "share"),
    [
        (0.2, 0.0, 0.16),
        (0.9, 0.0, 0.88),
        (0.2, 3.0, 0.204),  # asks for 3 times the noise, where 0 dB ask for twice
        (0.07, 0.0, None),  # 4 %
    ],
)
def test_a_material_in_the_noise_is_told(build_scene, build_case, dark, snr_db, share):
    """Part of a dyke at 1.5 times the noise, the rest at 4 times; other ground that is calibrated, at 10 times."""
    material = np.where(np.arange(40) < 22, 1, 2).astype(np.uint8) * np.ones((40, 1), dtype=np.uint8)
    scene = build_scene(lambda east, north: 0 * east, names=("dyke", "grass"), material=material)
    law = {"calibrate": True, "start": [10.0, 14.0, 6.0, 4.0]}
    case = build_case(
        materials={"dyke": law, "grass": law},
        radar={"nesz_db": -20.0, "radiometry": "sigma0_ref", "azimuth_spacing_m": 2.0, "azimuth_resolution_m": 2.8},
        target={"snr_db": snr_db, "leave_out_point_targets": False},  # an image without speckle is one step
    )
    geometry = make_geometry(scene, case.radar)
    columns = geometry.shape[1]
    assert columns == 100
    along = np.where(np.arange(columns) < dark * columns, 1.5, 4.0) * NOISE
    power = np.where(geometry.material == 1, along, 10.0 * NOISE)
    power[binary_dilation(geometry.material == 1, iterations=9) & (geometry.material != 1)] = np.nan
    measured = Measurement((10.0 * np.log10(power)).astype(np.float32), "a.tif")
    said = hidden_by_noise(case, geometry, measured)
    if share is None:
        assert said == []
        return
    # the mean of 9 columns exceeds twice the noise with 2 columns at 4 times the noise, three times with 6; the first
    # and the last of 100 columns border on other ground
    (found,) = said
    assert (found.code, found.severity, found.about) == ("in_the_noise", "warning", "dyke")
    assert found.numbers == pytest.approx({"share": share}, abs=0.005)
    assert found in outlook(case, geometry, measured)
    assert hidden_by_noise(case.model_copy(update={"target": _offset(case)}), geometry, measured) == []


def _offset(case):
    return case.target.model_copy(update={"normalisation": "offset"})
