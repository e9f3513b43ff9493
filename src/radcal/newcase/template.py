"""Template of a new case: the keys of its lines, and the options of ``radcal new`` that give their values."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

_LINE = re.compile(r"(?m)^(\w+):|^  (\w+):( FILL_IN)?(?:  # (?:(--\S+) ([A-Z]+): )?(.*))?$")


@dataclass(frozen=True)
class Line:
    """Line of the template.

    Attributes
    ----------
    needed : bool
        Whether the case needs a value, which is marked FILL_IN where no option and no file gives it.
    option : str
        Option of ``radcal new``, or several names of it with commas between them; empty for a key without an option.
    kind : str
        Kind of the option's value: TEXT, FLOAT, INTEGER or LIST (texts of an option that may be repeated).
    comment : str
        Comment in the case, and help of the option.
    """

    needed: bool
    option: str
    kind: str
    comment: str


def _template() -> dict[str, Line]:
    """Lines of ``template.yaml``, which ``radcal new --help`` shows without waiting for a library that reads YAML."""
    found, section = dict[str, Line](), ""
    for words in _LINE.finditer(Path(__file__).with_name("template.yaml").read_text("utf-8")):
        if words[1]:
            section = words[1]
        else:
            found[f"{section}.{words[2]}"] = Line(bool(words[3]), words[4] or "", words[5] or "", words[6] or "")
    return found


TEMPLATE = _template()
"""Lines of the template by key in dotted form, such as ``radar.looks``."""
