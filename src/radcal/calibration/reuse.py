"""Runs of an earlier case that are this one's too: same simulator, scene, pass, laws and random numbers."""

from __future__ import annotations

import logging
from collections import Counter
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from radcal.config import stages
from radcal.errors import ConfigError, StoreError
from radcal.seeds import draw_seeds
from radcal.simulators.runner import Runner
from radcal.storage.disclosure import disclosed
from radcal.storage.files import digest, first_difference
from radcal.storage.run_index import IndexedRun
from radcal.storage.runs import RunStore

__all__ = ["reuse_runs"]

logger = logging.getLogger(__name__)


def reuse_runs(case: stages.Reuse, runner: Runner, earlier: str | Path) -> list[IndexedRun]:
    """Take an earlier case's runs that this case could have made, with other parameters of what it calibrates.

    Parameters
    ----------
    case : stages.Reuse
        What this case simulates.
    runner : Runner
        The simulator behind this case's run store, which takes the records.
    earlier : path
        Folder of the earlier case's runs; left as it is.

    Returns
    -------
    list of IndexedRun
        In the order of the keys; the reference run, which counts for
        itself, is taken but not listed.

    Raises
    ------
    ConfigError
        None of the runs is one that this case could have made.
    """
    store = RunStore(earlier)
    seed, *more = draw_seeds(case)
    reference = case.start_parameters
    taken: list[IndexedRun] = []
    unlike: Counter[str] = Counter()
    for path in sorted(Path(earlier).glob("[!.]*.h5")):
        try:
            theirs = store.description(path.stem)
        except StoreError as error:
            unlike[str(error)] += 1
            continue
        if theirs.get("noise_seed") in more:  # taken with the first draw of its run
            continue
        parameters = {**reference, **_calibrated(case, theirs)}
        ours = runner.description(parameters, seed)
        told = runner.without_masks(theirs)
        of_earlier_version = digest(theirs) == path.stem and digest(told) == digest(ours)
        if digest(ours) != path.stem and not of_earlier_version:
            unlike[first_difference(disclosed(told), disclosed(ours))] += 1
            continue
        outside = [name for name in case.calibrated if not _inside(parameters[name], case.materials[name].box)]
        if outside and parameters != reference:
            unlike[f"materials.{outside[0]} is outside its bounds"] += 1
            continue
        if not runner.take(store, path.stem):
            unlike["its record does not hold the pixels of every calibrated material"] += 1
            continue
        if parameters != reference:
            keys = [digest(runner.description(parameters, draw)) for draw in more]
            draws = tuple(key for key in keys if store.path(key).is_file() and runner.take(store, key))
            taken.append(IndexedRun(path.stem, parameters, draws=draws))
    for reason, count in unlike.items():
        logger.info("%d runs of %s not taken: %s", count, earlier, reason)
    if not taken:
        why = f"; {unlike.most_common(1)[0][0]}" if unlike else ""
        raise ConfigError(
            f"design.reuse: none of the {sum(unlike.values())} runs in {earlier} is of this scene, pass, simulator and "
            f"seed with other parameters{why}. Take design.reuse out, or name another case."
        )
    return taken


def _calibrated(case: stages.Reuse, description: Mapping[str, Any]) -> dict[str, list[float]]:
    """A run's parameters of the materials that are calibrated here."""
    materials = description.get("materials", {})
    return {name: materials[name]["parameters"] for name in case.calibrated if name in materials}


def _inside(x: list[float], box: list[tuple[float, float]]) -> bool:
    return len(x) == len(box) and all(low <= value <= high for value, (low, high) in zip(x, box, strict=True))
