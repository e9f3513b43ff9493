"""Search for all mistakes in case files at once: wrong keys are replaced or left out, and the rest is checked again."""

from __future__ import annotations

import itertools
import re
from collections.abc import Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from radcal.config.case import Case
from radcal.config.inputs import expand_path
from radcal.config.loading import origin_of, read_cases
from radcal.config.undecided import FILL_IN, Undecided, undecided
from radcal.errors import ConfigError, RadcalError, UnknownMaterial
from radcal.sections.base import FURTHER
from radcal.sections.errors import Collected, WrongKey, shown, wrong_keys

__all__ = ["Loaded", "load_with_problems"]

_PATHS = {
    "scene": ("elevation", "materials", "labels", "names", "objects.path"),
    "measurement": ("path",),
}
_OF_GEOMETRY = ("scene", "radar")


@dataclass(frozen=True)
class Loaded:
    """Result of reading a case with mistakes: the case without the wrong keys, and sentences on the mistakes.

    Attributes
    ----------
    case : Case or None
        Case without the wrong keys, for further checks; None if the remaining keys do not make a case.
    found : list of ConfigError
        One error for each wrong key and each contradiction between settings.
    wrong : frozenset of str
        Keys, in dotted form, whose values were replaced by others or that were left out.
    without : frozenset of str
        Sections of the case file that were left out entirely.
    materials : tuple of str or None
        Names of all materials in the case file, including materials with mistakes; None if the file has no section
        ``materials``, or a name is still ``FILL_IN``.
    forward : bool
        Whether the case file has neither a measurement nor a material with ``calibrate: true``, so that it is for
        ``radcal simulate``; section ``measurement`` then counts as left out.
    given : mapping
        Contents of the case files, with all mistakes.
    """

    case: Case | None
    found: list[ConfigError]
    wrong: frozenset[str] = frozenset()
    without: frozenset[str] = frozenset()
    materials: tuple[str, ...] | None = None
    forward: bool = False
    given: Mapping[str, Any] = field(default_factory=dict)

    @property
    def problems(self) -> list[str]:
        """One sentence for each error."""
        return [str(error) for error in self.found]

    @property
    def has_geometry(self) -> bool:
        """Whether sections ``scene`` and ``radar``, which determine the image's size, are free of mistakes."""
        return not any(key.partition(".")[0] in _OF_GEOMETRY for key in (*self.wrong, *self.without))

    def follows(self, error: RadcalError) -> bool:
        """Whether a problem follows from a wrong key that another problem already names.

        A message names the configuration keys that it is about, so that their names are looked for in it.
        """
        names = [rf"{re.escape(key)}(?!\w)" for key in self.wrong] + [rf"{section}\.\w" for section in self.without]
        return any(re.search(rf"(?<![\w.]){name}", str(error)) for name in names)


def load_with_problems(files: Sequence[str | Path], overrides: Mapping[str, Any] | None = None) -> Loaded:
    """Read configuration files and list all wrong keys and values, not only the first.

    A misspelt key is replaced by the most similar known key, and a wrong word by the most similar word that the key
    allows. Any other wrong key is left out. If a required key is missing, its section is left out. Correction and check
    are repeated until the remaining keys make a case.

    Parameters
    ----------
    files, overrides
        As for :func:`radcal.config.load`.

    Returns
    -------
    Loaded

    Raises
    ------
    ConfigError
        A file is missing, empty or not YAML.
    """
    twice: list[str] = []
    given = read_cases(files, overrides, twice)
    marked = undecided(given, files)
    data = deepcopy(given)
    for one in marked:
        _leave_out(data, one.place)
    problems: dict[str, Undecided | UnknownMaterial | None] = {one.text: one for one in marked}
    wrong = {one.key for one in marked}
    case: Case | None = None
    contradictions = Collected()
    while case is None:
        contradictions = Collected(wrong)
        try:
            case = Case.model_validate(data, context=contradictions)
        except ValidationError as error:
            found = wrong_keys(error, Case)
            rest = deepcopy(data)
            # a corrected key may remove the cause of another error: after a correction, all keys are checked again
            mended = [key for key in found if _mend(rest, key)]
            found = [_blamed(data, key) for key in found]
            for key in () if mended else found:
                _leave_out(rest, key.place)
            problems |= dict.fromkeys(key.text for key in mended or found if not _is_missed(key, wrong))
            wrong |= {key.key for key in mended or found if key.meant is None and key.place}
            if rest == data:
                break
            data = rest
    names = given.get("materials")
    named = tuple(names) if isinstance(names, dict) and FILL_IN not in names else None
    gone = {name for name in given if name not in data and name in Case.model_fields}
    forward = _is_forward(given)
    gone |= {"measurement"} if forward else set()
    loaded = Loaded(case, [], frozenset(wrong), frozenset(gone), named, forward, given)
    # of a case for radcal simulate, section materials is as good as left out: none of them need be calibrated
    told = wrong | ({"materials"} if forward else set())
    for each in contradictions:
        # materials with mistakes were left out before the search for contradictions, but their names are known
        if not (each.unknown in (named or ()) or _is_told(each.lacks, told) or loaded.follows(ConfigError(str(each)))):
            problems.setdefault(str(replace(each, known=named or each.known)), each.about)
    errors = [ConfigError(text) for text in twice]
    errors += [ConfigError(f"{origin_of(files)}: {shown(text, 600)}.", about) for text, about in problems.items()]
    return replace(loaded, found=errors + _missing_files(given, gone.intersection(given)))


