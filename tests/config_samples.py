"""Cases as plain data that the tests of the configuration change and break."""

import pytest

from radcal.config import case_from
from radcal.errors import ConfigError

X = [1.0, 2.0, 3.0, 4.0]
FIXED = {"dyke": {"calibrate": True}, "grass": {"parameters": X}}


def dyke(**keys):
    return {"materials": {"dyke": {"calibrate": True, **keys}}}


def flat(**keys):
    both = {"labels": "ids.tif", "names": "a.json", "near_incidence_deg": 20, "far_incidence_deg": 40}
    return {"scene": {"source": "slant_range", **both, **keys}}


def mapped(**keys):
    files = {"elevation": "a.tif", "materials": "b.tif", "names": "a.json"}
    return {"scene": {"source": "raster", **files, **keys}}


def measured(**keys):
    return {"measurement": {"source": "file", "path": "a.tif", "scale": "db", "radiometry": "sigma0_ref", **keys}}


def synthetic(**keys):
    return {"measurement": {"source": "synthetic", "synthetic": keys}}


def focused(**sections):
    return {"simulator": {"product": "focused"}, **sections}


def message(data):
    with pytest.raises(ConfigError) as caught:
        case_from(data, "some.yaml")
    text = str(caught.value)
    assert text.startswith("some.yaml: ")
    assert text.endswith(".")
    assert "\n" not in text
    assert "pydantic" not in text
    return text


def truth(x, law, **radar):
    """A calibrated dyke of some law with a hidden truth."""
    return {**dyke(**law), **synthetic(parameters={"dyke": x}), "radar": radar}


GAMMA = {"law": "constant_gamma", "bounds": [[-30, 0]]}
TABLE = {"law": "tabulated", "angles_deg": [20, 40, 60], "bounds": [[-30, 0]] * 3}
OH = {"law": "oh1992"}


def write(folder, text, name="case.yaml"):
    path = folder / name
    path.write_bytes(text.encode() if isinstance(text, str) else text)
    return path


COMMAND = {"kind": "command", "command": ["sim"], "output": {"file": "i.npy", "scale": "db"}}
SOIL = {"calibrate": True, "law": "external", "names": ["mv", "s"], "bounds": [[0, 1], [0, 1e10]]}
NO_TRUTH = {"source": "synthetic", "synthetic": {"parameters": {}}}
TRUE_SOIL = {"source": "synthetic", "synthetic": {"parameters": {"soil": [0.2, 1.0]}}}


def outside(materials, **sections):
    """Plain data of a case of an external program."""
    soil = {"calibrate": True, "law": "external", "names": ["a", "n"], **materials}
    return {"simulator": COMMAND, "materials": {"soil": soil}, **measured(path="m.tif"), **sections}


WHOLE = {"bounds": [[0.5, 9], [1, 12]], "integer": ["n"]}

TWO_PASSES = {
    "radar": [{"depression_deg": 45}, {"depression_deg": 30, "polarisation": "VV"}],
    "measurement": [{}, {"synthetic": {"seed": 5}}],
}

HYP3 = "S1A_IW_20180128T161201_DVP_RTC30_G_gdunem_FD6A_VV.tif"
FORMULA = {"law": "formula", "formula": "a + b*cos(phi)", "names": ["a", "b"]}


def product(radar=None, path=HYP3, **measurement):
    """A case of a product whose name says how its numbers are read."""
    return {
        "measurement": {"source": "file", "path": path, **measurement},
        "radar": {"polarisation": "VV", "radiometry": "gamma0_rtc", **(radar or {})},
    }


def external(parameters):
    """A case of a law that only the simulator knows."""
    names, bounds = [f"p{k}" for k in range(parameters)], [[0, 1]] * parameters
    soil = {"calibrate": True, "law": "external", "names": names, "bounds": bounds, "start": [0.5] * parameters}
    return {"simulator": COMMAND, "materials": {"soil": soil}, "measurement": NO_TRUTH}
