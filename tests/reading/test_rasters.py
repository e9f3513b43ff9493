"""Rasters that would have GDAL read other files or the network: refused, with a listener that hears nothing."""

import threading
from socketserver import StreamRequestHandler, ThreadingTCPServer

import h5py
import numpy as np
import pytest
import rasterio
from raster_files import write_raster
from rasterio.errors import RasterioError

from radcal.reading.intake import LARGEST_VALUES
from radcal.reading.rasters import RasterRefused, check_blocks, open_raster, raster_files

VALUES = np.arange(48, dtype=np.float32).reshape(6, 8) + 3.0


def write(path, dtype="float32", **profile):
    path.parent.mkdir(exist_ok=True)
    return write_raster(path, VALUES.astype(dtype), **profile)


def vrt(source, relative=1, band="", before=""):
    return (
        f'<VRTDataset rasterXSize="8" rasterYSize="6">{before}<VRTRasterBand dataType="Float32" band="1"{band}>'
        f'<SimpleSource><SourceFilename relativeToVRT="{relative}">{source}</SourceFilename><SourceBand>1</SourceBand>'
        "</SimpleSource></VRTRasterBand></VRTDataset>"
    )


def wms(url):
    return (
        f'<GDAL_WMS><Service name="TMS"><ServerUrl>{url}/${{z}}/${{x}}/${{y}}.png</ServerUrl></Service><DataWindow>'
        "<UpperLeftX>0</UpperLeftX><UpperLeftY>1</UpperLeftY><LowerRightX>1</LowerRightX><LowerRightY>0</LowerRightY>"
        "<SizeX>8</SizeX><SizeY>6</SizeY></DataWindow><Projection>EPSG:4326</Projection><BandsCount>1</BandsCount>"
        "</GDAL_WMS>"
    )


@pytest.fixture(scope="module")
def requests():
    """Address of a server of this machine, and what it was asked for."""
    heard = []

    class Listener(StreamRequestHandler):
        def handle(self):
            heard.append(self.rfile.readline().decode())

    server = ThreadingTCPServer(("127.0.0.1", 0), Listener)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield f"http://127.0.0.1:{server.server_address[1]}", heard
    server.shutdown()
    thread.join()
    server.server_close()


def read(path, **keys):
    with open_raster(path, **keys) as raster:
        return np.asarray(raster.read(1, masked=True).filled(np.nan))


@pytest.fixture
def place(tmp_path):
    write(tmp_path / "other" / "secret.tif")
    write(tmp_path / "own" / "tile.tif")
    return tmp_path / "own"


def test_a_tif_that_holds_a_mosaic_of_another_file_is_refused(place):
    path = place / "image.tif"
    path.write_text(vrt(place.parent / "other/secret.tif", 0))
    with pytest.raises(RasterRefused, match=r"image\.tif holds XML, which is read as a mosaic \(VRT\) only in a file"):
        read(path)
    # wherever the mark stands that GDAL looks for
    path.write_text("\0" + vrt(place.parent / "other/secret.tif", 0))
    with pytest.raises(RasterRefused, match="holds XML"):
        read(path)


@pytest.mark.parametrize("name", ["a.vrt", "a.tif", "a.tif.msk", "a.tif.aux.xml", "overviews", "tag"])
def test_no_request_is_sent(place, requests, name):
    url, heard = requests
    path = place / ("a.vrt" if name == "a.vrt" else "a.tif")
    overviews = f'<Metadata domain="OVERVIEWS"><MDI key="OVERVIEW_FILE">/vsicurl/{url}/o</MDI></Metadata>'
    if name not in ("a.vrt", "a.tif"):
        write(path)
    if name == "tag":
        with rasterio.open(path, "r+") as raster:
            raster.update_tags(ns="OVERVIEWS", OVERVIEW_FILE=f"/vsicurl/{url}/o")
    else:
        text = {
            "a.vrt": vrt(f"/vsicurl/{url}/a.tif", 0),
            "a.tif.aux.xml": f"<PAMDataset><SRS>{url}/srs</SRS></PAMDataset>",
            "overviews": f"<PAMDataset>{overviews}</PAMDataset>",
        }.get(name, wms(url))
        (place / ("a.tif.aux.xml" if name == "overviews" else name)).write_text(text)
    heard.clear()
    if name == "a.tif.aux.xml":
        np.testing.assert_array_equal(read(path), VALUES)
    else:
        with pytest.raises(RasterRefused):
            read(path)
    assert heard == []


