"""SICD files written with the library read back to sigma0; damaged ones end in their sentence."""

import warnings

import lxml.etree
import numpy as np
import pytest
import sarkit.sicd
from raster_files import read_image, write_raster

from radcal.config import FileMeasurement, Radar
from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.image.sicd import SicdReader
from radcal.measurement.sources import make_measurement
from radcal.reading.images import Counts

ROWS, COLUMNS = 24, 18
SHAPE = (ROWS, COLUMNS)
SPACING = {"Row": 1.5, "Col": 2.5}
EARTH_M = 6378137.0  # the scene centre point lies on the equator: up is X, east is Y, north is Z
HEIGHT_M, GROUND_M = 4000.0, 3000.0
SLANT_M = np.hypot(HEIGHT_M, GROUND_M)
# of slant plane and ground; the flight is level and the look broadside: also the complement of incidence
SLOPE_DEG = float(np.degrees(np.arctan2(HEIGHT_M, GROUND_M)))
COEFFICIENTS = np.array([[2e-4, 1e-6, 2e-8], [-3e-6, 1e-8, 0.0]])
AMPLITUDES = np.linspace(0.5, 9.0, 256) ** 2


def pixels_of(pixel_type, shape=SHAPE):
    rng = np.random.default_rng(4)
    pixels = np.zeros(shape, dtype=sarkit.sicd.PIXEL_TYPES[pixel_type]["dtype"])
    if pixel_type == "RE32F_IM32F":
        return (rng.normal(size=shape) + 1j * rng.normal(size=shape)).astype(np.complex64)
    for name in pixels.dtype.names:
        limits = np.iinfo(pixels.dtype[name])
        pixels[name] = rng.integers(limits.min, limits.max, shape, endpoint=True)
    return pixels


def polynomial(name, coefficients):
    terms = "".join(
        f'<Coef exponent1="{i}" exponent2="{j}">{float(c)!r}</Coef>' for (i, j), c in np.ndenumerate(coefficients)
    )
    orders = np.array(coefficients.shape) - 1
    return f'<{name} order1="{orders[0]}" order2="{orders[1]}">{terms}</{name}>'


def xyz(name, vector):
    return f"<{name}>" + "".join(f"<{a}>{float(v)!r}</{a}>" for a, v in zip("XYZ", vector, strict=True)) + f"</{name}>"


