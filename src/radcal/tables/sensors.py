"""Values of known sensors and products: defaults of section ``radar`` if ``radar.sensor`` names the sensor.

Each value is listed with the source that it was read from. A value that was found in no source is missing in this
module, and a case must give the value. ``docs/sensors.md`` contains the table that :func:`sensors_table` returns.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

__all__ = ["SENSORS", "Sensor", "SensorName", "sensors_table"]

SensorName = Literal[
    "sentinel1_iw_grdh",
    "terrasarx_stripmap",
    "alos2_fine_l15",
    "iceye_strip_slc",
    "capella_strip_slc",
    "airsar_c",
    "airsar_l",
    "airsar_p",
]

_TABLE_5_1 = (
    "Sentinel-1 Product Definition, S1-RS-MDA-52-7440, table 5-1 (as transcribed in stactools-packages/sentinel1, "
    "grd/properties.py)"
)
_S1_SHEET = "ESA, Sentinel-1A data sheet (2013; slideshare.net/esaops/sentinel1), mission profile and platform"
_S1_FACTS = "ESA, Sentinel-1 facts and figures (esa.int), instrument"
_TSX_DLR = "DLR, Earth Observation Center, mission TerraSAR-X (dlr.de/de/eoc), text and orbit parameters"
_TSX_PRODUCTS = "DLR, TerraSAR-X Basic Product Specification Document, TX-GS-DD-3302 issue 1.7, section 2.2"
_ALOS2_SITE = "Monash University, SMAPEx-4, PALSAR-2 (smapex.monash.edu.au)"
_ALOS2_MODES = "PASCO, PALSAR-2 specifications (alos-pasco.com/en/alos-2/spec), stripmap 10 m"
_ICEYE_HELP = "CATALYST help (catalyst.earth), sensor ICEYE"
_ICEYE_PORTAL = "EARSC portal (earsc-portal.eu), ICEYE, satellite description: 560 to 580 km"
_ICEYE_ESA = "ESA, ICEYE full archive and tasking (earth.esa.int): standard stripmap"
_ICEYE_GUIDE = "ICEYE product guide (sar.iceye.com, 5.2.8), types of SAR data products, complex image parameters"
_CAPELLA_HELP = "CATALYST help (catalyst.earth), sensor Capella"
_CAPELLA_PRODUCTS = "Capella Space, SAR imagery products (support.capellaspace.com): single look complex"
_AIRSAR_PDS = "NASA PDS (pds.nasa.gov), data set NDC8-E-ASAR-4-RADAR-V1.0: wavelength"


@dataclass(frozen=True)
class _Value:
    """Value of a configuration key and its source; a length in ground range must be converted to slant range."""

    value: Any
    source: str
    ground_range: bool = False


@dataclass(frozen=True)
class Sensor:
    """Sensor and product, with values for keys of section ``radar``.

    Attributes
    ----------
    values : mapping
        Value and source of each known key of section ``radar``.
    asks : tuple of str
        Keys that the case must give; the case may give ``depression_deg`` instead of ``incidence_deg``.
    orbit : bool
        Whether the sensor is in orbit, so that its track does not head north.
    """

    values: Mapping[str, _Value]
    asks: tuple[str, ...]
    orbit: bool = True

    def missing(self, given: Mapping[str, Any]) -> list[str]:
        """Required keys that are missing in section ``radar`` of the case."""
        angles = ("depression_deg", "incidence_deg")
        return [
            key
            for key in self.asks
            if all(given.get(name) is None for name in (angles if key == "incidence_deg" else (key,)))
        ]

    def values_at(self, incidence_deg: float) -> dict[str, Any]:
        """Values of the sensor by key; lengths in ground range are converted to slant range.

        Parameters
        ----------
        incidence_deg : float
            Incidence on level ground at the scene's centre [deg]. Slant range is ground range times the sine of this
            angle.
        """
        sine = math.sin(math.radians(incidence_deg))
        return {key: item.value * sine if item.ground_range else item.value for key, item in self.values.items()}


_OF_PRODUCT = ("polarisation", "nesz_db")
_GRID = ("range_resolution_m", "azimuth_resolution_m", "range_spacing_m", "azimuth_spacing_m", "looks")


def _airsar(band: str, wavelength_m: float) -> Sensor:
    frequency = round(0.299792458 / wavelength_m, 3)
    return Sensor(
        {"band": _Value(band, _AIRSAR_PDS), "frequency_ghz": _Value(frequency, f"{_AIRSAR_PDS} {wavelength_m:g} m")},
        ("altitude_m", "incidence_deg", "look_side", *_GRID, *_OF_PRODUCT),
        orbit=False,
    )


SENSORS: Mapping[str, Sensor] = {
    "sentinel1_iw_grdh": Sensor(
        {
            "altitude_m": _Value(693_000.0, _S1_SHEET),
            "look_side": _Value("right", _S1_SHEET),
            "band": _Value("C", _S1_FACTS),
            "frequency_ghz": _Value(5.405, _S1_FACTS),
            "range_resolution_m": _Value(20.0, _TABLE_5_1, ground_range=True),
            "azimuth_resolution_m": _Value(22.0, _TABLE_5_1),
            "range_spacing_m": _Value(10.0, _TABLE_5_1, ground_range=True),
            "azimuth_spacing_m": _Value(10.0, _TABLE_5_1),
            "looks": _Value(4.4, f"{_TABLE_5_1}: ENL of 5 x 1 looks"),
        },
        ("incidence_deg", *_OF_PRODUCT),
    ),
    "terrasarx_stripmap": Sensor(
        {
            "altitude_m": _Value(514_000.0, _TSX_DLR),
            "look_side": _Value("right", _TSX_PRODUCTS),
            "band": _Value("X", _TSX_DLR),
            "frequency_ghz": _Value(9.65, _TSX_DLR),
        },
        ("incidence_deg", *_GRID, *_OF_PRODUCT),
    ),
    "alos2_fine_l15": Sensor(
        {
            "altitude_m": _Value(628_000.0, _ALOS2_SITE),
            "band": _Value("L", _ALOS2_SITE),
            "range_spacing_m": _Value(6.25, f"{_ALOS2_MODES}: level 1.5", ground_range=True),
            "azimuth_spacing_m": _Value(6.25, f"{_ALOS2_MODES}: level 1.5"),
            "looks": _Value(2, f"{_ALOS2_MODES}: level 1.5"),
        },
        ("incidence_deg", "look_side", "range_resolution_m", "azimuth_resolution_m", *_OF_PRODUCT),
    ),
    "iceye_strip_slc": Sensor(
        {
            "altitude_m": _Value(570_000.0, _ICEYE_PORTAL),
            "band": _Value("X", _ICEYE_HELP),
            "frequency_ghz": _Value(9.65, _ICEYE_HELP),
            "polarisation": _Value("VV", _ICEYE_HELP),
            "range_resolution_m": _Value(3.0, _ICEYE_ESA, ground_range=True),
            "azimuth_resolution_m": _Value(3.0, _ICEYE_GUIDE),
            "azimuth_spacing_m": _Value(1.6, _ICEYE_GUIDE),
            "looks": _Value(1, _ICEYE_GUIDE),
        },
        ("incidence_deg", "look_side", "range_spacing_m", "nesz_db"),
    ),
    "capella_strip_slc": Sensor(
        {
            "band": _Value("X", _CAPELLA_HELP),
            "frequency_ghz": _Value(9.65, _CAPELLA_HELP),
            "polarisation": _Value("HH", _CAPELLA_HELP),
            "range_resolution_m": _Value(0.75, _CAPELLA_HELP),
            "looks": _Value(1, _CAPELLA_PRODUCTS),
        },
        (
            "altitude_m", "incidence_deg", "look_side", "azimuth_resolution_m", "range_spacing_m", "azimuth_spacing_m",
            "nesz_db",
        ),
    ),
    "airsar_c": _airsar("C", 0.0566),
    "airsar_l": _airsar("L", 0.2398),
    "airsar_p": _airsar("P", 0.6813),
}  # fmt: skip


def sensors_table() -> str:
    """Markdown table of all values with their sources, and of the keys that a case must give."""
    lines = ["| `radar.sensor` | key | value | source |", "|---|---|---|---|"]
    for name, sensor in SENSORS.items():
        for key, item in sensor.values.items():
            value = f"{item.value:g}" if isinstance(item.value, float) else str(item.value)
            lines.append(f"| `{name}` | `{key}` | {value}{' in ground range' * item.ground_range} | {item.source} |")
        asked = ", ".join(f"`{key}`" for key in sensor.asks)
        lines.append(f"| `{name}` | {asked} | asked for | read in no source, or different from image to image |")
    return "\n".join(lines) + "\n"
