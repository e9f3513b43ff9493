"""Names of material ids, read from a JSON file."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

from radcal.errors import SceneError
from radcal.tables.landcover import landcovers

_LARGEST_ID = 255  # ids are stored in one byte
_LARGEST_BYTES = 1_000_000  # size limit of a file of names


def read_names(path: Path, present: Iterable[int], raster: Path) -> dict[int, str]:
    """Read the names of material ids and check that every id in a raster has a name.

    Parameters
    ----------
    path : path
        File with a JSON object that maps each material id to a name.
    present : iterable of int
        Material ids in the raster. Id 0 (no material) needs no name.
    raster : path
        Path of the raster, for error messages.

    Returns
    -------
    dict
        Name of each material id.

    Raises
    ------
    SceneError
        The file is too large or not a JSON object of ids and names, has an id above 255, gives one name to two ids, or
        has no name for an id in the raster.
    """
    size = path.stat().st_size if path.is_file() else 0
    if size > _LARGEST_BYTES:
        raise SceneError(f"scene.names: {path} has {size} bytes, expected at most {_LARGEST_BYTES}.")
    names = dict[int, str]()
    try:
        for key, name in json.loads(path.read_text(encoding="utf-8"), object_pairs_hook=tuple):
            if names.setdefault(int(key), str(name)) != str(name):
                raise ValueError(f"id {key} has the names {names[int(key)]!r} and {name!r}")
    except (OSError, ValueError, TypeError, RecursionError) as error:
        raise SceneError(
            f'scene.names: {path} is not a JSON object of id and name, such as {{"1": "grass"}} ({error}).'
        ) from None
    if wrong := [k for k in names if not 0 <= k <= _LARGEST_ID]:
        raise SceneError(f"scene.names: {path} names the material id {wrong[0]}, expected 1 to {_LARGEST_ID}.")
    names.pop(0, None)
    if not names:
        raise SceneError(f"scene.names: {path} names no material.")
    if (twice := _twice(names)) is not None:
        raise SceneError(f"scene.names: {path} gives the name {twice!r} to more than one material id.")
    missing = sorted(set(present) - {0, *names})
    if missing:
        raise SceneError(f"scene.names: {path} has no name for material id {missing[0]} of {raster}.")
    return names


def landcover_names(landcover: str, path: Path | None, present: Iterable[int], raster: Path) -> dict[int, str]:
    """Names of the land-cover codes that occur in a raster.

    Parameters
    ----------
    landcover : str
        Name of the land-cover map, a key of :func:`radcal.tables.landcover.landcovers`.
    path : path, optional
        File with names that replace names of the land-cover map, or with names of further codes.
    present : iterable of int
        Codes in the raster; 0 means no material.
    raster : path
        Path of the raster, for error messages.

    Returns
    -------
    dict
        Name of each code that is present, in ascending order of the codes.

    Raises
    ------
    SceneError
        The file is not a JSON object of codes and names, two codes have the same name, or a code in the raster has no
        name.
    """
    codes = sorted(set(present) - {0})
    own = read_names(path, (), raster) if path is not None else {}
    known = {code: cover.name for code, cover in landcovers()[landcover].items()} | own
    missing = [code for code in codes if code not in known]
    if missing:
        raise SceneError(
            f"scene.landcover is {landcover}, which has no code {missing[0]} of {raster}: name it in scene.names, or "
            "declare it as no-data of the raster."
        )
    names = {code: known[code] for code in codes}
    if (twice := _twice(names)) is not None:
        raise SceneError(f"scene.names: more than one code of {raster} has the name {twice!r}.")
    return names


def _twice(names: Mapping[int, str]) -> str | None:
    """First name of more than one id; None if all names differ."""
    return next((name for name, times in Counter(names.values()).items() if times > 1), None)


def by_id(names: Mapping[int, str]) -> tuple[str, ...]:
    """Material names in the order of their ids: the name of id k has the index k - 1.

    An id k without a name gets the name ``id k``.
    """
    return tuple(names.get(k, f"id {k}") for k in range(1, max(names) + 1))
