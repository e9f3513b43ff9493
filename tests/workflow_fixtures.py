"""The tiny case as fixtures: fresh, and run to its end."""

import fcntl
import shutil
from pathlib import Path

import pytest
from warm import Warm
from workflow_project import Project, make_project


@pytest.fixture(scope="session")
def warm():
    with Warm() as server:
        yield server


@pytest.fixture
def project(request, tmp_path):
    return quick(make_project(tmp_path / "project"), request)


@pytest.fixture(scope="session")
def _finished_once(request, tmp_path_factory, worker_id):
    base = tmp_path_factory.getbasetemp()
    # tests that run side by side have a folder in common, and make it once
    folder = (base if worker_id == "master" else base.parent) / "finished" / "project"
    folder.parent.mkdir(exist_ok=True)
    with (folder.parent / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        project = Project(folder)
        if not (folder.parent / "done").exists():
            project = make_project(folder)
            project.interpreter = request.getfixturevalue("warm").interpreter()
            project.ended("--configfile", "tiny.yaml")
            (folder.parent / "done").touch()
        return project


@pytest.fixture
def finished(request, _finished_once, tmp_path):
    """The tiny case, run to its end undisturbed: a copy for each test, time stamps kept."""
    return quick(Project(Path(shutil.copytree(_finished_once.folder, tmp_path / "finished"))), request)


def quick(project, request):
    """The project, whose ``run`` forks a warm process in the folders of long tests; the rest starts as people type it.

    What is to be killed is begun with ``start``.
    """
    if any(request.node.get_closest_marker(name) for name in ("workflow", "faults")):
        project.interpreter = request.getfixturevalue("warm").interpreter()
    return project