def xml_of(
    *, shape=SHAPE, first=(0, 0), scp=(9, 5), side="R", pixel_type="RE32F_IM32F", table=None, radiometric=None,
    polarisation="V:V", frequency_ghz=(9.4, 9.8), plane="SLANT", reference_frequency="", cone_deg=90,
    doctype="",
):  # fmt: skip
    """A schema-valid SICD XML of a level flight to the north, looking east (R) or west (L)."""
    east = 1.0 if side == "R" else -1.0
    row = np.array([-HEIGHT_M, east * GROUND_M, 0.0]) / SLANT_M
    normal = np.array([GROUND_M, east * HEIGHT_M, 0.0]) / SLANT_M  # of the slant plane, away from the earth
    column = np.cross(normal, row)
    grid = "".join(
        f"<{axis}>{xyz('UVectECF', vector)}<SS>{SPACING[axis]}</SS><ImpRespWid>2</ImpRespWid><Sgn>-1</Sgn>"
        f"<ImpRespBW>0.5</ImpRespBW><KCtr>0</KCtr><DeltaK1>-0.25</DeltaK1><DeltaK2>0.25</DeltaK2></{axis}>"
        for axis, vector in (("Row", row), ("Col", column))
    )
    amplitudes = ""
    if table is not None:
        entries = "".join(f'<Amplitude index="{k}">{float(a)!r}</Amplitude>' for k, a in enumerate(table))
        amplitudes = f'<AmpTable size="{len(table)}">{entries}</AmpTable>'
    corners = "".join(
        f'<ICP index="{name}"><Lat>0.1</Lat><Lon>0.1</Lon></ICP>' for name in ("1:FRFC", "2:FRLC", "3:LRLC", "4:LRFC")
    )
    levels = "".join(polynomial(name, np.atleast_2d(value)) for name, value in (radiometric or {}).items())
    low, high = (ghz * 1e9 for ghz in frequency_ghz)
    constant = '<Coef exponent1="0">1</Coef>'
    text = f"""{doctype}<SICD xmlns="urn:SICD:1.4.0">
    <CollectionInfo><CollectorName>a</CollectorName><CoreName>b</CoreName><RadarMode><ModeType>STRIPMAP</ModeType>
    </RadarMode><Classification>UNCLASSIFIED</Classification></CollectionInfo>
    <ImageData><PixelType>{pixel_type}</PixelType>{amplitudes}<NumRows>{shape[0]}</NumRows><NumCols>{shape[1]}</NumCols>
    <FirstRow>{first[0]}</FirstRow><FirstCol>{first[1]}</FirstCol><FullImage><NumRows>1000</NumRows>
    <NumCols>1000</NumCols></FullImage><SCPPixel><Row>{scp[0]}</Row><Col>{scp[1]}</Col></SCPPixel></ImageData>
    <GeoData><EarthModel>WGS_84</EarthModel><SCP>{xyz("ECF", (EARTH_M, 0, 0))}<LLH><Lat>0</Lat><Lon>0</Lon><HAE>0</HAE>
    </LLH></SCP><ImageCorners>{corners}</ImageCorners></GeoData>
    <Grid><ImagePlane>{plane}</ImagePlane><Type>RGZERO</Type>{polynomial("TimeCOAPoly", np.ones((1, 1)))}{grid}</Grid>
    <Timeline><CollectStart>2024-01-01T00:00:00Z</CollectStart><CollectDuration>2</CollectDuration></Timeline>
    <Position><ARPPoly>{"".join(f'<{a} order1="0">{constant}</{a}>' for a in "XYZ")}</ARPPoly></Position>
    <RadarCollection><TxFrequency><Min>{low}</Min><Max>{high}</Max></TxFrequency>{reference_frequency}
    <TxPolarization>V</TxPolarization>
    <RcvChannels size="1"><ChanParameters index="1"><TxRcvPolarization>V:V</TxRcvPolarization></ChanParameters>
    </RcvChannels></RadarCollection>
    <ImageFormation><RcvChanProc><NumChanProc>1</NumChanProc><ChanIndex>1</ChanIndex></RcvChanProc>
    <TxRcvPolarizationProc>{polarisation}</TxRcvPolarizationProc><TStartProc>0</TStartProc><TEndProc>2</TEndProc>
    <TxFrequencyProc><MinProc>{low}</MinProc><MaxProc>{high}</MaxProc></TxFrequencyProc>
    <ImageFormAlgo>RMA</ImageFormAlgo><STBeamComp>NO</STBeamComp><ImageBeamComp>NO</ImageBeamComp>
    <AzAutofocus>NO</AzAutofocus><RgAutofocus>NO</RgAutofocus></ImageFormation>
    <SCPCOA><SCPTime>1</SCPTime>{xyz("ARPPos", (EARTH_M + HEIGHT_M, -east * GROUND_M, 0))}{xyz("ARPVel", (0, 0, 100))}
    {xyz("ARPAcc", (0, 0, 0))}<SideOfTrack>{side}</SideOfTrack><SlantRange>{SLANT_M}</SlantRange>
    <GroundRange>{GROUND_M}</GroundRange><DopplerConeAng>{cone_deg}</DopplerConeAng><GrazeAng>{SLOPE_DEG}</GrazeAng>
    <IncidenceAng>{90 - SLOPE_DEG}</IncidenceAng><TwistAng>0</TwistAng><SlopeAng>{SLOPE_DEG}</SlopeAng>
    <AzimAng>0</AzimAng><LayoverAng>0</LayoverAng></SCPCOA>
    {f"<Radiometric>{levels}</Radiometric>" if levels else ""}</SICD>"""
    return lxml.etree.ElementTree(lxml.etree.fromstring(text))


