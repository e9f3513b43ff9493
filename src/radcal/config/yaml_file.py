"""Reader of YAML in case files and command-line settings; duplicate keys and too many aliases are refused.

This module returns plain data; the models of :mod:`radcal.config` check keys and values.
"""

from __future__ import annotations

import re
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from radcal.errors import ConfigError
from radcal.sections.errors import key_in_list, shown

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

    def __init__(self, text: str) -> None:
        super().__init__(text)
        self.lines: dict[str, int] = {}  # line of each key, in dotted form

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


def read_case_file(path: str | Path, places: dict[str, str] | None = None) -> dict[str, Any]:
    """Read the keys and values of a case file.

    Parameters
    ----------
    path : path
        A YAML file in UTF-8 with one document.
    places : dict, optional
        Mapping to which file and line of each key, in dotted form, are added.

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
        found, lines = _parsed(_text(_content(Path(path))))
    except _Fault as fault:
        line = "" if fault.line is None else f", line {fault.line}"
        raise ConfigError(f"{shown(str(path), 300)}{line}: {fault}.") from None
    if found is None:
        raise ConfigError(f"{path}: is empty, expected keys and values such as case: mine.")
    if not isinstance(found, Mapping):
        raise ConfigError(f"{path}: holds {type(found).__name__}, expected keys and values.")
    if places is not None:
        places |= {key: f"{path}, line {line}" for key, line in lines.items()}
    return dict(found)


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
        return _parsed(text)[0]
    except _Fault as fault:
        raise ConfigError(f"{origin}={shown(text)}: not valid JSON or YAML ({fault}).") from None


def settings(words: Sequence[str], origin: str = "--config") -> dict[str, Any]:
    """Convert settings ``section.key=value`` of the command line to nested data.

    Parameters
    ----------
    words : sequence of str
        Settings such as ``stop.rms=1e-6``; the names between the dots may contain blanks.
    origin : str
        Name of the option, for error messages.

    Raises
    ------
    ConfigError
        A word is not of the form ``key=value``, a value is neither JSON nor YAML, or a key is given twice, of which the
        last value would silently replace the first.
    """
    given, data = set[str](), dict[str, Any]()
    for word in words:
        key, equals, text = word.partition("=")
        parts = key.split(".")
        if not equals or not all(part.strip() for part in parts):
            raise ConfigError(f"{origin} {shown(word)}: expected KEY=VALUE such as stop.rms=1e-6.")
        value = read_value(text, f"{origin} {key}")
        for part in reversed(parts):
            value = {part: value}
        for name, _ in leaves(value):
            if name in given:
                raise ConfigError(f"{origin}: {shown(name)} is given twice, expected once.")
            given.add(name)
        data = merged(data, value)
    return data


def merged(base: Mapping[str, Any], over: Mapping[str, Any]) -> dict[str, Any]:
    """Copy of ``base`` with ``over`` merged into it, section by section."""
    both = dict(base)
    for key, value in over.items():
        below = both.get(key)
        both[key] = merged(below, value) if isinstance(value, Mapping) and isinstance(below, Mapping) else value
    return both


def leaves(data: Mapping[Any, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Keys in dotted form, and values that are no sections."""
    for key, value in data.items():
        name = f"{above}{key}"
        if isinstance(value, Mapping):
            yield from leaves(value, f"{name}.")
        else:
            yield name, value


def _content(path: Path) -> bytes:
    """Content of a regular file; a pipe or a device is refused, because reading it might never end."""
    try:
        found = path.stat()
        if not stat.S_ISREG(found.st_mode):
            raise _Fault("cannot be read (not a regular file, expected a YAML file)")
        if found.st_size > _LARGEST_BYTES:
            raise _Fault(f"holds {found.st_size:,} bytes, expected a case file of at most {_LARGEST_BYTES:,}")
        return path.read_bytes()
    except OSError as error:
        raise _Fault(f"cannot be read ({error.strerror}), expected a YAML file") from None
    except ValueError:  # the path contains a null character
        raise _Fault("cannot be read (no name of a file)") from None


def _text(content: bytes) -> str:
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        wrong = f"byte 0x{content[error.start]:02x} is not UTF-8"
        raise _Fault(f"not a text file in UTF-8 ({wrong}: save it as UTF-8)", line) from None


def _parsed(text: str) -> tuple[Any, dict[str, int]]:
    """Convert a YAML text to plain data, with the line of each key."""
    try:
        loader = _Loader(text)
    except yaml.reader.ReaderError as error:
        line = text.count("\n", 0, error.position) + 1
        raise _Fault(f"not a YAML file (character U+{ord(text[error.position]):04X} in it)", line) from None
    try:
        node = loader.get_single_node()
        if node is None:
            return None, {}
        _check(loader, node)
        return loader.construct_document(node), loader.lines
    except RecursionError:
        raise _Fault("not a case (sections or lists nested in one another hundreds of times)") from None
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        problem = shown(" ".join(str(error.problem).split()), 200)
        raise _Fault(f"not a YAML file ({problem})", None if mark is None else mark.line + 1) from None
    finally:
        loader.dispose()


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
            weight += sum(weigh(item, key_in_list(key, number)) for number, item in enumerate(node.value))
        elif isinstance(node, yaml.MappingNode):
            for name, (key_node, value) in zip(_names(loader, node, key), node.value, strict=True):
                weight += weigh(key_node, name) + weigh(value, name)
        weights[id(node)] = weight
        return weight

    if (values := weigh(root, "")) > _LARGEST_VALUES:
        number = f"{values:,}" if values < 10**15 else "10^15 and more"
        raise _Fault(f"its aliases stand for {number} values, expected at most {_LARGEST_VALUES:,}")


def _names(loader: _Loader, node: yaml.MappingNode, above: str) -> Iterable[str]:
    """Names of a section's keys in dotted form, none of which may occur twice."""
    lines: dict[str, int] = {}
    for key_node, _ in node.value:
        if not isinstance(key_node, yaml.ScalarNode):
            raise _Fault("not a YAML file (a key is a list or a section, expected a name)", _line(key_node))
        key = key_node.value if key_node.tag == _MERGE else loader.construct_object(key_node)
        if not isinstance(key, str):
            raise _Fault(f"YAML reads the key {key_node.value or 'null'} as {key}: put it in quotes", _line(key_node))
        name = f"{above}.{key}" if above else key
        if name in lines:
            text = f"{shown(name)} is given here and in line {lines[name]}, expected each key once"
            raise _Fault(text, _line(key_node))
        lines[name] = _line(key_node)
    loader.lines |= lines
    return lines


def _line(node: yaml.Node) -> int:
    return int(node.start_mark.line) + 1
