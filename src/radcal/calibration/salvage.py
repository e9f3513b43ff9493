"""Before a workflow plans its jobs: files that cannot be trusted are set aside, so that it makes them again."""

from __future__ import annotations

import logging
from pathlib import Path

from radcal.errors import DamagedError, StoreError
from radcal.files import bring_back
from radcal.records import SCHEMAS, inspect, is_sealed, kind_of, provenance, read_json
from radcal.store import RunStore

__all__ = ["salvage"]

_MOST_BYTES = 16 * 2**20
_FILES = (
    *(f"{kind}.h5" for kind in SCHEMAS),
    *(f"{name}.json" for name in ("simulator", "reference", "scores", "stop", "final", "summary")),
    "design/*.json",
    "iterations/*/surrogate.h5",
    "iterations/*/proposal.json",
    "iterations/*/verified.json",
)
_INDEXES = ("reference.json", "final.json", "design/*.json", "iterations/*/verified.json")

logger = logging.getLogger(__name__)


def salvage(folder: str | Path, case: str) -> tuple[list[Path], list[str]]:
    """Set damaged files of a results folder aside, and remove indexes that list a run that is not there.

    What is dated in the future, by a clock that was set back since, is dated now.

    Files up to 16 MiB are read whole; of larger ones header and size are compared, and the rest where a job
    reads them.

    Parameters
    ----------
    folder : path
        ``results/<case>``.
    case : str
        Name of the case: files of another one are set aside too. Records of runs are not: a run is what its key
        says, whichever case made it.

    Returns
    -------
    gone : list of Path
        Files, other than records of runs, that are to be made again.
    sentences : list of str
        What was found, for the person at the terminal.
    """
    folder = Path(folder)
    bring_back(folder)
    gone: list[Path] = []
    sentences: list[str] = []
    with provenance(case):
        for path in (found for pattern in _FILES for found in sorted(folder.glob(pattern))):
            try:
                if path.suffix == ".json" and path.stat().st_size <= _MOST_BYTES:
                    read_json(path)
                else:
                    inspect(path, kind_of(path), _MOST_BYTES)
            except DamagedError as error:
                gone.append(path)
                sentences.append(_here(error))
            except StoreError as error:
                # what cannot be reached is for the job that needs it to say, if any does
                logger.info("%s", error)
    found = _records(folder / "runs", sentences)
    for pattern in _INDEXES:
        for path in sorted(folder.glob(pattern)):
            try:
                lost = [entry["key"] for entry in read_json(path) if entry["key"] not in found]
            except (StoreError, KeyError, TypeError):
                continue
            if lost:
                path.unlink(missing_ok=True)
                gone.append(path)
                sentences.append(f"{path}: the run {lost[0]} that it lists is not there; it alone is made again.")
    return gone, sentences


def _here(error: StoreError) -> str:
    """The sentence of a file that this very command makes again."""
    return str(error).replace("type the same command again to have it made again", "it is made again where needed")


def _records(folder: Path, sentences: list[str]) -> set[str]:
    """Keys of the runs that are there."""
    store = RunStore(folder)
    found = set()
    for path in sorted(folder.glob("[!.]*.h5")):
        try:
            if is_sealed(path):
                inspect(path, "run", _MOST_BYTES)
            elif store.get(path.stem, ()) is None:
                aside = path.with_suffix(".damaged").name
                sentences.append(f"{path}: is damaged; set aside as {aside}; it is made again where needed.")
                continue
        except DamagedError as error:
            sentences.append(_here(error))
            continue
        except (StoreError, OSError) as error:
            logger.info("%s", error)
        found.add(path.stem)
    return found