def _is_forward(given: Mapping[str, Any]) -> bool:
    """Whether a case file names materials but neither a measured image nor a material to calibrate."""
    materials = given.get("materials")
    return (
        "measurement" not in given
        and isinstance(materials, dict)
        and not any(isinstance(one, dict) and one.get("calibrate", False) is not False for one in materials.values())
    )


def _blamed(data: dict[str, Any], key: WrongKey) -> WrongKey:
    """Contradiction inside a section as a mistake of the key that it names first, so that the others stay."""
    section = _section(data, _placed(data, key.place)) if key.first else None
    if not (isinstance(section, dict) and key.first in section):
        return key  # a default value, in place of a wrong one, contradicts: the whole section is left out
    return replace(key, place=(*key.place, key.first), key=f"{key.key}.{key.first}", first="")


def _is_missed(key: WrongKey, wrong: Iterable[str]) -> bool:
    """Whether a mistake is only the absence, or the default, of a key that was left out for another mistake."""
    return _is_told((*key.lacks, *([f"{key.key}.{key.first}"] if key.first else [])), wrong)


def _is_told(keys: Iterable[str], wrong: Iterable[str]) -> bool:
    """Whether one of the keys, or a key below it, is among those that other problems name."""
    return any(one == key or one.startswith(f"{key}.") for key in keys for one in wrong)


def _mend(data: dict[str, Any], key: WrongKey) -> bool:
    """Replace a wrong key or value by the one that was probably meant; return whether a replacement was possible."""
    *above, last = _placed(data, key.place) or ("",)
    section = _section(data, above)
    if not isinstance(section, dict):
        return False
    if last == "calibrate" and key.place[0] == "materials" and not isinstance(section.get(last), bool):
        section[last] = "parameters" not in section  # which of the two the other keys of the material tell
        return True
    if key.meant is not None and last in section and key.meant not in section:
        section[key.meant] = section.pop(last)
        return True
    if key.choices and section.get(str(last)) != key.choices[0]:
        section[str(last)] = key.choices[0]
        return True
    return False


def _section(data: Any, above: Sequence[int | str]) -> Any:
    """Section of plain data at a location that pydantic gives."""
    inside = data
    for part in above:
        if _leads(inside, part):
            inside = inside[part]
    return inside


def _leads(inside: Any, part: int | str) -> bool:
    """Whether a part of pydantic's location is a key or index in the data; other parts are tags and missing keys."""
    if isinstance(inside, list):
        return isinstance(part, int) and part < len(inside)
    return isinstance(inside, dict) and part in inside


def _placed(data: Mapping[str, Any], place: Sequence[int | str]) -> list[int | str]:
    """Location in the data of a case file, in which the sections of several passes are items of a list."""
    for section, further in FURTHER.items():
        if place and isinstance(data.get(section), list) and place[0] in (section, further):
            return [section, 0, *place[1:]] if place[0] == section else [section, int(place[1]) + 1, *place[2:]]
    return list(place)


def _leave_out(data: dict[str, Any], place: Sequence[int | str]) -> None:
    """Remove a key that is wrong, or the innermost section around a key that is missing."""
    inside: Any = data
    above: list[tuple[dict[str, Any], str]] = []
    for part in _placed(data, place):
        if _leads(inside, part):
            if isinstance(inside, dict):
                above.append((inside, str(part)))
            inside = inside[part]
    while above:  # an empty section would be a further mistake
        section, key = above.pop()
        del section[key]
        if section:
            break


def _missing_files(data: Mapping[str, Any], sections: Iterable[str]) -> list[ConfigError]:
    """Errors about missing files: one for each missing file that a left-out section names."""
    problems = []
    for name in sections:
        several = data[name] if isinstance(data[name], list) else [data[name]]
        for key, section in itertools.product(_PATHS.get(name, ()), several):
            path = section
            for part in key.split("."):
                path = path.get(part) if isinstance(path, dict) else None
            if isinstance(path, str) and path != FILL_IN:
                try:
                    expand_path(path, f"{name}.{key}", folder=True)
                except ConfigError as error:
                    problems.append(error)
    return problems