def write(path, pixels, on_warning="error", **keys):
    """Write a SICD file; by default, the writer's warning that the XML breaks the schema is an error."""
    security = sarkit.sicd.NitfSecurityFields(clas="U")
    metadata = sarkit.sicd.NitfMetadata(
        xmltree=xml_of(shape=pixels.shape, **keys),
        file_header_part=sarkit.sicd.NitfFileHeaderPart(ostaid="test", security=security),
        im_subheader_part=sarkit.sicd.NitfImSubheaderPart(isorce="test", security=security),
        de_subheader_part=sarkit.sicd.NitfDeSubheaderPart(security=security),
    )
    with warnings.catch_warnings(), path.open("wb") as file:
        warnings.simplefilter(on_warning, UserWarning)
        with sarkit.sicd.NitfWriter(file, metadata) as writer:
            writer.write_image(pixels)
    return path


def read(path, scale="complex", shape=None, **keys):
    return read_image(path, FileMeasurement(path=str(path), scale=scale, **keys), shape)


def facts_of(path):
    return SicdReader(path, FileMeasurement(path=str(path), scale="complex"), Radar()).facts()


def factor_of(coefficients, shape=SHAPE, first=(0, 0), scp=(9, 5)):
    """The polynomial's definition: c_ij (row distance [m])^i (column distance [m])^j, summed pixel by pixel."""
    factor = np.zeros(shape)
    for r, c in np.ndindex(shape):
        x = (first[0] + r - scp[0]) * SPACING["Row"]
        y = (first[1] + c - scp[1]) * SPACING["Col"]
        factor[r, c] = sum(value * x**i * y**j for (i, j), value in np.ndenumerate(np.atleast_2d(coefficients)))
    return factor


def db(power):
    with np.errstate(divide="ignore"):
        return np.where(power > 0, 10 * np.log10(power), np.nan)


def test_sigma0_is_the_polynomial_times_power(tmp_path):
    pixels = pixels_of("RE32F_IM32F")
    levels = {"SigmaZeroSFPoly": COEFFICIENTS, "BetaZeroSFPoly": 50.0, "GammaZeroSFPoly": 80.0}
    path = write(tmp_path / "a.nitf", pixels, radiometric=levels)
    found, facts = read(path), facts_of(path)
    factor = factor_of(COEFFICIENTS)
    assert factor.max() / factor.min() > 1.3
    assert found.image_db.dtype == np.float32
    np.testing.assert_allclose(found.image_db, db(np.abs(pixels.astype(complex)) ** 2 * factor), atol=1e-4)
    assert found.findings == (Finding("levels_sigma0", "note", "a.nitf", {"polynomial": "SigmaZeroSFPoly"}),)
    assert (facts.polarisation, facts.frequency_hz, facts.radiometry) == ("VV", pytest.approx(9.6e9), "sigma0_ref")
    assert found.counts == Counts(ROWS * COLUMNS, 0, 0, 0)


@pytest.mark.parametrize("ending", [".NITF", ".ntf", ".sicd"])
def test_integer_pixels(tmp_path, ending):
    pixels = pixels_of("RE16I_IM16I")
    pixels[3, 4] = (-32768, -32768)  # whose square no 16-bit integer holds
    path = write(tmp_path / f"a{ending}", pixels, pixel_type="RE16I_IM16I", radiometric={"SigmaZeroSFPoly": 1e-9})
    expected = np.array([[1e-9 * (int(p["real"]) ** 2 + int(p["imag"]) ** 2) for p in row] for row in pixels])
    np.testing.assert_allclose(read(path).image_db, db(expected), atol=1e-4)


@pytest.mark.parametrize("table", [AMPLITUDES, None])
def test_amplitude_and_phase_pixels(tmp_path, table):
    pixels = pixels_of("AMP8I_PHS8I")
    pixels["amp"][0, :2] = 0, 255
    path = write(
        tmp_path / "a.ntf", pixels, pixel_type="AMP8I_PHS8I", table=table, radiometric={"SigmaZeroSFPoly": 1e-3}
    )
    amplitudes = [float(k) for k in range(256)] if table is None else list(table)
    expected = np.array([[1e-3 * amplitudes[p["amp"]] ** 2 for p in row] for row in pixels])
    found = read(path)
    np.testing.assert_allclose(found.image_db, db(expected), atol=1e-4)
    assert found.counts.zero == np.count_nonzero(expected == 0)


