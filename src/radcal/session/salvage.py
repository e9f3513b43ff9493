"""Check of a results folder before Snakemake plans jobs; damaged files are renamed, so that jobs make them again."""

from __future__ import annotations

import contextlib
import logging
import os
import re
import shutil
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from radcal.config import Case
from radcal.config.stages import OUTPUTS
from radcal.errors import DamagedError, RenamedFile, StoreError
from radcal.radar import simulator_version
from radcal.storage.files import clamp_future_mtimes, file_sha256
from radcal.storage.records import CHECKSUMS, Fault, inspect, kind_of, provenance, read_json, set_aside
from radcal.storage.runs import RunStore, read_index

_MOST_BYTES = 16 * 2**20
_SHOWN = 3  # largest number of files named in one message
# files of earlier versions of radcal: those of the first pass, which now lie in passes/1, and the design of the other
# passes, which now lies beside that of the first pass
_EARLIER = (
    "geometry.h5", "measurement.h5", "reference.json", "registration_run.json", "registered.h5", "target.h5", "first",
    "simulator.json",
    "logs/geometry.log", "logs/measurement.log", "logs/reference.log", "logs/registration_run.log", "logs/target.log",
    "logs/registration.log", "logs/first_registration.log", "logs/simulator.log",
    "benchmarks/geometry.tsv", "benchmarks/measurement.tsv", "benchmarks/reference.tsv", "benchmarks/target.tsv",
    "benchmarks/registration_run.tsv", "benchmarks/registration.tsv", "benchmarks/first_registration.tsv",
    "passes/*/design", "passes/*/external", "logs/passes/*/design", "benchmarks/passes/*/design_*.tsv",
)  # fmt: skip

logger = logging.getLogger(__name__)


def files_of(folder: str | Path) -> Iterator[Path]:
    """Existing files below ``results/<case>`` whose paths match the outputs of the workflow rules."""
    for pattern in OUTPUTS:
        yield from sorted(Path(folder).glob(re.sub(r"\{[^}]*\}", "*", pattern)))


def salvage(folder: str | Path, case: str) -> list[str]:
    """Rename damaged files of a results folder, and remove each index of runs that lists a missing run.

    Files that an earlier version of radcal wrote to another place are removed. Modification times in the future, which
    remain after a clock was set back, are set to the present.

    Files of up to 16 MiB are read completely and compared with their checksums. In larger files, only the header and
    the size are checked here; a job that reads a larger file checks the content.

    Parameters
    ----------
    folder : path
        ``results/<case>``.
    case : str
        Name of the case. Files of another case are also renamed, except run records, because a run
        with the same key is valid in every case.

    Returns
    -------
    list of str
        Messages about the damaged and missing files, each one sentence for the terminal.
    """
    folder = Path(folder)
    clamp_future_mtimes(folder)
    sentences = _remove_earlier(folder)
    sealed = [path for path in files_of(folder) if path.suffix in (".h5", ".json")]
    with provenance(case):
        contents = {path: _contents(path, sentences) for path in sealed}
    for path, data in contents.items():
        _listing(path, _listed(data), sentences)
    kept = _records(folder / "runs", sentences)
    _indexes(folder, {path: _keys(data) - kept for path, data in contents.items()}, sentences)
    return sentences


def _remove_earlier(folder: Path) -> list[str]:
    """Remove files at the place where earlier versions of radcal wrote them.

    They are not renamed, because Snakemake would no longer see a change of the parameters from which they were made.
    """
    found = [path for pattern in _EARLIER for path in folder.glob(pattern)]
    for path in found:
        if path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
        else:
            _remove(path)
    return [
        f"{folder}: the files of pass 1 lie in passes/1 now; those of an earlier version of radcal are removed and "
        "made again. No stored run is repeated; a synthetic measured image is simulated again."
    ] * bool(found)


def _contents(path: Path, sentences: list[str]) -> Any:
    """Content of a JSON file of up to 16 MiB, or None for every other file; a damaged file is renamed."""
    try:
        if path.suffix == ".json" and path.stat().st_size <= _MOST_BYTES:
            return read_json(path)
        inspect(path, kind_of(path), _MOST_BYTES)
    except DamagedError as error:
        sentences.append(_here(error))
    except (StoreError, OSError) as error:
        # a job that needs this unreadable file reports the error; without such a job, no report is needed
        logger.info("%s", error)
    return None


