"""Prediction of another scene or pass from the laws of a finished calibration, and its comparison with measurements."""

from __future__ import annotations

import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.cells import DB
from radcal.assessment.curves import GRID_DEG
from radcal.assessment.posterior import Constant, Posterior, Predicted
from radcal.assessment.prediction import predict
from radcal.assessment.preposterior import Sight, common_errors, sight_of
from radcal.config import Case, Material, TargetConfig, Uncertainty, stages
from radcal.errors import ConfigError, StoreError
from radcal.measurement.classes import class_of, incidence_edges
from radcal.measurement.one_incidence import LEAST_SPAN_DEG
from radcal.measurement.registration import registered_as
from radcal.measurement.sources import make_measurement
from radcal.radar.geometry import Geometry
from radcal.radar.laws import Law
from radcal.report.applied_figures import KNOWN, OUTSIDE, SEEN, Prediction, draw_predictions
from radcal.report.archive import Archive, read_archive
from radcal.report.export import ground_layers
from radcal.report.geotiff import Layer, map_grid, write_geotiff
from radcal.report.simulated import Forward, forward
from radcal.report.tables import calibrated_materials, write_csv
from radcal.scene.model import Scene
from radcal.seeds import derived_rng
from radcal.simulators.sources import make_simulator
from radcal.storage.records import understood
from radcal.words import doubts

__all__ = ["COLUMNS", "Bins", "apply", "predictions", "predictive_db", "where_seen", "with_laws"]

Doubles = NDArray[np.float64]

COLUMNS = (
    "pass", "material", "incidence_from_deg", "incidence_to_deg", "incidence_deg", "pixels", "known", "predicted_db",
    "p05_db", "p95_db", "measured_db", "inside",
)  # fmt: skip


def with_laws(archive: Archive, source: Mapping[str, Any], other: stages.Forward) -> stages.Forward:
    """Settings of another case's forward run, in which materials have the laws and looks calibrated in an archive.

    The law of a material with a band is the one nearest to the band's median (:func:`simulated_x`).

    Parameters
    ----------
    archive : Archive
        Results of a calibration.
    source : mapping
        Section ``materials`` of the calibrated case, as plain data or models.
    other : stages.Forward
        Scene, passes, simulator and materials of the other case.

    Raises
    ------
    ConfigError
        The other case has none of the calibrated materials.
    """
    own = {name: Material.model_validate(value) for name, value in source.items()}
    found = calibrated_materials(archive, own)
    shared = [name for name in archive.materials if name in other.materials]
    if not shared:
        raise ConfigError(
            f"{archive.case} has calibrated {', '.join(archive.materials)}, of which {other.case} has no material: "
            f"it has {', '.join(other.materials)}."
        )
    changed = {
        name: Material.model_validate({**found[name], "parameters": simulated_x(archive, name)}) for name in shared
    }
    return other.model_copy(update={"materials": {**other.materials, **changed}})


def simulated_x(archive: Archive, name: str) -> list[float]:
    """X at which a material is simulated: the one nearest to the median of its band; without a band, the search's."""
    posterior = archive.materials[name].posterior
    nearest = None if posterior is None else posterior.parameters_model
    return [float(x) for x in (archive.laws[name].values if nearest is None else nearest)]