def test_chip_keeps_the_polynomial_of_the_whole_image(tmp_path):
    """To the left, range times the normal of the slant plane points against the flight: columns are turned over."""
    pixels, first, scp = pixels_of("RE32F_IM32F"), (120, 40), (130, 95)
    path = write(
        tmp_path / "a.nitf", pixels, first=first, scp=scp, side="L", radiometric={"SigmaZeroSFPoly": COEFFICIENTS}
    )
    expected = np.abs(pixels.astype(complex)) ** 2 * factor_of(COEFFICIENTS, first=first, scp=scp)
    np.testing.assert_allclose(read(path).image_db, db(expected)[:, ::-1], atol=1e-4)


@pytest.mark.parametrize(
    ("quantity", "angle_deg"), [("beta0", SLOPE_DEG), ("gamma0", 90.0 - SLOPE_DEG)], ids=["beta0", "gamma0"]
)
def test_sigma0_from_other_quantities(tmp_path, quantity, angle_deg):
    """Times the sine of the incidence, or of the grazing angle, which add up to 90 degrees."""
    pixels, polynomial = pixels_of("RE32F_IM32F"), f"{quantity.capitalize().removesuffix('0')}ZeroSFPoly"
    path = write(tmp_path / "a.nitf", pixels, radiometric={polynomial: COEFFICIENTS})
    found, cosine = read(path), np.sin(np.radians(90.0 - angle_deg))
    power = np.abs(pixels.astype(complex)) ** 2 * factor_of(COEFFICIENTS) * cosine
    np.testing.assert_allclose(found.image_db, db(power), atol=1e-4)
    assert facts_of(path).radiometry == "sigma0_ref"
    (level,) = found.findings
    angle = "SlopeAng" if quantity == "beta0" else "IncidenceAng"
    numbers = {"angle_deg": angle_deg, "factor_db": 10 * np.log10(cosine)}
    assert level.code == "levels_converted"
    assert dict(level.numbers) == {
        "quantity": quantity, "polynomial": polynomial, "angle": angle,
        **{key: pytest.approx(value, abs=0.005) for key, value in numbers.items()},
    }  # fmt: skip


def test_without_calibration_levels_are_relative(tmp_path):
    pixels = pixels_of("RE32F_IM32F")
    for radiometric in (None, {"RCSSFPoly": 2.0}):
        path = write(tmp_path / "a.nitf", pixels, radiometric=radiometric)
        found = read(path)
        assert facts_of(path).radiometry is None
        np.testing.assert_allclose(found.image_db, db(np.abs(pixels.astype(complex)) ** 2), atol=1e-4)
        assert found.findings[0].code == "levels_relative"


@pytest.mark.parametrize("scale", ["db", "power", "amplitude"])
def test_scale_must_be_complex(tmp_path, scale):
    path = write(tmp_path / "a.nitf", pixels_of("RE32F_IM32F"))
    with pytest.raises(MeasurementError, match=rf"scale is {scale}, .*a\.nitf is SICD.*set .*scale: complex"):
        read(path, scale)


