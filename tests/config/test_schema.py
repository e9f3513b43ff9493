"""The schema for editors: in step with the models, and of one mind with radcal about a case."""

import json
import re
import subprocess
import sys
from pathlib import Path

import pytest
from config_samples import COMMAND, X, dyke, flat, measured
from jsonschema import Draft7Validator

from radcal.config import case_from
from radcal.config.yaml_file import read_case_file
from radcal.errors import ConfigError

ROOT = Path(__file__).parents[2]
SCHEMA = ROOT / "config/schema.json"
CASES = [*sorted((ROOT / "config").glob("*.yaml")), *sorted((ROOT / "examples").glob("*/case.yaml"))]
FLAT = flat()["scene"]
PROGRAM = {**COMMAND, "command": ["./sim", "{input}"]}
MEASURED = measured()["measurement"]
SOIL = {"calibrate": True, "law": "external", "names": ["mv", "s"], "bounds": [[0.0, 0.4], [0.3, 2.5]]}


@pytest.fixture(scope="module")
def schema():
    return Draft7Validator(json.loads(SCHEMA.read_text()))


def written(*words):
    return subprocess.run([sys.executable, "-m", "radcal.config", *words], capture_output=True, text=True)


def test_the_shipped_schema_is_that_of_the_models():
    done = written("schema")
    assert done.returncode == 0
    assert SCHEMA.read_text() == done.stdout, "python -m radcal.config schema > config/schema.json"


def test_an_unknown_word_writes_nothing():
    done = written("scheme")
    assert done.returncode == 1
    assert done.stdout == ""
    assert done.stderr == "python -m radcal.config: 'scheme' is unknown, expected schema or nothing.\n"


def test_the_schema_is_of_the_draft_that_editors_read(schema):
    Draft7Validator.check_schema(schema.schema)
    assert schema.schema["$schema"] == Draft7Validator.META_SCHEMA["$schema"]
    later = {"prefixItems", "discriminator", "ge", "gt", "le", "lt", "title"}
    assert not later & set(re.findall(r'"(\w+)": ', SCHEMA.read_text()))


def test_every_key_is_explained(schema):
    models = schema.schema["$defs"]
    keys = {
        f"{name}.{key}": item if "description" in item else models.get(item.get("$ref", "").rpartition("/")[2], item)
        for name, model in [("", schema.schema), *models.items()]
        for key, item in model.get("properties", {}).items()
    }
    assert len(keys) > 100
    assert [key for key, item in keys.items() if not item.get("description")] == []


@pytest.mark.parametrize("path", CASES, ids=lambda path: path.relative_to(ROOT).as_posix())
def test_every_shipped_case_leads_to_the_schema_and_meets_it(path, schema):
    first = path.read_text().partition("\n")[0]
    assert first.startswith("# yaml-language-server: $schema=")
    assert (path.parent / first.partition("=")[2]).resolve() == SCHEMA
    assert [error.message for error in schema.iter_errors(read_case_file(path))] == []


@pytest.mark.parametrize(
    "data",
    [
        {},
        {"target": {"pixels": "all", "incidence_classes": "auto"}, "design": {"size": "auto"}},
        {"radar": {"nesz_db": [[20, -18.0], [50, -22.0]]}, "validation": {"rows": 30, "means": 10}},
        {"materials": {"dyke": {"calibrate": True, "start": X}, "lake": {"parameters": X}}},
        {
            "scene": FLAT,
            "simulator": {**PROGRAM, "environment": {"OMP_NUM_THREADS": 2, "HOME": "/x"}, "timeout_s": 0.5},
            "materials": {"soil": {**SOIL, "integer": ["s"], "bounds": [[0, 0.4], [1, 3]]}},
            "measurement": MEASURED,
        },
        # what YAML makes of an unquoted {input}
        {"simulator": {**PROGRAM, "command": ["./sim", {"input": None}]}},
        {**dyke(start={"law": "constant_gamma", "parameters": [-9.0]}), "measurement": MEASURED},
    ],
)
def test_what_radcal_takes_the_schema_takes(data, schema):
    case_from(data)
    assert [error.message for error in schema.iter_errors(data)] == []


@pytest.mark.parametrize(
    "data",
    [
        {"sede": 1},
        {"seed": True},
        {"radar": {"altitude_m": 1.4e8}},
        {"radar": {"depression_deg": 5}},
        {"radar": {"nesz_db": [[20, -18.0]]}},
        {"target": {"pixels": "every"}},
        {"scene": {key: value for key, value in FLAT.items() if key != "labels"}},
        {"scene": {"source": "cdb"}},
        {"simulator": {key: value for key, value in PROGRAM.items() if key != "kind"}},
        {"simulator": {**PROGRAM, "command": "./sim {input}"}},
        {"measurement": {"path": "a.tif", "scale": "db", "radiometry": "sigma0_ref"}},
    ],
)
def test_what_the_schema_refuses_radcal_refuses(data, schema):
    assert not schema.is_valid(data)
    with pytest.raises(ConfigError):
        case_from(data)
