"""Write the tables of the pages on laws, sensors and land-cover maps.

python docs/tables.py laws | sensors | esa_worldcover | corine | nlcd
"""

import sys
from typing import Any

from radcal.laws.curves import CURVES
from radcal.laws.grazing import GRAZING
from radcal.laws.soil import SOIL
from radcal.tables import read_table
from radcal.tables.landcover import gamma_db, landcovers


def laws() -> str:
    """Table of radcal's own laws, for ``laws.md``."""
    own = {**CURVES, **SOIL, **GRAZING}
    lines = [
        "| law | sigma0 [dB] | parameters | default bounds | made for | also needs | source |",
        "|---|---|---|---|---|---|---|",
    ]
    keys = {"frequency_ghz": "`radar.frequency_ghz`", "polarisation": "`radar.polarisation`"}
    for name, law in own.items():
        parameters = ", ".join(
            f"`{key}`{f' [{unit}]' if unit else ''}" for key, unit in zip(law.names, law.units, strict=True)
        )
        bounds = ", ".join(f"{low:g} to {high:g}" for low, high in law.bounds) if law.bounds else "none"
        valid = "its knots" if not law.names else f"{law.valid_deg[0]:g} to {law.valid_deg[1]:g} deg"
        needs = ", ".join(keys.get(key, f"`{key}`") for key in law.needs) or "nothing"
        cells = (f"`{name}`", law.formula, parameters or "sigma0 [dB] at each knot", bounds, valid, needs, law.source)
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def sensors() -> str:
    """Table of all values by sensor and source, for ``sensors.md``."""
    table = read_table("sensors")

    def noted(item: dict[str, Any]) -> str:
        """Note on a value, in brackets."""
        return f" ({item['note']})" if "note" in item else ""

    lines = ["| `radar.sensor` | values | source |", "|---|---|---|"]
    for name, sensor in table["sensors"].items():
        texts: dict[str, list[str]] = {}
        for key, item in sensor["values"].items():
            value = f"{item['value']:g}" if isinstance(item["value"], float) else str(item["value"])
            ground = " in ground range" * item.get("ground_range", False)
            texts.setdefault(item["source"], []).append(f"`{key}` {value}{ground}{noted(item)}")
        if (item := sensor.get("incidence_deg")) is not None:
            between = "{:g} to {:g}".format(*item["value"])
            texts.setdefault(item["source"], []).append(f"incidence {between} degrees{noted(item)}")
        for source, values in texts.items():
            lines.append(f"| `{name}` | {', '.join(values)} | {table['sources'][source]} |")
    return "\n".join(lines) + "\n"


def landcover(name: str) -> str:
    """Table of the classes of a land-cover map by terrain, for ``landcover.md``."""
    names: dict[str, list[str]] = {}
    star = r"\*"
    for code, cover in landcovers()[name].items():
        names.setdefault(cover.terrain, []).append(f"{code} `{cover.name}`{star * cover.taken_for}")
    lines = ["| starting gamma [dB] | terrain | codes and materials |", "|---|---|---|"]
    lines += [f"| {gamma_db(terrain):g} | {terrain} | {', '.join(found)} |" for terrain, found in names.items()]
    return "\n".join(lines) + "\n"


if __name__ == "__main__":
    print({"laws": laws, "sensors": sensors}.get(sys.argv[1], lambda: landcover(sys.argv[1]))(), end="")