def test_band_shape_and_plane(tmp_path):
    path = write(tmp_path / "a.nitf", pixels_of("RE32F_IM32F"), plane="GROUND")
    assert read(path, band=1).findings[-1] == Finding("image_plane", "note", "a.nitf", {"plane": "GROUND"})
    with pytest.raises(MeasurementError, match=r"measurement\.band is 2, .*a\.nitf has 1"):
        read(path, band=2)
    with pytest.raises(MeasurementError, match="has 24 x 18 pixels, the scene's image 18 x 24: crop"):
        read(path, shape=(COLUMNS, ROWS))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        (b'"urn:SICD:1.4.0">', b'"urn:SICD:0.4.0">', "version is urn:SICD:0.4.0, expected one of"),
        (b"<NumRows>24<", b"<NumRows>25<", "gives 25 x 18 pixels, its image segments hold 24 x 18"),
        (b"<NumRows>24<", b"<NumRows>23<", "gives 23 x 18 pixels, its image segments hold 24 x 18"),
        (b"<NumCols>18<", b"<NumCols>81<", "gives 24 x 81 pixels, its image segments hold 24 x 18"),
        (b"RE32F_IM32F", b"RE64F_IM64F", "pixel type is RE64F_IM64F, expected one of RE32F_IM32F"),
        (b"RE32F_IM32F", b"RE16I_IM16I", "24 x 18 pixels has 3456 bytes, expected 1728"),
        (b"<SideOfTrack>R", b"<SideOfTrack>L", "columns grow along the flight, SideOfTrack is L"),
        (b"<SideOfTrack>R", b"<SideOfTrack>B", "SideOfTrack is B, expected L or R"),
        (b"<ARPPos><X>6", b"<ARPPos><X>5", "rows do not grow away from the radar"),
        (b">0.0002<", b">-0.002<", "SigmaZeroSFPoly is not positive in 432 of 432 pixels"),
        (b"</SICD>", b"</CISD>", "tag mismatch"),
        (b"NC2", b"NC0", "invalid literal for int"),  # tens of thousands of bands
        (b"NC2", b"C82", "invalid literal for int"),
    ],
)
def test_files_that_contradict_themselves(tmp_path, old, new, words):
    path = write(tmp_path / "a.nitf", pixels_of("RE32F_IM32F"), radiometric={"SigmaZeroSFPoly": COEFFICIENTS})
    content = path.read_bytes()
    assert old in content
    assert len(old) == len(new)  # lengths are in the headers
    path.write_bytes(content.replace(old, new))
    with pytest.raises(MeasurementError, match=rf"^measurement\.path: .*a\.nitf cannot be read as SICD \(.*{words}"):
        read(path)


@pytest.mark.parametrize(
    ("keys", "words"),
    [
        (
            {"doctype": '<!DOCTYPE SICD [<!ENTITY e "1">]>'},
            r"read as SICD \(its XML declares a document type",
        ),
        ({"pixel_type": "AMP8I_PHS8I", "table": AMPLITUDES[:255]}, "AmpTable has 255 amplitudes, expected 256"),
    ],
)
def test_what_the_schema_forbids_is_refused(tmp_path, keys, words):
    pixels = pixels_of(keys.get("pixel_type", "RE32F_IM32F"))
    with pytest.raises(MeasurementError, match=words):
        read(write(tmp_path / "a.nitf", pixels, "ignore", **keys))


def test_other_nitf_files_are_rasters(tmp_path):
    power = np.random.default_rng(5).gamma(4, 0.025, SHAPE).astype(np.float32)
    path = write_raster(tmp_path / "a.ntf", power, driver="NITF")
    assert not SicdReader.matches(path)
    found = read(path, "power", radiometry="sigma0_ref")
    np.testing.assert_allclose(found.image_db, db(power), atol=1e-4)


