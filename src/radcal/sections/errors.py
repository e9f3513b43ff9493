"""Sentences on the wrong keys and values of a case, from the list of errors that pydantic gives."""

from __future__ import annotations

import difflib
import re
import typing
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import date

from pydantic import BaseModel, ValidationError
from pydantic.fields import FieldInfo
from pydantic_core import ErrorDetails

from radcal.sections.base import FILL_IN, MATERIALS_FROM, PASSES, TAGS, UNDECIDED

MISSING = "missing_because"  # type of the error for a missing key, with a reason in the message

# names that pydantic inserts into locations for the alternatives of a union
_ALTERNATIVES = ("a list", "a law", "one level", "a table", "yes or no")

# words of YAML in place of those of Python, by pydantic's type of the error or by the first word of this type
_EXPECTED = {
    "model": "keys and values",
    "dict": "keys and values",
    "list": "a list",
    "tuple": "a list",
    "string_type": "a text",
    "bool": "true or false",
    "bool_as_number": "a number",
    "float": "a number",
    "int": "an integer",
    "int_parsing_size": "an integer of fewer digits",
}


class Wrong(ValueError):
    """Error of a validator about one key of its section.

    Parameters
    ----------
    key : str
        Key below the section.
    text : str
        Rest of the sentence on the key.
    """

    def __init__(self, key: str, text: str) -> None:
        super().__init__(f"{key}{text}")
        self.key = key


@dataclass(frozen=True)
class Mistake:
    """Mistake in a case.

    Attributes
    ----------
    key : str
        Wrong key, or section with keys that contradict each other, in dotted form; empty if several sections do.
    text : str
        Sentence with the key, the value found and the value expected, without a full stop.
    undecided : bool
        Whether the value is still ``FILL_IN``.
    """

    key: str
    text: str
    undecided: bool = False


def shown(text: str, most: int = 60) -> str:
    """Text for quotation in a message: cut to ``most`` characters, with control characters escaped."""
    safe = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text[:most])
    return safe if len(text) <= most else f"{safe[: most - 3]}..."


def nearest(key: str, known: Iterable[str]) -> str:
    """Hint in brackets for an unknown key: the most similar known key, or a list of all known keys."""
    found = difflib.get_close_matches(key, list(known), n=1, cutoff=0.5)
    return f" (did you mean {found[0]!r}?)" if found else f" (known: {', '.join(known)})"


def first_of(texts: Sequence[str]) -> str:
    """First of several sentences, with the number of the others."""
    more = f" (and {len(texts) - 1} more; radcal check lists them)" if len(texts) > 1 else ""
    return f"{shown(texts[0], 600)}{more}."


def mistakes_of(found: Iterable[Wrong]) -> list[Mistake]:
    """Mistakes of a case from errors about its keys; equal sentences, as of several passes, count once."""
    return [Mistake(key, text) for text, key in {str(one): one.key for one in found}.items()]


def mistakes(error: ValidationError, root: type[BaseModel]) -> list[Mistake]:
    """List of the mistakes that pydantic found, one for each key and for each contradiction.

    Parameters
    ----------
    error : ValidationError
        Error that pydantic raised. A ``ValueError`` of a validator is a :class:`Wrong`, or has one contradiction in
        each argument: a sentence, or a :class:`Wrong`.
    root : type of model
        Model of the data. For an unknown key, the sentence names the most similar key of the model.
    """
    found: dict[str, list[Mistake]] = {}
    # A misspelt required key gives two errors, an unknown key and a missing key: the unknown key comes first.
    for detail in sorted(error.errors(), key=lambda detail: detail["type"] != "extra_forbidden"):
        one = _of_contradictions(detail) if detail["type"] == "value_error" else [_of_key(detail, root)]
        found.setdefault(one[0].key, one)  # the errors of all alternatives of one key count as one
    return [one for several in found.values() for one in several]


