"""Prediction of another scene or pass from the laws of a finished calibration, and its comparison with measurements.

Means of incidence-angle bins are compared, with their predicted differences of measured and simulated image.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.preposterior import View, common_errors, view_of
from radcal.config import Case, Material, Uncertainty
from radcal.config.part import Part
from radcal.config.stages import STAGES
from radcal.errors import ConfigError
from radcal.figures.applied_figures import KNOWN, OUTSIDE, SEEN, Prediction, draw_predictions
from radcal.figures.map_figures import gray_scale
from radcal.ground.bins import class_of, incidence_edges
from radcal.ground.one_incidence import LEAST_SPAN_DEG
from radcal.laws import OF_PASS, Law
from radcal.measurement.sources import make_measurement
from radcal.posterior.cells import DB
from radcal.posterior.curves import GRID_DEG, PER_DEG
from radcal.posterior.prediction import predict
from radcal.posterior.result import WHOLE_DEG, Constant, Posterior, Predicted
from radcal.products.export import ground_layers
from radcal.products.geotiff import Layer, write_layers
from radcal.products.simulated import forward, simulate
from radcal.products.tables import aligned, calibrated_materials, write_csv
from radcal.registration.registered import registered_as
from radcal.results.archive import Archive, MaterialResult, read_finished
from radcal.sections.materials import OtherLaw
from radcal.seeds import derived_rng
from radcal.simulators.forward import Forward
from radcal.simulators.runner import make_simulator
from radcal.storage.records import understood
from radcal.words import doubts, sentence

Doubles = NDArray[np.float64]

COLUMNS = (
    "pass", "material", "incidence_from_deg", "incidence_to_deg", "incidence_deg", "pixels", "known", "predicted_db",
    "p05_db", "p95_db", "measured_db", "inside",
)  # fmt: skip
_PREDICTOR = (
    "Each prediction is the average of that by the law and that by a constant sigma0. On other ground, this average is "
    "seldom worse than the constant; where sigma0 changes by many decibels, the law alone errs less."
)


@dataclass(frozen=True)
class PredictionBins:
    """Incidence-angle bins of a material in a pass, whose means are averages over parts of cells, weighted by pixels.

    The mean of a part is its mean power in dB.

    Attributes
    ----------
    edges_deg : ndarray, shape (b + 1,)
        Edges of the bins [deg].
    parts : View
        Pixels of the pass, in n parts of cells, each of which lies in one bin.
    weights : ndarray, shape (b, n)
        Weight of each part in the mean of each bin.
    """

    edges_deg: Doubles
    parts: View
    weights: Doubles

    @classmethod
    def of(cls, view: View) -> PredictionBins:
        """Bins of the usable pixels, with the cells divided at the edges of the bins."""
        angle = view.incidence_deg
        edges = incidence_edges(angle, "auto")
        size = edges.size - 1
        found, part = np.unique(view.cell * size + class_of(angle, edges), return_inverse=True)
        of, count = found // size, np.bincount(part)
        parts = replace(
            view,
            cell=part,
            patch=view.patch[of],
            middle_deg=np.bincount(part, angle) / count,
            independent=np.maximum(view.independent[of] * count / np.bincount(view.cell)[of], 1.0),
            noise_db=view.noise_db[of],
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
    posterior: Posterior,
    law: Law,
    start: Sequence[float],
    bins: PredictionBins,
    config: Uncertainty,
    rng: np.random.Generator,
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
    bins : PredictionBins
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
    constant: Constant, looks: float, law: Law, start: Sequence[float], bins: PredictionBins, config: Uncertainty
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


def with_laws(archive: Archive, other: Part) -> Part:
    """Settings of another case's forward run, in which materials have the laws and looks calibrated in an archive.

    The law of a material with a band is the one nearest to the band's median (:func:`simulated_x`).

    Parameters
    ----------
    archive : Archive
        Results of a calibration.
    other : Part
        Scene, passes, simulator and materials of the other case.

    Raises
    ------
    ConfigError
        The other case has none of the calibrated materials.
    """
    found = calibrated_materials(archive)
    shared = [name for name in archive.materials if name in other.materials]
    if not shared:
        raise ConfigError(
            f"{archive.configured.case} has calibrated {', '.join(archive.materials)}, of which {other.case} has no "
            f"material: it has {', '.join(other.materials)}."
        )
    changed = {
        name: Material.model_validate({**found[name], "parameters": simulated_x(archive, name)}) for name in shared
    }
    return other.model_copy(update={"materials": {**other.materials, **changed}})


def members_of(archive: Archive, other: Part, count: int) -> list[Part]:
    """Settings of another case's forward run with laws drawn from the posteriors of a calibration.

    A member has one draw of each calibrated material, law and error of its form, as a table of sigma0 at whole degrees.
    The draws of different materials are independent; the first of more members are those of fewer.

    Parameters
    ----------
    archive : Archive
        Results of a calibration.
    other : Part
        The other case.
    count : int
        Number of members.

    Raises
    ------
    ConfigError
        As for :func:`with_laws`; a posterior has too few draws of sigma0, or was found at another frequency or
        polarisation, on which its law depends.
    """
    drawn, case = with_laws(archive, other).materials, archive.configured
    each: list[dict[str, Material]] = [dict(drawn) for _ in range(count)]
    for name in (name for name in archive.materials if name in other.materials):
        posterior = archive.materials[name].posterior
        known = 0 if posterior.draws is None or posterior.curve is None else len(posterior.draws.parameters)
        if known < count:
            raise ConfigError(
                f"--draws is {count}, expected at most {known}, the draws of sigma0 of {name} in {case.case}."
            )
        needed = set(OF_PASS) & set(case.materials[name].unbound_law.needs)
        for key in (key for one in other.radars for key in needed if getattr(one, key) != getattr(case.radar, key)):
            raise ConfigError(
                f"radar.{key}: --draws has laws of {name} at {getattr(case.radar, key)} of {case.case} alone, because "
                f"law {case.materials[name].law!r} depends on it, expected this value."
            )
        curves = posterior.draws.curves_db(case.laws[name])[:, ::PER_DEG]  # type: ignore[union-attr]
        chosen = derived_rng(other.seed, "draws", name).permutation(len(curves))[:count]
        for materials, curve in zip(each, curves[chosen].tolist(), strict=True):
            law = OtherLaw(law="tabulated", angles_deg=WHOLE_DEG.tolist(), parameters=curve)
            materials[name] = drawn[name].with_law(law).model_copy(update={"parameters": curve, "start": None})
    return [other.model_copy(update={"materials": materials}) for materials in each]


def made_with(archive: Archive, case: Part, folder: str | Path, runs: str | Path) -> list[str]:
    """Make the products that the section ``products`` names, with the laws of ``calibrated.yaml``, as of a command.

    Parameters
    ----------
    archive : Archive
        Results of the case.
    case : Part
        Sections of a forward run, and ``products``.
    folder, runs : path
        Folder in which each product has one of its name, and folder of the run store.

    Returns
    -------
    list of str
        Lines of :func:`.simulated.simulate`.
    """
    found = {name: Material.model_validate(one) for name, one in calibrated_materials(archive).items()}
    changed = case.model_copy(update={"materials": found})
    members = members_of(archive, changed, case.products.draws)
    made = (simulate(changed, Path(folder) / name, runs, True, name, members) for name in case.products.make)
    return [line for lines in made for line in lines]


def simulated_x(archive: Archive, name: str) -> list[float]:
    """X at which a material is simulated: the one nearest to the median of its band; without a band, the search's."""
    nearest = archive.materials[name].posterior.parameters_model
    return [float(x) for x in (archive.laws[name] if nearest is None else nearest)]


