"""HTML report: one self-contained page, ``report.html``.

The page says when, by which command and from which files it was made.
"""

from __future__ import annotations

import base64
import io
import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from radcal import skewnormal
from radcal.config import Material, input_files
from radcal.errors import RadcalError
from radcal.figures.drawing import slugs
from radcal.figures.figures import Figure
from radcal.figures.map_figures import shots
from radcal.forecast.runs_and_time import duration
from radcal.objectives.base import MET
from radcal.page.plots import Interactive, embedded_library, interactive, packed, script
from radcal.results.archive import Archive, MaterialResult
from radcal.results.law_notes import at_bound
from radcal.results.summary import numbered_jobs, summarise, wall_seconds
from radcal.sections.objectives import OBJECTIVES
from radcal.storage.files import atomic, file_sha256
from radcal.words import (
    ENDINGS,
    STANDINGS,
    Step,
    asked_steps,
    beside_headline,
    ends,
    headline,
    remarks,
    sentence,
    standing,
    step,
)

if TYPE_CHECKING:
    from PIL import Image

_SUPERSCRIPTS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_MINUS = "\N{MINUS SIGN}"
_TIMES = "\N{NARROW NO-BREAK SPACE}\N{MULTIPLICATION SIGN}\N{NARROW NO-BREAK SPACE}"
_QUALITY = 82  # of maps as WebP, whose speckle takes most of the page
_SPECKLED = 70  # of images of speckle alone
_COLOURS = 256  # of figures of lines and letters
_METHOD = 2  # effort of the WebP encoder, 0 to 6
_DIAGNOSTICS = ("front", "fidelity", "histogram", "quality")  # figures for those who know the method


def provenance_of(archive: Archive, folder: str | Path, command: str) -> dict[str, Any]:
    """Provenance of a report that is made now.

    Parameters
    ----------
    archive : Archive
        Results of the calibration.
    folder : path
        ``results/<case>``.
    command : str
        Command line that makes the report.

    Returns
    -------
    dict
        ``date`` in UTC to the minute, ``command``, ``seconds`` of each stage of the workflow until the report [s], and
        ``inputs``, name and SHA-256 of each input file by configuration key; empty if a file is no longer there.
    """
    try:
        inputs = {key: (path.name, file_sha256(path)) for key, path in input_files(archive.configured).items()}
    except (RadcalError, OSError):
        inputs = {}
    return {
        "date": datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        "command": command,
        # the file of an earlier report is not counted
        "seconds": wall_seconds(Path(folder) / "benchmarks", {**numbered_jobs(archive), "report": 0}),
        "inputs": inputs,
    }


@dataclass(frozen=True)
class _Shown:
    """Calibrated material with all that the page shows of it; ``summary`` is its part of ``summary.json``."""

    name: str
    slug: str
    summary: Mapping[str, Any]
    result: MaterialResult
    configured: Material
    standing: str
    step: Step
    figures: Mapping[str, Figure]
    plots: Mapping[str, Interactive]

    @property
    def product(self) -> str | None:
        """Kind of the figure of the first screen: the law or, without a curve, the density."""
        return next((kind for kind in ("law", "densities") if kind in self.figures or kind in self.plots), None)

    @property
    def kinds(self) -> list[str]:
        """Kinds of the other figures."""
        return [kind for kind in dict.fromkeys((*self.plots, *self.figures)) if kind != self.product]

    @property
    def met(self) -> bool:
        """Whether its search met its criterion."""
        return self.summary["stop_reason"] in MET

    @property
    def at_bounds(self) -> list[str]:
        """Parameters at a bound beyond which a better law may lie.

        That may be where the form of the law is seen to be wrong or, if the form cannot be tested, the search has
        failed.
        """
        form = self.summary.get("misfit")
        if self.met if form is None else not form["noticed"]:
            return []
        each = zip(self.summary["parameters"].items(), self.summary["bounds"], strict=True)
        return [name for (name, value), bounds in each if at_bound(value, *bounds)]


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


def _webp(pixels: Image.Image, quality: int | None = None) -> str:
    """Data address of an image as WebP, without loss or with a quality of 0 to 100."""
    held = io.BytesIO()
    options: dict[str, Any] = {"lossless": True} if quality is None else {"quality": quality}
    pixels.save(held, "WEBP", method=_METHOD, **options)
    return "data:image/webp;base64," + base64.b64encode(held.getvalue()).decode("ascii")


def _embedded(figure: Figure) -> str:
    """Data address of a figure: maps with some loss, lines and letters without, but in few colours."""
    from PIL import Image

    with Image.open(figure.png) as opened:
        shown = opened.convert("RGB")
        if figure.material is None and figure.name != "overview":
            return _webp(shown, _QUALITY)
        # the octree keeps pale areas and rare colours; the largest coverage tints the former, the median cut the latter
        few = shown.quantize(_COLOURS, Image.Quantize.FASTOCTREE, dither=Image.Dither.NONE)
        return _webp(few.convert("RGB"))


def _pixels(pixels: Any) -> str:
    """Data address of an array of pixels."""
    from PIL import Image

    return _webp(Image.fromarray(pixels), _SPECKLED)