def _keys(data: Any) -> set[str]:
    """Hashes of the runs that an index of runs lists."""
    entries = data if isinstance(data, list) else []
    lists = ("keys", "draws")
    each = [[entry.get("key"), *(key for name in lists for key in entry.get(name, ()))] for entry in entries
            if isinstance(entry, dict)]  # fmt: skip
    return {key for keys in each for key in keys if isinstance(key, str)}


def _indexes(folder: Path, lost: Mapping[Path, set[str]], sentences: list[str]) -> None:
    """Remove indexes that list missing runs; the jobs that rewrite these indexes simulate only the missing runs."""
    lost = {path: keys for path, keys in lost.items() if keys}
    if not lost:
        return
    for path in lost:
        _remove(path)
    keys = sorted(set().union(*lost.values()))
    names = _few([path.relative_to(folder).as_posix() for path in lost])
    text = f"runs listed in {names} are not there ({_few(keys)}); they alone are made again where needed."
    sentences.append(f"{folder / 'runs'}: {text}")


def _few(names: Sequence[str]) -> str:
    """Text with the first three names and the number of further names."""
    more = len(names) - _SHOWN
    return ", ".join(names[:_SHOWN]) + (f" and {more} more" if more > 0 else "")


def _listing(path: Path, checksums: Mapping[str, str], sentences: list[str]) -> None:
    """Rename table, report and figures that differ from their listed checksums, so that jobs make them again."""
    try:
        found = _faulty(path.parent, checksums)
    except Fault as fault:
        sentences.append(_here(set_aside(path, str(fault))))
        return
    except OSError as error:
        logger.info("%s", error)
        return
    if missing := [file for file in found if not file.exists()]:
        sentences.append(f"missing, and made again: {_few([str(file) for file in missing])}.")
    for file, reason in found.items():
        if file not in missing:
            # not into the folder of the figures, because the job that draws the figures first empties this folder
            sentences.append(_here(set_aside(file, reason, aside=path.parent / f"{file.name}.damaged")))
    if found:
        _remove(path)


def _listed(data: Any) -> Mapping[str, str]:
    """Checksums by file name from the content of a JSON file; empty if the file is not a list of checksums."""
    found = data.get(CHECKSUMS) if isinstance(data, dict) else None
    return found if isinstance(found, dict) else {}


def _faulty(folder: str | Path, checksums: Mapping[str, str]) -> dict[Path, str]:
    """Listed files that are missing or differ from their checksum, each with a text that describes the fault.

    A Fault tells a listed file that does not lie below the folder of the list.
    """
    found = {}
    top = Path(os.path.realpath(folder))
    for name, expected in checksums.items():
        path = Path(folder) / name
        if "\0" in name or top not in Path(os.path.realpath(path)).parents:
            raise Fault(f"names {name!r}, expected a file below {folder}")
        if not path.exists():
            found[path] = "is missing"
        elif not path.is_file():
            found[path] = "is no file"
        elif file_sha256(path) != expected:
            found[path] = "is damaged or was changed (it differs from its checksum)"
    return found


def _remove(path: Path) -> None:
    with contextlib.suppress(OSError):  # the first job that writes into a read-only folder reports the error
        path.unlink()


def _here(error: StoreError) -> str:
    """Message which says that a file is damaged and that the present command makes the file again."""
    if isinstance(error.about, RenamedFile):
        return f"{error.about.what}; it is made again where needed (finished runs are kept)."
    return str(error)


def _records(folder: Path, sentences: list[str]) -> set[str]:
    """Hashes of all runs with an undamaged record in the run store; damaged records are renamed."""
    found = set()
    for path in sorted(folder.glob("[!.]*.h5")):
        try:
            inspect(path, "run", _MOST_BYTES)
        except DamagedError as error:
            sentences.append(_here(error))
            continue
        except (StoreError, OSError) as error:
            logger.info("%s", error)
        found.add(path.stem)
    return found


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
    try:
        key = read_index(folder / "passes/1/reference.json")[0].key
        theirs = RunStore(folder / "runs").description(key)["simulator"]
    except (StoreError, KeyError, IndexError, TypeError):
        return []  # salvage reports damaged files
    ours = simulator_version(case.radar.earth)
    if not case.simulator.own or theirs.get("kind") != "builtin" or theirs.get("version") == ours:
        return []
    return [
        f"the built-in simulator is version {ours} now, the runs of {folder} are of version {theirs.get('version')}: "
        f"runs are made anew, and the old ones are kept in {folder / 'runs'} (docs/simulator.md says what changed)."
    ]
