"""Acquisition of a Sentinel-1 product at a scene, read from its annotation, and comparison with section ``radar``."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.bands import letter_band, within_band
from radcal.config import Radar
from radcal.findings import Finding
from radcal.radar.radiometry import nesz_db

# over one degree the laws of natural surfaces change by up to 1 dB (docs/measured_images.md, "One incidence")
_INCIDENCE_DEG = 1.0
_HEADING_DEG = 5.0
_NOISE_DB = 1.0
_LOOKS = 1.0
_RATIO = 1.25
_TOLD = (
    "sensor", "polarisation", "start", "pass_direction", "heading_deg", "look_side", "incidence_deg", "looks",
    "range_spacing_m", "azimuth_spacing_m",
)  # fmt: skip
_FREQUENCY = 0.01  # relative; the bandwidth of most sensors is larger


@dataclass(frozen=True)
class Acquisition:
    """Acquisition of a product, with the values that hold at one scene.

    Attributes
    ----------
    product : str
        Name of the product.
    sensor : str
        Mission and mode, such as "S1B IW GRD".
    start : str
        Time of the first line (UTC).
    pass_direction : str
        ``ascending`` or ``descending``.
    heading_deg : float
        Heading of the flight over the scene, at right angles to the look direction at the scene's middle, clockwise
        from true north [deg, 0 to 360]. The annotated ``platformHeading`` differs by the convergence of the meridians.
    look_side : str
        ``right`` or ``left``.
    incidence_deg : float
        Incidence angle on the ellipsoid at the middle of the scene [deg].
    altitude_m : float
        Height of the radar above the ellipsoid [m].
    frequency_hz : float
        Carrier frequency [Hz].
    polarisation : str
        Transmitted and received polarisation.
    looks : float
        Equivalent number of looks; if no source gives it, the product of the two ``numbers_of_looks``.
    numbers_of_looks : (int, int)
        Numbers of looks in range and in azimuth; the looks overlap and are therefore not independent.
    range_spacing_m, azimuth_spacing_m : float
        Pixel spacings in ground range and azimuth [m].
    range_resolution_m, azimuth_resolution_m : float
        -3 dB widths of a look's response in slant range and azimuth [m].
    nesz_db : tuple of (float, float)
        Pairs of incidence angle [deg], ascending, and noise-equivalent sigma0 [dB] over the scene.
    noise_removed : bool
        Whether the processor has subtracted thermal noise.
    """

    product: str
    sensor: str
    start: str
    pass_direction: str
    heading_deg: float
    look_side: str
    incidence_deg: float
    altitude_m: float
    frequency_hz: float
    polarisation: str
    looks: float
    numbers_of_looks: tuple[int, int]
    range_spacing_m: float
    azimuth_spacing_m: float
    range_resolution_m: float
    azimuth_resolution_m: float
    nesz_db: tuple[tuple[float, float], ...]
    noise_removed: bool

    @property
    def slant_spacing_m(self) -> float:
        """Pixel spacing in slant range at the scene [m]."""
        return self.range_spacing_m * float(np.sin(np.radians(self.incidence_deg)))

    @property
    def lengths_m(self) -> dict[str, float]:
        """Resolutions and spacings in slant range and azimuth [m], by the keys of section ``radar``."""
        return {
            "range_resolution_m": self.range_resolution_m,
            "azimuth_resolution_m": self.azimuth_resolution_m,
            "range_spacing_m": self.slant_spacing_m,
            "azimuth_spacing_m": self.azimuth_spacing_m,
        }

    def finding(self) -> Finding:
        """Finding that describes the acquisition."""
        levels = [level for _, level in self.nesz_db]
        numbers: dict[str, float | str] = {name: getattr(self, name) for name in _TOLD}
        numbers |= {"frequency_ghz": self.frequency_hz / 1e9}
        numbers |= dict(zip(("range_looks", "azimuth_looks"), self.numbers_of_looks, strict=True))
        numbers |= {"least_nesz_db": min(levels), "largest_nesz_db": max(levels)}
        return Finding("acquisition", "note", self.product, numbers)


def radar_keys(acquisition: Acquisition) -> dict[str, tuple[Any, str]]:
    """Values of the keys of section ``radar`` for an acquisition, each with a remark, which may be an empty text.

    Parameters
    ----------
    acquisition : Acquisition
        Acquisition at a scene.
    """
    a = acquisition
    noise = [list(pair) for pair in a.nesz_db]
    return {
        "altitude_m": (float(round(a.altitude_m)), ""),
        "incidence_deg": (round(a.incidence_deg, 2), "at the middle of the scene, on the ellipsoid"),
        # 359.999 is rounded to 360, which is 0
        "heading_deg": (round(a.heading_deg, 2) % 360.0, "over the scene, from true north"),
        "look_side": (a.look_side, f"to {look_azimuth_deg(a):.1f} deg from north"),
        "band": (letter_band(a.frequency_hz) or "unknown", ""),
        "frequency_ghz": (float(f"{a.frequency_hz / 1e9:.6g}"), ""),
        "polarisation": (a.polarisation, ""),
        "range_resolution_m": (round(a.range_resolution_m, 2), "slant range"),
        "azimuth_resolution_m": (round(a.azimuth_resolution_m, 2), ""),
        "range_spacing_m": (round(a.slant_spacing_m, 3), f"slant range, of {a.range_spacing_m:g} m on the ground"),
        "azimuth_spacing_m": (a.azimuth_spacing_m, ""),
        "looks": (float(f"{min(max(a.looks, 1.0), 64.0):.4g}"), "equivalent number of looks"),
        "nesz_db": (-100.0, "the processor has subtracted the noise") if a.noise_removed else (noise, ""),
        "radiometry": ("sigma0_ref", ""),
    }


def radar_section(acquisition: Acquisition) -> str:
    """Text in YAML of the section ``radar`` that describes an acquisition.

    Parameters
    ----------
    acquisition : Acquisition
        Acquisition at a scene.
    """
    a = acquisition
    lines = [f"radar:   # {a.product}, {a.pass_direction}, heading {a.heading_deg:.2f} deg over the scene"]
    for key, (value, remark) in radar_keys(a).items():
        shown = f"{value:.10g}" if isinstance(value, float) else str(value)
        lines.append(f"  {key}: {shown}" + (f"   # {remark}" if remark else ""))
    return "\n".join(lines) + "\n"


def contradictions(
    acquisition: Acquisition, radar: Radar, incidence_deg: NDArray[np.float64], slope_deg: float = 0.0
) -> list[str]:
    """Phrases about keys of section ``radar`` that differ too much from a product for a comparison with its image.

    Parameters
    ----------
    acquisition : Acquisition
        Acquisition of the product.
    radar : Radar
        Configured pass.
    incidence_deg : ndarray
        Incidence angles of the configured pass on flat ground, over the scene [deg].
    slope_deg : float
        Slope of the scene's steep ground [deg]; the local incidence angle on it depends on the heading.

    Returns
    -------
    list of str
        Phrases of the form "radar.band is X, its carrier is 5.405 GHz (band C)".
    """
    a, found = acquisition, []
    carrier = f"{a.frequency_hz / 1e9:.4g} GHz (band {letter_band(a.frequency_hz) or 'without a letter'})"
    if within_band(radar.band, a.frequency_hz) is False:
        found.append(f"radar.band is {radar.band}, its carrier {carrier}")
    elif radar.frequency_ghz is not None and abs(radar.frequency_ghz * 1e9 / a.frequency_hz - 1.0) > _FREQUENCY:
        found.append(f"radar.frequency_ghz is {radar.frequency_ghz:g}, its carrier {carrier}")
    if abs(radar.looks - a.looks) > _LOOKS:
        found.append(f"radar.looks is {radar.looks:g}, its equivalent number of looks {a.looks:.3g}")
    middle = float(np.median(incidence_deg))
    if abs(middle - a.incidence_deg) > _INCIDENCE_DEG:
        key = "depression_deg" if radar.incidence_deg is None else "incidence_deg"
        instead = " instead of depression_deg" if radar.incidence_deg is None else ""
        found.append(
            f"radar.{key} is {getattr(radar, key):g}, an incidence of {middle:.2f} deg at the scene, where its own is "
            f"{a.incidence_deg:.2f} deg (incidence_deg: {a.incidence_deg:.2f}{instead})"
        )
    apart = _apart(look_azimuth_deg(a), look_azimuth_deg(radar))
    if apart > 90.0:
        found.append(
            f"radar.look_side is {radar.look_side}, a look to {look_azimuth_deg(radar):.0f} deg from north, it looks "
            f"to {look_azimuth_deg(a):.1f} deg, from the other side of every slope (look_side: {a.look_side}, "
            f"heading_deg: {a.heading_deg:.2f})"
        )
    elif (change := _turned_deg(slope_deg, apart)) > _INCIDENCE_DEG:
        found.append(
            f"radar.heading_deg is {radar.heading_deg:g}, a look to {look_azimuth_deg(radar):.1f} deg from north, it "
            f"looks to {look_azimuth_deg(a):.1f} deg, which changes the incidence on slopes of {slope_deg:.1f} deg, as "
            f"the scene has them, by up to {change:.1f} deg (look_side: {a.look_side}, heading_deg: "
            f"{a.heading_deg:.2f})"
        )
    return found


def differences(acquisition: Acquisition, radar: Radar) -> list[Finding]:
    """Findings on keys of section ``radar`` that differ from a product, but too little to forbid a comparison."""
    a, found = acquisition, []
    look = look_azimuth_deg(radar)
    if _HEADING_DEG < _apart(look_azimuth_deg(a), look) <= 90.0:
        numbers = {"look_deg": look_azimuth_deg(a), "heading_deg": a.heading_deg, "configured_deg": look}
        found.append(Finding("look_direction", "note", a.product, numbers))
    angles, levels = (np.array(part) for part in zip(*a.nesz_db, strict=True))
    configured = nesz_db(radar, angles)
    if not a.noise_removed and np.abs(configured - levels).max() > _NOISE_DB:
        worst = int(np.argmax(np.abs(configured - levels)))
        at = {"angle_deg": angles[worst], "nesz_db": levels[worst], "configured_db": configured[worst]}
        found.append(Finding("noise_differs", "note", a.product, {key: float(x) for key, x in at.items()}))
    for key, own in a.lengths_m.items():
        value = getattr(radar, key)
        if not 1.0 / _RATIO <= value / own <= _RATIO:
            found.append(Finding("radar_differs", "note", a.product, {"key": key, "own_m": own, "configured_m": value}))
    return found


def look_azimuth_deg(flight: Acquisition | Radar) -> float:
    """Look direction, clockwise from north [deg, 0 to 360]; a pass without a heading flies to the grid's north."""
    return (flight.heading_deg + (90.0 if flight.look_side == "right" else 270.0)) % 360.0


def _turned_deg(slope_deg: float, apart_deg: float) -> float:
    """Largest change of the local incidence angle on a slope [deg] if the look direction turns by ``apart_deg``.

    To first order in the slope, the local incidence angle is the incidence angle on level ground minus the slope times
    the cosine of the angle between aspect and look direction. The cosine changes by at most 2 sin(apart_deg / 2).
    """
    return 2.0 * slope_deg * math.sin(0.5 * math.radians(apart_deg))


def _apart(one: float, other: float) -> float:
    """Angle between two directions [deg, 0 to 180]."""
    return abs((one - other + 180.0) % 360.0 - 180.0)
