"""Values of known sensors and products: defaults of section ``radar`` if ``radar.sensor`` names the sensor.

The values and their sources are in ``sensors.yaml``. ``docs/sensors.md`` contains the table that :func:`sensors_table`
returns.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping
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
class _Value:
    """Value of a configuration key and its source; a length in ground range must be converted to slant range."""

    value: Any
    source: str
    note: str = ""
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
    incidence : _Value or None
        Lowest and highest incidence of the product [deg], with its source; None if it was read in no source.
    """

    values: Mapping[str, _Value]
    asks: tuple[str, ...]
    orbit: bool = True
    incidence: _Value | None = None

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


@functools.cache
def sensors() -> dict[str, Sensor]:
    """Sensors by name."""
    table = read_table("sensors")

    def read(value: Any, source: str, note: str = "", ground_range: bool = False) -> _Value:
        return _Value(value, table["sources"][source], note, ground_range)

    found = {}
    for name, one in table["sensors"].items():
        values = {key: read(**item) for key, item in one["values"].items()}
        incidence = read(**one["incidence_deg"]) if "incidence_deg" in one else None
        found[name] = Sensor(values, tuple(one["asks"]), one.get("orbit", True), incidence)
    return found


def _noted(item: _Value) -> str:
    """Note on a value, in brackets."""
    return f" ({item.note})" if item.note else ""


def sensors_table() -> str:
    """Markdown table of all values by sensor and source."""
    lines = ["| `radar.sensor` | values | source |", "|---|---|---|"]
    for name, sensor in sensors().items():
        texts: dict[str, list[str]] = {}
        for key, item in sensor.values.items():
            value = f"{item.value:g}" if isinstance(item.value, float) else str(item.value)
            ground = " in ground range" * item.ground_range
            texts.setdefault(item.source, []).append(f"`{key}` {value}{ground}{_noted(item)}")
        if sensor.incidence is not None:
            between = "{:g} to {:g}".format(*sensor.incidence.value)
            texts.setdefault(sensor.incidence.source, []).append(
                f"incidence {between} degrees{_noted(sensor.incidence)}"
            )
        lines += [f"| `{name}` | {', '.join(values)} | {source} |" for source, values in texts.items()]
    return "\n".join(lines) + "\n"
