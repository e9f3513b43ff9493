import pytest
from browser import Browser


@pytest.fixture(scope="package")
def browser():
    with Browser() as opened:
        yield opened
