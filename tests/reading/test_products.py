"""Names of products, read as their producers document them."""

import pytest

from radcal.reading.products import named_product

HYP3 = "S1A_IW_20180128T161201_DVP_RTC30_G_gpuned_FD6A_VV.tif"
NRB = "s1a-iw-nrb-20220721t051225-044194-05465e-33tuf-vh-g-lin.tif"
OPERA = "OPERA_L2_RTC-S1_T093-197867-IW3_20210426T013646Z_20250903T222329Z_S1A_30_v1.0_VH.tif"


@pytest.mark.parametrize(
    ("path", "scale", "radiometry", "polarisation", "filtered"),
    [
        (HYP3, "power", "gamma0_rtc", "VV", False),
        (f"${{DATA}}/{HYP3.replace('gpuned', 'gdunem')}", "db", "gamma0_rtc", "VV", False),
        (HYP3.replace("gpuned", "gawfcd").replace("VV", "VH"), "amplitude", "gamma0_rtc", "VH", True),
        (HYP3.replace("gpuned", "spuned"), "power", None, "VV", False),
        (f"/data/{NRB}", "power", "gamma0_rtc", "VH", False),
        (NRB.replace("-g-", "-s-"), "power", None, "VH", False),
        (OPERA, "power", "gamma0_rtc", "VH", False),
    ],
)
def test_names_say_scale_and_radiometry(path, scale, radiometry, polarisation, filtered):
    product = named_product(path)
    found = (product.scale, product.radiometry, product.polarisation, product.filtered)
    assert found == (scale, radiometry, polarisation, filtered)


@pytest.mark.parametrize(
    "path",
    [
        "image.tif",
        HYP3.replace("_VV.tif", "_inc_map.tif"),
        HYP3.replace("_VV.tif", "_ls_map.tif"),
        HYP3.replace("_G_", "_"),
        NRB.replace("vh-g-lin", "dm"),
        f"{HYP3}/other.tif",
        f"copy_of_{HYP3}",
    ],
)
def test_other_names_say_nothing(path):
    assert named_product(path) is None
