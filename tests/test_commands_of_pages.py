"""Every command in a block of README and the pages is tried as far as it goes without a calibration."""

import functools
import os
import re
import runpy
import shlex
import shutil
import sys
from pathlib import Path

import pytest
import typer
from commands import typed
from snakemake.cli import parse_args

from radcal.cli import app
from radcal.cli.run import files_of_stages
from radcal.config import load

ROOT = Path(__file__).parents[1]
PROGRAM = r"(?:\.venv/bin/|python3? |snakemake |gdal\w+ |cc |export |docker |conda )"
COMMAND = re.compile(rf"(?m)^(?: {{4}}|(?=python3 |\.venv/))({PROGRAM}(?:.*\\\n)*.*)$")

# how a command is tried, by its beginning
KINDS = {
    "run": ".venv/bin/radcal run ",
    "snakemake": ".venv/bin/snakemake ",
    "other": ".venv/bin/radcal ",
    "script": ".venv/bin/python examples/command",
}
# tried elsewhere, or not at all
ELSEWHERE = {
    "python3 -m venv .venv && .venv/bin/pip install --quiet --constraint requirements.lock --editable . "
    "&& .venv/bin/snakemake --cores 2": ".ci/run all",
    "python3 -m venv .venv && .venv/bin/pip install --quiet --constraint requirements.lock --editable '.[test]' "
    "&& .venv/bin/pytest": ".ci/run check",
    "python3 -m venv .venv && .venv/bin/pip install --constraint requirements.lock --editable '.[slurm]'": ".ci/run",
    "cc -O2 -o examples/command_c/sim examples/command_c/sim.c -lm": "tests/workflow/test_command.py",
    ".venv/bin/python -m radcal.results.archive": "tests/results/test_archive.py, as a function",
    ".venv/bin/python -m radcal.cdb MAPPING ROOT WEST SOUTH EAST NORTH": "tests/cdb/test_cdb.py, as a function",
    ".venv/bin/python examples/flevoland/convert.py CV-ASDF2Net/Datasets/Flevoland": "by hand: needs the data",
    "export RADCAL_DATA=$PWD": "a setting of the shell",
    "gdal_translate -a_scale 7.0795e-05 -a_nodata 0 IMG-HH-ALOS2....tif hh.tif": "not radcal's",
}  # fmt: skip


def kind_of(command):
    """Name of the first beginning that fits; None for what is tried elsewhere, or not at all."""
    return next((kind for kind, beginning in KINDS.items() if command.startswith(beginning)), None)


@functools.cache
def commands(kind):
    """Commands of this kind in README and the pages, without their beginning."""
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    found = {
        re.sub(r"\s+", " ", re.sub(r"\s#.*", "", command).replace("\\\n", " ")).strip()
        for page in pages
        for command in COMMAND.findall(page.read_text(encoding="utf-8"))
    }
    return sorted(command.removeprefix(KINDS.get(kind, "")) for command in found if kind_of(command) == kind)


def test_commands_of_other_programs_have_an_entry_that_says_where_they_are_tried():
    assert set(commands(None)) == set(ELSEWHERE)
    assert all(commands(kind) for kind in KINDS)


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """What a clone has that these commands read, with cases of the reader's own, for which the default case stands."""
    for name in ("Snakefile", "workflow", "profiles"):
        (tmp_path / name).symlink_to(ROOT / name)
    for name in ("config", "examples"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("data"))
    default = (ROOT / "config/config.yaml").read_text(encoding="utf-8")
    for name in ("mine", "segura"):
        (tmp_path / f"config/{name}.yaml").write_text(default.replace("case: dyke", f"case: {name}"))
    (tmp_path / "examples/command_c/sim").touch(mode=0o755)
    monkeypatch.chdir(tmp_path)
    for script in commands("script"):
        runpy.run_path(f"examples/command{script}", run_name="__main__")
    return tmp_path


def test_commands_reach_snakemake(clone, monkeypatch):
    """The case and the settings are checked, Snakemake's options are parsed, and the targets exist."""
    started = []
    monkeypatch.setattr("radcal.cli.run.os.execv", lambda _, words: started.append(words) or sys.exit(0))
    for command in commands("run"):
        if ("flevoland" in command and "RADCAL_DATA" not in os.environ) or "--profile" in command:
            continue
        typed("run", *shlex.split(command))
    for words in [words[4:] for words in started] + [shlex.split(words) for words in commands("snakemake")]:
        options = parse_args(words)[1]
        case = load(options.configfile or ["config/config.yaml"])
        assert len(files_of_stages(options.targets, case, Path("results"))) >= len(options.targets)


def test_options_of_other_commands_are_known():
    """Options and values are parsed; tests/cli, tests/products and tests/checking run the commands."""
    group = typer.main.get_command(app)
    for command in commands("other"):
        name, *words = shlex.split(command)
        assert group.commands[name].make_context(name, words).params, command