@dataclass(frozen=True)
class Bins:
    """Incidence-angle bins of a material in a pass, whose means are averages over parts of cells, weighted by pixels.

    The mean of a part is its mean power in dB.

    Attributes
    ----------
    edges_deg : ndarray, shape (b + 1,)
        Edges of the bins [deg].
    parts : Sight
        Pixels of the pass, in n parts of cells, each of which lies in one bin.
    weights : ndarray, shape (b, n)
        Weight of each part in the mean of each bin.
    """

    edges_deg: Doubles
    parts: Sight
    weights: Doubles

    @classmethod
    def of(cls, sight: Sight) -> Bins:
        """Bins of the usable pixels, with the cells divided at the edges of the bins."""
        angle = sight.incidence_deg
        edges = incidence_edges(angle, "auto")
        size = edges.size - 1
        found, part = np.unique(sight.cell * size + class_of(angle, edges), return_inverse=True)
        of, count = found // size, np.bincount(part)
        parts = replace(
            sight,
            cell=part,
            patch=sight.patch[of],
            middle_deg=np.bincount(part, angle) / count,
            independent=np.maximum(sight.independent[of] * count / np.bincount(sight.cell)[of], 1.0),
            noise_db=sight.noise_db[of],
        )
        weights = np.equal(found % size, np.arange(size)[:, None]) * count
        return cls(edges, parts, weights / weights.sum(axis=1, keepdims=True))

    @property
    def member(self) -> NDArray[np.int64]:
        """Bin of each pixel, shape (p,)."""
        return class_of(self.parts.incidence_deg, self.edges_deg)

    def levels_db(self, image_db: Doubles) -> Doubles:
        """Mean of each bin [dB], shape (b,), from the values of the pixels [dB], shape (p,).

        A pixel with NaN has no value; the mean of a bin without values is NaN.
        """
        has, size = np.isfinite(image_db), len(self.weights)
        _, part, count = np.unique(self.parts.cell[has], return_inverse=True, return_counts=True)
        level = DB * np.log(np.bincount(part, 10.0 ** (image_db[has] / 10.0)) / count)
        member = self.member[has]
        with np.errstate(invalid="ignore"):
            return np.asarray(np.bincount(member, level[part], size) / np.bincount(member, minlength=size))


def predictive_db(
    posterior: Posterior, law: Law, start: Sequence[float], bins: Bins, config: Uncertainty, rng: np.random.Generator
) -> Doubles:
    """Draws of measured minus simulated means of the bins of a pass [dB], shape (m, b).

    Each draw of the posterior moves the simulated means by its law and form error minus the simulated law. Effects of
    fields and cells with the draw's standard deviations, speckle of measured and simulated pixels, and errors of the
    image's level and noise floor are added.

    Parameters
    ----------
    posterior : Posterior
        Posterior of the law, with m draws.
    law : Law
        Law of the material.
    start : sequence of float, shape (d,)
        X with which the image was simulated.
    bins : Bins
        Bins of the material in the pass.
    config : Uncertainty
        Standard errors of level and noise floor.
    rng : numpy.random.Generator
        Generator of the random errors.
    """
    draws, parts = posterior.draws, bins.parts
    assert draws is not None  # noqa: S101 - asked for by the caller
    means = parts.means_db(draws.laws_db(law))
    common = common_errors([parts], means.mean(axis=0), 1.0, config)
    effects = rng.standard_normal((len(means), common.shape[1]))
    effects[:, :-2] *= draws.field_db[:, None]  # the last two columns are level and noise floor
    # half the looks: speckle of the measured and of the simulated pixels
    own = np.sqrt(draws.cell_db[:, None] ** 2 + parts.speckle_db2(0.5 * posterior.looks))
    errors = effects @ common.T + own * rng.standard_normal(means.shape)
    simulated = parts.means_db(np.asarray(law(np.radians(GRID_DEG), start))[None])
    return np.asarray((means - simulated + errors) @ bins.weights.T)


def by_constant_db(
    constant: Constant, looks: float, law: Law, start: Sequence[float], bins: Bins, config: Uncertainty
) -> tuple[Doubles, Doubles]:
    """Measured minus simulated means of the bins by a constant level, and standard errors [dB], shape (b,) each.

    ``looks`` are those of the measured pixels inside of cells; for the rest see :func:`predictive_db`.
    """
    parts, weights = bins.parts, bins.weights
    level = parts.means_db(np.full((1, GRID_DEG.size), constant.mean_db))[0]
    simulated = parts.means_db(np.asarray(law(np.radians(GRID_DEG), start))[None])[0]
    common = weights @ common_errors([parts], level, constant.between_db, config)
    variance = (common**2).sum(axis=1) + weights**2 @ parts.speckle_db2(0.5 * looks)
    # cells of one incidence differ from a constant alike, by the slope of the law
    return weights @ (level - simulated), np.sqrt(variance + constant.within_db**2 + constant.variance)


