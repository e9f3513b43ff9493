"""Writing and reading of dataclasses in HDF5 files; the types of the fields determine the layout of the file.

=====================================================  =====================================================
type of a field                                        in the file
=====================================================  =====================================================
``bool``, ``int``, ``float``, ``str``, ``Literal``     attribute of the group
``Finding``                                            attribute of the group, as JSON
``tuple`` of numbers                                   attribute of the group
numpy array                                            dataset, compressed from 1 KiB to 1 MB
``tuple[str, ...]``                                    dataset of strings, because HDF5 limits the size of attributes
``tuple[Finding, ...]``                                dataset of strings, each of them a finding as JSON
dataclass                                              group
``Mapping[str, ...]`` of any type above                group with one entry for each key, in the order of the keys
any type above ``| None``                              absent if the value is None
=====================================================  =====================================================

An array of 1 MB or more is mapped into memory when it is read, so that the operating system reads only the parts of the
file that are used. Changes of such an array stay in memory.

If a file lacks a field, the field gets its default value. Files written before the field was added can therefore
still be read. Description, unit and dimensions of a field are taken from the section ``Attributes`` of the dataclass's
docstring, and become attributes of its dataset or group. An array of the type ``ndarray, shape (n,), dimension scale``
holds the coordinates of its dimension for all datasets in its group that have a dimension with the same label.
:func:`table` lists the descriptions and units.

References
----------
The HDF Group, "HDF5 Dimension Scale Specification and Design Notes" (2005).
"""

from __future__ import annotations

import functools
import inspect
import os
import re
import types
import typing
from collections.abc import Callable, Collection, Iterator, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from typing import Any, Literal, TypeVar

import h5py
import numpy as np
from numpy.typing import NDArray

from radcal.findings import Finding

# sizes of compressed datasets [bytes]: compression of smaller ones saves no space, and of larger ones takes too long
_COMPRESSED = range(1024, 1_000_000)
_TEXT = h5py.string_dtype()
_TEXTS, _FINDINGS = tuple[str, ...], tuple[Finding, ...]

T = TypeVar("T")


@dataclass(frozen=True)
class _About:
    """Description of a dataclass field, its unit, the labels of its dimensions, and whether it is a dimension scale."""

    description: str
    unit: str
    labels: list[str]
    scale: bool


@dataclass(frozen=True)
class _Entry:
    """Field of a dataclass: name, type (without None), and description."""

    name: str
    kind: Any
    about: _About | None
    optional: bool
    default: Any  # MISSING for a field that the file must contain


def put(group: h5py.Group, value: Any) -> None:
    """Write a dataclass into an HDF5 group.

    Parameters
    ----------
    group : h5py.Group
        Group that has no entries or attributes with the names of the fields.
    value : dataclass instance
        Dataclass whose fields have types from the table in the docstring of :mod:`radcal.storage.dataclass_groups`.

    Raises
    ------
    TypeError
        A field has a type that is not in the table in the docstring of :mod:`radcal.storage.dataclass_groups`.
    """
    for entry in _entries(type(value)):
        if (one := getattr(value, entry.name)) is not None:
            _put(group, entry.name, one, entry.kind, entry.about)
    # each scale, which has one dimension, belongs to all dimensions of the group's datasets with its label
    held = {one.name: one.about for one in _entries(type(value)) if isinstance(group.get(one.name), h5py.Dataset)}
    abouts = {name: about for name, about in held.items() if about is not None}
    for name, scale in ((name, about) for name, about in abouts.items() if about.scale):
        group[name].make_scale(scale.labels[0])
        for other, about in abouts.items():
            for place, label in enumerate(about.labels):
                if label == scale.labels[0] and other != name:
                    group[other].dims[place].attach_scale(group[name])


def take(group: h5py.Group, kind: type[T], without: Collection[str] = ()) -> T:
    """Read a dataclass that :func:`put` wrote into an HDF5 group.

    Parameters
    ----------
    group : h5py.Group
        Group to read from.
    kind : type
        Type of the dataclass.
    without : collection of str
        Names of fields that are not read; these fields get their default values.

    Raises
    ------
    LookupError
        The group lacks a field that has no default: another version of radcal wrote the file.
    """
    found = {}
    for entry in _entries(kind):
        held = group.attrs if _is_attribute(entry.kind) else group
        if entry.name not in without and entry.name in held:
            found[entry.name] = _take(held[entry.name], entry.kind)
        elif entry.default is None:
            found[entry.name] = None
        elif entry.default is MISSING:
            raise LookupError(f"{group.name} lacks {entry.name}")
    return kind(**found)


