"""Advice on a further pass: how far each candidate is expected to narrow the 90 % bands of a finished calibration."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radcal.angles import depression_deg
from radcal.assessment.preposterior import View, half_widths_after, half_widths_now, view_of
from radcal.config import Case, Radar
from radcal.errors import ConfigError
from radcal.findings import Finding
from radcal.laws import Law
from radcal.posterior.curves import GRID_DEG, NORMAL_90
from radcal.posterior.result import Posterior
from radcal.products.tables import aligned, write_csv
from radcal.radar.projection import make_geometry
from radcal.results.archive import Archive, read_finished
from radcal.scene.model import Scene
from radcal.tables.sensors import sensors
from radcal.words import doubts, sentence

Doubles = NDArray[np.float64]

_STEP_DEG = 15.0
_DEPRESSIONS = (10.0, 75.0)
_INCIDENCES = (15.0, 80.0)
_SIDES = ("right", "left")
_EQUAL = 1.05  # ratio of two half-widths after a pass up to which the passes count as equally good
_LITTLE = 0.9  # ratio of the half-width after a pass to that now above which the pass hardly narrows the band
_ALL = "all materials"
COLUMNS = (
    "depression_deg", "look_side", "material", "incidence_p05_deg", "incidence_p95_deg", "half_width_now_db",
    "half_width_after_db", "after_over_now", "over_from_deg", "over_to_deg", "layover", "shadow",
)  # fmt: skip
_HEADINGS = ("pass", "material", "incidence 5-95 %", "half-width now", "after", "layover", "shadow")


@dataclass(frozen=True)
class Advised:
    """Expected effect of one further pass on the 90 % band of one material.

    Attributes
    ----------
    radar : Radar
        The further pass.
    material : str
        Calibrated material.
    incidence_deg : (float, float) or None
        5 and 95 % quantile of the local incidence of the material's usable pixels in this pass [deg]; None for fewer
        than 50 pixels.
    now_db, after_db : float
        Mean half-width of the 90 % band of sigma0 [dB] over ``over_deg``, now and expected after this pass.
    over_deg : (float, float)
        Incidence over which the half-widths are averaged [deg].
    layover, shadow : float
        Shares of the image's pixels in layover, and with ground in shadow.
    """

    radar: Radar
    material: str
    incidence_deg: tuple[float, float] | None
    now_db: float
    after_db: float
    over_deg: tuple[float, float]
    layover: float
    shadow: float

    @property
    def name(self) -> str:
        """Depression or incidence angle and look side of the pass, in words."""
        if self.radar.incidence_deg is not None:
            return f"incidence {self.radar.incidence_deg:g} deg {self.radar.look_side}"
        return f"{self.radar.depression_deg:g} deg {self.radar.look_side}"


def candidates(case: Case, depressions: Sequence[float] = ()) -> list[Radar]:
    """Candidate passes that the sensor can fly, without the passes that the case already has.

    Parameters
    ----------
    case : Case
        Case whose first pass gives the other settings. If it names a sensor whose look side or incidences are known
        (``radar.sensor``), candidates keep them; else they have both look sides.
    depressions : sequence of float
        Depression angles [deg]; by default that of the first pass, and 15 degrees more and less, or as far as the
        sensor can. In a case with ``incidence_deg``, a candidate has the incidence 90 degrees minus depression angle.

    Raises
    ------
    ConfigError
        A given angle is impossible, or the sensor cannot fly it.
    """
    first = case.radar
    for angle in depressions:
        if not 5.0 < angle < 85.0:
            raise ConfigError(f"--depression is {angle:g}, expected an angle above 5 and below 85 degrees.")
    sensor = None if first.sensor is None else sensors()[first.sensor]
    sides = _SIDES if sensor is None or "look_side" not in sensor.values else (first.look_side,)
    if first.incidence_deg is None:
        key, middle, (low, high), given = "depression_deg", first.depression_deg, _DEPRESSIONS, list(depressions)
    else:
        key, middle, (low, high) = "incidence_deg", first.incidence_deg, _INCIDENCES
        given = [90.0 - angle for angle in depressions]
    around = [middle + step for step in (0.0, -_STEP_DEG, _STEP_DEG)]
    if sensor is not None and sensor.incidence_deg is not None:
        low, high = sensor.incidence_deg
        if key == "depression_deg":
            low, high = (_depression_deg(first, angle) for angle in (high, low))
        around = [middle, max(around[1], low), min(around[2], high)]
        for angle in given:
            if not low <= angle <= high:
                raise ConfigError(
                    f"--depression gives a pass of {key} {angle:g}, which {first.sensor} does not fly (radar.sensor), "
                    f"expected {low:.1f} to {high:.1f} degrees (docs/sensors.md)."
                )
    angles = given or [angle for angle in dict.fromkeys(around) if low <= angle <= high]
    if first.incidence_deg is not None:
        angles = [round(angle, 2) for angle in angles]
    taken = {(getattr(one.radar, key), one.radar.look_side) for one in case.passes}
    return [
        first.model_copy(update={key: float(angle), "look_side": side})
        for angle in angles
        for side in sides
        if (angle, side) not in taken
    ]


def _depression_deg(radar: Radar, incidence_deg: float) -> float:
    """Depression angle of a pass of another incidence [deg], over the earth of the given pass."""
    return 90.0 - incidence_deg if radar.earth == "flat" else depression_deg(incidence_deg, radar.altitude_m)


def _opposite(radar: Radar) -> Finding:
    """Heading of a satellite that sees the scene from the other side."""
    numbers = {"heading_deg": radar.heading_deg, "opposite_deg": (180.0 - radar.heading_deg) % 360.0}
    return Finding("opposite_side", "note", "radar.heading_deg", numbers)


def advice_on(
    case: Case,
    scene: Scene,
    found: Mapping[str, tuple[Posterior, Law]],
    passes: Sequence[Radar],
    over_deg: tuple[float, float] | None = None,
    removed_db: float | None = None,
) -> list[list[Advised]]:
    """Expected half-widths of the bands of calibrated materials after each candidate pass, one pass at a time.

    Parameters
    ----------
    case : Case
        Passes, target settings and uncertainties of the calibration.
    scene : Scene
        Scene of the calibration, with elevations.
    found : mapping
        Posterior, with draws, and law of each material.
    passes : sequence of Radar
        Passes to compare.
    over_deg : (float, float), optional
        Incidence of interest [deg]. By default, it reaches from the lowest 5 % quantile to the highest 95 % quantile of
        the material's incidence, over the passes of the case and the passes compared.
    removed_db : float, optional
        Standard error of a level that the fixed laws give in all passes [dB] (``normalisation: offset``). By default,
        each pass has its own error of ``uncertainty.level_db``.

    Returns
    -------
    list of list of Advised
        For each pass, one item for each material; passes are in ascending order of :func:`common_ratio`.
    """
    geometries = [make_geometry(scene, radar) for radar in passes]
    own = [(one.radar, make_geometry(scene, one.radar)) for one in case.passes]
    rows: list[list[Advised]] = [[] for _ in passes]
    removed, margin_px = removed_db is not None, case.target.margin_px
    config = case.uncertainty.model_copy(update={"level_db": removed_db} if removed else {})
    for name, (posterior, law) in found.items():
        draws = posterior.draws
        assert draws is not None  # noqa: S101 - asked for by the caller
        views = [view_of(name, made, radar, margin_px, scene) for radar, made in zip(passes, geometries, strict=True)]
        known = [view_of(name, made, radar, margin_px, scene) for radar, made in own]
        measured = [one for one in known if one is not None]
        seen = [_seen(one) for one in (*views, *measured) if one is not None]
        over = over_deg or (min(low for low, _ in seen), max(high for _, high in seen))
        of = np.flatnonzero((over[0] <= GRID_DEG) & (over[1] >= GRID_DEG)).astype(np.int64)
        now = float(half_widths_now(draws.curves_db(law)[:, of]).mean())
        for each, radar, made, view in zip(rows, passes, geometries, views, strict=True):
            after = now
            if view is not None:
                widths = half_widths_after(draws, law, measured, [view], posterior.looks, config, of, removed)
                after = float(widths.mean())
            incidence = None if view is None else _seen(view)
            each.append(Advised(radar, name, incidence, now, after, over, made.layover.mean(), made.shadow.mean()))
    return sorted(rows, key=common_ratio)


def common_ratio(rows: Sequence[Advised]) -> float:
    """Ratio of the half-width after one pass to the half-width now: geometric mean over the materials.

    The geometric mean gives the ratios of wide and narrow bands the same weight.

    Parameters
    ----------
    rows : sequence of Advised
        Rows of one pass, one for each material.
    """
    return float(np.exp(np.mean([np.log(row.after_db / row.now_db) for row in rows])))


def _seen(view: View) -> tuple[float, float]:
    low, high = np.quantile(view.incidence_deg, [0.05, 0.95])
    return float(low), float(high)


def of_archive(archive: Archive, folder: str | Path) -> dict[str, tuple[Posterior, Law]]:
    """Posterior and law of each calibrated material whose law has a curve in dB.

    Raises
    ------
    ConfigError
        No material has draws and a law with a curve in dB.
    """
    found = {}
    for name, material in archive.materials.items():
        posterior = material.posterior
        if posterior.curve is not None and posterior.draws is not None:
            found[name] = (posterior, archive.configured.laws[name])
    if not found:
        raise ConfigError(
            f"{folder}: no calibrated material has a band of sigma0 in dB, expected a law with a curve and "
            "target.normalisation none or offset."
        )
    return found


def advise(
    folder: str | Path, depressions: Sequence[float] = (), over_deg: tuple[float, float] | None = None
) -> list[str]:
    """Lines on further passes, with a table that is also written to a file in the results folder.

    The file is ``advice.csv``, or, with given angles, for example ``advice_depression_30_between_20_50.csv``.

    Parameters
    ----------
    folder : path
        Results folder of a finished case.
    depressions : sequence of float
        Depression angles to compare [deg]; see :func:`candidates`.
    over_deg : (float, float), optional
        Incidence of interest [deg]; see :func:`advice_on`.

    Returns
    -------
    list of str

    Raises
    ------
    ConfigError
        The scene has no elevations, no law has a band, or an angle is impossible.
    DamagedError, StoreError
        A file is damaged, or is missing because the calibration is not finished.
    """
    folder = Path(folder)
    if over_deg is not None and not 0.0 <= over_deg[0] < over_deg[1] <= 90.0:
        raise ConfigError(f"--between is {over_deg[0]:g} {over_deg[1]:g}, expected two increasing angles in 0 to 90.")
    archive, scene = read_finished(folder), Scene.read(folder / "scene.h5")
    if scene.elevation_m is None:
        raise ConfigError(
            f"{folder}: the scene is in slant range, whose incidence is the same in every pass, expected a scene with "
            "elevations."
        )
    case = archive.configured
    passes = candidates(case, depressions)
    if not passes:
        raise ConfigError("--depression names only passes that the case has, expected at least one other.")
    found = of_archive(archive, folder)
    low, _, high = archive.image.levels_db.T
    removed_db = float(0.5 * (high - low).mean() / NORMAL_90) if case.target.normalisation == "offset" else None
    advised = advice_on(case, scene, found, passes, over_deg, removed_db)
    # tables of other angles lie side by side
    named = [("depression", depressions), ("between", over_deg or ())]
    words = ["advice", *("_".join([key, *(f"{x:g}" for x in angles)]) for key, angles in named if angles)]
    table = folder / f"{'_'.join(words)}.csv"
    write_csv(table, COLUMNS, _rows(advised))
    remarks = [*map(sentence, best_passes(advised)), *doubts(found, archive.findings)]
    if case.radar.incidence_deg is not None:
        remarks.append(sentence(_opposite(case.radar)))
    return [*_table(advised), *remarks, f"table: {table}"]


def _rows(passes: Sequence[Sequence[Advised]]) -> Iterator[tuple[object, ...]]:
    nothing = float("nan")
    for each in passes:
        for row in each:
            seen = row.incidence_deg or (nothing, nothing)
            widths = (row.now_db, row.after_db, row.after_db / row.now_db, *row.over_deg, row.layover, row.shadow)
            yield (float(row.radar.centre_depression_deg), row.radar.look_side, row.material, *seen, *widths)
        if len(each) > 1:
            radar, hidden = each[0].radar, (each[0].layover, each[0].shadow)
            numbers = (*[nothing] * 4, common_ratio(each), nothing, nothing, *hidden)
            yield (float(radar.centre_depression_deg), radar.look_side, _ALL, *numbers)


def _table(passes: Sequence[Sequence[Advised]]) -> list[str]:
    cells = [_HEADINGS]
    for each in passes:
        for row in each:
            seen = "too few pixels" if row.incidence_deg is None else "{:.1f}-{:.1f} deg".format(*row.incidence_deg)
            widths = (f"+-{row.now_db:.2f} dB", f"+-{row.after_db:.2f} dB")
            hidden = (f"{100 * row.layover:.1f} %", f"{100 * row.shadow:.1f} %")
            cells.append((row.name, row.material, seen, *widths, *hidden))
        if len(each) > 1:
            cells.append((each[0].name, _ALL, "", "", f"times {common_ratio(each):.2f}", "", ""))
    return aligned(cells)


def judged(ratios: Sequence[float]) -> tuple[int | None, list[int]]:
    """Index of the pass that narrows a band most, and of those as good within 5 %, best first.

    The first index is None if no pass narrows the band by a tenth.

    Parameters
    ----------
    ratios : sequence of float
        Ratio of the half-width after each pass to that now.
    """
    best, *others = sorted(range(len(ratios)), key=ratios.__getitem__)
    equal = [k for k in others if ratios[k] <= _EQUAL * ratios[best]]
    return (None if ratios[best] > _LITTLE else best), equal


def best_passes(passes: Sequence[Sequence[Advised]]) -> list[Finding]:
    """Findings on the best further pass for each material and, where there are several, for all of them together."""
    found, names = list[Finding](), [each[0].name for each in passes]
    for of_one in zip(*passes, strict=True):
        low, high = of_one[0].over_deg
        now_db, after_db = of_one[0].now_db, min(row.after_db for row in of_one)
        numbers = {"now_db": now_db, "after_db": after_db, "over_from_deg": low, "over_to_deg": high}
        found += _best(of_one[0].material, "band", names, [row.after_db / row.now_db for row in of_one], **numbers)
    common = [common_ratio(one) for one in passes]
    return found if len(passes[0]) == 1 else found + _best(_ALL, "bands", names, common)


def _best(
    about: str, code: str, names: Sequence[str], ratios: Sequence[float], **numbers: float | str
) -> list[Finding]:
    """Findings on the best pass, and on those as good as it, by :func:`judged`."""
    best, equal = judged(ratios)
    numbers["ratio"] = min(ratios)
    if best is None:
        return [Finding(f"{code}_none", "note", about, numbers)]
    found = [Finding(f"{code}_best", "note", about, {**numbers, "name": names[best]})]
    if equal:
        found.append(Finding("passes_equal", "note", about, {"names": ", ".join(names[k] for k in equal)}))
    return found