def predictions(
    name: str,
    posterior: Posterior,
    bins: Bins,
    simulated_db: Doubles,
    moved: Predicted,
    measured_db: Doubles | None = None,
) -> Iterator[Prediction]:
    """Predicted level of a material in each incidence-angle bin of a pass, with the measured one.

    Parameters
    ----------
    name : str
        Material.
    posterior : Posterior
        Posterior of the law.
    bins : Bins
        Bins of the usable pixels of the material in the pass.
    simulated_db : ndarray, shape (p,)
        Simulated pixels [dB].
    moved : Predicted
        Predicted measured minus simulated means of the bins.
    measured_db : ndarray, shape (p,), optional
        Measured pixels [dB]; NaN for a pixel without a measured value.
    """
    member, edges = bins.member, bins.edges_deg.tolist()
    levels = bins.levels_db(simulated_db) + np.stack([moved.mean_db, moved.p05_db, moved.p95_db])
    nothing = np.full(simulated_db.shape, np.nan)
    measured = bins.levels_db(nothing if measured_db is None else measured_db)
    for k, (mean, low, high) in enumerate(levels.T.tolist()):
        angle, pixels = float(bins.parts.incidence_deg[member == k].mean()), int((member == k).sum())
        known = _known(posterior, angle)
        yield Prediction(name, (edges[k], edges[k + 1]), angle, pixels, known, mean, low, high, float(measured[k]))


def _known(posterior: Posterior, angle_deg: float) -> str:
    known = posterior.known_between_deg
    if known is not None and known[0] <= angle_deg <= known[1]:
        return KNOWN
    return SEEN if any(low <= angle_deg <= high for low, high in posterior.seen_deg) else OUTSIDE


@dataclass(frozen=True)
class _Pass:
    """Predicted image of one pass and, if there is one, its measured image [dB]."""

    geometry: Geometry
    predicted_db: NDArray[np.float32]
    measured_db: NDArray[np.float32] | None
    said: tuple[str, ...]


def apply(
    folder: str | Path, other: stages.Forward, measured: Case | None, out: str | Path, runs: str | Path
) -> list[str]:
    """Predict the images of another case from the laws of a finished calibration, and compare them with measurements.

    Parameters
    ----------
    folder : path
        Results folder of the finished case.
    other : stages.Forward
        The other case.
    measured : Case or None
        The other case with its measured images; None if it has none.
    out : path
        Folder of the files written: ``predicted.tif``, masks, ``predictions.csv`` and ``predictions.png``.
    runs : path
        Folder of the other case's run store.

    Returns
    -------
    list of str
        A table, with one line for each material and incidence-angle bin, remarks, and paths.

    Raises
    ------
    ConfigError
        The two cases have no material in common, or no material has both a posterior in dB and 50 usable pixels.
    StoreError
        The calibration is not finished.
    RadcalError
        The other case cannot be simulated, or its image cannot be read.
    """
    folder, out = Path(folder), Path(out)
    if not (folder / "calibration.h5").is_file():
        raise StoreError(f"{folder}: the calibration is not finished, expected calibration.h5; radcal show says more.")
    archive = read_archive(folder / "calibration.h5", images=False)
    with understood(folder / "calibration.h5"):
        config = json.loads(archive.config)
        changed = with_laws(archive, config["materials"], other)
    scene, passes = forward(changed, out, runs)
    rows: list[tuple[int, Prediction]] = []
    lines: list[str] = []
    files: list[Path] = []
    for number, made in enumerate(passes, start=1):
        one = _measured(measured, number, made, scene, out, Path(runs).parent)
        lines += one.said
        files += _images(out, number, other.passes[number - 1], scene, one)
        with understood(folder / "calibration.h5"):
            rows += [(number, row) for row in _of_pass(archive, config, changed, number, one)]
    shared = [name for name in archive.materials if name in other.materials]
    said = [*_few_pixels(archive, shared, {one.material for _, one in rows}), *doubts(shared, archive.found)]
    rows, left_out = where_seen(archive, rows)
    said += left_out
    if not rows:
        raise ConfigError(f"{folder}: nothing can be predicted of {other.case}: {' '.join(said)}")
    files += [out / "predictions.csv", out / "predictions.png"]
    write_csv(files[-2], COLUMNS, map(_cells, rows))
    draw_predictions(files[-1], [row for _, row in rows], archive.case, other.case)
    return [*_table(rows, len(passes) > 1), *lines, *said, *_conclusion(rows), *map(str, files)]


