"""The tiny case as fixtures: fresh, and run to its end."""

from __future__ import annotations

from pathlib import Path

import pytest
from workflow_project import Project, make_project


@pytest.fixture
def project(tmp_path: Path) -> Project:
    return make_project(tmp_path / "project")


@pytest.fixture(scope="module")
def finished(tmp_path_factory: pytest.TempPathFactory) -> Project:
    """The tiny case, run to its end undisturbed."""
    made = make_project(tmp_path_factory.mktemp("finished"))
    done = made.run("--configfile", "tiny.yaml")
    assert done.returncode == 0, done.stdout
    return made
