"""Reuse of an earlier case's runs that have the same simulator, scene, pass, laws and random numbers."""

from __future__ import annotations

import logging
from collections import Counter
from pathlib import Path

from radcal.config.disclosure import disclosed
from radcal.config.part import Part
from radcal.errors import ConfigError, StoreError
from radcal.sections.measurement import within
from radcal.seeds import draw_seeds
from radcal.simulators.runner import Runner
from radcal.storage.files import digest, first_difference
from radcal.storage.records import Fault, inspect_file
from radcal.storage.runs import IndexedRun, RunStore

logger = logging.getLogger(__name__)


def reuse_runs(case: Part, runner: Runner, earlier: str | Path | None) -> list[IndexedRun]:
    """Take over an earlier case's runs that differ from runs of this case only in parameters of calibrated materials.

    Parameters
    ----------
    case : Part
        Simulation settings of this case.
    runner : Runner
        Simulator with the run store of this case, to which the records are copied.
    earlier : path
        Folder of the earlier case's runs, which are not changed; None if the configuration names no earlier case.

    Returns
    -------
    list of IndexedRun
        Reused runs, sorted by their hashes, each with all draws of speckle of this case. A run at the starting
        parameters is copied, but not listed, because it serves as the reference run.

    Raises
    ------
    ConfigError
        If no earlier case is named, or none of its runs can be reused.
    """
    if earlier is None:
        raise ConfigError("design.reuse is missing, expected the name of the earlier case whose runs are taken.")
    store = RunStore(earlier)
    seed, *more = draw_seeds(case)
    reference = case.start_parameters
    taken: list[IndexedRun] = []
    unlike: Counter[str] = Counter()
    sound: set[str] = set()
    for path in sorted(Path(earlier).glob("[!.]*.h5")):
        try:
            inspect_file(path, "run")  # before the store, which would rename a damaged file
            sound.add(path.stem)
        except Fault as fault:
            unlike[f"its record {fault}"] += 1
        except (OSError, StoreError) as error:
            unlike[str(error)] += 1
    for key in sorted(sound):
        theirs = store.description(key)
        if theirs.get("noise_seed") in more:  # a further draw, which is taken with the first draw of its run
            continue
        laws = theirs.get("materials", {})
        parameters = {**reference, **{name: laws[name]["parameters"] for name in case.calibrated if name in laws}}
        ours = runner.description(parameters, seed)
        if digest(ours) != key:
            unlike[first_difference(disclosed(theirs), disclosed(ours))] += 1
            continue
        outside = [name for name in case.calibrated if not within(parameters[name], case.materials[name].box)]
        if outside and parameters != reference:
            unlike[f"materials.{outside[0]} is outside its bounds"] += 1
            continue
        draws = tuple(digest(runner.description(parameters, draw)) for draw in more)
        if parameters != reference and not sound.issuperset(draws):
            unlike[f"it has fewer than the {1 + len(more)} speckle draws of this case (simulator.draws)"] += 1
            continue
        if not all(runner.take(store, one) for one in (key, *draws) if one in sound):
            unlike["its record does not hold the pixels of every calibrated material"] += 1
        elif parameters != reference:
            taken.append(IndexedRun(key, parameters, draws=draws))
    for reason, count in unlike.items():
        logger.info("%d runs of %s not taken: %s", count, earlier, reason)
    if not taken:
        why = f"; {unlike.most_common(1)[0][0]}" if unlike else ""
        raise ConfigError(
            f"design.reuse: none of the {sum(unlike.values())} runs in {earlier} is of this scene, pass, simulator and "
            f"seed with other parameters{why}. Take design.reuse out, or name another case."
        )
    return taken
