"""The JSON schema of a case, with which editors complete, explain and check its keys.

Its first reader is the YAML language server of editors, which knows draft 7 of JSON Schema. Numbers are to be numbers
here, where radcal takes text for them too, and what one key means for another only radcal checks.
"""

from __future__ import annotations

import json
from typing import Any

from radcal.config.case import Case

__all__ = ["schema_json"]

_DRAFT = "http://json-schema.org/draft-07/schema#"
# pydantic's words for limits of numbers behind a validator, and a later draft's for lists, to draft 7's
_WORDS = {
    "ge": "minimum",
    "gt": "exclusiveMinimum",
    "le": "maximum",
    "lt": "exclusiveMaximum",
    "prefixItems": "items",
}


def schema_json() -> str:
    """The text of ``config/schema.json``.

    Returns
    -------
    str
        A JSON schema of draft 7, written from the models.

    References
    ----------
    Wright, Andrews, Luff: JSON Schema Validation: A Vocabulary for Structural Validation of JSON
    (draft-handrews-json-schema-validation-01), 2018.
    """
    schema = Case.model_json_schema()
    for section in schema["properties"].values():
        _require_tag(section, schema["$defs"])
    return json.dumps({"$schema": _DRAFT, **_plain(schema)}, indent=1, ensure_ascii=False) + "\n"


def _require_tag(section: dict[str, Any], models: dict[str, dict[str, Any]]) -> None:
    """Require the key that says which kind a section is, but for the kind that it is without one."""
    if (union := section.pop("discriminator", None)) is None:
        return
    tag = union["propertyName"]
    for kind, reference in union["mapping"].items():
        if kind != section["default"][tag]:
            models[reference.rpartition("/")[2]].setdefault("required", []).append(tag)


def _plain(part: Any) -> Any:
    """A part of the schema in words of draft 7, without titles made of names and without defaults of whole sections."""
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
