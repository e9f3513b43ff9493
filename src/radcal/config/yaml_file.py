"""Reader of YAML in case files and command-line settings; duplicate keys and too many aliases are refused.

This module returns plain data; the models of :mod:`radcal.config` check keys and values.
"""

from __future__ import annotations

import codecs
import re
import stat
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from radcal.errors import ConfigError
from radcal.sections.errors import shown

__all__ = ["check_words", "lines_of", "merged", "read_case_file", "read_value", "setting"]

_LARGEST_BYTES = 200_000  # size limit of a case file: about twenty times the size of radcal's longest case file
_LARGEST_VALUES = 200_000  # limit after every alias is expanded; no case file without aliases contains as many values
# texts that YAML 1.1 reads as octal numbers, or as numbers in base 60 (hours and minutes)
_OTHER_BASE = re.compile(r"[-+]?(0[0-7_]+|[0-9_]+(:[0-9_.]+)+)")
_MERGE = "tag:yaml.org,2002:merge"


class _Fault(Exception):
    """Fault in a YAML text, with the number of the faulty line, counted from 1."""

    def __init__(self, text: str, line: int | None = None) -> None:
        super().__init__(text)
        self.line = line


class _Loader(yaml.SafeLoader):
    """PyYAML's safe loader with an error message that names the line of a value that cannot be converted."""

    twice: list[_Fault] | None = None  # duplicate keys, of which the last value is read; None to refuse the first

    def construct_object(self, node: yaml.Node, deep: bool = False) -> Any:
        try:
            value = super().construct_object(node, deep)
            # Python refuses to print hexadecimal numbers of thousands of digits
            text = str(value) if isinstance(value, int | float) else ""
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError):
            text = shown(str(node.value)) if isinstance(node, yaml.ScalarNode) else "the value"
            raise _Fault(f"{text} is not a valid {node.tag.rpartition(':')[2]}", _line(node)) from None
        if text and _OTHER_BASE.fullmatch(node.value):
            raise _Fault(
                f"YAML reads {node.value} as {text}: expected digits without colons or leading zeros", _line(node)
            )
        return value


def read_case_file(path: str | Path, twice: list[str] | None = None) -> dict[str, Any]:
    """Read the keys and values of a case file.

    Parameters
    ----------
    path : path
        A YAML file in UTF-8 with one document.
    twice : list of str, optional
        List that is extended by a sentence on each duplicate key, of which the last value is then read.

    Returns
    -------
    dict
        Plain data in which aliases and merge keys (``<<``) are expanded.

    Raises
    ------
    ConfigError
        The file cannot be read, is not YAML in UTF-8 or does not consist of keys and values. Or the file contains a key
        twice, an anchor that contains itself, or aliases that expand to more than 200,000 values.

    References
    ----------
    YAML 1.1, sections 3.2.1.3 (keys are unique) and 7.1 (aliases).
    """
    try:
        faults = None if twice is None else list[_Fault]()
        found = _parsed(_text(_content(Path(path))), faults)
    except _Fault as fault:
        raise ConfigError(_at_line(path, fault)) from None
    if twice is not None:
        twice += [_at_line(path, fault) for fault in faults or ()]
    if found is None:
        raise ConfigError(f"{path}: is empty, expected keys and values such as case: mine.")
    if not isinstance(found, Mapping):
        raise ConfigError(f"{path}: holds {type(found).__name__}, expected keys and values.")
    return dict(found)


def _at_line(path: str | Path, fault: _Fault) -> str:
    line = "" if fault.line is None else f", line {fault.line}"
    return f"{shown(str(path), 300)}{line}: {fault}."


def lines_of(path: str | Path, text: str) -> list[tuple[tuple[int | str, ...], int]]:
    """Positions of a text in a case file that :func:`read_case_file` accepts: keys and line numbers.

    Parameters
    ----------
    path : path
        Case file.
    text : str
        A value, or the name of a key.

    Returns
    -------
    list of (tuple, int)
        Keys and indices that lead to the value, or to the key itself; and the number of the line, from 1.
    """
    root = yaml.compose(_text(_content(Path(path))), _Loader)
    return [] if root is None else list(_with_text(root, text, ()))


