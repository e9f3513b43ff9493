"""Every number of the configuration is bounded on both sides, and no number ends in anything but a sentence."""

import copy
import json
import math
import re
from pathlib import Path

import pytest
from config_samples import flat, mapped, measured, message

from radcal.config import Case, case_from
from radcal.errors import ConfigError
from radcal.forecast.memory_and_time import memory_mb, runtime_minutes
from radcal.radar.size import image_size
from radcal.scene.base import SceneSize

ROOT = Path(__file__).parents[2]
WILD = [0, -1, 1e308, -1e308, 1e-308, math.inf, math.nan, 2**63 - 1, 2**63, 2**64, 10**400, True, "1e3", "x", None, []]


def said(limit):
    return f"{limit:,.0f}" if limit == round(limit) and abs(limit) < 1e13 else f"{limit:,}"


def numbers(node, key=""):
    """Key and limits of every number in a schema; variables of the environment are texts that may be digits."""
    if isinstance(node, list):
        for item in node:
            yield from numbers(item, key)
    elif isinstance(node, dict) and key != "environment":
        if node.get("type") in ("integer", "number") and "enum" not in node:
            low = said(node["minimum"]) if "minimum" in node else f">{said(node['exclusiveMinimum'])}"
            high = said(node["maximum"]) if "maximum" in node else f"<{said(node['exclusiveMaximum'])}"
            yield key, low, high
        for word, inner in node.items():
            for name, item in inner.items() if word in ("properties", "$defs") else [(key, inner)]:
                yield from numbers(item, name)


DEFAULT = Case().model_dump(mode="json", exclude_none=True)
DEFAULT["materials"] = {"dyke": DEFAULT["materials"]["dyke"]}
DEFAULT["measurement"]["synthetic"]["parameters"] = {"dyke": [-24, 10, 14, 5]}
PROGRAM = {
    "kind": "command", "command": ["./sim"], "timeout_s": 60, "retries": 3, "retry_wait_s": 2.0,
    "accept_exit_codes": [0, 1], "seed_bits": 31, "draws": 2,
    "output": {
        "file": "a.raw", "scale": "db", "format": "raw", "dtype": "float32", "shape": [80, 90], "header_bytes": 8,
    },
}  # fmt: skip
CASES = {
    "default": DEFAULT,
    "orbit": {
        **mapped(cell_m=2.0, bounds=[0, 1, 2000, 2001], elevation_error_m=0.5),
        "radar": {
            "altitude_m": 7e5, "incidence_deg": 35.0, "heading_deg": 192.0, "looks": 4.4,
            "nesz_db": [[20, -30], [50, -25]],
        },
    },
    "program": {
        **flat(), **measured(band=2),
        "materials": {"a": {"calibrate": True, "law": "external", "names": ["p"], "bounds": [[0, 9]], "start": [4]}},
        "simulator": PROGRAM,
    },
}  # fmt: skip


def places(data, at=()):
    """Where the numbers of plain data are."""
    if isinstance(data, dict | list):
        for key, value in data.items() if isinstance(data, dict) else enumerate(data):
            yield from places(value, (*at, key))
    elif isinstance(data, int | float) and not isinstance(data, bool):
        yield at


def replaced(data, place, value):
    copied = copy.deepcopy(data)
    inner = copied
    for part in place[:-1]:
        inner = inner[part]
    inner[place[-1]] = value
    return dict(copied)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_wild_numbers_are_taken_or_refused_in_a_sentence(name):
    case = CASES[name]
    assert case_from(case)
    taken = refused = 0
    for place in places(case):
        for value in WILD:
            try:
                found = case_from(replaced(case, place, value), "mine.yaml")
            except ConfigError as error:
                refused += re.fullmatch(r"mine\.yaml: .{20,280}[^.]\.", str(error)) is not None
                continue
            taken += 1
            # what is taken can be planned with, written down and read back
            json.dumps(found.model_dump(mode="json"), allow_nan=False)
            assert case_from(found.model_dump(mode="json")) == found
            minutes = runtime_minutes("verify", {"image": 10**8}, 1000 * found.simulator.longest_run_s)
            assert 0 < minutes < 2**31
            size = image_size(SceneSize(10**8, 1000.0, 10**8), found.radar)
            assert memory_mb("geometry", {"image": max(size.facets, size.pixels)}) > 0
            assert len(found.laws) == len(found.materials)
    assert taken >= 10
    assert taken + refused == len(WILD) * len(list(places(case)))


@pytest.mark.parametrize(
    ("section", "said"),
    [
        ({"seed": 2**63}, "seed is 9223372036854775808, expected less than or equal to 9223372036854775807."),
        ({"seed": 10**70}, f"seed is 1{'0' * 56}..., expected less than or equal to 9223372036854775807."),
        ({"seed": 1e308}, "seed is 1e+308, expected an integer of fewer digits."),
        ({"timeout_s": 1e308}, "simulator.timeout_s is 1e+308, expected less than or equal to 2592000."),
        ({"retry_wait_s": 1e300}, "retry_wait_s is 1e+300, expected less than or equal to 86400."),
    ],
)
def test_limits_are_said_as_they_are(section, said):
    assert message(section if "seed" in section else {"simulator": PROGRAM | section}).endswith(said)


def test_every_number_has_both_limits_and_the_page_says_which():
    found = set(numbers(json.loads((ROOT / "config/schema.json").read_text())))
    assert len(found) > 100
    rows = re.findall(
        r"^- `(\w+)` \((.*?)\): ", (ROOT / "docs/configuration.md").read_text(encoding="utf-8"), flags=re.MULTILINE
    )
    for name, low, high in found:
        assert any(key == name and f"{low}..{high}" in values for key, values in rows), name
