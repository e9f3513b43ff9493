"""The tiny case as fixtures: fresh, and run to its end."""

from __future__ import annotations

import fcntl
import shutil
from pathlib import Path

import pytest
from workflow_project import Project, make_project


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return make_project(tmp_path / "project")


@pytest.fixture(scope="session")
def _finished_once(tmp_path_factory: pytest.TempPathFactory, worker_id: str) -> Project:
    base = tmp_path_factory.getbasetemp()
    # tests that run side by side have a folder in common, and make it once
    folder = (base if worker_id == "master" else base.parent) / "finished" / "project"
    folder.parent.mkdir(exist_ok=True)
    with (folder.parent / "lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        project = Project(folder)
        if not (folder.parent / "done").exists():
            project = make_project(folder)
            done = project.run("--configfile", "tiny.yaml")
            assert done.returncode == 0, done.stdout
            (folder.parent / "done").touch()
        return project


@pytest.fixture
def finished(_finished_once: Project, tmp_path: Path) -> Project:
    """The tiny case, run to its end undisturbed: a copy for each test, time stamps kept."""
    return Project(Path(shutil.copytree(_finished_once.folder, tmp_path / "finished")))