def where_seen(
    archive: Archive, rows: Sequence[tuple[int, Prediction]]
) -> tuple[list[tuple[int, Prediction]], list[str]]:
    """Predictions without those at incidences where a level is not known, and sentences on the bins left out.

    The level of a material that was seen at one incidence is known only within 1 degree of the incidence seen.

    Parameters
    ----------
    archive : Archive
        Results of a calibration.
    rows : sequence of (int, Prediction)
        Number of the pass, and prediction of a bin.

    Returns
    -------
    rows, left_out : list of (int, Prediction), list of str
        Predictions that are kept, and sentences.
    """
    kept, count = list[tuple[int, Prediction]](), dict[str, int]()
    for number, one in rows:
        material = archive.materials[one.material]
        seen = np.empty((0, 2)) if material.posterior is None else material.posterior.seen_deg
        near = any(low - LEAST_SPAN_DEG <= one.incidence_deg <= high + LEAST_SPAN_DEG for low, high in seen)
        if material.level_only and not near:
            count[one.material] = count.get(one.material, 0) + 1
        else:
            kept.append((number, one))
    return kept, [
        f"{name}: {number} bin{'s' if number > 1 else ''} left out, more than {LEAST_SPAN_DEG:g} degree from the one "
        "incidence at which the calibration has seen it: its level is known there alone."
        for name, number in count.items()
    ]


def _few_pixels(archive: Archive, names: Iterable[str], predicted: Collection[str]) -> Iterator[str]:
    """Sentences on materials that could be predicted, but have too few pixels in each pass."""
    for name in names:
        posterior = archive.materials[name].posterior
        if name not in predicted and posterior is not None and posterior.constant is not None:
            yield f"{name}: not predicted, because no pass has 50 usable pixels of it."


def _measured(case: Case | None, number: int, made: Forward, scene: Scene, out: Path, own: Path) -> _Pass:
    """Measured image of a pass, registered as in the results folder ``own`` of its case or onto the predicted image."""
    if case is None:
        return _Pass(made.geometry, made.image_db, None, ())
    one = case.passes[number - 1]
    path = (out / f"passes/{number}" if number > 1 else out) / "geometry.h5"
    simulator = make_simulator(stages.Simulator.of(one), made.geometry, path)
    found = make_measurement(stages.Measurement.of(one), made.geometry, simulator, scene, partly=True)
    below = own / f"passes/{number}" if number > 1 else own
    registered, by = registered_as(below / "registered.h5", made.image_db, found, one.registration)
    said = (f"pass {number}: {found.source}; {by}: {registered.verdict}", *found.notes)
    return _Pass(made.geometry, made.image_db, registered.measurement.image_db, said)


def _images(out: Path, number: int, case: stages.Forward, scene: Scene, one: _Pass) -> list[Path]:
    """Write the GeoTIFFs of a pass, and return their paths."""
    ending, tags = f"_pass{number}" if number > 1 else "", {"case": case.case, "radiometry": case.radar.radiometry}
    layers = {"predicted": Layer(one.predicted_db, "dB", "image predicted from the laws of another case", tags)}
    if one.measured_db is not None:
        layers["measured"] = Layer(one.measured_db, "dB", "measured image, registered", tags)
    grid, paths = map_grid(scene, one.geometry), []
    for name, layer in {**layers, **ground_layers(one.geometry, tags)}.items():
        paths.append(out / f"{name}{ending}.tif")
        write_geotiff(paths[-1], layer, grid)
    return paths


