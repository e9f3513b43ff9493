"""Folder of radcal's workflow: the current folder if it is a clone, else the folder installed with radcal."""

from __future__ import annotations

from importlib import metadata
from pathlib import Path

import radcal
from radcal.errors import ConfigError

_MARK = '"""radcal'  # first letters of radcal's Snakefile


def holds_workflow(folder: Path) -> bool:
    """Whether a folder has the Snakefile of radcal."""
    try:
        with (folder / "Snakefile").open(encoding="utf-8") as file:
            return file.read(len(_MARK)) == _MARK
    except (OSError, UnicodeDecodeError):
        return False


def workflow_folder(here: Path) -> Path:
    """Folder with the Snakefile that radcal's commands run.

    Parameters
    ----------
    here : path
        Current folder; it is returned if it is the folder of a clone.

    Raises
    ------
    ConfigError
        ``here`` is no clone, and radcal was installed without its workflow.
    """
    if holds_workflow(here):
        return here
    clone = Path(radcal.__file__).resolve().parents[2]  # of an editable installation
    if holds_workflow(clone):
        return clone
    for file in metadata.files("radcal") or ():
        # the list of installed files says where the installation has put the wheel's data files
        if file.name == "Snakefile" and holds_workflow(folder := Path(str(file.locate())).parent.resolve()):
            return folder
    raise ConfigError(
        f"{here} is not the folder of a clone of radcal, and radcal was installed without its workflow: go to a clone "
        "with cd, or install radcal again."
    )


def carried_case(path: Path) -> Path:
    """Path of a case file: as typed, or in radcal's own folder ``config`` if the file exists only there."""
    if path.exists() or path.is_absolute() or path.parts[:1] != ("config",):
        return path
    try:
        carried = workflow_folder(Path.cwd()) / path
    except ConfigError:
        return path
    return carried if carried.is_file() else path
