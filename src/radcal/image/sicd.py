"""Measured images in SICD, NGA's format of complex SAR images, converted to sigma0.

A SICD image shows the ground from above, with shadows pointing down: row numbers grow away from the radar, and the
vector product of the row and column directions points away from the earth. Column numbers therefore grow along the
flight direction if the radar looks right, and against the flight direction if it looks left.
"""

from __future__ import annotations

import logging
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.polynomial.polynomial import polygrid2d
from numpy.typing import NDArray

from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.image.base import Facts, Grid, Reader, ReadImage, image_file
from radcal.reading.images import check_header, reading

if TYPE_CHECKING:
    from radcal.scene.model import Scene

_ENDINGS = (".nitf", ".ntf", ".sicd")
_LEAST_HEADER_BYTES = 388 + 439  # of a file and its first image: MIL-STD-2500C, tables
_HEADER_BYTES = 1_000_000  # a NITF header gives its length in six digits
_LENGTH = slice(342, 354)  # of the file, in its header: MIL-STD-2500C, table A-1
_LINEAR = frozenset("HV")
_SQUINT_DEG = 5.0  # largest angle from zero Doppler
_POLYNOMIALS = (  # each with its quantity, and the angle that converts it to sigma0
    ("SigmaZeroSFPoly", "sigma0", None),
    ("BetaZeroSFPoly", "beta0", "SlopeAng"),
    ("GammaZeroSFPoly", "gamma0", "IncidenceAng"),
)


class SicdReader(Reader):
    """Reader of a SICD image as sigma0 [dB], turned to slant range along rows and azimuth along columns.

    Row 0 is nearest to the radar, and columns grow along the flight.

    Sigma0 is the pixel power times the polynomial SigmaZeroSFPoly of the file, whose variables are the row and column
    distances [m] from the scene centre point. If this polynomial is missing, sigma0 follows from BetaZeroSFPoly or
    GammaZeroSFPoly by one factor for the whole image. If all three polynomials are missing, the result is relative
    power.

    References
    ----------
    NGA.STND.0024-1, "Sensor Independent Complex Data (SICD), Volume 1, Design & Implementation
    Description Document", version 1.3.0 (2021), parameters ImageData, Grid, SCPCOA, Radiometric.
    Ulander, "Radiometric slope correction of synthetic-aperture radar images", IEEE TGRS 34
    (1996): sigma0 = beta0 cos(angle between the normals of ground and image plane).
    """

    called = "SICD"
    gives_radiometry = True

    @classmethod
    def matches(cls, path: Path) -> bool:
        """Whether the first NITF image segment is labelled SICD; without a whole header, the ending decides."""
        if path.suffix.lower() not in _ENDINGS:
            return False
        try:
            with path.open("rb") as file:
                header = file.read(_HEADER_BYTES)
        except OSError:
            return True
        # the first image subheader, "IM" and its identifier IID1, follows the file header (SICD Volume 2, table of
        # image subheader fields); later parts of the file may be damaged
        return len(header) < _LEAST_HEADER_BYTES or b"IMSICD" in header

    def facts(self, scene: Scene | None = None) -> Facts:
        """Polarisation, carrier and radiometry in the XML of the file."""
        del scene
        with self._opened(None) as (_, xml):
            # the clutter cell of all three polynomials is level ground at the height of the scene centre point
            known = any(_value(xml, f"Radiometric/{polynomial}") is not None for polynomial, _, _ in _POLYNOMIALS)
            return Facts(_polarisation(xml), _frequency_hz(xml), "sigma0_ref" if known else None)

    def read(self, grid: Grid) -> ReadImage:
        """Image of the size of the scene's image, whose scale must be complex."""
        config, path = self.config, self.path
        if config.scale != "complex":
            raise MeasurementError(
                f"measurement.scale is {config.scale}, {path} is SICD, whose pixels are complex: "
                "set measurement.scale: complex."
            )
        if config.band not in (None, 1):
            raise MeasurementError(f"measurement.band is {config.band}, {path} has 1.")
        if config.dataset is not None:
            raise MeasurementError(f"measurement.dataset is {config.dataset!r}, {path} is SICD, which has no datasets.")
        with self._opened(grid) as (reader, xml):
            pixel_type = _needed(xml, "ImageData/PixelType")
            backwards = _flown_backwards(xml)
            cone = float(_needed(xml, "SCPCOA/DopplerConeAng"))
            if not abs(cone - 90.0) <= _SQUINT_DEG:
                raise ValueError(
                    f"its SCPCOA/DopplerConeAng is {cone:g}, expected {90 - _SQUINT_DEG:g} to {90 + _SQUINT_DEG:g} "
                    "degrees: images of squinted collections cannot be compared with the simulated one"
                )
            power = _power(reader.read_image(), pixel_type, _value(xml, "ImageData/AmpTable"))
            factor, level = _level(xml, path.name)
            plane, polarisation, frequency_hz = _needed(xml, "Grid/ImagePlane"), _polarisation(xml), _frequency_hz(xml)
        findings = [level]
        if factor is not None:
            power *= factor
        if plane != "SLANT":
            findings.append(Finding("image_plane", "note", path.name, {"plane": str(plane)}))
        if backwards:
            power = power[:, ::-1]
        if polarisation is None:
            findings.append(Finding("polarisation_unknown", "note", path.name))
        if frequency_hz is None:
            findings.append(Finding("carrier_unknown", "note", path.name))
        return ReadImage(*self.in_db(np.ascontiguousarray(power), "power", grid.shape), tuple(findings))

    @contextmanager
    def _opened(self, grid: Grid | None) -> Iterator[tuple[Any, Any]]:
        """Context with the library's reader and the XML, after the checks of headers and, for a grid, of the size."""
        from sarkit import sicd

        image = image_file(self.path, self.config, None if grid is None else grid.shape)
        with reading(image, self.called), self.path.open("rb") as file:
            length, found = int(file.read(_LENGTH.stop)[_LENGTH]), self.path.stat().st_size
            if found < length:
                raise ValueError(f"it has {found} bytes, its header gives {length}")
            logging.getLogger("jbpy").setLevel(logging.CRITICAL)  # it would print what the sentence says
            file.seek(0)
            reader = sicd.NitfReader(file)
            tree = reader.metadata.xmltree
            if tree.docinfo.doctype:
                raise ValueError("its XML declares a document type, with which entities could be smuggled in")
            version = str(tree.getroot().tag)[1:].partition("}")[0]
            if version not in sicd.VERSION_INFO:
                raise ValueError(f"its version is {version}, expected one of {', '.join(sicd.VERSION_INFO)}")
            xml = sicd.XmlHelper(tree)
            pixel_type = _needed(xml, "ImageData/PixelType")
            if pixel_type not in sicd.PIXEL_TYPES:
                raise ValueError(f"its pixel type is {pixel_type}, expected one of {', '.join(sicd.PIXEL_TYPES)}")
            size = (_needed(xml, "ImageData/NumRows"), _needed(xml, "ImageData/NumCols"))
            check_header(image, size, np.dtype(np.complex64))
            _check_segments(reader, xml, sicd.PIXEL_TYPES[pixel_type]["bytes"])
            yield reader, xml


