"""The tiny case as fixtures, for tests/workflow and tests/faults: fresh, and run to its end."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from workflow_project import Project, make_project


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return make_project(tmp_path / "project")


@pytest.fixture(scope="session")
def _finished_once(tmp_path_factory: pytest.TempPathFactory) -> Project:
    made = make_project(tmp_path_factory.mktemp("finished") / "project")
    done = made.run("--configfile", "tiny.yaml")
    assert done.returncode == 0, done.stdout
    return made


@pytest.fixture
def finished(_finished_once: Project, tmp_path: Path) -> Project:
    """The tiny case, run to its end undisturbed: a copy for each test, time stamps kept."""
    return Project(Path(shutil.copytree(_finished_once.folder, tmp_path / "finished")))
