"""Message that the earlier runs of a case were made with another version of the built-in simulator."""

from __future__ import annotations

from pathlib import Path

from radcal.config import Case
from radcal.errors import StoreError
from radcal.radar import simulator_version
from radcal.storage.run_index import read_index
from radcal.storage.runs import RunStore

__all__ = ["simulator_change"]


def simulator_change(folder: str | Path, case: Case) -> list[str]:
    """Message that radcal repeats the runs of a case because the version of the built-in simulator has changed.

    Parameters
    ----------
    folder : path
        Results folder of the case, ``results/<case>``.
    case : Case
        Configuration of the case.

    Returns
    -------
    list of str
        One message, or an empty list. The list is empty if no reference run exists, if the present version made the
        reference run, or if the case or the reference run uses an external simulator.
    """
    folder = Path(folder)
    if case.simulator.kind != "builtin" or not (folder / "reference.json").is_file():
        return []
    try:
        key = read_index(folder / "reference.json")[0].key
        theirs = RunStore(folder / "runs").description(key)["simulator"]
    except (StoreError, KeyError, IndexError, TypeError):
        return []  # radcal.session.salvage reports damaged files
    ours = simulator_version(case.radar.earth)
    if theirs.get("kind") != "builtin" or theirs.get("version") == ours:
        return []
    return [
        f"the built-in simulator is version {ours} now, the runs of {folder} are of version "
        f"{theirs.get('version')}: its identity has changed, runs are made anew, and the old ones are kept in "
        f"{folder / 'runs'} (docs/simulator.md says what changed)."
    ]
