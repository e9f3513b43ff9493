"""HTML report: one self-contained page, ``report.html``."""

from __future__ import annotations

import base64
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from radcal import skewnormal
from radcal.config import Material
from radcal.figures.figures import Figure
from radcal.results.archive import Archive, MaterialResult
from radcal.results.law_notes import at_bound
from radcal.results.reasons import REASONS
from radcal.results.summary import summarise
from radcal.sections.objectives import OBJECTIVES
from radcal.storage.files import atomic
from radcal.words import beside_headline, remarks, sentence

__all__ = ["write_report"]

_AGREE = 1.4  # largest ratio of rms to sampling error at which two densities count as equal
_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_MINUS = "\N{MINUS SIGN}"
_TIMES = "\N{NARROW NO-BREAK SPACE}\N{MULTIPLICATION SIGN}\N{NARROW NO-BREAK SPACE}"


def _number(value: float | None, digits: int = 3) -> str:
    """Text of a number with ``digits`` significant digits; very large or small numbers get a power of ten."""
    if value is None or not math.isfinite(value):
        return "\N{EN DASH}"
    if value == 0:
        return "0"
    if 1e-2 <= abs(value) < 1e6:
        decimals = max(0, digits - 1 - math.floor(math.log10(abs(value))))
        return f"{value:,.{decimals}f}".replace("-", _MINUS)
    mantissa, exponent = f"{value:.{digits - 1}e}".split("e")
    return f"{mantissa.replace('-', _MINUS)}{_TIMES}10{str(int(exponent)).translate(_SUPERSCRIPTS)}"


