"""Findings: what a check or an assessment has found, as data; ``radcal.words`` turns them into sentences."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field, replace
from typing import Literal

Severity = Literal["note", "warning", "refusal"]


@dataclass(frozen=True)
class Finding:
    """Something that was found about an image, a case or a law.

    Attributes
    ----------
    code : str
        Name of the kind of finding, such as ``radiometry``.
    severity : {'note', 'warning', 'refusal'}
        ``refusal``: sigma0 is not determined whatever its band.
    about : str
        Material, pass (``pass 1``), key or file.
    numbers : mapping
        Numbers and names, whose keys end with their unit (``offset_db``, ``implied_deg``); ``pass`` is the number of
        the pass, where a case has several.
    do : str
        Line to set in the case file, such as ``radar.radiometry: sigma0_ref``; empty if there is none.
    """

    code: str
    severity: Severity
    about: str
    numbers: Mapping[str, float | str] = field(default_factory=dict)
    do: str = ""

    def json(self) -> str:
        """Finding as JSON."""
        return json.dumps(asdict(self), default=float)

    @classmethod
    def of_json(cls, text: str) -> Finding:
        """Finding from JSON that :meth:`json` wrote."""
        return cls(**json.loads(text))


def of_pass(findings: Iterable[Finding], number: int, passes: int) -> list[Finding]:
    """Findings with the number of their pass, from 1, among their numbers if a case has several passes."""
    if passes == 1:
        return list(findings)
    return [replace(one, numbers={**one.numbers, "pass": number}) for one in findings]
