"""The default case as YAML."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import yaml

from radcal.config import Case, default_case, default_yaml, load


def test_default_yaml_is_the_default_case(tmp_path: Path) -> None:
    path = tmp_path / "config.yaml"
    path.write_text(default_yaml())
    assert load([path]) == default_case()
    assert yaml.safe_load(default_yaml())["stop"]["rms"] == 1e-5  # a number, not text


def test_default_case_differs_from_the_defaults_in_radiometry_alone() -> None:
    case, defaults = default_case().model_dump(), Case().model_dump()
    assert (case["radar"].pop("radiometry"), defaults["radar"].pop("radiometry")) == ("sigma0_local", "sigma0_ref")
    assert case == defaults


def test_shipped_config_is_the_default_case() -> None:
    shipped = Path(__file__).parents[2] / "config" / "config.yaml"
    assert shipped.read_text() == default_yaml()


def test_module_writes_the_default_yaml() -> None:
    done = subprocess.run([sys.executable, "-m", "radcal.config"], capture_output=True, text=True, check=True)
    assert done.stdout == default_yaml()