def _theta(values: Mapping[str, float]) -> dict[str, float]:
    """Direct and centred parameters of a density by name."""
    mean, sd, skewness = skewnormal.centred([values["xi"], values["omega"], values["alpha"]])
    return {**values, "mean": float(mean), "sd": float(sd), "skewness": float(skewness)}


def _difference_db(name: str, summary: Mapping[str, Any]) -> float | None:
    """Largest difference of the law of the search from the truth over the incidence of all passes [dB]."""
    passes = [one["materials"] for one in summary.get("passes", ())]
    of_passes = [laws[name]["difference_db"] for laws in passes if name in laws]
    found = [summary["materials"][name].get("law_difference_db"), *of_passes]
    return max((one for one in found if one is not None), default=None)


def _seen(shown: _Shown) -> str:
    """Text of the incidence at which a material is seen in each pass."""
    spans = shown.result.posterior.seen_deg.tolist()
    return f"{' and '.join(f'{_number(a)} to {_number(b)}' for a, b in spans)} deg"


def _who(found: Sequence[_Shown], total: int) -> str:
    """Names of up to four materials, else their number."""
    return _listed([m.name for m in found]) if len(found) <= 4 else f"{len(found)} of {total} materials"


def _materials(
    archive: Archive, summary: Mapping[str, Any], figures: Sequence[Figure], plots: Sequence[Interactive]
) -> list[_Shown]:
    """Calibrated materials in the order of the configuration."""
    stop, found = archive.configured.stop, []
    of_search = np.isin(archive.runs.kind, ("design", "infill"))  # may exceed settings that were lowered since
    numbers = {"case": summary["case"], "idle": 2 * stop.stagnation_runs}
    numbers["max_runs"] = 2 * max(stop.max_runs, int(of_search.sum()))
    numbers["max_hours"] = 2.0 * max(stop.max_hours or 0.0, float(np.nansum(archive.runs.seconds[of_search])) / 3600.0)
    for (name, result), slug in zip(archive.materials.items(), slugs(archive.materials), strict=True):
        own, configured = summary["materials"][name], archive.configured.materials[name]
        found.append(
            _Shown(
                name=name,
                slug=slug,
                summary=own,
                result=result,
                configured=configured,
                standing=standing(name, archive.findings, own["stop_reason"] in MET),
                step=step(name, archive.findings, own["stop_reason"], **numbers),
                figures={figure.name.removesuffix(f"_{slug}"): figure for figure in figures if figure.material == name},
                plots={plot.name.removesuffix(f"-{slug}"): plot for plot in plots if plot.material == name},
            )
        )
    return found


def write_report(
    page: str | Path, archive: Archive, figures: Sequence[Figure], made: Mapping[str, Any] | None = None
) -> None:
    """Write ``report.html``, atomically.

    Parameters
    ----------
    page : path
        Path of the file.
    archive : Archive
        Results of a calibration.
    figures : sequence of Figure
        Figures from :func:`radcal.figures.figures.write_figures`; they are embedded as WebP, so that the page is one
        file that opens offline.
    made : mapping, optional
        Date, command, run time and input files (:func:`.provenance_of`).
    """
    import yaml
    from jinja2 import Environment, PackageLoader, StrictUndefined

    summary = summarise(archive)
    plots = interactive(archive)
    materials = _materials(archive, summary, figures, plots)
    urgency = list(STANDINGS)
    environment = Environment(
        loader=PackageLoader("radcal.page", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
    )
    filters = (_number, _listed, _embedded, _pixels, _span, _who, _theta, _seen)
    environment.filters |= {one.__name__[1:]: one for one in filters}
    environment.filters["duration"] = duration
    environment.globals |= {"at_bound": at_bound, "ends": ends, "endings": ENDINGS, "standings": STANDINGS}
    asked = asked_steps(archive.findings)[:1]
    text = environment.get_template("report.html.j2").render(
        summary=summary,
        configured=archive.configured,
        objective=OBJECTIVES[archive.configured.objective],
        refused=any(one.severity == "refusal" for one in archive.findings),
        asked=asked,
        headline=headline(list(archive.materials), archive.findings, archive.decision.converged, asked),
        warnings=beside_headline(summary["warnings"], archive.findings),
        remarks=[sentence(one) for one in remarks(archive.findings) if one.severity == "note"],
        runs=archive.runs,
        materials=materials,
        ranked=sorted(materials, key=lambda m: urgency.index(m.standing)),
        determined={one.about: one.numbers for one in archive.findings if one.code == "determined"},
        differences_db={m.name: _difference_db(m.name, summary) for m in materials},
        overall=[figure for figure in figures if figure.material is None and figure.name != "images"],
        shots=shots(archive),
        diagnostics=_DIAGNOSTICS,
        reasons=list(dict.fromkeys(reason for m in materials for reason in m.summary["left_out"])),
        specs=packed(json.dumps({plot.name: plot.spec for plot in plots}, separators=(",", ":"))) if plots else "",
        library=embedded_library(),
        drawing=script(),
        made=made,
        simulator_seconds=float(np.nansum(archive.runs.seconds)),
        config=yaml.safe_dump(json.loads(archive.config), sort_keys=False, default_flow_style=None, allow_unicode=True),
    )
    with atomic(page) as partial:
        partial.write_text(text, encoding="utf-8")
