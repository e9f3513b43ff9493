"""Cases with a product whose name says how its numbers are read."""

import pytest

from radcal.config import case_from
from radcal.errors import ConfigError

HYP3 = "S1A_IW_20180128T161201_DVP_RTC30_G_gdunem_FD6A_VV.tif"


def case(radar=None, path=HYP3, **measurement):
    return case_from(
        {
            "measurement": {"source": "file", "path": path, **measurement},
            "radar": {"polarisation": "VV", "radiometry": "gamma0_rtc", **(radar or {})},
        }
    ).measurement


def test_the_name_replaces_three_keys():
    found = case()
    assert (found.scale, found.radiometry, found.polarisation) == ("db", "gamma0_rtc", "VV")
    assert case(scale="db", polarisation="VV") == case()


@pytest.mark.parametrize(
    ("radar", "measurement", "words"),
    [
        (None, {"scale": "power"}, "scale is power, S1A.*tif is a HyP3 RTC product, whose scale is db: leave the key"),
        (None, {"radiometry": "sigma0_ref"}, "radiometry is sigma0_ref, .* whose radiometry is gamma0_rtc"),
        (None, {"polarisation": "VH"}, "polarisation is VH, .* whose polarisation is VV"),
        ({"polarisation": "VH"}, {}, "measurement.polarisation is VV, radar.polarisation is VH"),
        ({"radiometry": "sigma0_ref"}, {}, "measurement.radiometry is gamma0_rtc, radar.radiometry is sigma0_ref"),
        (None, {"path": HYP3.replace("gdunem", "sdunem")}, "measurement.radiometry is missing"),
        (None, {"path": "other.tif"}, "measurement.scale is missing"),
    ],
)
def test_contradictions_are_one_sentence(radar, measurement, words):
    with pytest.raises(ConfigError, match=words):
        case(radar, **measurement)
