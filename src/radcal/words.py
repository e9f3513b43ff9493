"""Sentences, verdicts and headlines: the one place where findings become words, by the texts of `finding_texts`."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

from radcal.finding_texts import STEPS, TEXTS
from radcal.findings import Finding

_NOTICED = " (a bump of {noticed_db:.1f} dB would be noticed in 9 of 10 images)"
_STATES = ("determined", "undetermined", "withheld", "another_law", "level_only", "parameters_only", "without_cells")
_OF_VERDICT = (*_STATES, "refuted", "form_noticed", "not_refuted")
_COUNTED = {
    "determined": "determined at some angles",
    "undetermined": "determined at no angle",
    "withheld": "determined at no angle, because an image is refused",
    "another_law": "determined at no angle, because the program computes another law",
    "level_only": "seen at one incidence alone",
    "parameters_only": "without a band of sigma0",
    "without_cells": "without enough pixels side by side",
}
_DETERMINED = "determined to +-{half_width_db:.1f} dB {between}"
_WIDTHS = (
    "+-{half_width_db:.1f} dB for the material, +-{field_half_width_db:.1f} dB for its fields in this image, and "
    "+-{systematic_db:.1f} dB for the material by errors of level, radiometry, noise, incidence and point spread alone "
    "(systematic)"
)
STANDINGS = {
    "refuted": "law refuted",
    "unfinished": "search not finished",
    "nowhere": "determined nowhere",
    "level": "level only",
    "parameters": "parameters only",
    "determined": "determined",
}
"""Words for the standing of a material, those that need action first."""
ENDINGS = {
    "rms": "tolerance reached",
    "settled": "stop criterion met",
    "unreachable": "target seems out of reach inside the bounds",
    "stagnation": "no longer getting better",
    "max_runs": "maximum number of runs",
    "max_hours": "maximum time of the simulator",
    "running": "not finished",
}
"""Words for each :data:`radcal.objectives.base.Reason` why a search ended, and for one that has not ended."""
_MOVES = " (the best law predicted differs from that of the best run by {moved_db:.2g} dB)"
_ABOVE = "rms {rms:.2g}, above the tolerance {tolerance:.2g}"
_NAMED = 4  # most materials named in a headline
_STEPS = ("depression", "relief", "place", "radiometry", "fixed_law", "fixed_law_and_image", "level")
_DO = {
    "relief": "check {do}, whose heights must be in metres (not feet), of the same place, and not flipped",
    "place": "check {do}, or set the materials and the elevation of the place that it shows",
    "fixed_law": "check {do}",
    "fixed_level": "check {do} and the calibration of the image",
    "fixed_law_and_image": "check materials.{about}.parameters and the calibration of the image",
    "level": "check the absolute calibration of the image",
}


@dataclass(frozen=True)
class Step:
    """What to do next.

    Attributes
    ----------
    short : str
        Two or three words, for a table.
    text : str
        Clause without an end mark.
    paste : str
        Line for the case file, or command; empty if there is none.
    """

    short: str
    text: str
    paste: str


def sentence(finding: Finding, prefix: bool = True, asks: bool = True) -> str:
    """Sentence of a finding.

    Parameters
    ----------
    finding : Finding
        Finding.
    prefix : bool
        Whether the sentence of a warning or refusal begins with this word.
    asks : bool
        Whether it ends with what to do.
    """
    start = f"{finding.severity}: " if prefix and finding.severity != "note" else ""
    start += f"pass {finding.numbers['pass']:.0f}: " if "pass" in finding.numbers else ""
    start += f"{finding.about}: " if finding.code in _OF_VERDICT else ""
    text = f"{start}{_clause(finding, asks)}"
    return text if text.endswith(("?", ".")) else f"{text}."


def _clause(finding: Finding, asks: bool = True) -> str:
    """Text of a finding with what to do about it; of a part of a verdict, without the name of the material."""
    text = TEXTS[finding.code].format(about=finding.about, do=finding.do, **_numbers(finding))
    if finding.code == "not_refuted" and "noticed_db" in finding.numbers:
        text += _NOTICED.format(**finding.numbers)
    return f"{text}: {_do(finding)}" if asks and finding.severity != "note" and _do(finding) else text


def _numbers(finding: Finding) -> dict[str, float | str]:
    """Numbers of a finding, with the texts of its intervals and counts."""
    numbers = dict(finding.numbers)
    numbers |= {f"counted_{key}": _runs(int(numbers[key])) for key in ("runs", "idle") if key in numbers}
    standing = _ABOVE if "tolerance" in numbers else "stop criterion not met" + _MOVES * ("moved_db" in numbers)
    numbers["standing"] = standing.format(**numbers)
    if "least_nesz_db" in numbers:
        low, high = f"{numbers['least_nesz_db']:.1f}", f"{numbers['largest_nesz_db']:.1f}"
        numbers["nesz"] = low if low == high else f"{low} to {high}"
    if "from_deg" in numbers:
        numbers["between"] = degrees(float(numbers["from_deg"]), float(numbers["to_deg"]))
    return numbers


def _runs(number: int) -> str:
    return f"{number} run{'' if number == 1 else 's'}"


def _do(finding: Finding) -> str:
    """What to do about a finding, without an end mark; empty if there is nothing."""
    asked = _DO.get(finding.code, "set {do}" if finding.do else "")
    return asked.format(about=finding.about, do=finding.do)


def verdict(name: str, findings: Sequence[Finding]) -> str:
    """Verdict on one material: where sigma0 is determined, and whether the law is refuted."""
    own = [_clause(one) for one in findings if one.about == name and one.code in _OF_VERDICT]
    return f"{name}: {'; '.join(own)}."


def doubts(names: Collection[str], findings: Iterable[Finding]) -> list[str]:
    """Sentences on materials whose sigma0 is determined at no angle or at one, or whose law is refuted."""
    codes = (*(code for code in _STATES if code != "determined"), "refuted")
    return [sentence(one) for one in findings if one.about in names and one.code in codes]


def state(name: str, findings: Iterable[Finding]) -> str:
    """Few words, for a title, on where sigma0 of a material is determined; empty without such a finding."""
    own = next((one for one in findings if one.about == name and one.code in _STATES), None)
    if own is None:
        return ""
    return (_DETERMINED if own.code == "determined" else _COUNTED[own.code]).format(**_numbers(own))


def widths(name: str, findings: Iterable[Finding]) -> str:
    """Half-widths of the bands of a material, of its fields and of the systematic part; empty if not determined."""
    own = next((one for one in findings if one.about == name and one.code == "determined"), None)
    return "" if own is None or "systematic_db" not in own.numbers else _WIDTHS.format(**own.numbers)


def remarks(findings: Iterable[Finding]) -> list[Finding]:
    """Findings that no verdict tells, warnings and refusals first."""
    return sorted((one for one in findings if one.code not in _OF_VERDICT), key=lambda one: one.severity == "note")


def beside_headline(sentences: Iterable[str], findings: Iterable[Finding]) -> list[str]:
    """Sentences of findings without those that the headline on ``findings`` tells."""
    stated = {sentence(one) for one in _in_headline(findings)}
    return [one for one in sentences if one not in stated]


def _in_headline(findings: Iterable[Finding]) -> list[Finding]:
    """Findings that the headline tells beside the verdict: refusals, or else the first warning that asks for a step."""
    refused, warned = list[Finding](), list[Finding]()
    for one in findings:
        if one.severity == "refusal" and one.code != "withheld":
            refused.append(one)
        elif one.severity == "warning" and one.code in _STEPS:
            warned.append(one)
    return refused or warned[:1]


def asked_steps(findings: Iterable[Finding]) -> list[Step]:
    """Steps that findings on the whole case ask for, the most important first."""
    asked = [one for one in findings if one.code in _STEPS and one.severity != "note" and _do(one)]
    first = sorted(asked, key=lambda one: _STEPS.index(one.code))
    return [Step(one.code, _do(one), one.do if ": " in one.do else "") for one in first]


def standing(name: str, findings: Iterable[Finding], finished: bool) -> str:
    """Standing of a material, a key of :data:`STANDINGS`; ``finished`` says whether its search met its criterion."""
    codes = {one.code for one in findings if one.about == name}
    if "refuted" in codes:
        return "refuted"
    if not finished:
        return "unfinished"
    known = {"level_only": "level", "parameters_only": "parameters", "determined": "determined"}
    return next((word for code, word in known.items() if code in codes), "nowhere")


def step(name: str, findings: Sequence[Finding], reason: str, **numbers: float | str) -> Step:
    """Next step that follows from the state of a material.

    Parameters
    ----------
    name : str
        Calibrated material.
    findings : sequence of Finding
        All findings.
    reason : str
        Why its search ended, a key of :data:`ENDINGS`.
    **numbers
        Numbers and names for the texts of findings: ``case``, ``max_runs``, ``max_hours`` and ``idle``.
    """
    codes = [one.code for one in findings if one.about == name and one.code in (*_STATES, "refuted")]
    code = "refuted" if "refuted" in codes else reason if reason in STEPS else next(iter(codes), "undetermined")
    short, text, paste = (each.format(about=name, **numbers) for each in STEPS[code])
    return Step(short, text, paste)


def headline(names: Sequence[str], findings: Sequence[Finding], finished: bool, beside: Collection[Step] = ()) -> str:
    """First line of terminal output, summary and report.

    Parameters
    ----------
    names : sequence of str
        Calibrated materials.
    findings : sequence of Finding
        All findings.
    finished : bool
        Whether the search has met its stop criterion.
    beside : collection of Step
        Steps that stand beside it, and are not said again.
    """
    said = {step.text for step in beside}
    stated = _in_headline(findings)
    refused = any(one.severity == "refusal" for one in stated)
    texts = [sentence(one, prefix=False, asks=_do(one) not in said) for one in stated]
    if len(names) == 1:
        overall = verdict(names[0], findings)
    else:
        overall = f"sigma0 of {len(names)} materials: {', '.join(_counts(findings))}."
    unchecked = [one.code for one in findings if one.code.endswith("_unchecked")]
    if unchecked and not refused:
        overall += f" Unchecked: {', '.join(dict.fromkeys(code.removesuffix('_unchecked') for code in unchecked))}."
    return " ".join([*texts, overall] if refused else [overall, *texts]) + (
        "" if finished else " The search is not finished."
    )


def _counts(findings: Sequence[Finding]) -> list[str]:
    found = []
    for code, words in _COUNTED.items():
        names = [one.about for one in findings if one.code == code]
        if names:
            who = f" ({', '.join(names)})" if len(names) <= _NAMED else ""
            found.append(f"{len(names)} {'is' if len(names) == 1 else 'are'} {words}{who}")
    refuted = [one.about for one in findings if one.code == "refuted"]
    if refuted:
        found.append(f"laws refuted: {', '.join(refuted)}")
    return found


def degrees(low: float, high: float) -> str:
    """Text "between a and b degrees" of an interval [deg], rounded by :func:`ends`."""
    return "between {} and {} degrees".format(*ends(low, high))


def ends(low: float, high: float) -> tuple[str, str]:
    """Ends of an interval [deg], rounded into it; those of a narrow one have two decimals."""
    inner = math.ceil(low), math.floor(high)
    return (str(inner[0]), str(inner[1])) if inner[0] < inner[1] else (f"{low:.2f}", f"{high:.2f}")
