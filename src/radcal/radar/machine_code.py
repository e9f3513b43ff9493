"""Compilation by numba, with a cache on disk that is named after all sources of the compiled functions.

numba takes a function from its cache while the function's own file is unchanged, whatever has become of the compiled
functions that it calls in other files, or of the constants that it takes from them. The folder is therefore named
after a hash of all of these. Every module with compiled functions takes ``njit`` from :mod:`radcal.radar.compiled`,
which is also how the hash finds it.
"""

from __future__ import annotations

import ast
import contextlib
import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import llvmlite
import numba
from llvmlite import binding
from numba import prange

__all__ = ["cache_folder", "compiled", "prange", "sources"]

_config: Any = numba.config  # which makes its own names as it is imported
_PACKAGE = Path(__file__).resolve().parents[1]
_KEPT, _IN_USE_S = 8, 24 * 3600.0  # folders of other hashes: so many, and those of the last day


def sources(package: Path) -> list[Path]:
    """Files whose text determines the machine code of a package.

    Parameters
    ----------
    package : path
        Folder of a package ``radcal``.

    Returns
    -------
    list of Path
        Modules with compiled functions, and those that these, or constants beside them, take values from.
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
    """Modules of radcal whose values a module's functions with decorators, or its own variables, are made of."""
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
    """Folder for the machine code of a package's present sources, made if need be.

    Parameters
    ----------
    package : path
        Folder of a package ``radcal``.

    Returns
    -------
    str or None
        ``radcal-<hash>`` below the first of these that may be written: ``NUMBA_CACHE_DIR`` where it is set, the
        package's own ``__pycache__``, the user's cache (``XDG_CACHE_HOME``, else ``~/.cache``); None if none may.
        The hash is that of the sources, the versions of numba and llvmlite, and the processor, so that nodes of a
        cluster with a common home do not meet in one folder unless they run the same code. Beside it, folders of
        other hashes are removed but for the eight used last and those used within a day.
    """
    total = hashlib.sha256(f"{numba.__version__} {llvmlite.__version__} {binding.get_host_cpu_name()}".encode())
    total.update(binding.get_host_cpu_features().flatten().encode())
    for path in sources(package):
        content = path.read_bytes()
        total.update(f"\n{path.relative_to(package)} {len(content)}\n".encode() + content)
    own = [Path(_config.CACHE_DIR)] if _config.CACHE_DIR else []
    home = Path(os.environ.get("XDG_CACHE_HOME") or "~/.cache")
    for parent in (*own, package / "__pycache__", home / "radcal"):
        with contextlib.suppress(OSError, RuntimeError):  # may not be written; nobody's home
            folder = parent.expanduser().absolute() / f"radcal-{total.hexdigest()[:20]}"
            folder.mkdir(parents=True, exist_ok=True)
            tempfile.TemporaryFile(dir=folder).close()
            os.utime(folder)
            _remove_others(folder)
            return str(folder)
    return None


def _remove_others(folder: Path) -> None:
    """Remove the folders of other hashes that have not been used for long."""
    used = {}
    for path in folder.parent.glob("radcal-" + "[0-9a-f]" * 20):
        with contextlib.suppress(OSError):  # removed meanwhile
            used[path] = path.stat().st_mtime
    others = sorted((path for path in used if path != folder), key=used.__getitem__)
    for path in others[:-_KEPT]:
        if time.time() - used[path] > _IN_USE_S:
            shutil.rmtree(path, ignore_errors=True)


_FOLDER = cache_folder()


def compiled(function: Callable[..., Any], options: Mapping[str, Any], keep: bool) -> Callable[..., Any]:
    """``numba.njit`` of a function, with its machine code kept in :func:`cache_folder`.

    Parameters
    ----------
    function : callable
        The function.
    options : mapping
        Of ``numba.njit``.
    keep : bool
        Whether the folder's hash is that of the function; without a folder, too, every process compiles.

    Returns
    -------
    callable
        numba's dispatcher.
    """
    # read where a function is decorated, and of no concern to other users of numba in this process
    theirs, _config.CACHE_DIR = _config.CACHE_DIR, _FOLDER or ""
    try:
        dispatcher: Callable[..., Any] = numba.njit(cache=keep and _FOLDER is not None, **options)(function)
        return dispatcher
    finally:
        _config.CACHE_DIR = theirs
