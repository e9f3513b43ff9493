"""Cases as plain data that the tests of the configuration change and break."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from radcal.config import case_from
from radcal.errors import ConfigError

X = [1.0, 2.0, 3.0, 4.0]
FIXED = {"dyke": {"calibrate": True}, "grass": {"parameters": X}}


def dyke(**keys: Any) -> dict[str, Any]:
    return {"materials": {"dyke": {"calibrate": True, **keys}}}


def flat(**keys: Any) -> dict[str, Any]:
    both = {"labels": "ids.tif", "names": "a.json", "near_incidence_deg": 20, "far_incidence_deg": 40}
    return {"scene": {"source": "slant_range", **both, **keys}}


def mapped(**keys: Any) -> dict[str, Any]:
    files = {"elevation": "a.tif", "materials": "b.tif", "names": "a.json"}
    return {"scene": {"source": "raster", **files, **keys}}


def measured(**keys: Any) -> dict[str, Any]:
    return {"measurement": {"source": "file", "path": "a.tif", "scale": "db", "radiometry": "sigma0_ref", **keys}}


def synthetic(**keys: Any) -> dict[str, Any]:
    return {"measurement": {"source": "synthetic", "synthetic": keys}}


def message(data: dict[str, Any]) -> str:
    with pytest.raises(ConfigError) as caught:
        case_from(data, "some.yaml")
    text = str(caught.value)
    assert text.startswith("some.yaml: ")
    assert text.endswith(".")
    assert "\n" not in text
    assert "pydantic" not in text
    return text


def truth(x: list[float], law: dict[str, Any], **radar: Any) -> dict[str, Any]:
    """A calibrated dyke of some law with a hidden truth."""
    return {**dyke(**law), **synthetic(parameters={"dyke": x}), "radar": radar}


GAMMA = {"law": "constant_gamma", "bounds": [[-30, 0]]}
TABLE = {"law": "tabulated", "angles_deg": [20, 40, 60], "bounds": [[-30, 0]] * 3}
OH = {"law": "oh1992"}


def write(folder: Path, text: str | bytes, name: str = "case.yaml") -> Path:
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


COMMAND = {"kind": "command", "command": ["sim"], "output": {"file": "i.npy", "scale": "db"}}
SOIL = {"calibrate": True, "law": "external", "names": ["mv", "s"], "bounds": [[0, 1], [0, 1e10]]}
NO_TRUTH = {"source": "synthetic", "synthetic": {"parameters": {}}}
TRUE_SOIL = {"source": "synthetic", "synthetic": {"parameters": {"soil": [0.2, 1.0]}}}


def outside(materials: dict[str, Any], **sections: Any) -> dict[str, Any]:
    """Plain data of a case of an external program."""
    return {
        "simulator": {"kind": "command", "command": ["sh"], "output": {"file": "i.npy", "scale": "db"}},
        "materials": {"soil": {"calibrate": True, "law": "external", "names": ["a", "n"], **materials}},
        "measurement": {"source": "file", "path": "m.tif", "scale": "db", "radiometry": "sigma0_ref"},
        **sections,
    }


WHOLE = {"bounds": [[0.5, 9], [1, 12]], "integer": ["n"]}
