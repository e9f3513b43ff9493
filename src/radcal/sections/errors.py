"""Conversion of pydantic's validation errors to error messages of one sentence about a wrong key or value."""

from __future__ import annotations

import difflib
import math
import re
import types
import typing
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from radcal.bands import letter_band
from radcal.errors import ConfigError, UnknownMaterial
from radcal.sections.base import EXAMPLES, FURTHER, MATERIALS_FROM, TAGS

__all__ = [
    "MISSING",
    "Collected",
    "Contradiction",
    "Contradictions",
    "WrongKey",
    "first_error",
    "nearest",
    "shown",
    "wrong_keys",
]

MISSING = "missing_because"  # type of the error for a missing key, with a reason in the message


@dataclass(frozen=True)
class Contradiction:
    """Contradiction between settings of a case, with what it is about; as text, a sentence without a full stop.

    Attributes
    ----------
    text : str
        Sentence, to which a hint is added if a name is unknown.
    first : str
        Key of the section that the sentence names first, and that counts as the wrong one; may be empty.
    lacks : tuple of str
        Keys of the section whose absence is all that the sentence is about.
    unknown : str
        Name that no material has; empty if the sentence is about something else.
    known : tuple of str
        Names of the materials, for the hint.
    """

    text: str
    first: str = ""
    lacks: tuple[str, ...] = ()
    unknown: str = ""
    known: tuple[str, ...] = ()

    @property
    def about(self) -> UnknownMaterial | None:
        """Unknown name, as the error of the case is about it."""
        return UnknownMaterial(self.unknown) if self.unknown else None

    def __str__(self) -> str:
        return self.text + (nearest(self.unknown, self.known) if self.unknown else "")


class Contradictions(ValueError):
    """Error of one or several contradictions between settings of a case.

    Parameters
    ----------
    *found : Contradiction or str
        Contradictions; a text is about nothing that other code asks for, apart from the next parameters.
    first, lacks
        As for :class:`Contradiction`, of each text in ``found``.
    """

    def __init__(self, *found: Contradiction | str, first: str = "", lacks: tuple[str, ...] = ()) -> None:
        self.found = [one if isinstance(one, Contradiction) else Contradiction(one, first, lacks) for one in found]
        super().__init__(str(self.found[0]))


class Collected(list[Contradiction]):
    """Contradictions that a validation puts into its context instead of failing, so that the caller gets the case.

    Parameters
    ----------
    told : collection of str
        Keys, in dotted form, that were left out because of other mistakes: they are not called missing.
    """

    def __init__(self, told: Iterable[str] = ()) -> None:
        super().__init__()
        self.told = frozenset(told)


def shown(text: str, most: int = 60) -> str:
    """Text for quotation in a message: cut to ``most`` characters, with control characters escaped."""
    safe = "".join(c if c.isprintable() else ascii(c)[1:-1] for c in text[:most])
    return safe if len(text) <= most else f"{safe[: most - 3]}..."


def nearest(key: str, known: Iterable[str]) -> str:
    """Hint in brackets for an unknown key: the most similar known key, or a list of all known keys."""
    found = difflib.get_close_matches(key, list(known), n=1, cutoff=0.5)
    return f" (did you mean {found[0]!r}?)" if found else f" (known: {', '.join(known)})"


def _models_in(annotation: object) -> list[type[BaseModel]]:
    """Configuration models that a type annotation contains."""
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    if isinstance(annotation, types.UnionType) or typing.get_origin(annotation) is not None:
        return [model for part in typing.get_args(annotation) for model in _models_in(part)]
    return []


def _tags(model: type[BaseModel]) -> list[object]:
    return [model.model_fields[key].default for key in TAGS.values() if key in model.model_fields]


def _models_at(location: Sequence[int | str], root: type[BaseModel]) -> list[type[BaseModel]]:
    """Models of the section that contains the location of an error."""
    models = [root]
    for section, further in FURTHER.items():
        if location[0] == further:
            location = [section, *location[2:]]
    for part in location[:-1]:
        if len(models) > 1:  # in a union, this part of the location is the tag of the section's kind, not a key
            models = [model for model in models if part in _tags(model)]
        else:
            field = models[0].model_fields.get(str(part))
            models = (_models_in(field.annotation) if field else []) or models
    return models


