"""Projects whose commands are forked from a warm process; ``start`` and ``command`` stay what people type."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from warm import Warm
from workflow_project import Project


@pytest.fixture(scope="session")
def warm() -> Iterator[Warm]:
    with Warm() as server:
        yield server


@pytest.fixture
def project(project: Project, warm: Warm) -> Project:
    project.interpreter = warm.interpreter()
    return project


@pytest.fixture
def finished(finished: Project, warm: Warm) -> Project:
    finished.interpreter = warm.interpreter()
    return finished