def predictions(
    name: str,
    posterior: Posterior,
    bins: PredictionBins,
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
    bins : PredictionBins
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


def apply(folder: str | Path, other: Part, measured: Case | None, out: str | Path, runs: str | Path) -> list[str]:
    """Predict the images of another case from the laws of a finished calibration, and compare them with measurements.

    Parameters
    ----------
    folder : path
        Results folder of the finished case.
    other : Part
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
    archive = read_finished(folder)
    with understood(folder / "calibration.h5"):
        changed = with_laws(archive, other)
    scene, passes = forward(changed, out, runs)
    rows: list[tuple[int, Prediction]] = []
    lines: list[str] = []
    files: list[Path] = []
    for number, made in enumerate(passes, start=1):
        radar, measured_db = other.passes[number - 1].radar, None
        tags = {"case": other.case, "radiometry": radar.radiometry}
        text, gray = "image predicted from the laws of another case", gray_scale(made.image_db)
        layers = {"predicted": Layer(made.image_db, "dB", text, tags, gray=gray)}
        if measured is not None:
            one = measured.passes[number - 1]
            path = out / f"passes/{number}/geometry.h5"
            simulator = make_simulator(STAGES["simulator"].of(one), made.geometry, path, scene)
            found = make_measurement(STAGES["measurement"].of(one), made.geometry, simulator, scene, partly=True)
            as_in_case = Path(runs).parent / f"passes/{number}/registered.h5"
            registered, by = registered_as(as_in_case, made.image_db, found, one.registration)
            lines += [f"pass {number}: {found.source}; {by}: {registered.verdict}", *map(sentence, found.findings)]
            measured_db = registered.measurement.image_db
            layers["measured"] = Layer(measured_db, "dB", "measured image, registered", tags, gray=gray)
        layers |= ground_layers(made.geometry, tags, changed.materials)
        files += write_layers(out, number, layers, scene, made.geometry)
        with understood(folder / "calibration.h5"):
            rows += [(number, row) for row in _of_pass(archive, changed, number, made, measured_db)]
    shared = [name for name in archive.materials if name in other.materials]
    remarks = [*_few_pixels(archive, shared, {one.material for _, one in rows}), *doubts(shared, archive.findings)]
    if not rows:
        raise ConfigError(f"{folder}: nothing can be predicted of {other.case}: {' '.join(remarks)}")
    files += [out / "predictions.csv", out / "predictions.png"]
    write_csv(files[-2], COLUMNS, map(_cells, rows))
    draw_predictions(files[-1], [row for _, row in rows], archive.configured.case, other.case)
    return [*_table(rows, len(passes) > 1), _PREDICTOR, *lines, *remarks, *_conclusion(rows), *map(str, files)]


def _is_level_known(material: MaterialResult, angle_deg: float) -> bool:
    """Whether the level at an incidence is known: of a material seen at one incidence, within 1 degree of it."""
    near = (low - LEAST_SPAN_DEG <= angle_deg <= high + LEAST_SPAN_DEG for low, high in material.posterior.seen_deg)
    return not material.level_only or any(near)


def _few_pixels(archive: Archive, names: Iterable[str], predicted: Collection[str]) -> Iterator[str]:
    """Sentences on materials that could be predicted, but have too few pixels in each pass."""
    for name in names:
        if name not in predicted and archive.materials[name].posterior.constant is not None:
            seen = f" within {LEAST_SPAN_DEG:g} degree of the one incidence of the calibration"
            where = seen if archive.materials[name].level_only else ""
            yield f"{name}: not predicted, because no pass has 50 usable pixels of it{where}."


def _of_pass(
    archive: Archive, changed: Part, number: int, made: Forward, measured_db: NDArray[np.float32] | None
) -> Iterator[Prediction]:
    """Predictions of all calibrated materials in a pass."""
    case = changed.passes[number - 1]
    margin_px, uncertainty = archive.configured.target.margin_px, archive.configured.uncertainty
    for name, material in archive.materials.items():
        posterior = material.posterior
        if name not in changed.materials or posterior.constant is None:
            continue
        view = view_of(name, made.geometry, case.radar, margin_px)
        if view is None:
            continue
        simulated = made.image_db.ravel()[view.pixels].astype(np.float64)
        values = None if measured_db is None else measured_db.ravel()[view.pixels].astype(np.float64)
        start, rng = changed.materials[name].start_parameters, derived_rng(changed.seed, "apply", name)
        law = case.laws[name]
        bins = PredictionBins.of(view)
        constant = by_constant_db(posterior.constant, posterior.looks, law, start, bins, uncertainty)
        moved = predict(predictive_db(posterior, law, start, bins, uncertainty, rng), *constant)
        each = predictions(name, posterior, bins, simulated, moved, values)
        yield from (one for one in each if _is_level_known(material, one.incidence_deg))


def _cells(row: tuple[int, Prediction]) -> tuple[object, ...]:
    number, one = row
    band = (one.predicted_db, one.p05_db, one.p95_db, one.measured_db)
    return (number, one.material, *one.edges_deg, one.incidence_deg, one.pixels, one.known, *band, one.inside)


def _table(rows: Sequence[tuple[int, Prediction]], several: bool) -> list[str]:
    cells = [("pass", "material", "incidence", "pixels", "law there", "predicted (90 %)", "measured", "inside")]
    for number, one in rows:
        band = f"{one.predicted_db:.2f} ({one.p05_db:.2f} to {one.p95_db:.2f}) dB"
        measured = "-" if one.inside is None else f"{one.measured_db:.2f} dB"
        inside = {True: "yes", False: "no", None: "-"}[one.inside]
        angles = f"{one.edges_deg[0]:.1f}-{one.edges_deg[1]:.1f} deg"
        cells.append((str(number), one.material, angles, str(one.pixels), one.known, band, measured, inside))
    return aligned([line if several else line[1:] for line in cells])


def _conclusion(rows: Sequence[tuple[int, Prediction]]) -> Iterator[str]:
    """Sentences on how many bins of each material lie inside the predicted 90 % interval."""
    for name in dict.fromkeys(one.material for _, one in rows):
        for known, where in (
            (KNOWN, "where sigma0 is determined"),
            (SEEN, "at angles that the calibration has seen, where sigma0 is not determined"),
            (OUTSIDE, "at angles that the calibration has not seen (an extrapolation)"),
        ):
            own = [one for _, one in rows if (one.material, one.known) == (name, known)]
            of = [one.inside for one in own if one.inside is not None]
            if of:
                lie = "bin lies inside of its" if len(of) == 1 else "bins lie inside of their"
                yield f"{name}: {sum(of)} of {len(of)} {lie} 90 % interval {where}."