def _known_keys(location: Sequence[int | str], root: type[BaseModel]) -> list[str]:
    """Allowed keys of the section that contains the location of an error."""
    models = _models_at(location, root)
    known = {name for model in models for name in model.model_fields}
    return sorted(known | ({MATERIALS_FROM} if root in models and "materials" in known else set()))


_ALTERNATIVES = (
    "a list",
    "a law",
    "one level",
    "a table",
    "yes or no",
)  # names that pydantic inserts for the alternatives of a union


def _of_kind(match: re.Match[str]) -> str:
    """Name in terms of YAML for the Python type that pydantic expects."""
    return {"dictionary": "keys and values", "tuple": "a list"}[match[1]]


def first_error(error: ValidationError, origin: str, root: type[BaseModel], where: str = "") -> ConfigError:
    """Error with a message of one sentence about the first problem in a validation error.

    Parameters
    ----------
    error : ValidationError
        Error that pydantic raised.
    origin : str
        Source of the data, such as the name of a case file.
    root : type of model
        Model of the data. For an unknown key, the message suggests the most similar key of the model.
    where : str
        Words on where the other problems are listed, for a message with their number.
    """
    first, *others = wrong_keys(error, root)
    more = f" (and {len(others)} more{where})" if others else ""
    return ConfigError(f"{origin}: {shown(first.text, 600)}{more}.", first.about)


@dataclass(frozen=True)
class WrongKey:
    """Problem of one key.

    Attributes
    ----------
    text : str
        Sentence that says what is wrong, without a full stop.
    place : tuple
        Location as pydantic gives it, without the tag of a section's kind: the sections that contain the key, from
        outside to inside, and the key; empty for a contradiction between settings.
    key : str
        Key in dotted form.
    meant : str or None
        Known key that is most similar to an unknown key.
    choices : tuple of str
        Allowed values of the key, beginning with the one most similar to the value found; empty if they cannot be
        listed.
    first : str
        As in :class:`Contradiction`.
    lacks : tuple of str
        Keys in dotted form whose absence is all that the sentence is about.
    about : UnknownMaterial or None
        As in :class:`radcal.errors.RadcalError`.
    """

    text: str
    place: tuple[int | str, ...]
    key: str = ""
    meant: str | None = None
    choices: tuple[str, ...] = ()
    first: str = ""
    lacks: tuple[str, ...] = ()
    about: UnknownMaterial | None = None


def wrong_keys(error: ValidationError, root: type[BaseModel]) -> list[WrongKey]:
    """List of the problems in a validation error, one for each key; parameters as for :func:`first_error`."""
    # A misspelt required key gives two errors, an unknown key and a missing key: the unknown key comes first.
    details = sorted(error.errors(), key=lambda detail: detail["type"] != "extra_forbidden")
    found: dict[str, WrongKey] = {}
    for detail in map(_whole_list, details):
        several = detail.get("ctx", {}).get("error")
        place, key = detail["loc"], _key(detail["loc"])
        if not isinstance(several, Contradictions):
            # the errors of all alternatives of one key count as one problem
            found.setdefault(key, _wrong_key(detail, root))
            continue
        for one in several.found:
            text, lacks = f"{key}: {one}", tuple(f"{key}.{name}" for name in one.lacks)
            found[text] = WrongKey(text, _untagged(place), key, first=one.first, lacks=lacks, about=one.about)
    return list(found.values())


def _whole_list(detail: ErrorDetails) -> ErrorDetails:
    """Error of the list, in place of the error of each of its items, if ``bounds`` are a list of two numbers."""
    place = detail["loc"]
    if len(place) > 2 and place[-2] == "bounds" and detail["type"] == "tuple_type":
        detail["loc"], detail["msg"] = place[:-1], "Input should be [lower, upper] for each parameter"
    return detail


