"""JSON schema of a case, which editors use to complete, explain and check the keys of a case file.

The schema follows draft 7 of JSON Schema, the version that the YAML language server of editors supports. The schema
differs from radcal's own checks in two points. The schema refuses numbers in quotes, which radcal accepts. The schema
does not compare the values of different keys.
"""

from __future__ import annotations

import json
from typing import Any

from radcal.config.case import Case
from radcal.sections.base import MATERIALS_FROM, PASSES

_DRAFT = "http://json-schema.org/draft-07/schema#"
# keywords that pydantic writes for number limits and for lists, and the corresponding keywords of draft 7
_WORDS = {
    "ge": "minimum",
    "gt": "exclusiveMinimum",
    "le": "maximum",
    "lt": "exclusiveMaximum",
    "prefixItems": "items",
}


def schema_json() -> str:
    """Text of ``config/schema.json``.

    Returns
    -------
    str
        JSON schema of draft 7, generated from the configuration models.

    References
    ----------
    Wright, Andrews, Luff: JSON Schema Validation: A Vocabulary for Structural Validation of JSON
    (draft-handrews-json-schema-validation-01), 2018.
    """
    schema = Case.model_json_schema()
    schema["$defs"]["FileMeasurement"]["required"].remove("scale")  # the name of a product may give the scale
    sections = schema["properties"]
    for section in (*sections.values(), sections["measurement"]["items"]):
        _require_tag(section, schema["$defs"])
    del sections["colours"]  # each material has a key colour instead
    for name in PASSES:  # one pass, or a list with an item for each pass
        one = sections[name]["items"]
        sections[name] = {
            "description": f"{sections[name]['description']}; for several passes, a list with one item for each pass",
            "anyOf": [one, {"type": "array", "items": one, "minItems": 1}],
        }
    sections[MATERIALS_FROM] = {
        "type": "string",
        "description": "file with a section materials, such as results/dyke/export/calibrated.yaml; materials of "
        "the case replace those of the same name (docs/exports.md)",
    }
    return json.dumps({"$schema": _DRAFT, **_plain(schema)}, indent=1, ensure_ascii=False) + "\n"


def _require_tag(section: dict[str, Any], models: dict[str, dict[str, Any]]) -> None:
    """Make the key that chooses a section's kind required for every kind except the first, which is the default."""
    if (union := section.pop("discriminator", None)) is None:
        return
    for kind in section["oneOf"][1:]:
        models[kind["$ref"].rpartition("/")[2]].setdefault("required", []).append(union["propertyName"])


def _plain(part: Any) -> Any:
    """Part of the schema with keywords of draft 7, without pydantic's titles and without default values of sections."""
    if isinstance(part, list):
        return [_plain(item) for item in part]
    if not isinstance(part, dict):
        return part
    plain: dict[str, Any] = {}
    for word, value in part.items():
        if word in ("properties", "$defs"):
            plain[word] = {name: _plain(item) for name, item in value.items()}
        elif word != "title" and not (word == "default" and (value is None or isinstance(value, dict))):
            plain[_WORDS.get(word, str(word))] = _plain(value)
    return plain