def same(one: Any, other: Any) -> bool:
    """Whether two dataclasses, or two field values, are equal bit for bit, including their types and order."""
    if isinstance(one, np.ndarray):
        alike = isinstance(other, np.ndarray) and (one.dtype, one.shape) == (other.dtype, other.shape)
        return alike and (one.tolist() == other.tolist() if one.dtype == object else one.tobytes() == other.tobytes())
    if isinstance(one, Mapping):
        return (
            isinstance(other, Mapping)
            and list(one) == list(other)
            and all(same(item, other[key]) for key, item in one.items())
        )
    if type(one) is not type(other):
        return False
    if is_dataclass(one):
        return all(same(getattr(one, entry.name), getattr(other, entry.name)) for entry in _entries(type(one)))
    if isinstance(one, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, float):  # in this comparison NaN equals NaN, and 0 differs from -0
        return bool(one.hex() == other.hex())
    return bool(one == other)


def _read_entries(kind: type) -> tuple[_Entry, ...]:
    """One entry for each stored field of a dataclass; a field that may be None has the default None."""
    hints, documented = typing.get_type_hints(kind), _documented(kind)
    entries = []
    for item in (one for one in fields(kind) if one.init):
        bare, optional = _without_none(hints[item.name])
        default = item.default if item.default_factory is MISSING else item.default_factory
        default = None if optional and default is MISSING else default
        entries.append(_Entry(item.name, bare, documented.get(item.name), optional, default))
    return tuple(entries)


_entries: Callable[[Any], tuple[_Entry, ...]] = functools.cache(_read_entries)


def _documented(kind: type) -> dict[str, _About]:
    """Descriptions of fields in the section ``Attributes`` of a dataclass's docstring, which has numpydoc's form."""
    _, _, section = inspect.cleandoc(kind.__doc__ or "").partition("Attributes\n----------\n")
    found = {}
    for names, described, lines in re.findall(r"^(\w[\w, ]*) : (.*)\n((?: {4}.*\n?)+)", section, re.MULTILINE):
        text = re.sub(r":\w+:`[~.\w]*?(\w+)`", r"`\1`", " ".join(lines.split()).removesuffix(".").replace("``", "`"))
        shape, units = re.search(r"shape \(([^()]*?),?\)", described), re.findall(r" \[([^\]]*)\]", text)
        unit = units[0] if len(units) == 1 else ""
        labels = shape[1].split(", ") if shape else []
        about = _About(text.replace(f" [{unit}]", ""), unit, labels, described.endswith("dimension scale"))
        found.update(dict.fromkeys(names.split(", "), about))
    return found


