"""Comparison of two finished calibrations: one table of the materials in both, and one figure of their laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from radcal.errors import ConfigError
from radcal.figures.drawing import FOUND, SIGMA0, START, law_panels
from radcal.posterior.result import Curve
from radcal.products.tables import aligned
from radcal.results.archive import Archive, MaterialResult, read_finished
from radcal.results.summary import summarise
from radcal.storage.records import understood
from radcal.words import ends

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Doubles = NDArray[np.float64]
Intervals = tuple[tuple[float, float], ...]

_ANGLES = 101  # angles at which two laws are compared

_HEADINGS = ("material", "seen by both", "mean B-A", "largest", "bands meet", "law", "determined", "runs of search")


@dataclass(frozen=True)
class LawDifference:
    """Difference between the laws of one material in two calibrations, over the incidence that both have seen.

    Attributes
    ----------
    seen_deg : tuple of (float, float)
        Intervals of incidence seen by both [deg]: 5 to 95 % quantile of the pixels' local incidence in each pass.
    mean_db, largest_db : float
        Difference between the medians, second minus first: its mean, and its value where its magnitude is largest [dB].
    bands_meet : float
        Share of the incidence ``seen_deg`` at which the two 90 % bands overlap.
    """

    seen_deg: Intervals
    mean_db: float
    largest_db: float
    bands_meet: float


def _band(archive: Archive, name: str) -> tuple[Curve, Intervals] | None:
    """Sigma0 of a material with its band, and incidence seen [deg]; None for a law without a curve."""
    posterior = archive.materials[name].posterior
    return None if posterior.curve is None else (posterior.curve, _united(posterior.seen_deg.tolist()))


def _united(intervals: Sequence[Sequence[float]]) -> Intervals:
    """Union of intervals, as separate intervals in ascending order."""
    found: list[tuple[float, float]] = []
    for low, high in sorted(map(tuple, intervals)):
        if found and low <= found[-1][1]:
            found[-1] = (found[-1][0], max(found[-1][1], high))
        else:
            found.append((low, high))
    return tuple(found)


def law_difference(first: Archive, second: Archive, name: str) -> LawDifference | None:
    """Difference between the laws of a material.

    Parameters
    ----------
    first, second : Archive
        Results of two calibrations.
    name : str
        A material that both have calibrated.

    Returns
    -------
    LawDifference or None
        None if a law has no curve, or if the two calibrations have seen no incidence in common.
    """
    a, b = _band(first, name), _band(second, name)
    if a is None or b is None:
        return None
    pairs = ((max(one[0], two[0]), min(one[1], two[1])) for one in a[1] for two in b[1])
    both = _united([(low, high) for low, high in pairs if low <= high])
    if not both:
        return None
    whole = sum(high - low for low, high in both)
    degrees = np.concatenate([
        np.linspace(low, high, max(2, round(_ANGLES * ((high - low) / whole if whole > 0.0 else 1.0))))
        for low, high in both
    ])  # fmt: skip
    (low_a, middle_a, high_a), (low_b, middle_b, high_b) = a[0].at(degrees), b[0].at(degrees)
    difference = middle_b - middle_a
    meet = float(np.mean((low_a <= high_b) & (low_b <= high_a)))
    largest = float(difference[np.argmax(np.abs(difference))])
    return LawDifference(both, float(difference.mean()), largest, meet)


def compare(folders: Sequence[str | Path], figure: str | Path) -> list[str]:
    """Compare two calibrations: return a table as lines, and write a figure of the laws with their bands.

    Parameters
    ----------
    folders : sequence of two paths
        Results folders of two finished cases.
    figure : path
        PNG file, written atomically.

    Returns
    -------
    list of str
        Table, with one line for each material that both have calibrated, and the path of the figure.

    Raises
    ------
    ConfigError
        The cases have no calibrated material in common, or the levels of a case are not in dB.
    DamagedError, StoreError
        An archive is damaged, or is missing because the calibration is not finished.
    """
    first, second = map(read_finished, folders)
    shared = [name for name in first.materials if name in second.materials]
    if not shared:
        raise ConfigError(
            f"{folders[0]} and {folders[1]} have calibrated no material in common: found {', '.join(first.materials)} "
            f"and {', '.join(second.materials)}, expected at least one of the same name."
        )
    for folder, archive in zip(folders, (first, second), strict=True):
        if archive.levels.unit != "dB":
            raise ConfigError(
                f"{folder}: levels are in {archive.levels.unit}, expected dB, in which laws are compared."
            )
        with understood(Path(folder) / "calibration.h5"):
            for name in shared:
                _row(archive, archive, name)
    rows = [_HEADINGS, *(_row(first, second, name) for name in shared)]
    lines = [f"A: {folders[0]}", f"B: {folders[1]}", "", *aligned(rows)]
    for one, other, letter in ((first, second, "A"), (second, first, "B")):
        if alone := [name for name in one.materials if name not in other.materials]:
            lines.append(f"only in {letter}: {', '.join(alone)}")
    with law_panels(figure, shared, SIGMA0) as panels:
        for axes, name in panels:
            for archive, letter, style in ((first, "A", START), (second, "B", FOUND)):
                if (band := _band(archive, name)) is not None:
                    _draw(axes, *band, f"{letter}: {archive.configured.case}", style)
    return [*lines, f"figure: {figure}"]


def _row(first: Archive, second: Archive, name: str) -> tuple[str, ...]:
    """Cells of the table for one material."""
    found = law_difference(first, second, name)
    cells = ("-",) * 4
    if found is not None:
        seen = f"{', '.join(f'{low:.1f}-{high:.1f}' for low, high in found.seen_deg)} deg"
        cells = (seen, f"{found.mean_db:+.2f} dB", f"{found.largest_db:+.2f} dB", f"{100 * found.bands_meet:.0f} %")
    pair = [(archive, archive.materials[name]) for archive in (first, second)]
    fits = [_fits(material) for _, material in pair]
    known = [_known(material) for _, material in pair]
    runs = [str(summarise(archive)["runs"]["search"]) for archive, _ in pair]
    return (name, *cells, *(" | ".join(each) for each in (fits, known, runs)))


def _fits(material: MaterialResult) -> str:
    """Cell of the table on the form of the law."""
    if material.fits is None:
        return "level only" if material.level_only else "unknown"
    return "not refuted" if material.fits else "refuted"


def _known(material: MaterialResult) -> str:
    """Cell of the table on the incidence at which sigma0 is determined."""
    if material.posterior.curve is None:
        return "-"
    if material.level_only:
        return "level only"
    known = material.posterior.known_between_deg
    return "nowhere" if known is None else "{}-{} deg".format(*ends(*known))


def _draw(axes: Axes, curve: Curve, each_seen: Intervals, label: str, style: Mapping[str, Any]) -> None:
    """Draw one law with its 90 % band; the line is thick over the incidence seen, and dashed lines lie on top."""
    low, high = each_seen[0][0], each_seen[-1][1]
    around = np.linspace(max(low - 10.0, 0.0), min(high + 10.0, 90.0), 201)
    lowest, middle, highest = curve.at(around)
    line = {"color": style["color"], "linestyle": style["linestyle"], "zorder": 2 if style["linestyle"] == "-" else 3}
    axes.plot(around, middle, linewidth=1.0, **line)
    for k, seen in enumerate(each_seen):
        inside = np.linspace(*seen, _ANGLES)
        axes.plot(inside, curve.at(inside)[1], linewidth=3.0, label=label if k == 0 else None, **line)
    axes.fill_between(around, lowest, highest, color=style["color"], alpha=0.25, linewidth=0)
