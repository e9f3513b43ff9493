"""Scores of runs against the targets, with the texture of each material."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from radcal.calibration.history import Kind, Run, Score
from radcal.calibration.noise import noise_variance
from radcal.calibration.objectives import Objective, make_objectives
from radcal.config import stages
from radcal.radar.texture import texture_db, texture_order
from radcal.seeds import derived_rng, derived_seed
from radcal.storage.runs import Parameters, Record

if TYPE_CHECKING:
    from radcal.measurement.target import Targets

__all__ = ["score", "score_reference", "with_texture"]


def score(
    kind: Kind,
    index: int,
    record: Record,
    parameters: Parameters,
    targets: Targets,
    objectives: Mapping[str, Objective],
    seed: int,
    other_law: Sequence[str] = (),
) -> Run:
    """Score a record against the targets.

    Parameters
    ----------
    kind, index
        As in :class:`radcal.calibration.history.Run`.
    record : Record
        The run with its draws of speckle, whose statistics are averaged.
    parameters : mapping
        X by material.
    targets : Targets
        By calibrated material.
    objectives : mapping
        Objective by material.
    seed : int
        Seed of the case, from which that of the texture derives.
    other_law : sequence of str
        Materials to which the run gave another law than the one that is calibrated.
    """
    pixels_db = dict(record.pixels_db)
    draws = [(draw.pixels_db, targets.levels.simulated(draw.pixels_db)) for draw in (record, *record.draws)]
    found = {}
    for name, objective in objectives.items():
        order = targets[name].order
        each = [objective.statistics(targets.levels.apply(db[name][order], mapping)) for db, mapping in draws]
        statistics = np.mean(each, axis=0)
        looks, cost = objective.material.looks, None
        if name not in other_law:
            looks, cost = objective.worth(parameters[name], statistics)
        pixels_db[name] = with_texture(record.pixels_db[name], objective, looks, seed)
        found[name] = statistics, looks, cost
    densities = targets.score(pixels_db)
    scores = {}
    for name, (statistics, looks, cost) in found.items():
        dp, rms = densities[name]
        scores[name] = Score(
            parameters=[float(x) for x in parameters[name]],
            dp=[float(v) for v in dp],
            rms=rms,
            statistics=statistics.tolist(),
            looks=looks,
            cost=rms if cost is None else cost,
            own_law=name not in other_law,
        )
    return Run(
        kind=kind,
        index=index,
        key=record.key,
        seconds=sum(draw.seconds for draw in (record, *record.draws)),
        scores=scores,
    )


def with_texture(
    pixels_db: NDArray[np.float32], objective: Objective, looks: float, seed: int, fresh: bool = False
) -> NDArray[np.float32]:
    """Pixels of a material in a run with the texture that makes the speckle's looks the material's.

    Parameters
    ----------
    pixels_db : ndarray
        All visible pixels of the material [dB].
    objective : Objective
        The material's.
    looks : float
        Effective looks of the material; texture only lowers those of the speckle.
    seed : int
        Seed of the case.
    fresh : bool
        Other random numbers, for the final check.

    Returns
    -------
    ndarray of float32
        The same random numbers for every run: the texture is a smooth function of the looks.
    """
    order = texture_order(objective.material.looks, looks)
    if not np.isfinite(order):
        return pixels_db
    rng = np.random.default_rng([derived_seed(seed, "texture", objective.material.name), int(fresh)])
    return (pixels_db + texture_db(rng.random(pixels_db.shape), order)).astype(np.float32)


def score_reference(case: stages.Scores, records: Sequence[Record], targets: Targets) -> list[Run]:
    """Score the reference run and its repetition, with how far their pixels differ.

    Parameters
    ----------
    case : stages.Scores
        Starting parameters, laws and seed.
    records : sequence of Record
        The reference run, and perhaps its repetition.
    targets : mapping
        Target by calibrated material.

    Returns
    -------
    list of Run
        As many as records; ``rms_sampling`` is the first's, ``repeat_db`` [dB] that of all others,
        ``repeat_variance`` that of those which differ from the first.
    """
    start, others = case.start_parameters, case.start_with_another_law
    objectives = make_objectives(case, targets)
    runs = [
        score("reference", k, record, start, targets, objectives, case.seed, other_law=others)
        for k, record in enumerate(records)
    ]
    runs[0] = replace(runs[0], rms_sampling={name: target.rms_sampling for name, target in targets.items()})
    for k, record in enumerate(records[1:], start=1):
        difference = records[0].largest_difference_db(record)
        runs[k] = replace(runs[k], repeat_db=difference)
        if difference > 0:
            runs[k] = replace(runs[k], repeat_variance=_repeat_variance(case, records[0], record, targets, objectives))
    return runs


def _repeat_variance(
    case: stages.Scores, first: Record, again: Record, targets: Targets, objectives: Mapping[str, Objective]
) -> dict[str, list[list[float]]]:
    pair = [(record.pixels_db, targets.levels.simulated(record.pixels_db)) for record in (first, again)]
    found = {}
    for name, target in targets.items():
        values = [targets.levels.apply(pixels_db[name][target.order], mapping) for pixels_db, mapping in pair]
        rng = derived_rng(case.seed, "repeat", name)
        variance = noise_variance(values[0], values[1], objectives[name].statistics, rng, target.effective)
        found[name] = variance.tolist()
    return found