def _with_text(node: yaml.Node, text: str, above: tuple[int | str, ...]) -> Iterator[tuple[tuple[int | str, ...], int]]:
    if isinstance(node, yaml.ScalarNode) and node.value == text:
        yield above, _line(node)
    elif isinstance(node, yaml.SequenceNode):
        for number, item in enumerate(node.value):
            yield from _with_text(item, text, (*above, number))
    elif isinstance(node, yaml.MappingNode):
        for key, value in node.value:
            place = (*above, str(key.value))
            yield from [(place, _line(key))] if key.value == text else _with_text(value, text, place)


def read_value(text: str, origin: str) -> Any:
    """Convert the value of a command-line setting, which is one line of JSON or YAML.

    Parameters
    ----------
    text : str
        The value as typed.
    origin : str
        Name of the option and of the key, for error messages.

    Raises
    ------
    ConfigError
        The text is neither JSON nor YAML, or contains a key twice.
    """
    try:
        return _parsed(text)
    except _Fault as fault:
        raise ConfigError(f"{origin}={shown(text)}: not valid JSON or YAML ({fault}).") from None


def setting(word: str, origin: str) -> dict[str, Any]:
    """Convert a setting ``section.key=value`` to nested data.

    Parameters
    ----------
    word : str
        Setting such as ``stop.rms=1e-6``; the names between the dots may contain blanks.
    origin : str
        Name of the option, for error messages.

    Raises
    ------
    ConfigError
        The word is not of the form ``key=value``.
    """
    key, equals, text = word.partition("=")
    parts = key.split(".")
    if not equals or not all(part.strip() for part in parts):
        raise ConfigError(f"{origin} {shown(word)}: expected KEY=VALUE such as stop.rms=1e-6.")
    value = read_value(text, f"{origin} {key}")
    for part in reversed(parts):
        value = {part: value}
    return dict(value)


def merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Copy of ``base`` with ``over`` merged into it, section by section."""
    both = dict(base)
    for key, value in over.items():
        below = both.get(key)
        both[key] = merged(below, value) if isinstance(value, Mapping) and isinstance(below, Mapping) else value
    return both


def check_words(words: Sequence[str], origin: str = "--config") -> None:
    """Refuse command-line settings that give a key twice, because the last value would silently replace the first.

    Parameters
    ----------
    words : sequence of str
        Settings as typed on the command line, each ``key=value``.
    origin : str
        Name of the option, for error messages.

    Raises
    ------
    ConfigError
        A key occurs twice, or a value is neither JSON nor YAML.
    """
    given: set[str] = set()
    for word in words:
        for key in _leaves(setting(word, origin)):
            if key in given:
                raise ConfigError(f"{origin}: {shown(key)} is given twice, expected once.")
            given.add(key)


def _leaves(data: Mapping[Any, Any], above: str = "") -> Iterator[str]:
    for key, value in data.items():
        name = f"{above}{key}"
        if isinstance(value, Mapping):
            yield from _leaves(value, f"{name}.")
        else:
            yield name


def _content(path: Path) -> bytes:
    """Content of a regular file; a pipe or a device is refused, because reading it might never end."""
    try:
        found = path.stat()
        if stat.S_ISDIR(found.st_mode):
            raise _Fault("cannot be read (a folder, expected a YAML file)")
        if not stat.S_ISREG(found.st_mode):
            raise _Fault("cannot be read (not a regular file)")
        if found.st_size > _LARGEST_BYTES:
            raise _Fault(f"holds {found.st_size:,} bytes, expected a case file of at most {_LARGEST_BYTES:,}")
        return path.read_bytes()
    except OSError as error:
        raise _Fault(f"cannot be read ({error.strerror})") from None
    except ValueError:  # the path contains a null character
        raise _Fault("cannot be read (no name of a file)") from None


def _text(content: bytes) -> str:
    if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)) or b"\0" in content[:2]:
        raise _Fault("is text in UTF-16, expected UTF-8: save it as UTF-8")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        wrong = f"byte 0x{content[error.start]:02x} is not UTF-8"
        raise _Fault(f"not a text file in UTF-8 ({wrong}; in Latin-1? save it as UTF-8)", line) from None


def _parsed(text: str, twice: list[_Fault] | None = None) -> Any:
    """Convert a YAML text to plain data; ``twice`` collects the duplicate keys, which are refused without it."""
    try:
        loader = _Loader(text)
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise _Fault(f"not a YAML file (character U+{ord(text[error.position]):04X} in it)", line) from None
    loader.twice = twice
    try:
        node = loader.get_single_node()
        if node is None:
            return None
        _check(loader, node)
        return loader.construct_document(node)
    except RecursionError:
        raise _Fault("not a case (sections or lists nested in one another hundreds of times)") from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise _Fault(f"not a YAML file ({_problem(error)})", None if mark is None else mark.line + 1) from None
    finally:
        loader.dispose()


def _problem(error: yaml.MarkedYAMLError) -> str:
    """Error message for an error of PyYAML, with advice for frequent mistakes."""
    problem = shown(" ".join(str(error.problem).split()), 200)
    if "'\\t'" in problem:
        return "a tab, expected blanks: YAML takes no tabs before a key"
    if problem == "but found another document":
        return "a second document begins, expected one"
    if problem.startswith("could not determine a constructor"):
        return f"{problem}: only plain values are read"
    return problem


def _check(loader: _Loader, root: yaml.Node) -> None:
    """Refuse duplicate keys, anchors that contain themselves, and aliases that expand to too many values."""
    weights: dict[int, int] = {}  # number of values in each node after its aliases are expanded
    entered: set[int] = set()

    def weigh(node: yaml.Node, key: str) -> int:
        if id(node) in weights:
            return weights[id(node)]
        if id(node) in entered:
            raise _Fault(f"the anchor that {shown(key) or 'the case'} refers to contains itself", _line(node))
        entered.add(id(node))
        weight = 1
        if isinstance(node, yaml.SequenceNode):
            weight += sum(weigh(item, key) for item in node.value)
        elif isinstance(node, yaml.MappingNode):
            for name, (key_node, value) in zip(_names(loader, node, key), node.value, strict=True):
                weight += weigh(key_node, name) + weigh(value, name)
        weights[id(node)] = weight
        return weight

    if (values := weigh(root, "")) > _LARGEST_VALUES:
        number = f"{values:,}" if values < 10**15 else "10^15 and more"
        raise _Fault(f"its aliases stand for {number} values, expected at most {_LARGEST_VALUES:,}")


def _names(loader: _Loader, node: yaml.MappingNode, above: str) -> list[str]:
    """Names of a section's keys in dotted form; a duplicate key is refused, or collected."""
    lines: dict[Any, int] = {}
    names = []
    for key_node, _ in node.value:
        if not isinstance(key_node, yaml.ScalarNode):
            raise _Fault("not a YAML file (a key is a list or a section, expected a name)", _line(key_node))
        key = key_node.value if key_node.tag == _MERGE else loader.construct_object(key_node)
        if not isinstance(key, str):
            raise _Fault(f"YAML reads the key {key_node.value or 'null'} as {key}: put it in quotes", _line(key_node))
        name = f"{above}.{key}" if above else key
        if key in lines:
            text = f"{shown(name)} is given here and in line {lines[key]}, expected each key once"
            if loader.twice is None:
                raise _Fault(text, _line(key_node))
            loader.twice.append(_Fault(f"{text} (only the last one was looked at)", _line(key_node)))
        lines[key] = _line(key_node)
        names.append(name)
    return names


def _line(node: yaml.Node) -> int:
    return int(node.start_mark.line) + 1