@pytest.mark.parametrize("name", ["a.nitf", "a.ntf", "a.sicd"])
@pytest.mark.parametrize("content", [b"", b"no image at all", b"NITF02.10", b"NITF02.10IMSICD000"])
def test_empty_and_wrong_files_end_in_a_sentence(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(MeasurementError, match=r"^measurement\.path: .* cannot be read as (a raster|SICD) \(.+\)\.$"):
        read(tmp_path / name)


@pytest.fixture
def measure(tmp_path, geometry, build_case):
    """Write a SICD file of the tiny case's size and make it the measurement of a case with such a radar."""

    def measure(section, pixels=None, radiometry=None, radiometric=(("SigmaZeroSFPoly", 0.01),), **keys):
        pixels = pixels_of("RE32F_IM32F", geometry.shape) if pixels is None else pixels
        path = write(tmp_path / "a.nitf", pixels, radiometric=dict(radiometric), **keys)
        case = build_case(
            radar={"altitude_m": 1000.0, "looks": 1, "polarisation": "VV", **section},
            measurement={"source": "file", "path": str(path), "scale": "complex", "radiometry": radiometry},
        )
        nothing = None  # a file needs no simulator
        return make_measurement(case, geometry, nothing)

    return measure


def test_findings_of_a_measurement(measure, geometry):
    pixels = pixels_of("RE32F_IM32F", geometry.shape)
    pixels[0, :5], pixels[1, 1] = 0, np.nan
    counts, levels, looks = measure({}, pixels).findings[:3]
    none = {"pixels": pixels.size, "no_data": 1, "zero": 5, "negative": 0, "impossible": 0}
    assert counts == Finding("pixels", "note", "a.nitf", none)
    assert levels == Finding("levels_sigma0", "note", "a.nitf", {"polynomial": "SigmaZeroSFPoly"})
    assert (looks.code, looks.numbers["declared"]) == ("looks", 1)
    assert 0.8 <= looks.numbers["looks"] < 1.4
    said = r"scale is complex, but .*; radar\.looks is 9; set radar\.looks to what"
    with pytest.raises(MeasurementError, match=said):
        measure({"looks": 9})


@pytest.mark.parametrize(
    ("section", "keys", "words"),
    [
        ({"polarisation": "HH"}, {}, "polarisation of .*a.nitf is VV, radar.polarisation is HH"),
        ({"polarisation": "VH"}, {"polarisation": "H:V"}, "is HV, radar.polarisation is VH"),
        ({}, {"polarisation": "RHC:LHC"}, "is RHC:LHC, radar.polarisation is VV"),
        ({"band": "C"}, {}, r"carrier of .*a.nitf is 9.6 GHz \(band X\), radar.band is C"),
        ({"band": "X"}, {"frequency_ghz": (200, 202)}, r"201 GHz \(band without a letter\), radar.band is X"),
    ],
)
def test_another_pass_is_refused(measure, section, keys, words):
    with pytest.raises(MeasurementError, match=words):
        measure(section, **keys)


@pytest.mark.parametrize(
    ("section", "keys", "code"),
    [
        ({}, {"polarisation": "UNKNOWN"}, "polarisation_unknown"),
        ({}, {"polarisation": "V:OTHER"}, "polarisation_unknown"),
        ({"band": "L"}, {"reference_frequency": "<RefFreqIndex>1</RefFreqIndex>"}, "carrier_unknown"),
        ({"band": "9.6 GHz"}, {}, "carrier_not_compared"),
    ],
)
def test_what_cannot_be_compared_is_told(measure, section, keys, code):
    assert code in [one.code for one in measure(section, **keys).findings[2:]]


@pytest.mark.parametrize(
    ("of_pass", "configured", "polynomial", "words"),
    [
        ("sigma0_local", None, "SigmaZeroSFPoly", "radiometry of .*a.nitf is sigma0_ref, radar.radiometry is sigm"),
        ("gamma0", "gamma0", "GammaZeroSFPoly", "radiometry is gamma0, .*a.nitf is read as sigma0_ref: leave th"),
        ("sigma0_ref", None, "RCSSFPoly", "measurement.radiometry is missing: .*a.nitf does not say it .*expect"),
    ],
)
def test_another_radiometry_is_refused(measure, of_pass, configured, polynomial, words):
    with pytest.raises(MeasurementError, match=words):
        measure({"radiometry": of_pass}, radiometry=configured, radiometric={polynomial: 1.0})


def test_radiometry_of_relative_levels_is_configured(measure):
    findings = measure({"radiometry": "beta0"}, radiometry="beta0", radiometric={}).findings
    assert findings[1].code == "levels_relative"
    assert measure({}, radiometry="sigma0_ref").findings[1].code == "levels_sigma0"


@pytest.mark.parametrize("cone_deg", [84.9, 95.1, 130.0])
def test_a_squinted_collection_is_refused(tmp_path, cone_deg):
    assert read(write(tmp_path / "near.nitf", pixels_of("RE32F_IM32F"), cone_deg=94.9)).image_db.shape == SHAPE
    path = write(tmp_path / "squinted.nitf", pixels_of("RE32F_IM32F"), cone_deg=cone_deg)
    said = rf"DopplerConeAng is {cone_deg:g}, expected 85 to 95 degrees: images of"
    with pytest.raises(MeasurementError, match=said):
        read(path)
