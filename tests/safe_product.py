"""Small Sentinel-1 product with a true orbit and tables of known functions, and places found by solving for them."""

import numpy as np
from pyproj import Transformer
from raster_files import write_raster
from rasterio.transform import from_origin
from scipy.optimize import fsolve

LINES, PIXELS = 120, 100
LINE_S, SPACING_M = 1.4965e-3, 10.0
NEAR_M = 850_000.0
START = np.datetime64("2021-12-23T05:11:22.594441", "ns")
STEM = "s1b-iw-grd-vv-20211223t051122-20211223t051147-030148-039993-001"
NAME = "S1B_IW_GRDH_1SDV_20211223T051122_20211223T051147_030148_039993_5371.SAFE"
_EARTH = Transformer.from_crs("EPSG:4979", "EPSG:4978", always_xy=True)


def radar_at(time):
    """Place of a satellite on a circular, inclined orbit, in coordinates that turn with the earth [m]."""
    along, tilt, turn = np.radians(138.0) + 1.0618e-3 * time, np.radians(98.18), np.radians(195.0) - 7.2921e-5 * time
    flat = 7.07e6 * np.array([np.cos(along), np.sin(along) * np.cos(tilt), np.sin(along) * np.sin(tilt)])
    cosine, sine = np.cos(turn), np.sin(turn)
    return np.array([cosine * flat[0] - sine * flat[1], sine * flat[0] + cosine * flat[1], flat[2]])


def velocity_at(time):
    return (radar_at(time + 0.01) - radar_at(time - 0.01)) / 0.02


def slant_m(line, pixel):
    """Slant range of a pixel: ground range is 1.6 (r - near) and grows by 40 m from -0.05 to 0.25 s."""
    return NEAR_M + (SPACING_M * pixel - 40.0 * (line * LINE_S + 0.05) / 0.3) / 1.6


def place_of(line, pixel, height=0.0):
    """Longitude and latitude of what a pixel shows at a height: zero Doppler and the pixel's slant range."""
    radar, velocity = radar_at(line * LINE_S), velocity_at(line * LINE_S)

    def missed(place):
        ray = np.array(_EARTH.transform(place[0], place[1], height)) - radar
        return [ray @ velocity / 7e3, np.linalg.norm(ray) - slant_m(line, pixel)]

    below = Transformer.from_crs("EPSG:4978", "EPSG:4979", always_xy=True).transform(*radar)
    found = fsolve(missed, [below[0] - 7.0, below[1] + 1.0], xtol=1e-12)  # to the west: right of a descending pass
    assert np.abs(missed(found)).max() < 1e-3
    return float(found[0]), float(found[1])


def divisor(line, pixel):
    """sigmaNought: linear in each of line and pixel, so that bilinear interpolation is exact."""
    return 300.0 + 0.8 * line + 1.7 * pixel + 0.004 * line * pixel


def noise(line, pixel):
    """Noise of range and azimuth tables."""
    factor = np.where(pixel < 50, 1.0 + 0.003 * line, 1.4 - 0.001 * line)
    return noise_over_range(line, pixel) * factor


def noise_over_range(line, pixel):
    """Noise of the range table alone."""
    return 200.0 + 0.3 * line + 0.9 * pixel + 0.001 * line * pixel


def digital_numbers():
    """Digital numbers without any order that a shift would leave."""
    line, pixel = np.indices((LINES, PIXELS))
    return (100 + (7 * line + 13 * pixel + line * pixel) % 701).astype(np.uint16)


def _words(values):
    return " ".join(f"{value:.10e}" for value in np.atleast_1d(values))


def _time(seconds):
    return str(START + np.timedelta64(round(seconds * 1e9), "ns"))


def _annotation(polarisation, noise_removed):
    orbit = "".join(
        f"<orbit><time>{_time(t)}</time>"
        + "".join(
            f"<{kind}>"
            + "".join(f"<{axis}>{value:.9f}</{axis}>" for axis, value in zip("xyz", of(t), strict=True))
            + f"</{kind}>"
            for kind, of in (("position", radar_at), ("velocity", velocity_at))
        )
        + "</orbit>"
        for t in np.arange(-30.0, 31.0, 10.0)
    )
    conversions = "".join(
        f"<coordinateConversion><azimuthTime>{_time(t)}</azimuthTime><sr0>{NEAR_M}</sr0>"
        f"<srgrCoefficients>{offset} 1.6</srgrCoefficients></coordinateConversion>"
        for t, offset in ((-0.05, 0.0), (0.25, 40.0))
    )
    points = ""
    for line in (0, 60, LINES - 1):
        for pixel in (0, 33, 66, PIXELS - 1):
            height = 10.0 * pixel  # heights of the grid are of no use to the positions
            longitude, latitude = place_of(line, pixel, height)
            points += (
                f"<geolocationGridPoint><line>{line}</line><pixel>{pixel}</pixel><latitude>{latitude:.12f}</latitude>"
                f"<longitude>{longitude:.12f}</longitude><height>{height}</height></geolocationGridPoint>"
            )
    swaths = merged = ""
    for name, first, last, bandwidth in (("IW1", 0, 49, 14.1e6), ("IW2", 50, PIXELS - 1, 12.1e6)):
        swaths += (
            f"<swathProcParams><swath>{name}</swath>"
            f"<rangeProcessing><windowType>Hamming</windowType><windowCoefficient>0.7</windowCoefficient>"
            f"<lookBandwidth>{bandwidth}</lookBandwidth><numberOfLooks>5</numberOfLooks></rangeProcessing>"
            "<azimuthProcessing><windowType>NONE</windowType><windowCoefficient>0</windowCoefficient>"
            "<lookBandwidth>327</lookBandwidth><numberOfLooks>1</numberOfLooks></azimuthProcessing></swathProcParams>"
        )
        merged += (
            f"<swathMerge><swath>{name}</swath><swathBoundsList><swathBounds><firstAzimuthLine>0</firstAzimuthLine>"
            f"<lastAzimuthLine>{LINES - 1}</lastAzimuthLine><firstRangeSample>{first}</firstRangeSample>"
            f"<lastRangeSample>{last}</lastRangeSample></swathBounds></swathBoundsList></swathMerge>"
        )
    return f"""<product><adsHeader><missionId>S1B</missionId><productType>GRD</productType>
<polarisation>{polarisation}</polarisation><mode>IW</mode></adsHeader>
<generalAnnotation><productInformation><pass>Descending</pass><platformHeading>-166.3</platformHeading>
<radarFrequency>5.405e9</radarFrequency></productInformation><orbitList>{orbit}</orbitList></generalAnnotation>
<imageAnnotation><imageInformation><productFirstLineUtcTime>{START}</productFirstLineUtcTime>
<rangePixelSpacing>{SPACING_M}</rangePixelSpacing><azimuthPixelSpacing>9.7</azimuthPixelSpacing>
<azimuthTimeInterval>{LINE_S}</azimuthTimeInterval><numberOfSamples>{PIXELS}</numberOfSamples>
<numberOfLines>{LINES}</numberOfLines></imageInformation><processingInformation>
<thermalNoiseCorrectionPerformed>{noise_removed}</thermalNoiseCorrectionPerformed>
<swathProcParamsList>{swaths}</swathProcParamsList></processingInformation></imageAnnotation>
<geolocationGrid><geolocationGridPointList>{points}</geolocationGridPointList></geolocationGrid>
<coordinateConversion><coordinateConversionList>{conversions}</coordinateConversionList></coordinateConversion>
<swathMerging><swathMergeList>{merged}</swathMergeList></swathMerging></product>"""


