"""Compilation by numba, with a cache folder that is named after a hash of all source files of compiled functions.

numba loads a function's machine code from its cache as long as the function's own source file is unchanged. It does not
notice changes in other source files whose compiled functions or constants the function uses. The cache folder is
therefore named after a hash of all source files with compiled functions or with constants that compiled functions use.
Every module with compiled functions imports ``njit`` from this module, and :func:`sources` finds these modules by this
import.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeVar

import llvmlite
import numba
from llvmlite import binding
from numba import prange

__all__ = ["cache_folder", "njit", "prange", "sources"]

_config: Any = numba.config  # the names of numba.config are defined only at import, so that mypy does not know them
_PACKAGE = Path(__file__).resolve().parents[1]
_KEPT, _IN_USE_S = 8, 24 * 3600.0  # number of folders of other hashes that are kept, besides those of the last day


def sources(package: Path) -> list[Path]:
    """Source files of a package that determine the machine code of its compiled functions.

    Parameters
    ----------
    package : path
        Folder of a package ``radcal``.

    Returns
    -------
    list of Path
        Modules that import ``radcal.radar.compiled``, and modules whose functions or constants these modules use,
        directly or indirectly, in decorated functions or global variables.
    """
    waiting = [path for path in package.rglob("*.py") if b"radcal.radar.compiled" in path.read_bytes()]
    found = set(waiting)
    while waiting:
        for name in _taken(ast.parse(waiting.pop().read_bytes())):
            path = package.parent.joinpath(*name.split(".")).with_suffix(".py")
            if path not in found and path.is_file():
                found.add(path)
                waiting.append(path)
    return sorted(found)


def _taken(tree: ast.Module) -> set[str]:
    """Names of radcal's modules whose contents are used in a module's decorated functions or global variables."""
    makers = [node for node in tree.body if isinstance(node, ast.Assign | ast.AnnAssign)]
    compiled = [node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef) and node.decorator_list]
    used = {node.id for part in (*makers, *compiled) for node in ast.walk(part) if isinstance(node, ast.Name)}
    taken: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "radcal":
            names = {alias.name for alias in node.names if (alias.asname or alias.name) in used}
            taken |= {node.module, *(f"{node.module}.{name}" for name in names)} if names else set()
        elif isinstance(node, ast.Import):
            taken |= {alias.name for alias in node.names if (alias.asname or alias.name).split(".")[0] in used}
    return taken


def cache_folder(package: Path = _PACKAGE) -> str | None:
    """Path of the cache folder for the machine code of a package's current source files; created if it is missing.

    Parameters
    ----------
    package : path
        Folder of a package ``radcal``.

    Returns
    -------
    str or None
        ``radcal-<hash>`` in the first writable folder of: ``NUMBA_CACHE_DIR`` if it is set, the package's own
        ``__pycache__``, ``radcal`` in the user's cache (``XDG_CACHE_HOME``, else ``~/.cache``). None if none of them is
        writable. The hash covers the source files, the versions of numba and llvmlite, and the processor. Nodes of a
        cluster with a common home directory therefore share a folder only if they run the same machine code. Folders of
        other hashes are removed, except the eight used most recently and those used within the last day.
    """
    total = hashlib.sha256(f"{numba.__version__} {llvmlite.__version__} {binding.get_host_cpu_name()}".encode())
    total.update(binding.get_host_cpu_features().flatten().encode())
    for path in sources(package):
        content = path.read_bytes()
        total.update(f"\n{path.relative_to(package)} {len(content)}\n".encode() + content)
    own = [Path(_config.CACHE_DIR)] if _config.CACHE_DIR else []
    home = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache")
    for parent in (*own, package / "__pycache__", home / "radcal"):
        with contextlib.suppress(OSError, RuntimeError):  # the folder is not writable, or the user has no home
            folder = parent.expanduser().absolute() / f"radcal-{total.hexdigest()[:20]}"
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            os.utime(folder)
            _remove_others(folder)
            return str(folder)
    return None


def _remove_others(folder: Path) -> None:
    """Remove all cache folders beside ``folder``, except the eight used most recently and those used within a day."""
    used = {}
    for path in folder.parent.glob("radcal-" + "[0-9a-f]" * 20):
        with contextlib.suppress(OSError):  # removed meanwhile
            used[path] = path.stat().st_mtime
    others = sorted((path for path in used if path != folder), key=used.__getitem__)
    for path in others[:-_KEPT]:
        if time.time() - used[path] > _IN_USE_S:
            shutil.rmtree(path, ignore_errors=True)


_FOLDER = cache_folder()


_Function = TypeVar("_Function", bound=Callable[..., Any])


def njit(**options: Any) -> Callable[[_Function], _Function]:
    """Decorator ``numba.njit`` that stores the machine code in the folder of :func:`cache_folder`.

    If there is no writable cache folder, every process compiles the functions again.

    Parameters
    ----------
    **options
        Options of ``numba.njit``.
    """

    def compiled(function: _Function) -> _Function:
        # read when a function is decorated; reset so that other users of numba in this process are not affected
        theirs, _config.CACHE_DIR = _config.CACHE_DIR, _FOLDER or ""
        try:
            dispatcher: _Function = numba.njit(cache=_FOLDER is not None, **options)(function)
            return dispatcher
        finally:
            _config.CACHE_DIR = theirs

    return compiled
