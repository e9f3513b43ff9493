"""Tables of the calibrated laws and parameters, and the calibrated materials as a section of a case file."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import CommandSimulation
from radcal.results.archive import Archive, MaterialResult
from radcal.storage.files import atomic

LAWS = (
    "material", "incidence_deg", "median_db", "p05_db", "p95_db", "known", "calibrated_db", "parameters_model_db",
    "level",
)  # fmt: skip
PARAMETERS = (
    "material", "law", "parameter", "unit", "calibrated", "parameters_model", "p05", "p95", "lower", "upper", "looks",
    "fits", "known_from_deg", "known_to_deg",
)  # fmt: skip

_HEADING = """\
# Materials of the case {case}, as radcal calibrated them: {verdict}
# To simulate with these laws, use this section as the section materials of a case of your own, and replace there the
# materials that the new case calibrates. Parameters are those of the search (column calibrated of parameters.csv, where
# parameters_model gives the law nearest to the median of sigma0), with all digits: scene, radar, simulator and seed of
# the case {case} give its calibrated image again{exactly} with the noise seed {noise_seed}.
# looks are the effective looks of a material's pixels in an image of {looks} looks (radar.looks). Where they are fewer
# than the image's, gamma texture is multiplied onto the simulated pixels. Without this key, pixels have speckle alone.
"""


def law_rows(archive: Archive) -> Iterator[Sequence[Any]]:
    """Rows of ``laws.csv``, with the columns :data:`LAWS`.

    Parameters
    ----------
    archive : Archive
        Results of a calibration.

    Yields
    ------
    sequence
        Material, local incidence [deg], median, 5 % and 95 % quantile of sigma0 [dB] (the ground's mean power), whether
        sigma0 is determined at this incidence, the law at the X of the search [dB], the law nearest to the median
        [dB], and whether the row is the level of a material seen at one incidence. A law without a curve has no rows;
        of a normalised image there are neither median and quantiles nor a nearest law.
    """
    for name, material in archive.materials.items():
        law = archive.configured.laws[name]
        if not law.has_curve:
            continue
        curve = material.posterior.curve
        degrees, levels = np.arange(91.0) if curve is None else curve.incidence_deg, np.empty(0)
        if curve is not None and material.level_only:
            levels = material.posterior.middles_deg
            degrees = np.union1d(degrees, levels)
        low_db, median_db, high_db = np.full((3, degrees.size), np.nan) if curve is None else curve.at(degrees)
        low, high = _known(material)
        known = (degrees >= low) & (degrees <= high)
        each_x = (archive.laws[name], _model(archive, name))
        laws = [np.asarray(law(np.radians(degrees), x)) for x in each_x]
        for row in zip(degrees, median_db, low_db, high_db, known, *laws, np.isin(degrees, levels), strict=True):
            yield (name, *row)


def parameter_rows(archive: Archive) -> Iterator[Sequence[Any]]:
    """Rows of ``parameters.csv``, with the columns :data:`PARAMETERS`.

    Parameters
    ----------
    archive : Archive
        Results of a calibration.

    Yields
    ------
    sequence
        One row for each parameter of each calibrated material, with unit, value of the search, value of the law nearest
        to the median of sigma0, 5 % and 95 % quantile, and bounds. Each row also contains the effective looks of the
        material, whether its law is not refuted, and the lowest and highest incidence at which sigma0 is determined
        [deg].
    """
    for name, material in archive.materials.items():
        posterior = material.posterior
        configured = archive.configured.materials[name]
        each = zip(
            configured.parameter_names,
            configured.parameter_units,
            archive.laws[name],
            _model(archive, name),
            posterior.parameters_p05,
            posterior.parameters_p95,
            *np.array(configured.box).T,
            strict=True,
        )
        for row in each:
            yield (name, configured.law, *row, float(material.looks[material.best]), material.fits, *_known(material))


def write_runs(path: str | Path, archive: Archive) -> None:
    """Write ``runs.csv`` with one line per run and material.

    Parameters
    ----------
    path : path
        Path of the file.
    archive : Archive
        Results of a calibration.
    """
    headings = [list(archive.configured.materials[name].parameter_names) for name in archive.materials]
    widest = max(headings, key=len)
    if any(heading != widest[: len(heading)] for heading in headings):  # materials of different laws
        widest = [f"X{k}" for k in range(1, len(widest) + 1)]
    columns = ("run", "kind", "index", "key", "seconds", "material", *widest, "xi", "omega", "alpha", "rms")
    runs = archive.runs
    each = zip(runs.kind, runs.index, archive.passes["1"].keys, runs.seconds, strict=True)

    def rows() -> Iterator[Sequence[Any]]:
        for n, (kind, index, key, seconds) in enumerate(each):
            for name, one in archive.materials.items():
                x, missing = one.parameters[n], len(widest) - one.parameters.shape[1]
                yield (n, kind, index, key, f"{seconds:.3f}", name, *x, *[None] * missing, *one.dp[n], one.rms[n])

    write_csv(path, columns, rows())


def _model(archive: Archive, name: str) -> NDArray[np.float64]:
    """X whose law is nearest to the median of sigma0; NaN if there is none."""
    nearest = archive.materials[name].posterior.parameters_model
    return np.full(archive.laws[name].size, np.nan) if nearest is None else nearest


def _known(material: MaterialResult) -> tuple[float, float]:
    """Lowest and highest incidence at which sigma0 of a material is determined [deg]; NaN if at none."""
    known = material.posterior.known_between_deg
    return (math.nan, math.nan) if known is None else (known[0], known[1])


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Lines of a table for the terminal, with columns of equal width."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def write_csv(path: str | Path, columns: Sequence[str], rows: Iterable[Sequence[Any]]) -> None:
    """Write a table, atomically; unknown values are empty, and numbers have all their digits."""
    with atomic(path) as partial, partial.open("w", newline="", encoding="utf-8") as handle:
        writer = csv.writer(handle, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows([_cell(value) for value in row] for row in rows)


def _cell(value: Any) -> str:
    if value is None:
        return ""
    if isinstance(value, bool | np.bool_):
        return str(bool(value)).lower()
    if isinstance(value, float | np.floating):
        return "" if math.isnan(value) else repr(float(value))
    return str(value)


def calibrated_materials(archive: Archive) -> dict[str, dict[str, Any]]:
    """Materials of a case with their calibrated laws and effective looks, as materials that are not to be calibrated.

    Parameters
    ----------
    archive : Archive
        Results of a calibration.

    Returns
    -------
    dict
        Section ``materials`` as plain data. A material has ``looks`` if the calibration found texture, and ``colour``
        if the case gives one.
    """
    found = {}
    for name, material in archive.configured.materials.items():
        kept = ("law", "angles_deg", "formula", "names", "units", "conditions", "integer")
        data = {"calibrate": False, **material.model_dump(mode="json", include=set(kept), exclude_none=True)}
        data["parameters"] = [float(x) for x in archive.laws[name]]
        if material.colour is not None:
            data["colour"] = material.colour
        looks = material.looks
        if name in archive.materials:
            result = archive.materials[name]
            # looks of the best run, which gave the calibrated image its texture; objective density finds those of radar
            effective = float(result.looks[result.best])
            looks = effective if effective < archive.configured.radar.looks else None
        found[name] = data if looks is None else {**data, "looks": looks}
    return found


def calibrated_yaml(archive: Archive, materials: dict[str, dict[str, Any]], verdict: str, noise_seed: int) -> str:
    """Text of ``calibrated.yaml``: a heading that explains it, and the section ``materials``.

    Parameters
    ----------
    archive : Archive
        Results of a calibration.
    materials : mapping
        From :func:`calibrated_materials`.
    verdict : str
        Verdict on all materials.
    noise_seed : int
        Seed of the calibrated image's speckle.
    """
    import yaml

    simulator = archive.configured.simulator
    repeats = not isinstance(simulator, CommandSimulation) or simulator.deterministic is True
    heading = _HEADING.format(
        case=archive.configured.case,
        verdict=" ".join(verdict.split()),
        looks=f"{archive.configured.radar.looks:g}",
        noise_seed=noise_seed,
        exactly=", bit for bit," * repeats,
    )
    return heading + yaml.safe_dump(
        {"materials": materials}, sort_keys=False, default_flow_style=None, width=120, allow_unicode=True
    )