def _wrong_key(detail: ErrorDetails, root: type[BaseModel]) -> WrongKey:
    """Problem of one key, with what may have been meant."""
    place, text, value = detail["loc"], _text(detail, root), detail["input"]
    last = str(place[-1]) if place else ""
    if detail["type"] == "extra_forbidden":
        return WrongKey(text, _untagged(place), f"{_key(place[:-1])}.{last}", meant=_meant(detail, root))
    key = _key(place)
    if detail["type"] in ("union_tag_invalid", "union_tag_not_found"):
        tag = TAGS[key.partition(".")[0]]
        place, key = (*place, tag), f"{key}.{tag}"
        value = value.get(tag) if isinstance(value, Mapping) else value
        tags = re.findall("'([^']*)'", str(detail.get("ctx", {}).get("expected_tags", "")))
        # a text that is not similar to the name of a kind is not replaced by one, because each kind has other keys
        choices = difflib.get_close_matches(str(value), tags, n=1, cutoff=0.6)
    elif detail["type"] in ("literal_error", "missing", MISSING):
        fields = [model.model_fields[last] for model in _models_at(place, root) if last in model.model_fields]
        choices = [text for field in fields for text in _literals(field.annotation)]
    else:
        choices = []
    near = difflib.get_close_matches(str(value), choices, n=1, cutoff=0.0)
    lacks = (key,) if detail["type"] in ("missing", MISSING) else ()
    # the location of an error about the kind itself has no tag
    place = (*_untagged(detail["loc"]), *place[len(detail["loc"]) :])
    return WrongKey(text, place, key, choices=(*near, *(one for one in choices if one not in near)), lacks=lacks)


def _meant(detail: ErrorDetails, root: type[BaseModel]) -> str | None:
    """Known key that an unknown key most probably stands for.

    This is the most similar key, unless the key is the first word of a key that allows its value: ``look: left`` stands
    for ``look_side``, ``look: 4`` for ``looks``.
    """
    place, value = detail["loc"], detail["input"]
    last, known = str(place[-1]), _known_keys(place, root)
    for name in (name for name in known if name.startswith(f"{last}_")):
        fields = [model.model_fields[name] for model in _models_at(place, root) if name in model.model_fields]
        if value in [text for field in fields for text in _literals(field.annotation)]:
            return name
    near = difflib.get_close_matches(last, known, n=1, cutoff=0.5)
    return near[0] if near else None


def _literals(annotation: object) -> list[str]:
    """Texts that a type annotation allows (its ``Literal`` values)."""
    if typing.get_origin(annotation) is typing.Literal:
        return [text for text in typing.get_args(annotation) if isinstance(text, str)]
    return [text for part in typing.get_args(annotation) for text in _literals(part)]


def _text(detail: ErrorDetails, root: type[BaseModel]) -> str:
    """Sentence on one error of pydantic, without a full stop."""
    key, found = _key(detail["loc"]), detail["input"]
    match detail["type"]:
        case "extra_forbidden":
            *above, last = detail["loc"]
            key = f"{_key(above)}.{last}" if above else str(last)
            meant = _meant(detail, root)
            known = _known_keys(detail["loc"], root)
            return f"unknown key {key}{nearest(str(last), known) if meant is None else f' (did you mean {meant!r}?)'}"
        case "missing":
            return f"{key} is missing"
        case _ if detail["type"] == MISSING:
            return f"{key} is missing: {detail['msg']}"
        case "value_error":
            return f"{key}: {detail['msg'].removeprefix('Value error, ')}"
        case "union_tag_invalid" | "union_tag_not_found":
            tag = TAGS[key.partition(".")[0]]
            return f"{key}.{tag} is {_shown(found, tag)}, expected {detail.get('ctx', {}).get('expected_tags', '')}"
        case "int_parsing_size":
            return f"{key} is {shown(repr(found))}, expected an integer of fewer digits"
        case "tuple_type" if key.endswith(".bounds"):
            return f"{key}: {shown(_plain(found))} is no interval, expected {_BOUNDS}"
    message = detail["msg"].removeprefix("Input should be ").replace(" after validation", "")
    message = re.sub(r"^\w+ should have ", "", message)
    message = re.sub("^a valid (dictionary|tuple).*", _of_kind, message)
    message = re.sub(", unable to .*", "", message).replace("a valid boolean", "true or false")
    example = _example(detail, root) if message in ("a valid number", "a valid integer") else ""
    if message == "a valid list" and key.endswith(".bounds"):
        message = _BOUNDS
    elif message == "a valid list" and isinstance(found, str | int | float):
        example = f" (in brackets: [{shown(str(found))}])"
    return f"{key} is {shown(_plain(found))}, expected {message}{example}{_other_unit(key, found)}"


