"""Scores of runs: statistics, costs and densities against the targets, with the texture of each material.

Two runs of equal parameters give the variance of the statistics among such runs.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal import skewnormal
from radcal.config.part import Part
from radcal.findings import Finding
from radcal.inference.moments import to_dp
from radcal.objectives import Comparison
from radcal.objectives.history import Kind, PassScore, Run, Score
from radcal.seeds import derived_rng
from radcal.simulators.runner import textured
from radcal.speckle.texture import equal_texture, texture_order
from radcal.storage.runs import Parameters, Record
from radcal.targets.target import Targets

Statistics = Callable[[NDArray[np.float64], NDArray[np.int64]], NDArray[np.float64]]

_DRAWS = 60  # bootstrap samples, which give the variance with an error of 20 %
_UNLIKELY = 6.635  # chi-squared of one degree of freedom that is exceeded once in a hundred


def noise_variance(
    first: ArrayLike, again: ArrayLike, statistics: Statistics, rng: np.random.Generator, effective: float | None = None
) -> NDArray[np.float64]:
    """Variance of the statistics among runs of equal X, estimated from the same pixels of two runs.

    Half the squared difference between the statistics of the two runs estimates the variance, but with a single degree
    of freedom. A paired bootstrap (Efron and Tibshirani, "An introduction to the bootstrap", 1993, section 8.3) is more
    precise: it draws pixels with replacement, the same ones in both runs, and takes the variance of the differences.
    The bootstrap only sees noise that differs from pixel to pixel. Noise that all pixels of a run share, such as a
    random gain, appears in the squared difference alone. The squared difference is therefore used if it exceeds the
    bootstrap variance significantly (chi-squared, 1 %).

    Parameters
    ----------
    first, again : array_like, shape (n,)
        The material's pixels in two runs [dB], in the same order.
    statistics : callable
        Function from values [dB] and indices of the drawn pixels to statistics, shape (n, 3).
    rng : Generator
        Source of the random numbers.
    effective : float, optional
        Effective sample size of the n pixels; n if missing.

    Returns
    -------
    ndarray, shape (n, 3)
        Variance of mean [dB2], log standard deviation and skewness; exactly 0 for equal runs.
    """
    pair = [np.asarray(values, dtype=np.float64) for values in (first, again)]
    n = pair[0].size

    def difference(index: NDArray[np.int64]) -> NDArray[np.float64]:
        return statistics(pair[0], index) - statistics(pair[1], index)

    drawn = np.array([difference(rng.integers(n, size=n)) for _ in range(_DRAWS)])
    correlated = max(1.0, n / effective) if effective else 1.0
    pixels = 0.5 * correlated * drawn.var(axis=0, ddof=1)
    whole = 0.5 * difference(np.arange(n)) ** 2
    return np.asarray(np.where(whole > _UNLIKELY * pixels, whole, pixels))


def scatter(name: str, variance: ArrayLike) -> Finding:
    """Standard deviations of a material's statistics among runs of equal parameters.

    Parameters
    ----------
    name : str
        Name of the material.
    variance : array_like, shape (n, 3)
        Variance of the statistics, from :func:`noise_variance`.
    """
    mean, log_sd, skewness = np.sqrt(np.asarray(variance, dtype=np.float64).mean(axis=0)).tolist()
    return Finding("scatter", "note", name, {"mean_db": mean, "sd_percent": 100.0 * log_sd, "skewness": skewness})


def score(
    kind: Kind,
    index: int,
    records: Sequence[Record],
    parameters: Parameters,
    targets: Sequence[Targets],
    objectives: Mapping[str, Comparison],
    seed: int,
    other_law: Sequence[str] = (),
) -> Run:
    """Score of a run against the targets of all calibrated materials.

    Parameters
    ----------
    kind, index
        Kind of the run, and its number (:class:`radcal.objectives.history.Run`).
    records : sequence of Record
        Record of the run in each pass; the statistics of its draws of speckle are averaged.
    parameters : mapping
        Parameters X by material.
    targets : sequence of Targets
        Targets of the calibrated materials in each pass.
    objectives : mapping
        Objective by material.
    seed : int
        Seed of the case, from which the seed of the texture is derived.
    other_law : sequence of str
        Materials for which the run used another law than the calibrated one.
    """
    draws = [
        [_values(one, draw.pixels_db) for draw in (run, *run.draws)] for run, one in zip(records, targets, strict=True)
    ]
    found = {}
    for name, objective in objectives.items():
        statistics = _statistics(name, objective, draws)
        looks, cost = objective.material.looks, None
        if name not in other_law:
            looks, cost = objective.worth(parameters[name], statistics)
        found[name] = statistics, looks, cost
    of_texture = {name: looks for name, (_, looks, _) in found.items()}
    densities = [
        one.score(with_texture(run.pixels_db, objectives, of_texture, seed, number=number))
        for number, (run, one) in enumerate(zip(records, targets, strict=True))
    ]
    scores = {}
    for name, (statistics, looks, cost) in found.items():
        of_passes = [PassScore(one[name][0].tolist(), one[name][1]) if name in one else None for one in densities]
        if cost is None:  # the cost is the rms of the densities
            first = objectives[name].first
            if first.moments is None and any(record.draws for record in records):
                of_passes = _densities_of(name, statistics, targets)  # the surrogate learns these averages, too
            cost = float(first.together(np.array([one.rms for one in of_passes if one is not None])))
        scores[name] = Score(
            parameters=[float(x) for x in parameters[name]],
            densities=of_passes,
            statistics=statistics.tolist(),
            looks=looks,
            cost=cost,
            own_law=name not in other_law,
        )
    return Run(
        kind=kind,
        index=index,
        keys=[record.key for record in records],
        seconds=sum(record.draws_s for record in records),
        scores=scores,
    )


def _values(targets: Targets, pixels_db: Mapping[str, NDArray[np.float32]]) -> dict[str, NDArray[np.float64]]:
    """Values of a run at the pixels of each target of one pass, with the levels of the pass."""
    mapping = targets.levels.simulated(pixels_db)
    return {name: targets.levels.apply(pixels_db[name][target.order], mapping) for name, target in targets.items()}


def _statistics(
    name: str, objective: Comparison, draws: Sequence[Sequence[Mapping[str, NDArray[np.float64]]]]
) -> NDArray[np.float64]:
    """Mean, log sd and skewness of each bin, averaged over the draws of speckle, for the bins of all passes, (n, 3)."""
    found = []
    for one, values in zip(objective.passes, draws, strict=True):
        if one is not None:
            found.append(np.mean([one.statistics(draw[name]) for draw in values], axis=0))
    return np.concatenate(found)


def _densities_of(name: str, statistics: NDArray[np.float64], targets: Sequence[Targets]) -> list[PassScore | None]:
    """Densities with the given mean, log sd and skewness in each pass that shows the material."""
    rows = iter(to_dp(statistics))
    found: list[PassScore | None] = []
    for one in targets:
        dp = next(rows) if name in one else None
        found.append(None if dp is None else PassScore(dp.tolist(), skewnormal.density_rms(dp, one[name].dp)))
    return found


def with_texture(
    pixels_db: Mapping[str, NDArray[np.float32]],
    objectives: Mapping[str, Comparison],
    looks: Mapping[str, float],
    seed: int,
    fresh: bool = False,
    number: int = 0,
) -> dict[str, NDArray[np.float32]]:
    """Pixels of a run in one pass, with added texture that gives each calibrated material its effective looks.

    Parameters
    ----------
    pixels_db : mapping
        All visible pixels by material [dB].
    objectives : mapping
        Objective by calibrated material.
    looks : mapping
        Effective looks of each calibrated material in the first pass; texture can only lower the looks of the speckle.
    seed : int
        Seed of the case.
    fresh : bool
        Whether the texture has other random numbers than in the runs of the calibration, for the final check.
    number : int
        Number of the pass, from 0.

    Returns
    -------
    dict
        Pixels by material [dB]. All runs use the same random numbers, so that texture changes smoothly with the looks.
    """
    found = dict(pixels_db)
    for name, objective in objectives.items():
        if (one := objective.passes[number]) is not None:
            sensor = one.material.looks
            order = texture_order(sensor, equal_texture(objective.material.looks, looks[name], sensor))
            found[name] = textured(pixels_db[name], order, seed, name, fresh)
    return found


def score_reference(
    case: Part, made: Sequence[Sequence[Record]], targets: Sequence[Targets], objectives: Mapping[str, Comparison]
) -> list[Run]:
    """Scores of the reference run and of its repetition, with the difference of their pixels.

    Parameters
    ----------
    case : Part
        Starting parameters and seed.
    made : sequence of sequence of Record
        Records of the reference run in all passes and, if it was repeated, those of the repetition.
    targets : sequence of Targets
        Targets of the calibrated materials in each pass.
    objectives : mapping
        Objective by calibrated material.

    Returns
    -------
    list of Run
        Reference run and repetition. The first run holds ``rms_sampling``, a repetition holds ``repeat_db`` [dB], and a
        repetition that differs from the first run also holds ``repeat_variance``.
    """
    start, others = case.start_parameters, case.start_with_another_law
    runs = [
        score("reference", k, records, start, targets, objectives, case.seed, other_law=others)
        for k, records in enumerate(made)
    ]
    each = {name: [one[name].rms_sampling for one in targets if name in one] for name in targets[0]}
    sampling = {name: float(np.sqrt(np.mean(np.square(found)))) for name, found in each.items()}
    runs[0] = replace(runs[0], rms_sampling=sampling)
    for k, again in enumerate(made[1:], start=1):
        difference = max(one.largest_difference_db(other) for one, other in zip(made[0], again, strict=True))
        runs[k] = replace(runs[k], repeat_db=difference)
        if difference > 0:
            runs[k] = replace(runs[k], repeat_variance=_repeat_variance(case, made[0], again, targets, objectives))
    return runs


def _repeat_variance(
    case: Part,
    first: Sequence[Record],
    again: Sequence[Record],
    targets: Sequence[Targets],
    objectives: Mapping[str, Comparison],
) -> dict[str, list[list[float]]]:
    found: dict[str, list[NDArray[np.float64]]] = {name: [] for name in targets[0]}
    for number, one in enumerate(targets):
        values, others = (_values(one, records[number].pixels_db) for records in (first, again))
        for name, target in one.items():
            objective = objectives[name].passes[number]
            assert objective is not None  # noqa: S101
            rng = derived_rng(case.seed, "repeat", name)
            variance = noise_variance(values[name], others[name], objective.statistics, rng, target.effective)
            found[name].append(variance / (1 + len(first[number].draws)))  # runs have the average of all their draws
    return {name: np.concatenate(each).tolist() for name, each in found.items()}