def _without_none(hint: Any) -> tuple[Any, bool]:
    """Type with ``None`` removed, and whether the original type allowed ``None``."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        others = [one for one in typing.get_args(hint) if one is not type(None)]
        if len(others) == 1:
            return others[0], True
    return hint, False


def _is_array(kind: Any) -> bool:
    return kind is np.ndarray or typing.get_origin(kind) is np.ndarray


def _is_mapping(kind: Any) -> bool:
    return isinstance(typing.get_origin(kind), type) and issubclass(typing.get_origin(kind), Mapping)


def _is_attribute(kind: Any) -> bool:
    """Whether values of a type are stored as attributes."""
    if typing.get_origin(kind) is tuple:
        return kind not in (_TEXTS, _FINDINGS)
    return kind in (bool, int, float, str, Finding) or typing.get_origin(kind) is Literal


def _put(group: h5py.Group, name: str, value: Any, kind: Any, about: _About | None = None) -> None:
    if _is_attribute(kind):
        group.attrs[name] = value.json() if kind is Finding else value
        return
    made: h5py.Group | h5py.Dataset
    if _is_array(kind):
        made = _put_array(group, name, np.asarray(value))
    elif kind in (_TEXTS, _FINDINGS):
        texts = [one.json() if isinstance(one, Finding) else one for one in value]
        made = group.create_dataset(name, data=np.array(texts, dtype=_TEXT), dtype=_TEXT)
    elif _is_mapping(kind):
        made = group.create_group(name, track_order=True)
        for key, item in value.items():
            _put(made, key, item, _item(kind), about if _is_array(_item(kind)) else None)
    elif isinstance(kind, type) and is_dataclass(kind):
        made = group.create_group(name)
        put(made, value)
    else:
        raise TypeError(f"{name}: a {kind} has no place in the layout")
    attributes_of_entries = _is_mapping(kind) and _is_attribute(_item(kind))
    if about is not None and not attributes_of_entries:
        made.attrs["description"] = about.description
        if about.unit:
            made.attrs["unit"] = about.unit
        if isinstance(made, h5py.Dataset) and len(about.labels) == made.ndim:
            for place, label in enumerate(about.labels):
                made.dims[place].label = label


def _put_array(group: h5py.Group, name: str, values: NDArray[Any]) -> h5py.Dataset:
    if values.dtype.kind in "OU":
        return group.create_dataset(name, data=values.astype(object), dtype=_TEXT)
    packed = {"compression": "gzip", "compression_opts": 1} if values.nbytes in _COMPRESSED else {}
    return group.create_dataset(name, data=values, **packed)


def _item(kind: Any) -> Any:
    """Type of the values in a mapping, from the annotated type of the mapping."""
    return typing.get_args(kind)[1]


def _take(held: Any, kind: Any) -> Any:
    if _is_attribute(kind):
        return _scalar(held, kind)
    if _is_array(kind):
        return held.asstr()[()] if h5py.check_string_dtype(held.dtype) else _array(held)
    if kind in (_TEXTS, _FINDINGS):
        return tuple(map(Finding.of_json if kind == _FINDINGS else str, held.asstr()[()]))
    if _is_mapping(kind):
        item = _item(kind)
        names = held.attrs if _is_attribute(item) else held
        return {name: _take(names[name], item) for name in names}
    return take(held, kind)


def _array(held: h5py.Dataset) -> NDArray[Any]:
    """Array of a dataset, mapped into memory if it is large and stored in one piece."""
    offset = held.id.get_offset() if held.chunks is None and held.nbytes >= _COMPRESSED.stop else None
    if offset is None:
        return np.asarray(held[()])
    # the file that HDF5 has opened, because another one may have replaced it at its path
    with open(os.dup(held.file.id.get_vfd_handle()), "rb") as file:
        return np.asarray(np.memmap(file, held.dtype, "c", offset, held.shape))


def _scalar(held: Any, kind: Any) -> Any:
    """Attribute of an HDF5 file as a Python value of the annotated type."""
    if typing.get_origin(kind) is tuple:
        return tuple(np.asarray(held).tolist())
    if kind is Finding:
        return Finding.of_json(held)
    value = held.item() if isinstance(held, np.generic) else held
    return kind(value) if kind in (bool, int, float, str) else value


def table(kind: type, unlisted: Collection[type] = ()) -> str:
    """Table that documents the layout of a file.

    Parameters
    ----------
    kind : type
        Type of the dataclass that the file contains.
    unlisted : collection of type
        Dataclasses whose fields the table does not list.

    Returns
    -------
    str
        Table in Markdown with one line for each group, dataset and attribute.
    """
    lines = ["| group or dataset | attribute | holds | unit | description |", "|---|---|---|---|---|"]
    lines += [f"| {' | '.join(row)} |" for row in _rows(kind, "", unlisted)]
    return "\n".join(lines) + "\n"


def _rows(kind: type, path: str, unlisted: Collection[type]) -> Iterator[tuple[str, str, str, str, str]]:
    """Rows of the table that describes the layout of a file: one for each dataclass field stored below an HDF5 path."""
    for entry in _entries(kind):
        about, inner, place = entry.about or _About("", "", [], False), entry.kind, f"{path}{entry.name}"
        if _is_mapping(inner):
            inner, place = _item(inner), f"{place}/<name>"
        shape = f" ({', '.join(about.labels)})" if about.labels else ""
        holds = f"{_holds(inner)}{shape}{', or absent' if entry.optional else ''}"
        if _is_mapping(entry.kind) and _is_attribute(inner):
            place, attribute = f"{path}{entry.name}", "`<name>`"
        elif _is_attribute(inner):
            place, attribute = path.removesuffix("/") or "/", f"`{entry.name}`"
        else:
            attribute = ""
        yield f"`{place}`", attribute, holds, about.unit, about.description
        if isinstance(inner, type) and is_dataclass(inner) and inner not in (Finding, *unlisted):
            yield from _rows(inner, f"{place}/", unlisted)


def _holds(kind: Any) -> str:
    """Name under which the table lists a type."""
    if _is_array(kind):
        (number,) = typing.get_args(typing.get_args(kind)[1])
        return "numbers" if number is Any else "text" if number is np.str_ else str(number.__name__).rstrip("_")
    if isinstance(kind, type) and is_dataclass(kind) and kind is not Finding:
        return "group"
    if typing.get_origin(kind) is tuple:
        return "findings" if kind == _FINDINGS else "texts" if kind == _TEXTS else "numbers"
    return {bool: "true or false", int: "integer", float: "number", Finding: "finding"}.get(kind, "text")