_BOUNDS = "[lower, upper] for each parameter, for example bounds: [[-20, -10]]"


def _plain(found: object) -> str:
    """Value as a case file gives it, with texts in quotes."""
    if isinstance(found, list):
        return f"[{', '.join(map(_plain, found))}]"
    if isinstance(found, dict):
        return f"{{{', '.join(f'{key}: {_plain(value)}' for key, value in found.items())}}}"
    if found is None:
        return "empty"
    return str(found).lower() if isinstance(found, bool) else repr(found)


def _example(detail: ErrorDetails, root: type[BaseModel]) -> str:
    """Number that a text probably stands for, or else an example of the key's value; empty if there is none."""
    place, found = detail["loc"], detail["input"]
    number = re.fullmatch(r"\s*([-+]?\d+)(?:[.,](\d+))?\s*([A-Za-z%°/]*)\s*", found) if isinstance(found, str) else None
    if number is not None:
        fraction = f".{number[2]}" if number[2] else ""
        why = "without its unit" if number[3] else "with a decimal point"
        return f" ({why}: {number[1]}{fraction})"
    last = next((str(part) for part in reversed(place) if f"{place[0]}.{part}" in EXAMPLES), None)
    if last is not None:
        return f", for example {EXAMPLES[f'{place[0]}.{last}']}"
    if {"parameters", "bounds", "start"} & set(place):
        return ", for example -15"
    fields = [
        model.model_fields[str(place[-1])] for model in _models_at(place, root) if place[-1] in model.model_fields
    ]
    default = fields[0].default if fields else None
    return f", for example {default:g}" if isinstance(default, int | float) and not isinstance(default, bool) else ""


def _other_unit(key: str, found: object) -> str:
    """Question whether a carrier frequency is in MHz or Hz; empty for other keys and values."""
    number = float(found) if isinstance(found, int | float) and -1e308 < found < 1e308 else math.nan
    if key.rpartition(".")[2] == "frequency_ghz":
        for unit, per_ghz in (("MHz", 1e3), ("Hz", 1e9)):
            if letter_band(number / per_ghz * 1e9) is not None:
                return f" (in {unit}? {number / per_ghz:g} GHz)"
    return ""


def _untagged(place: Sequence[int | str]) -> tuple[int | str, ...]:
    """Location of an error without the tag of a section's kind, which may be the name of one of its keys, too."""
    for section in TAGS:
        for name, tagged in ((section, 1), (FURTHER.get(section), 2)):
            if place and place[0] == name:
                return (*place[:tagged], *place[tagged + 1 :])
    return tuple(place)


def _key(place: Sequence[int | str]) -> str:
    """Key of an error in dotted form, without the tags and alternatives that pydantic inserts."""
    location = list(_untagged(place))
    for section, further in FURTHER.items():
        if location and location[0] == further:  # passes are counted from 1
            location[:2] = [section, *(int(part) + 2 for part in location[1:2])]
    location = [part for part in location if part not in _ALTERNATIVES and "[" not in str(part)]
    return ".".join(str(part) for part in location) or "the configuration"


def _shown(found: object, key: str) -> str:
    return repr(found.get(key)) if isinstance(found, Mapping) else repr(found)
