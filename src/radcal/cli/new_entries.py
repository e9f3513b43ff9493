"""Entries of a new case: each entry is one option of ``radcal new`` and one line of the case file.

For a further key, add one entry.
"""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["ENTRIES", "Entry"]


@dataclass(frozen=True)
class Entry:
    """Key of a new case whose value the user decides.

    Attributes
    ----------
    option : str
        Option on the command line.
    key : str
        Key of the case in dotted form, such as ``scene.names``.
    text : str
        Help of the option, and comment in the case.
    kind : type
        Type of the value: str, float or int.
    several : bool
        Whether the option may be repeated.
    optional : bool
        Whether the key's default is right in most cases, so that the key is not marked FILL_IN.
    """

    option: str
    key: str
    text: str
    kind: type[str | float | int] = str
    several: bool = False
    optional: bool = False

    @property
    def name(self) -> str:
        """Name of the option without dashes."""
        return self.option.split(",")[0].strip("-").replace("-", "_")


ENTRIES = (
    Entry("--elevation", "scene.elevation", "raster of heights [m]; left out for a land cover in slant range"),
    Entry("--materials,--landcover", "scene.materials", "raster of land cover, as whole codes from 1 to 255"),
    Entry(
        "--landcover-preset", "scene.landcover", "land-cover map with known codes: esa_worldcover, corine or nlcd",
        optional=True,
    ),
    Entry("--names", "scene.names", "JSON file of names by code; without it, one is written beside the case"),
    Entry("--vertical-datum", "scene.vertical_datum", "vertical datum of the heights, such as EGM2008"),
    Entry("--near-incidence", "scene.near_incidence_deg", "incidence angle at the first row [deg]", float),
    Entry("--far-incidence", "scene.far_incidence_deg", "incidence angle at the last row [deg]", float),
    Entry(
        "--image", "measurement.path",
        "measured image, Sentinel-1 SAFE folder, or the word synthetic, or none for radcal simulate alone",
    ),
    Entry("--band", "measurement.band", "number of the raster band, from 1", int),
    Entry("--dataset", "measurement.dataset", "name of the array in an npz, mat or HDF5 file", optional=True),
    Entry("--scale", "measurement.scale", "scale of the image's numbers: db, power, amplitude or complex"),
    Entry(
        "--sensor", "radar.sensor",
        "sensor of docs/sensors.md, which decides most keys of section radar, such as sentinel1_iw_grdh", optional=True,
    ),
    Entry("--radiometry", "radar.radiometry", "quantity: sigma0_ref, sigma0_local, beta0, gamma0 or gamma0_rtc"),
    Entry("--polarisation", "radar.polarisation", "transmitted and received polarisation: HH, HV, VH or VV"),
    Entry("--frequency", "radar.frequency_ghz", "carrier frequency [GHz]", float),
    Entry("--altitude", "radar.altitude_m", "height of the track above the scene [m]", float),
    Entry("--depression", "radar.depression_deg", "depression angle to the scene's centre [deg]", float),
    Entry(
        "--incidence", "radar.incidence_deg", "incidence at the scene's centre [deg], instead of depression", float,
        optional=True,
    ),
    Entry(
        "--heading", "radar.heading_deg",
        "heading of the track over the scene, clockwise from north [deg]; a case without this key has a track to the "
        "grid's north", float,
    ),
    Entry("--look-side", "radar.look_side", "side to which the radar looks: right (east) or left (west)"),
    Entry("--range-resolution", "radar.range_resolution_m", "-3 dB width in slant range [m]", float),
    Entry("--azimuth-resolution", "radar.azimuth_resolution_m", "-3 dB width in azimuth [m]", float),
    Entry("--range-spacing", "radar.range_spacing_m", "pixel spacing in slant range [m]", float),
    Entry("--azimuth-spacing", "radar.azimuth_spacing_m", "pixel spacing in azimuth [m]", float),
    Entry("--looks", "radar.looks", "independent looks averaged in power", float),
    Entry("--nesz", "radar.nesz_db", "noise-equivalent sigma0 [dB]", float),
    Entry("--material", "materials.calibrated", "name of a material to calibrate; all if none is named", several=True),
    Entry(
        "--fixed", "materials.fixed",
        "law of another material: constant gamma [dB] as water=-17, or a law of docs/laws.md with its parameters as "
        "road=mangia:-28,8,14,8", several=True,
    ),
)  # fmt: skip