def _of_contradictions(detail: ErrorDetails) -> list[Mistake]:
    section, error = _dotted(detail["loc"]), detail["ctx"]["error"]
    found = [error] if isinstance(error, Wrong) else error.args
    places = [f"{section}.{one.key}".strip(".") if isinstance(one, Wrong) else section for one in found]
    return [Mistake(key, f"{section}: {one}".removeprefix(": ")) for key, one in zip(places, found, strict=True)]


def _of_key(detail: ErrorDetails, root: type[BaseModel]) -> Mistake:
    """Mistake of one key, in words of YAML."""
    kind, place, value, context = detail["type"], detail["loc"], detail["input"], detail.get("ctx", {})
    key = _dotted(place)
    if kind == "extra_forbidden":
        *above, last = place
        key = f"{_dotted(above)}.{last}".lstrip(".")
        known = sorted({*_fields(above, root)} | (set() if above else {MATERIALS_FROM}))
        return Mistake(key, f"unknown key {key}{nearest(str(last), known)}")
    if kind == MISSING:
        return Mistake(key, f"{key} is missing: {detail['msg']}")
    if kind == "missing":
        return Mistake(key, f"{key} is missing, expected {_meaning(place, root)}")
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        tag = context["discriminator"].strip("'")
        key, value = f"{key}.{tag}", value.get(tag) if isinstance(value, dict) else value
    if value is UNDECIDED:
        material = "the name of a material of the scene in its place, for example crops: {calibrate: true}"
        what = material if place[-1] == FILL_IN else _meaning(place, root)
        return Mistake(key, f"{key} is {FILL_IN}, expected {what}", True)
    words = context.get("expected_tags") or re.sub(r"^\w+ should (be |have |match )?", "", detail["msg"])
    usual = _EXPECTED.get(kind.partition("_")[0], words.replace(" after validation", ""))
    expected = _EXPECTED.get(kind, usual)
    text = str(value).lower() if isinstance(value, bool) else str(value) if isinstance(value, date) else repr(value)
    return Mistake(key, f"{key} is {'empty' if value is None else shown(text)}, expected {expected}")


def _meaning(place: Sequence[int | str], root: type[BaseModel]) -> str:
    """First clause of the description of a key, for one that needs a value."""
    field = _fields(place[:-1], root).get(str(place[-1]))
    return "its value" if field is None or not field.description else field.description.partition(";")[0]


def key_in_list(key: str, number: int) -> str:
    """Key in dotted form of an item of a list, of which passes are counted from 1, and the first has no number."""
    if key not in PASSES:
        return f"{key}.{number}"
    return f"{key}.{number + 1}" if number else key


def _dotted(location: Sequence[int | str]) -> str:
    """Key in dotted form of an error's location, without the tags and alternatives that pydantic inserts."""
    section, *place = location or ("",)
    tagged = section in TAGS
    if section in PASSES and place:
        section = key_in_list(str(section), int(place.pop(0)))
    place = [section, *place[tagged:]]  # the tag may be the name of one of the section's keys, too
    return ".".join(str(part) for part in place if part not in _ALTERNATIVES and "[" not in str(part))


def _fields(section: Sequence[int | str], root: type[BaseModel]) -> dict[str, FieldInfo]:
    """Fields of the section at a location, by their keys."""
    models = [root]
    for part in section:
        fields = [field for model in models for name, field in _by_key(model).items() if part == name]
        inside = [model for field in fields for model in _models_in(field.annotation)]
        of_kind = [model for model in models if part in [field.default for field in model.model_fields.values()]]
        models = inside or of_kind or models
    return {key: field for model in models for key, field in _by_key(model).items()}


def _by_key(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """Fields of a model by their keys in a case file."""
    return {field.alias or name: field for name, field in model.model_fields.items()}


def _models_in(annotation: object) -> list[type[BaseModel]]:
    """Configuration models that a type annotation contains."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [model for part in typing.get_args(annotation) for model in _models_in(part)]
