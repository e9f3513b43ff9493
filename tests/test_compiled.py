"""The folder of the machine code: another one for other sources, and the same in every process of one source."""

import ast
import os
import re
import shutil
import time
from pathlib import Path

import numpy as np
import pytest

from radcal import compiled
from radcal.compiled import ROOMS, cache_folder

PACKAGE = Path(compiled.__file__).parent


@compiled.threaded
def shared(part, found, factor):
    for i in range(part[0], part[1]):
        found[i, 0], found[i, 1] = part[0], factor * i


def twice(x):
    return 2 * x


@pytest.fixture
def package(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled._config, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "home"))
    return Path(shutil.copytree(PACKAGE, tmp_path / "radcal", ignore=shutil.ignore_patterns("__pycache__")))


def test_one_process_compiles_a_function_and_others_wait(tmp_path, monkeypatch):
    """The other process holds the lock until the test has seen that it is waited for."""
    monkeypatch.setattr(compiled, "_FOLDER", str(tmp_path))
    double = compiled.njit()(twice)
    lock = tmp_path / f"{twice.__module__}.twice.lock"
    held, release = os.pipe(), os.pipe()
    if (other := os.fork()) == 0:
        with compiled._locked(lock):
            os.write(held[1], b"x")
            os.read(release[0], 1)
            os._exit(0)
    os.read(held[0], 1)
    # one that is suspended meanwhile holds up nobody for ever, a folder that is gone nobody at all
    with monkeypatch.context() as patch:
        patch.setattr(compiled, "_PATIENCE_S", 0.1)
        with compiled._locked(lock), compiled._locked(tmp_path / "gone" / "lock"):
            pass
    waits = []

    def sleep(seconds):
        assert not double.signatures
        waits.append(seconds)
        if len(waits) == 3:
            os.write(release[1], b"x")
            os.waitpid(other, 0)

    monkeypatch.setattr(compiled.time, "sleep", sleep)
    assert double(21) == 42
    assert len(waits) == 3
    assert list(tmp_path.rglob("*twice*.nbc"))  # its machine code is kept in the folder


@pytest.mark.parametrize(
    ("threads", "first"), [(3, [0] * 3 + [3] * 4 + [7] * 4), (3, [0, 1]), (1, [0, 0, 0, 0]), (3, [])]
)
def test_threads_share_a_loop_evenly(monkeypatch, threads, first):
    monkeypatch.setattr(compiled._config, "NUMBA_NUM_THREADS", threads)
    found = np.full((len(first), 2), -1)
    shared(len(first), found, 5)
    np.testing.assert_array_equal(found[:, 0], first)
    np.testing.assert_array_equal(found[:, 1], 5 * np.arange(len(first)))


def test_another_source_of_the_rooms_has_another_folder(package):
    before = cache_folder(package)
    (package / "scene" / "further.py").write_text("MOST = 3\n")
    assert cache_folder(package) == before, "what compiled functions do not see costs no compilation"
    (package / "speckle" / "further.py").write_text("MOST = 3\n")
    assert cache_folder(package) != before


def test_compiled_functions_use_functions_and_numbers_of_the_rooms_alone():
    modules = [path for path in PACKAGE.rglob("*.py") if "radcal.compiled import" in path.read_text()]
    assert {path.relative_to(PACKAGE).parts[0] for path in modules} == set(ROOMS)
    for path in modules:
        tree = ast.parse(path.read_text())
        compiled_here = [
            node
            for node in tree.body
            if isinstance(node, ast.FunctionDef)
            and any(re.match("njit|threaded", ast.unparse(each)) for each in node.decorator_list)
        ]
        used = {node.id for one in compiled_here for node in ast.walk(one) if isinstance(node, ast.Name)}
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("radcal."):
                foreign = used & {alias.asname or alias.name for alias in node.names} - {"njit", "threaded"}
                assert not foreign or str(node.module).split(".")[1] in ROOMS, (path, foreign)


def test_no_other_module_imports_numba():
    """Its ``njit`` would keep machine code where nothing asks for the sources of what it calls."""
    direct = [path.name for path in PACKAGE.rglob("*.py") if re.search(r"(import|from) numba", path.read_text())]
    assert direct == ["compiled.py"]


def test_folder_is_the_users_the_packages_or_below_home(package, tmp_path, monkeypatch):
    name = Path(cache_folder(package) or "").name
    assert cache_folder(package) == str(package / "__pycache__" / name)
    # as in a site-packages that may not be written: a file stands where a folder would be made
    shutil.rmtree(package / "__pycache__")
    (package / "__pycache__").write_text("")
    assert cache_folder(package) == str(tmp_path / "home" / "radcal" / name)
    monkeypatch.setattr(compiled._config, "CACHE_DIR", str(tmp_path / "mine"))
    assert cache_folder(package) == str(tmp_path / "mine" / name)
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(compiled._config, "CACHE_DIR", str(tmp_path / "file"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "file"))
    assert cache_folder(package) is None


def test_another_processor_numba_or_bounds_check_has_another_folder(package, monkeypatch):
    folders = {cache_folder(package)}
    monkeypatch.setattr(compiled.numba, "__version__", "0.0")
    folders.add(cache_folder(package))
    monkeypatch.setattr(compiled.binding, "get_host_cpu_name", lambda: "z80")
    folders.add(cache_folder(package))
    monkeypatch.setattr(compiled._config, "BOUNDSCHECK", 1 - (compiled._config.BOUNDSCHECK or 0))
    folders.add(cache_folder(package))
    assert len(folders) == 4


@pytest.mark.parametrize(("future", "kept"), [(4.5, 8), (9.5, 11)])
def test_folders_of_other_hashes_do_not_pile_up(package, future, kept):
    """Eight are kept, and those that were used within a day."""
    parent = package / "__pycache__"
    for k in range(20):
        other = parent / f"radcal-{k:020x}"
        other.mkdir(parents=True)
        (other / "code.nbc").write_text("")
        os.utime(other, (time.time() - (k - future) * 24 * 3600,) * 2)
    (parent / "radcal-notes").mkdir()
    now = Path(cache_folder(package) or "")
    others = [parent / f"radcal-{k:020x}" for k in range(kept)]
    assert sorted(parent.iterdir()) == sorted([now, parent / "radcal-notes", *others])