def _listed(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{', '.join(names[:-1])} and {names[-1]}"


def _span(values: Iterable[float | None]) -> str:
    """Text of the range of the known values; a single number if both ends have the same text."""
    found = sorted(value for value in values if value is not None)
    if not found:
        return _number(None)
    return " to ".join(dict.fromkeys((_number(found[0], 2), _number(found[-1], 2))))


def _embedded(path: Path) -> str:
    return "data:image/png;base64," + base64.b64encode(path.read_bytes()).decode("ascii")


def _theta(values: Mapping[str, float]) -> dict[str, float]:
    """Direct and centred parameters of a density by name."""
    mean, sd, skewness = skewnormal.centred([values["xi"], values["omega"], values["alpha"]])
    return {**values, "mean": float(mean), "sd": float(sd), "skewness": float(skewness)}


def _largest(found: Sequence[Mapping[str, Any]], key: str) -> Mapping[str, Any]:
    """Material with the largest value of ``key``; an unknown value counts as smallest."""
    return max(found, key=lambda m: -math.inf if m[key] is None else m[key])


def _material(
    name: str,
    summary: Mapping[str, Any],
    result: MaterialResult,
    material: Material,
    passes: Sequence[Mapping[str, Any]],
) -> dict[str, Any]:
    """Data of one material for the template of the page; ``passes`` are those of a case of several passes."""
    low, high = np.percentile(result.target.incidence_deg, [5.0, 95.0])
    laws = [one["materials"][name] for one in passes if name in one["materials"]]
    seen = [(law["low_deg"], law["high_deg"]) for law in laws] or [(float(low), float(high))]
    differences = [summary.get("law_difference_db"), *(law["difference_db"] for law in laws)]
    start, same_law = material.start_parameters, not material.starts_with_another_law
    hidden = summary.get("hidden", {})
    parameters = [
        {
            "name": key,
            "unit": unit.replace("rad2", "rad²"),
            # a value next to a bound has digits of the search without meaning
            "value": {"lower": bounds[0], "upper": bounds[1]}.get(at_bound(value, *bounds), value),
            "start": begun,
            "hidden": hidden.get(key),
            "model": (summary.get("parameters_model") or {}).get(key),
            "p05": summary.get("parameters_p05", {}).get(key),
            "p95": summary.get("parameters_p95", {}).get(key),
            "low": bounds[0],
            "high": bounds[1],
            "at": at_bound(value, *bounds),
        }
        for (key, value), unit, begun, bounds in zip(
            summary["parameters"].items(),
            material.parameter_units,
            # a start with another law has parameters of that other law
            start if same_law else [None] * len(summary["bounds"]),
            summary["bounds"],
            strict=True,
        )
    ]
    words = REASONS[summary["stop_reason"]]
    form = summary.get("misfit")
    # a better law may lie outside of the bounds where the form is seen to be wrong, or the search has failed
    limited = not words.met if form is None else form["noticed"]
    return {
        **summary,
        "name": name,
        "other_start": None if same_law else {"law": summary["start_law"], "parameters": start},
        "reason": words.clause,
        "short_reason": words.cell,
        "parameters": parameters,
        "at_bounds": [p for p in parameters if p["at"] and limited],
        "target": _theta(summary["target"]),
        "calibrated": _theta(summary["calibrated"]),
        "within": words.met,
        "low": float(low),
        "high": float(high),
        "drawn": result.target.pixels.size,
        "eligible": result.target.eligible,
        "at_boundary": result.target.at_boundary,
        "seen": f"{' and '.join(f'{_number(a)} to {_number(b)}' for a, b in seen)} deg",
        "difference_db": max((one for one in differences if one is not None), default=None),
        "known": "law_difference_db" in summary,
        # true for hidden parameters of an external law, too
        "truth": bool(hidden),
    }


def _who(found: Sequence[Mapping[str, Any]], total: int) -> str:
    """Names of up to four materials, else their number."""
    return _listed([m["name"] for m in found]) if len(found) <= 4 else f"{len(found)} of {total} materials"


def _criterion(materials: Sequence[Mapping[str, Any]]) -> str:
    """Sentences on the stop criterion of laws that are compared by incidence-angle bin."""
    missed, count = [m for m in materials if not m["within"]], len(materials)
    text = (
        "Laws that meet the stop criterion (the surrogate of all runs predicts no law that is clearly better and "
        f"differs by more than stop.law_db): {count - len(missed)} of {count}."
    )
    return f"{text} Better laws of {_who(missed, count)} may exist." if missed else text


def _ending(summary: Mapping[str, Any], materials: Sequence[Mapping[str, Any]]) -> str:
    """Sentence that says how the search ended, and after how many runs."""
    runs = f"{summary['runs']['design'] + summary['runs']['infill']} runs"
    if reused := summary["runs"]["reused"]:
        runs += f" and {reused} of an earlier case"
    aim = "the stop criterion of the law"
    if not OBJECTIVES[summary["objective"]].bins:
        aim = (
            f"the tolerance of {_number(summary['tolerance'], 2)} 1/{summary['levels']['unit']} (rms of the densities)"
        )
    if summary["converged"]:
        return f"Converged after {runs}: {aim} is met for {_who(materials, len(materials))}."
    missed = [m for m in materials if not m["within"]]
    who = _who(missed, len(materials))
    if summary["stop_reason"] == "running":
        return f"Not finished after {runs}: {aim} is not yet met for {who}."
    reasons = _listed(list(dict.fromkeys(m["reason"] for m in missed)))
    return f"Stopped after {runs}: {aim} is not met for {who} ({reasons})."


def _yaml(text: str) -> str:
    import yaml

    class Dumper(yaml.SafeDumper):
        pass

    Dumper.add_representer(
        list,
        lambda dumper, value: dumper.represent_sequence(
            "tag:yaml.org,2002:seq", value, flow_style=not any(isinstance(item, dict) for item in value)
        ),
    )
    return yaml.dump(json.loads(text), Dumper=Dumper, sort_keys=False, width=100, allow_unicode=True)


def write_report(page: str | Path, archive: Archive, figures: Sequence[Figure]) -> None:
    """Write ``report.html``, atomically.

    Parameters
    ----------
    page : path
        Path of the file.
    archive : Archive
        Results of a calibration.
    figures : sequence of Figure
        Figures from :func:`radcal.figures.figures.write_figures`; their PNG files are
        embedded, so that the page is one file that opens offline.
    """
    from jinja2 import Environment, PackageLoader, StrictUndefined

    summary = summarise(archive)
    passes = summary.get("passes", ())
    materials = [
        _material(name, summary["materials"][name], result, archive.configured.materials[name], passes)
        for name, result in archive.materials.items()
    ]
    refused = any(one.severity == "refusal" for one in archive.findings)
    determined = any(m.get("identified") for m in materials)
    good = summary["converged"] and determined and not refused and summary["fits"] is not False
    environment = Environment(
        loader=PackageLoader("radcal.page", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    environment.filters |= {"number": _number, "listed": _listed, "embedded": _embedded, "span": _span}
    environment.filters |= {"who": _who, "largest": _largest}
    text = environment.get_template("report.html.j2").render(
        summary=summary,
        objective=OBJECTIVES[archive.configured.objective],
        search=_ending(summary, materials),
        criterion=_criterion(materials),
        good=good,
        warnings=beside_headline(summary["warnings"], archive.findings),
        remarks=[sentence(one) for one in remarks(archive.findings) if one.severity == "note"],
        materials=materials,
        within=[m for m in materials if m["within"]],
        determined={one.about: one.numbers for one in archive.findings if one.code == "determined"},
        modelled=[m for m in materials if "posterior" in m],
        agreeing=[m["name"] for m in materials if m["rms"] is not None and m["rms"] <= _AGREE * m["rms_sampling"]],
        known=[m for m in materials if m["known"]],
        external=[m for m in materials if m["truth"] and not m["known"]],
        unknown=[m for m in materials if not m["truth"]],
        overall=[figure for figure in figures if figure.material is None],
        figures={m["name"]: [figure for figure in figures if figure.material == m["name"]] for m in materials},
        reasons=list(dict.fromkeys(reason for m in materials for reason in m["left_out"])),
        looks=f"{archive.configured.radar.looks:g}",
        max_runs=archive.configured.stop.max_runs,
        margin_px=archive.configured.target.margin_px,
        config=_yaml(archive.config),
    )
    with atomic(page) as partial:
        partial.write_text(text, encoding="utf-8")
