"""Distributions as an installer leaves them."""

import pytest

from radcal import plugins


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Function that installs version 1.5 of a distribution with its entry points by group."""
    monkeypatch.syspath_prepend(str(tmp_path))
    plugins._installed.cache_clear()

    def installed(name, **groups):
        folder = tmp_path / f"{name}-1.5.dist-info"
        folder.mkdir()
        (folder / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: 1.5\n")
        lines = []
        for group, points in groups.items():
            lines += [f"[{group}]", *(f"{key} = {value}" for key, value in points.items())]
        (folder / "entry_points.txt").write_text("\n".join(lines))

    yield installed
    plugins._installed.cache_clear()
