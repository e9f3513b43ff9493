"""Atomic writes (temporary name, flush, rename), removal of killed processes' files, and digests of plain data."""

from __future__ import annotations

import contextlib
import hashlib
import json
import os
import shutil
import socket
import stat
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from radcal.errors import StoreError

_PARTIAL = ".partial-"


@contextlib.contextmanager
def atomic(path: str | Path) -> Iterator[Path]:
    """Yield a temporary path; after the ``with`` block, flush the file there and rename it to ``path``.

    If the block raises an exception, the temporary file is removed.

    Raises
    ------
    StoreError
        The file cannot be written.
    """
    path = Path(path)
    partial = path.with_name(f"{_PARTIAL}{socket.gethostname()}-{os.getpid()}-{path.name}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        yield partial
        with partial.open("rb") as handle:
            os.fsync(handle.fileno())
        partial.replace(path)
        folder = os.open(path.parent, os.O_RDONLY)
        try:
            os.fsync(folder)
        finally:
            os.close(folder)
    except OSError as error:
        raise StoreError(f"{path}: cannot be written ({error.strerror or error}).") from error
    finally:
        with contextlib.suppress(OSError):
            partial.unlink()


def first_difference(theirs: Any, ours: Any, key: str = "") -> str:
    """Text that states the first difference between two sets of plain data: the key and both values."""
    if isinstance(theirs, dict) and isinstance(ours, dict):
        for name in [*ours, *(name for name in theirs if name not in ours)]:
            if theirs.get(name) != ours.get(name):
                return first_difference(theirs.get(name), ours.get(name), f"{key}.{name}" if key else name)
    return f"{key} is {theirs!r} there, {ours!r} here"


def digest(data: Any) -> str:
    """Hash of plain data, as twenty hex digits; the order of keys does not change the hash."""
    text = json.dumps(data, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()[:20]


def file_sha256(path: Path) -> str:
    """SHA-256 of the bytes of a file, in hexadecimal digits."""
    with path.open("rb") as handle:
        return hashlib.file_digest(handle, "sha256").hexdigest()


def working_folder(parent: str | Path) -> Path:
    """Create an empty folder that :func:`sweep` removes after the end of this process.

    Parameters
    ----------
    parent : path
        Folder in which the new folder is created. A missing ``parent`` is created first.

    Raises
    ------
    StoreError
        The folder cannot be created.
    """
    try:
        Path(parent).mkdir(parents=True, exist_ok=True)
        return Path(tempfile.mkdtemp(prefix=f"{_PARTIAL}{socket.gethostname()}-{os.getpid()}-", dir=parent))
    except OSError as error:
        raise StoreError(f"{parent}: no folder can be made there ({error.strerror or error}).") from error


def sweep(folder: str | Path) -> int:
    """Remove temporary files and folders of processes that have ended on this machine; return the number removed."""
    removed = 0
    host = socket.gethostname()
    for partial in list(Path(folder).rglob(f"{_PARTIAL}{host}-*")):
        pid = partial.name.removeprefix(f"{_PARTIAL}{host}-").split("-", 1)[0]
        if not pid.isdigit() or not alive(int(pid)):
            if partial.is_dir() and not partial.is_symlink():
                shutil.rmtree(partial, ignore_errors=True)
            else:
                with contextlib.suppress(OSError):  # the file belongs to another user, in a folder that is not writable
                    partial.unlink()
            removed += 1
    return removed


def case_folder(path: str | Path) -> Path:
    """Results folder ``results/<case>`` of a file that lies there, or in the folder ``passes/<p>`` of its pass."""
    folder = Path(path).parent
    return folder.parent.parent if folder.parent.name == "passes" else folder


def unwritable(folder: str | Path) -> Path | None:
    """First folder, among ``folder`` and its subfolders, in which this process may not create files, or None.

    Parameters
    ----------
    folder : path
        ``results/<case>``, whose subfolder ``external`` is not checked.
    """
    for path, folders, _ in os.walk(folder):
        if not os.access(path, os.W_OK | os.X_OK):
            return Path(path)
        if Path(path) == Path(folder) and "external" in folders:
            folders.remove("external")
    return None


def clamp_future_mtimes(folder: str | Path) -> int:
    """Set modification times in the future to the present, without changing their order; return the number changed.

    Modification times in the future remain after the computer's clock was set back. With such files, Snakemake would
    fail every job whose output is older than its input. Run records, which Snakemake does not use, and the targets of
    links are not changed.

    Parameters
    ----------
    folder : path
        ``results/<case>``.
    """
    now = time.time_ns()
    dated = []
    # os.walk() does not follow links to folders
    for place, _, names in os.walk(folder):
        if Path(place).name == "runs":
            continue
        for path in (Path(place, name) for name in ("", *names)):
            with contextlib.suppress(OSError):  # another process has removed the file
                status = path.lstat()
                # a file with a further hard link may also be a user's file outside the results
                if stat.S_ISDIR(status.st_mode) or (stat.S_ISREG(status.st_mode) and status.st_nlink == 1):
                    dated.append((status.st_mtime_ns, path))
    future = sorted(item for item in dated if item[0] > now)
    for k, (_, path) in enumerate(reversed(future)):
        with contextlib.suppress(OSError):
            os.utime(path, ns=(now - k * 1000, now - k * 1000), follow_symlinks=False)
    return len(future)


def alive(pid: int) -> bool:
    """Whether the process with this number runs on this machine; a killed process that nobody waits for does not."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    except PermissionError:
        return True
    return not _zombie(pid)


def _zombie(pid: int) -> bool:
    """Whether a process has ended and only its entry in the table of processes is left; false without /proc."""
    try:
        status = Path(f"/proc/{pid}/stat").read_text(encoding="utf-8", errors="replace")
    except OSError:
        return False
    return status.rpartition(")")[2].split()[0] == "Z"  # after the name of the program, see proc(5)