def _vectors(name, quantity, of):
    """Table on lines outside and inside of the image, each with other pixels, in no order."""
    text = ""
    for line, step in ((130, 40), (-10, 25), (45, 33)):
        pixel = np.append(np.arange(0, PIXELS - 1, step), PIXELS - 1)
        text += (
            f"<{name}><line>{line}</line><pixel>{' '.join(map(str, pixel))}</pixel>"
            f"<{quantity}>{_words(of(float(line), pixel.astype(float)))}</{quantity}></{name}>"
        )
    return f"<{name}List>{text}</{name}List>"


def _azimuth_noise():
    text = ""
    lines = np.array([0, 20, 90, LINES - 1])
    for first, last, factors in ((0, 49, 1.0 + 0.003 * lines), (50, PIXELS - 1, 1.4 - 0.001 * lines)):
        text += (
            f"<noiseAzimuthVector><firstAzimuthLine>0</firstAzimuthLine><lastAzimuthLine>{LINES - 1}</lastAzimuthLine>"
            f"<firstRangeSample>{first}</firstRangeSample><lastRangeSample>{last}</lastRangeSample>"
            f"<line>{' '.join(map(str, lines))}</line><noiseAzimuthLut>{_words(factors)}</noiseAzimuthLut>"
            "</noiseAzimuthVector>"
        )
    return f"<noiseAzimuthVectorList>{text}</noiseAzimuthVectorList>"


def write_product(folder, pixels=None, polarisation="VV", noise_removed="false"):
    """Write a product of one polarisation, and a manifest that lists a second one whose files are missing."""
    safe = folder / NAME
    (safe / "annotation/calibration").mkdir(parents=True)
    (safe / "measurement").mkdir()
    items = ""
    for stem in (STEM, STEM.replace("-vv-", "-vh-").replace("-001", "-002")):
        name = stem.replace("-", "")
        for prefix, kind, href in (
            ("product", "s1Level1ProductSchema", f"./annotation/{stem}.xml"),
            ("calibration", "s1Level1CalibrationSchema", f"./annotation/calibration/calibration-{stem}.xml"),
            ("noise", "s1Level1NoiseSchema", f"./annotation/calibration/noise-{stem}.xml"),
            ("", "s1Level1MeasurementSchema", f"./measurement/{stem}.tiff"),
        ):
            items += (
                f'<dataObject ID="{prefix}{name}" repID="{kind}"><byteStream><fileLocation href="{href}"/></byteStream>'
                "</dataObject>"
            )
    (safe / "manifest.safe").write_text(f"<XFDU><dataObjectSection>{items}</dataObjectSection></XFDU>")
    (safe / f"annotation/{STEM}.xml").write_text(_annotation(polarisation, noise_removed))
    tables = safe / "annotation/calibration"
    (tables / f"calibration-{STEM}.xml").write_text(
        f"<calibration>{_vectors('calibrationVector', 'sigmaNought', divisor)}</calibration>"
    )
    over_range = _vectors("noiseRangeVector", "noiseRangeLut", noise_over_range)
    (tables / f"noise-{STEM}.xml").write_text(f"<noise>{over_range}{_azimuth_noise()}</noise>")
    values = digital_numbers() if pixels is None else pixels
    write_raster(safe / f"measurement/{STEM}.tiff", values)
    return safe


def write_ground(code):
    """Write level ground at 120 m, and land cover of one code, about the middle of the product."""
    x, y = Transformer.from_crs("EPSG:4326", "EPSG:32633", always_xy=True).transform(*place_of(60.0, 50.0, 120.0))
    where = {"crs": "EPSG:32633", "transform": from_origin(x - 300.0, y + 300.0, 15.0, 15.0)}
    write_raster("height.tif", np.full((40, 40), 120.0, dtype=np.float32), **where)
    write_raster("cover.tif", np.full((40, 40), code, dtype=np.uint8), **where)
