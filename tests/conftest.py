"""A scene of 40 x 40 cells, small enough that geometry and image take milliseconds."""

import functools
import gc
import os
import sys

# before numpy: its threads wait for each other longer than these small problems take
for _name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
    os.environ.setdefault(_name, "1")

from pathlib import Path

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter

from radcal.config import Radar, case_from
from radcal.findings import Finding
from radcal.radar.projection import make_geometry
from radcal.scene.model import Scene
from radcal.words import sentence

pytest_plugins = ["workflow_fixtures", "archive_fixtures", "field_fixtures"]

MARKED = ("workflow", "faults", "cluster")  # folders of tests, and the markers that their tests get
DESELECTED = f"not ({' or '.join((*MARKED, 'slow'))})"  # as in pyproject.toml
TESTS = Path(__file__).parent
FIRST = TESTS / "test_small_calibration.py"
# folders whose tests run little or nothing that numba compiles
LIGHT = [TESTS / name for name in ("cli", "config", "reading", "sections", "session", "storage", "tables")]

WORKER = int(os.environ.get("PYTEST_XDIST_WORKER", "gw0").removeprefix("gw"))


@pytest.fixture(autouse=True)
def _findings_have_sentences(monkeypatch):
    """Every finding that radcal itself makes has a text in `finding_texts`, to which its numbers belong."""
    made = Finding.__init__

    def checked(self, *args, **keys):
        made(self, *args, **keys)
        name = sys._getframe(1).f_globals["__name__"]
        if name.startswith("radcal.") and name != "radcal.findings":
            sentence(self)

    monkeypatch.setattr(Finding, "__init__", checked)


def pytest_configure(config):
    """Folders and files that are named on the command line are run whatever their markers."""
    named = [(config.invocation_params.dir / arg.partition("::")[0]).resolve() for arg in config.args]
    if config.option.markexpr == DESELECTED and all(TESTS in path.parents for path in named):
        config.option.markexpr = ""


def pytest_ignore_collect(collection_path, config):
    """Folders whose tests are all deselected are not read."""
    return True if config.option.markexpr == DESELECTED and _marker(collection_path) else None


@pytest.hookimpl(wrapper=True)
def pytest_make_collect_report(collector):
    """Folders are read from their last file on by every other worker.

    The first worker that reads a test module compiles it for all. Two workers that read in the same order would compile
    every module twice.
    """
    report = yield
    if WORKER % 2 and isinstance(collector, pytest.Dir):
        report.result.reverse()
    return report


@pytest.hookimpl(wrapper=True)
def pytest_collection_modifyitems(items):
    """Mark by folder, so that no test can forget, and put the tests in an order in which all workers end together."""
    for item in items:
        if marker := _marker(item.path):
            item.add_marker(marker)
    yield  # tests are deselected by their markers
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return
    items.sort(key=lambda item: item.path)  # the same order in all workers
    kinds = {"first": [], "workflow": [], "light": [], "rest": []}
    for item in items:
        kinds[_kind(item.path)].append(item)
    first, long, light, rest = kinds.values()
    if long:
        # Each worker begins with an equal part of the tests that take a minute, and takes over short ones at the end.
        workers = int(os.environ["PYTEST_XDIST_WORKER_COUNT"])
        short = [*first, *rest, *light]
        items[:] = [item for k in range(workers) for kind in (long, short) for item in _part(kind, k, workers)]
    else:
        # Of two workers, one begins with the first half. The longest test, at its start, compiles for both: the other
        # worker begins with tests that need little machine code.
        before = max(0, len(items) // 2 - len(first))
        items[:] = [*first, *rest[:before], *light, *rest[before:]]


def pytest_collection_finish():
    """Leave modules and tests out of the search for garbage: they last to the end."""
    gc.freeze()


@functools.cache
def _marker(path):
    """Marker of the tests in a file or folder."""
    return next((name for name in MARKED if path.is_relative_to(TESTS / name)), None)


@functools.cache
def _kind(path):
    """Kind of the tests in a file, by which they are ordered."""
    if path == FIRST:
        return "first"
    if _marker(path):
        return "workflow"
    return "light" if any(folder in path.parents for folder in LIGHT) else "rest"


def _part(items, k, parts):
    """Part number k of equal parts of a list."""
    return items[len(items) * k // parts : len(items) * (k + 1) // parts]


@pytest.fixture(scope="session")
def build_scene():
    """Make a scene from a function of (east, north) in metres from the scene's middle."""

    def build(surface, *, cells=(40, 40), cell_m=5.0, names=("dyke",), material=None):
        ny, nx = cells
        north, east = np.meshgrid(
            (np.arange(ny) + 0.5 - ny / 2) * cell_m, (np.arange(nx) + 0.5 - nx / 2) * cell_m, indexing="ij"
        )
        elevation = np.broadcast_to(surface(east, north), cells).astype(np.float64)
        if material is None:
            material = np.ones(cells, dtype=np.uint8)
        return Scene("by hand", names, material, elevation, cell_m)

    return build


@pytest.fixture(scope="session")
def scene(build_scene):
    """Rough ground: the dyke in the west, grass in the east."""
    rough = gaussian_filter(np.random.default_rng(5).standard_normal((40, 40)), 1.5, mode="wrap")
    material = np.where(np.arange(40) < 22, 1, 2).astype(np.uint8) * np.ones((40, 1), dtype=np.uint8)
    return build_scene(lambda east, north: rough / rough.std(), names=("dyke", "grass"), material=material)


@pytest.fixture(scope="session")
def radar():
    return Radar(altitude_m=1000.0, nesz_db=-20.0, radiometry="sigma0_local")


@pytest.fixture(scope="session")
def geometry(scene, radar):
    return make_geometry(scene, radar)


@pytest.fixture(scope="session")
def build_case():
    """Make the tiny case with some sections replaced."""

    def build(**sections):
        data = {
            "radar": {"altitude_m": 1000.0, "nesz_db": -20.0, "radiometry": "sigma0_local"},
            "materials": {"dyke": {"calibrate": True}, "grass": {"parameters": [10.0, 14.0, 6.0, 4.0]}},
            "measurement": {"source": "synthetic", "synthetic": {"parameters": {"dyke": [6.1, 14.2, 21.5, 3.3]}}},
            "objective": "density",
            "target": {"pixels": 500},
        }
        return case_from(data | sections)

    return build


@pytest.fixture(scope="session")
def case(build_case):
    return build_case()
