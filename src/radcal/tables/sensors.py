"""Values of known sensors and products: defaults of section ``radar`` if ``radar.sensor`` names the sensor.

The values and their sources are in ``sensors.yaml``, and in a table of ``docs/sensors.md``.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from radcal.tables import read_table

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


@dataclass(frozen=True)
class Sensor:
    """Sensor and product, with values for keys of section ``radar``.

    Attributes
    ----------
    values : mapping
        Value of each known key of section ``radar``.
    in_ground_range : frozenset of str
        Keys whose values are lengths in ground range, and must be converted to slant range.
    asks : tuple of str
        Keys that the case must give; the case may give ``depression_deg`` instead of ``incidence_deg``.
    orbit : bool
        Whether the sensor is in orbit, so that its track does not head north.
    incidence_deg : sequence of float or None
        Lowest and highest incidence of the product [deg]; None if it was read in no source.
    """

    values: Mapping[str, Any]
    in_ground_range: frozenset[str]
    asks: tuple[str, ...]
    orbit: bool = True
    incidence_deg: Sequence[float] | None = None

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
        return {key: value * sine if key in self.in_ground_range else value for key, value in self.values.items()}


@functools.cache
def sensors() -> dict[str, Sensor]:
    """Sensors by name."""
    found = {}
    for name, one in read_table("sensors")["sensors"].items():
        values = {key: item["value"] for key, item in one["values"].items()}
        in_ground_range = frozenset(key for key, item in one["values"].items() if item.get("ground_range"))
        incidence_deg = one.get("incidence_deg", {}).get("value")
        found[name] = Sensor(values, in_ground_range, tuple(one["asks"]), one.get("orbit", True), incidence_deg)
    return found