def _value(xml: Any, name: str) -> Any:
    """Value of a parameter in the XML, None where it is missing."""
    return xml.load("./" + "/".join("{*}" + part for part in name.split("/")))


def _needed(xml: Any, name: str) -> Any:
    """Value of a mandatory parameter in the XML."""
    value = _value(xml, name)
    if value is None:
        raise ValueError(f"its XML has no {name}")
    return value


def _check_segments(reader: Any, xml: Any, pixel_bytes: int) -> None:
    """Compare the image size in the XML with the NITF segments; the library does not initialise missing pixels."""
    rows, columns = (_needed(xml, f"ImageData/{name}") for name in ("NumRows", "NumCols"))
    segments = [s for s in reader.jbp["ImageSegments"] if s["subheader"]["IID1"].value.startswith("SICD")]
    sizes = [(s["subheader"]["NROWS"].value, s["subheader"]["NCOLS"].value) for s in segments]
    if sum(n for n, _ in sizes) != rows or any(n != columns for _, n in sizes):
        held = ", ".join(f"{n} x {m}" for n, m in sizes) or "none"
        raise ValueError(f"its XML gives {rows} x {columns} pixels, its image segments hold {held}")
    for segment, (n, m) in zip(segments, sizes, strict=True):
        if segment["Data"].size != n * m * pixel_bytes:
            raise ValueError(
                f"an image segment of {n} x {m} pixels has {segment['Data'].size} bytes, expected {n * m * pixel_bytes}"
            )


