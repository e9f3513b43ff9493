"""Tags and band names of rasters, against the keys of a case."""

import numpy as np
import pytest
import rasterio
from raster_files import write_raster

from radcal.config import FileMeasurement, Radar
from radcal.errors import MeasurementError
from radcal.image.raster import Header, RasterReader
from radcal.measurement.sources import make_measurement

CONFIG = FileMeasurement(path="a.tif", scale="power", radiometry="sigma0_ref")
NORMALISATION = "PROCESSING_INFORMATION_OUTPUT_BACKSCATTER_NORMALIZATION_CONVENTION"


def write(path, shape, names, **tags):
    write_raster(path, np.random.default_rng(1).normal(-12.0, 3.0, (len(names), *shape)).astype(np.float32), names)
    with rasterio.open(path, "r+") as raster:
        raster.update_tags(**tags)
    return path


@pytest.mark.parametrize(
    ("names", "band", "tags", "expected"),
    [
        (["VV", "VH"], 2, {}, Header(polarisation="VH")),
        (["VV", " Angle"], 2, {}, Header(incidence=(2, "Angle", False))),
        (["localIncidenceAngle", "HV"], 3, {}, Header(incidence=(1, "localIncidenceAngle", True))),
        (["Sigma0_VH_db"], None, {}, Header(polarisation="VH", decibels=True)),
        (["Gamma0_HH"], None, {NORMALISATION: "gamma0"}, Header(polarisation="HH", normalisation="gamma0")),
        ([None], None, {}, Header()),
    ],
)
def test_bands_and_tags_are_read(tmp_path, names, band, tags, expected):
    config = CONFIG.model_copy(update={"band": band})
    assert RasterReader(write(tmp_path / "a.tif", (4, 5), names, **tags), config, Radar()).facts() == expected


def test_files_without_tags_say_nothing(tmp_path):
    (tmp_path / "a.tif").write_text("no raster")
    assert RasterReader(tmp_path / "a.tif", CONFIG, Radar()).facts() == Header()


@pytest.mark.parametrize(
    ("names", "tags", "keys", "words"),
    [
        (["VH"], {}, {}, r"the polarisation of .*a\.tif is VH, radar\.polarisation is HH"),
        (["Sigma0_HH_db"], {}, {"scale": "power"}, "measurement.scale is power, the name of the band of .* says dB"),
        ([None], {NORMALISATION: "gamma0"}, {}, "measurement.radiometry is sigma0_local, the tags of .* say gamma0"),
    ],
)
def test_contradictions_are_refused(tmp_path, geometry, build_case, names, tags, keys, words):
    path = write(tmp_path / "a.tif", geometry.shape, names, **tags)
    file = {"source": "file", "path": str(path), "scale": "db", "radiometry": "sigma0_local", **keys}
    if keys:
        with rasterio.open(path, "r+") as raster:
            raster.write(10.0 ** (raster.read() / 10.0))
    with pytest.raises(MeasurementError, match=words):
        measured(build_case(measurement=file), geometry)
    right = write(tmp_path / "b.tif", geometry.shape, ["HH"], **{NORMALISATION: "sigma0"})
    file = {"source": "file", "path": str(right), "scale": "db", "radiometry": "sigma0_local"}
    assert measured(build_case(measurement=file), geometry).source == "b.tif"


@pytest.mark.parametrize(("letters", "filtered"), [("gpuned", False), ("gpufed", True)])
def test_what_a_name_says_is_told(tmp_path, geometry, build_case, letters, filtered):
    path = write(tmp_path / f"S1A_IW_20180128T161201_DVP_RTC30_G_{letters}_FD6A_HH.tif", geometry.shape, [None])
    with rasterio.open(path, "r+") as raster:
        raster.write(10.0 ** (raster.read() / 10.0))
    case = build_case(measurement={"source": "file", "path": str(path)}, radar={"radiometry": "gamma0_rtc"})
    found = {one.code: one.numbers for one in measured(case, geometry).findings}
    keys = {"scale": "power", "radiometry": "gamma0_rtc", "polarisation": "HH"}
    assert found["product"] == {"product": "a HyP3 RTC product", **keys}
    assert ("product_filtered" in found) == filtered


def measured(case, geometry):
    nothing = None  # a file needs no simulator
    return make_measurement(case, geometry, nothing)
