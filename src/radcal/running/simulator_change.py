"""A case that goes on from runs of another version of radcal's own simulator."""

from __future__ import annotations

from pathlib import Path

from radcal.config import Case
from radcal.errors import StoreError
from radcal.radar import SIMULATOR_VERSION
from radcal.storage.run_index import read_index
from radcal.storage.runs import RunStore

__all__ = ["simulator_change"]


def simulator_change(folder: str | Path, case: Case) -> list[str]:
    """What to say where a case's runs are to be made anew because the built-in simulator is another one.

    Parameters
    ----------
    folder : path
        ``results/<case>``.
    case : Case
        The configuration.

    Returns
    -------
    list of str
        One sentence, or none: where there is no reference run yet, or it is this simulator's, or either is not the
        built-in one.
    """
    folder = Path(folder)
    if case.simulator.kind != "builtin" or not (folder / "reference.json").is_file():
        return []
    try:
        key = read_index(folder / "reference.json")[0].key
        theirs = RunStore(folder / "runs").description(key)["simulator"]
    except (StoreError, KeyError, IndexError, TypeError):
        return []  # what is damaged has its own sentence
    if theirs.get("kind") != "builtin" or theirs.get("version") == SIMULATOR_VERSION:
        return []
    return [
        f"the built-in simulator is version {SIMULATOR_VERSION} now, the runs of {folder} are of version "
        f"{theirs.get('version')}: its identity has changed, runs are made anew, and the old ones are kept in "
        f"{folder / 'runs'} (docs/simulator.md says what changed)."
    ]