def _power(pixels: NDArray[Any], pixel_type: str, amplitudes: NDArray[np.float64] | None) -> NDArray[np.float64]:
    """Power (squared modulus) of the complex pixels stored in a file."""
    if pixel_type == "AMP8I_PHS8I":
        # without a table the stored number is the amplitude
        table = np.arange(256.0) if amplitudes is None else np.asarray(amplitudes, dtype=np.float64)
        if table.shape != (256,):
            raise ValueError(f"its AmpTable has {table.size} amplitudes, expected 256")
        return np.asarray((table**2)[pixels["amp"]])
    parts = (pixels.real, pixels.imag) if pixel_type == "RE32F_IM32F" else (pixels["real"], pixels["imag"])
    real, imaginary = (part.astype(np.float64) for part in parts)
    return np.asarray(real**2 + imaginary**2)


def _level(xml: Any, name: str) -> tuple[NDArray[np.float64] | None, Finding]:
    """Factors by which pixel power is multiplied to give sigma0, shape (rows, columns), and a finding on them."""
    for polynomial, quantity, angle in _POLYNOMIALS:
        coefficients = _value(xml, f"Radiometric/{polynomial}")
        if coefficients is None:
            continue
        # rows and columns count from the corner of the full image; those of a chip do not begin at 0
        along_row, along_column = (
            (np.arange(_needed(xml, f"ImageData/Num{axis}s")) + _needed(xml, f"ImageData/First{axis}") - centre)
            * _needed(xml, f"Grid/{axis}/SS")
            for axis, centre in zip(("Row", "Col"), _needed(xml, "ImageData/SCPPixel"), strict=True)
        )
        factor = polygrid2d(along_row, along_column, coefficients)
        bad = np.count_nonzero(~((factor > 0) & np.isfinite(factor)))
        if bad:
            raise ValueError(f"its {polynomial} is not positive in {bad} of {factor.size} pixels")
        if angle is None:
            return factor, Finding("levels_sigma0", "note", name, {"polynomial": polynomial})
        degrees = _needed(xml, f"SCPCOA/{angle}")
        cosine = float(np.cos(np.radians(degrees)))
        if not 0 < cosine <= 1:
            raise ValueError(f"its SCPCOA/{angle} is {degrees:g}, expected 0 to 90 degrees")
        numbers: dict[str, float | str] = {
            "quantity": quantity,
            "polynomial": polynomial,
            "angle": angle,
            "angle_deg": float(degrees),
            "factor_db": float(10 * np.log10(cosine)),
        }
        return factor * cosine, Finding("levels_converted", "note", name, numbers)
    return None, Finding("levels_relative", "note", name)


def _flown_backwards(xml: Any) -> bool:
    """Whether columns grow against the flight direction; raises a ValueError if the metadata contradict each other."""
    row, column = (_needed(xml, f"Grid/{axis}/UVectECF") for axis in ("Row", "Col"))
    position, velocity = _needed(xml, "SCPCOA/ARPPos"), _needed(xml, "SCPCOA/ARPVel")
    side = _needed(xml, "SCPCOA/SideOfTrack")
    if side not in ("L", "R"):
        raise ValueError(f"its SideOfTrack is {side}, expected L or R")
    if not np.dot(row, _needed(xml, "GeoData/SCP/ECF") - position) > 0:
        raise ValueError("its rows do not grow away from the radar")
    along = float(np.dot(column, velocity))
    if not (along < 0 if side == "L" else along > 0):
        raise ValueError(f"its columns grow {'along' if along > 0 else 'against'} the flight, SideOfTrack is {side}")
    return along < 0


def _polarisation(xml: Any) -> str | None:
    """Transmitted and received polarisation; None where the file says UNKNOWN or OTHER."""
    text = _value(xml, "ImageFormation/TxRcvPolarizationProc")
    if text is None or "UNKNOWN" in text or "OTHER" in text:
        return None
    pair = text.split(":")
    return "".join(pair) if len(pair) == 2 and _LINEAR.issuperset(pair) else str(text)


def _frequency_hz(xml: Any) -> float | None:
    """Centre of the processed band [Hz]; None if it is missing or relative to an undisclosed reference frequency."""
    low, high = (_value(xml, f"ImageFormation/TxFrequencyProc/{name}") for name in ("MinProc", "MaxProc"))
    if low is None or high is None or _value(xml, "RadarCollection/RefFreqIndex"):
        return None
    centre = 0.5 * (float(low) + float(high))
    return centre if np.isfinite(centre) and centre > 0 else None