def test_the_listener_hears_what_gdal_does_by_itself(place, requests):
    url, heard = requests
    path = place / "a.tif"
    path.write_text(vrt(f"/vsicurl/{url}/by_itself.tif", 0))
    with pytest.raises(RasterioError), rasterio.open(path) as raster:
        raster.read(1)
    assert any("by_itself" in request for request in heard)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (vrt("../other/secret.tif"), r"names the source '\.\./other/secret\.tif', expected a file below .*own"),
        (vrt("link.tif"), "'link.tif', expected a file below"),
        (vrt("tile.tif", 0), "'tile.tif', expected a file below"),  # relative to wherever the command is typed
        (vrt("NETCDF:tile.tif:a"), "names the source 'NETCDF:tile.tif:a'"),
        (vrt("/vsizip/x.zip/y.tif", 0), "names the source '/vsizip/x.zip/y.tif'"),
        (vrt("missing.tif"), "'missing.tif', which is no file"),
        (vrt("inner.vrt"), "'inner.vrt', which is a mosaic itself"),
        (vrt("service.tif"), "service.tif holds XML"),
        (
            vrt("tile.tif", band=' subClass="VRTDerivedRasterBand"'),
            "VRTRasterBand VRTDerivedRasterBand, expected a mos",
        ),
        (
            '<VRTDataset rasterXSize="8" rasterYSize="6"><VRTRasterBand dataType="Byte" band="1" subClass='
            '"VRTRawRasterBand"><SourceFilename>/etc/passwd</SourceFilename></VRTRasterBand></VRTDataset>',
            "VRTRawRasterBand",
        ),
        (vrt("tile.tif", before="<OverviewList>2</OverviewList>"), "has OverviewList, expected a mosaic"),
        (
            vrt("&e;", before="").replace("<VRTDataset", '<!DOCTYPE x [<!ENTITY e SYSTEM "tile.tif">]><VRTDataset', 1),
            "ty",
        ),
        ("<VRTDataset", "a.vrt: its XML cannot be parsed"),
    ],
)
def test_what_a_mosaic_may_not_name(place, content, words):
    (place / "link.tif").symlink_to(place.parent / "other/secret.tif")
    (place / "inner.vrt").write_text(vrt("tile.tif"))
    (place / "service.tif").write_text(wms("http://127.0.0.1:9"))
    (place / "a.vrt").write_text(content)
    with pytest.raises(RasterRefused, match=words):
        read(place / "a.vrt")
    with pytest.raises(RasterRefused, match=words):
        raster_files(place / "a.vrt")


def test_a_mosaic_of_its_own_folder_is_read_and_its_sources_are_inputs(place):
    other = place.parent / "other"
    for name, source, relative, folders in (
        ("a.vrt", "tile.tif", 1, ()),
        ("b.vrt", place / "tile.tif", 0, ()),
        ("c.vrt", "../other/secret.tif", 1, (other,)),
    ):
        (place / name).write_text(vrt(source, relative))
        np.testing.assert_array_equal(read(place / name, folders=folders), VALUES)
    (other / "secret.tif.aux.xml").write_text("<PAMDataset/>")
    assert raster_files(place / "a.vrt") == [place / "tile.tif"]
    assert raster_files(place / "c.vrt", (other,)) == [other / "secret.tif.aux.xml", other / "secret.tif"]
    link = place.parent / "link.vrt"
    link.symlink_to(place / "a.vrt")
    np.testing.assert_array_equal(read(link), VALUES)


def test_headers_and_world_files_are_inputs(tmp_path):
    path = write(tmp_path / "image.img", driver="ENVI")
    np.testing.assert_array_equal(read(path), VALUES)
    assert tmp_path / "image.hdr" in raster_files(path)
    (tmp_path / "a.tfw").write_text("1\n0\n0\n-1\n0\n0\n")
    assert raster_files(write(tmp_path / "a.tif")) == [tmp_path / "a.tfw"]


def test_formats_with_numbers_in_other_files_are_refused(tmp_path):
    """An HFA raster (Erdas Imagine) names the file of its numbers, which may be any."""
    path = write(tmp_path / "image.img", driver="HFA", USE_SPILL="YES")
    with pytest.raises(RasterioError, match="not recognized as being in a supported file format"):
        read(path)


def test_hdf5_that_leads_elsewhere_is_no_raster(tmp_path):
    (tmp_path / "numbers").write_bytes(VALUES.tobytes())
    with h5py.File(tmp_path / "a.tif", "w") as file:
        file.create_dataset("x", (6, 8), "f4", external=[(str(tmp_path / "numbers"), 0, VALUES.nbytes)])
    with pytest.raises(RasterRefused, match=r"in a\.tif 'x' keeps its numbers in another file, which is not followed"):
        read(tmp_path / "a.tif")


def test_blocks_larger_than_any_image_are_refused(tmp_path):
    side = 10_016  # a multiple of 16, and the smallest that is too large
    assert (side - 16) ** 2 <= LARGEST_VALUES < side**2
    shape = {"tiled": True, "blockxsize": side, "blockysize": side, "dtype": "uint8"}
    path = write(tmp_path / "a.tif", compress="deflate", SPARSE_OK=True, **shape)
    with (
        open_raster(path) as raster,
        pytest.raises(RasterRefused, match=f"blocks of {side} x {side} pixels, expected at"),
    ):
        check_blocks(raster)
