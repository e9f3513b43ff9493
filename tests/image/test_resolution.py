"""Resolutions against the widths of areas, and the note on those that were not checked."""

import numpy as np
import pytest

from radcal.config import Radar
from radcal.errors import MeasurementError
from radcal.image.speckle_check import check_resolutions, unchecked_resolutions

MATERIAL = np.zeros((40, 60), dtype=np.uint8)
MATERIAL[3:21, 5:40] = 1
MATERIAL[10, 20:30] = 0  # mixed pixels do not end an area
MATERIAL[21:30, 4:40] = 2


def radar(**keys):
    return Radar(range_spacing_m=1.5, azimuth_spacing_m=2.5, **keys)


def test_a_resolution_wider_than_every_area_is_refused():
    check_resolutions(MATERIAL, radar(range_resolution_m=26.9, azimuth_resolution_m=89.0))  # 18 rows and 36 columns
    said = r"^radar\.range_resolution_m is 28: no area .* wider than 27 m in slant range, .* expected at most 27 \("
    with pytest.raises(MeasurementError, match=said):
        check_resolutions(MATERIAL, radar(range_resolution_m=28.0))
    with pytest.raises(MeasurementError, match=r"^radar\.azimuth_resolution_m is 91: .* 90 m in azimuth"):
        check_resolutions(MATERIAL, radar(azimuth_resolution_m=91.0))
    # the extent of an image of one material
    check_resolutions(np.ones((40, 60), np.uint8), radar(range_resolution_m=59.0))
    with pytest.raises(MeasurementError, match=r"60 m in slant range"):
        check_resolutions(np.ones((40, 60), np.uint8), radar(range_resolution_m=61.0))
    check_resolutions(np.zeros((40, 60), np.uint8), radar(range_resolution_m=61.0))  # other errors tell that


def test_unusual_resolutions_that_the_speckle_cannot_check_are_a_warning():
    (plain,) = unchecked_resolutions(radar(range_resolution_m=7.0), "a.tif")
    assert (plain.code, plain.severity, plain.about) == ("resolutions_unknown", "note", "a.tif")
    assert plain.numbers == {"pairs": 150, "apart_px": 4}
    # four times 1.184
    again, unusual = unchecked_resolutions(radar(azimuth_resolution_m=12.0), "a.tif")
    assert again == plain
    assert (unusual.code, unusual.severity) == ("resolution_unusual", "warning")
    assert unusual.about == "radar.azimuth_resolution_m"
    assert unusual.numbers == pytest.approx({"resolution_m": 12.0, "spacings": 4.8, "most_spacings": 4.74}, rel=0.01)