def _of_pass(
    archive: Archive, config: Mapping[str, Any], changed: stages.Forward, number: int, one: _Pass
) -> Iterator[Prediction]:
    """Predictions of all calibrated materials in a pass."""
    case = changed.passes[number - 1]
    margin_px = TargetConfig.model_validate(config["target"]).margin_px
    uncertainty = Uncertainty.model_validate(config["uncertainty"])
    for name, material in archive.materials.items():
        posterior = material.posterior
        if name not in changed.materials or posterior is None or posterior.constant is None:
            continue
        sight = sight_of(name, one.geometry, case.radar, margin_px)
        if sight is None:
            continue
        simulated = one.predicted_db.ravel()[sight.pixels].astype(np.float64)
        values = None if one.measured_db is None else one.measured_db.ravel()[sight.pixels].astype(np.float64)
        start, rng = changed.materials[name].start_parameters, derived_rng(changed.seed, "apply", name)
        law = case.laws[name]
        bins = Bins.of(sight)
        constant = by_constant_db(posterior.constant, posterior.looks, law, start, bins, uncertainty)
        moved = predict(predictive_db(posterior, law, start, bins, uncertainty, rng), *constant)
        yield from predictions(name, posterior, bins, simulated, moved, values)


def _cells(row: tuple[int, Prediction]) -> tuple[object, ...]:
    number, one = row
    band = (one.predicted_db, one.p05_db, one.p95_db, one.measured_db)
    return (number, one.material, *one.edges_deg, one.incidence_deg, one.pixels, one.known, *band, one.inside)


def _table(rows: Sequence[tuple[int, Prediction]], several: bool) -> Iterator[str]:
    cells = [("pass", "material", "incidence", "pixels", "law there", "predicted (90 %)", "measured", "inside")]
    for number, one in rows:
        band = f"{one.predicted_db:.2f} ({one.p05_db:.2f} to {one.p95_db:.2f}) dB"
        measured = "-" if one.inside is None else f"{one.measured_db:.2f} dB"
        inside = {True: "yes", False: "no", None: "-"}[one.inside]
        angles = f"{one.edges_deg[0]:.1f}-{one.edges_deg[1]:.1f} deg"
        cells.append((str(number), one.material, angles, str(one.pixels), one.known, band, measured, inside))
    shown = [line if several else line[1:] for line in cells]
    sizes = [max(map(len, column)) for column in zip(*shown, strict=True)]
    for line in shown:
        yield "  ".join(cell.ljust(size) for cell, size in zip(line, sizes, strict=True)).rstrip()


def _conclusion(rows: Sequence[tuple[int, Prediction]]) -> Iterator[str]:
    """Sentences on how many bins of each material lie inside the predicted 90 % interval."""
    for name in dict.fromkeys(one.material for _, one in rows):
        for known, where in (
            (KNOWN, "where sigma0 is determined"),
            (SEEN, "at angles that the calibration has seen, where sigma0 is not determined"),
            (OUTSIDE, "at angles that the calibration has not seen (an extrapolation)"),
        ):
            of = [one for _, one in rows if (one.material, one.known) == (name, known)]
            compared = [one for one in of if one.inside is not None]
            if compared:
                held = sum(bool(one.inside) for one in compared)
                lie = "bin lies inside of its" if len(compared) == 1 else "bins lie inside of their"
                yield f"{name}: {held} of {len(compared)} {lie} 90 % interval {where}."
            elif of:
                are, them = ("bin is", "it") if len(of) == 1 else ("bins are", "them")
                yield f"{name}: {len(of)} {are} predicted {where}; nothing measured to compare {them} with."
