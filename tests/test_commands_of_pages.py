"""Every command in a block of README and the pages has an entry here, which says how it is tried."""

import os
import re
import runpy
import shlex
import shutil
import sys
from pathlib import Path

import pytest
import typer
from snakemake.cli import parse_args
from typer.testing import CliRunner

from radcal.cli import app
from radcal.cli.run import files_of_stages
from radcal.config import load

ROOT = Path(__file__).parents[1]
PROGRAM = r"(?:\.venv/bin/|python3? |snakemake |gdal\w+ |cc |export |docker |conda )"
COMMAND = re.compile(rf"(?m)^(?: {{4}}|(?=python3 |\.venv/))({PROGRAM}(?:.*\\\n)*.*)$")

# radcal run, up to where Snakemake takes over: the case and the settings are checked, Snakemake's options are parsed
STARTED = """
config/config.yaml --set objective=density
config/config.yaml --set stop.law_db=0.02
config/flevoland.yaml
config/mine.yaml
config/mine.yaml --dry-run
config/mine.yaml --set 'materials.dyke.start=[-16.2, 2.1, 17.0, 4.6]'
config/mine.yaml --set stop.law_db=0.02
config/mine.yaml design
config/mine.yaml products
config/mine.yaml reference
config/mine.yaml registration
config/segura.yaml
"""
# Snakemake's own command line: its options are parsed, the case is loaded, the targets exist
SNAKEMAKE = """
--cores 2
--cores 2 --configfile examples/command_c/case.yaml
--cores 2 --configfile examples/command_python/case.yaml
--cores 2 --forcerun report
--cores 2 design --configfile config/mine.yaml
--cores 2 results/dyke/report.html
--report snakemake.html
"""
# other commands of radcal: options and values are parsed (tests/cli, tests/products and tests/checking run them)
PARSED = """
advise dyke
advise dyke --depression 30 --depression 60 --between 20 50
advise segura
apply dyke --to config/other.yaml
check config/flevoland.yaml
check config/mine.yaml
check config/segura.yaml
new config/mine.yaml
new config/segura.yaml --elevation $S1/elevation_plane.tif --landcover $S1/landcover.tif --names $S1/names.json --vertical-datum EGM2008 --image $S1/s1.tif --band 1 --scale db --radiometry sigma0_ref --sensor sentinel1_iw_grdh --polarisation VV --incidence 39 --heading 350 --nesz -24 --material crops --material bare --fixed water=-17
show config/mine.yaml --watch --html
show mine
simulate config/config.yaml --product focused
simulate config/config.yaml --product focused --materials results/dyke/export/calibrated.yaml
simulate config/config.yaml --product focused --set radar.looks=1
simulate config/config.yaml --product iq
simulate config/mine.yaml
simulate config/mine.yaml --materials results/mine/export/calibrated.yaml
simulate config/mine.yaml --product gmti
simulate config/mine.yaml --product gmti --draws 20
simulate config/mine.yaml --product ppi --materials results/mine/export/calibrated.yaml
"""  # noqa: E501
# run in the fixture below, for the cases of the examples
SCRIPTS = """
examples/command_c/scene.py
examples/command_python/scene.py
"""
# tried elsewhere, or not at all
ELSEWHERE = {
    "python3 -m venv .venv && .venv/bin/pip install --quiet --constraint requirements.lock --editable . "
    "&& .venv/bin/snakemake --cores 2": ".ci/run all",
    "python3 -m venv .venv && .venv/bin/pip install --quiet --constraint requirements.lock --editable '.[test]' "
    "&& .venv/bin/pytest": ".ci/run check",
    "python3 -m venv .venv && .venv/bin/pip install --constraint requirements.lock --editable '.[slurm]'": ".ci/run",
    "cc -O2 -o examples/command_c/sim examples/command_c/sim.c -lm": "tests/workflow/test_command.py",
    ".venv/bin/radcal run config/mine.yaml -- --profile profiles/slurm": "tests/cluster",
    ".venv/bin/python -m radcal.results.archive": "tests/results/test_archive.py, as a function",
    ".venv/bin/python -m radcal.cdb MAPPING ROOT WEST SOUTH EAST NORTH": "tests/cdb/test_cdb.py, as a function",
    ".venv/bin/python examples/flevoland/convert.py CV-ASDF2Net/Datasets/Flevoland": "by hand: needs the data",
    "export RADCAL_DATA=$PWD": "a setting of the shell",
    "gdal_translate -a_scale 7.0795e-05 -a_nodata 0 IMG-HH-ALOS2....tif hh.tif": "not radcal's",
}  # fmt: skip


def listed(commands, before=""):
    return [before + line for line in commands.split("\n") if line]


def test_every_command_of_the_pages_has_its_entry():
    pages = [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]
    found = {
        re.sub(r"\s+", " ", re.sub(r"\s#.*", "", command).replace("\\\n", " ")).strip()
        for page in pages
        for command in COMMAND.findall(page.read_text(encoding="utf-8"))
    }
    entries = [
        *listed(STARTED, ".venv/bin/radcal run "), *listed(SNAKEMAKE, ".venv/bin/snakemake "),
        *listed(PARSED, ".venv/bin/radcal "), *listed(SCRIPTS, ".venv/bin/python "), *ELSEWHERE,
    ]  # fmt: skip
    assert found - set(entries) == set(), "a command of a page without an entry"
    assert set(entries) - found == set(), "an entry without its command"


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """What a clone has that these commands read, with cases of the reader's own."""
    for name in ("Snakefile", "workflow", "profiles"):
        (tmp_path / name).symlink_to(ROOT / name)
    for name in ("config", "examples"):
        shutil.copytree(ROOT / name, tmp_path / name, ignore=shutil.ignore_patterns("data"))
    default = (ROOT / "config/config.yaml").read_text(encoding="utf-8")
    for name in ("mine", "segura"):
        (tmp_path / f"config/{name}.yaml").write_text(default.replace("case: dyke", f"case: {name}"))
    (tmp_path / "examples/command_c/sim").touch(mode=0o755)
    monkeypatch.chdir(tmp_path)
    for script in listed(SCRIPTS):
        runpy.run_path(script, run_name="__main__")
    return tmp_path


def test_commands_reach_snakemake(clone, monkeypatch):
    """The default case stands for the reader's."""
    started = []
    monkeypatch.setattr("radcal.cli.run.os.execv", lambda _, words: started.append(words) or sys.exit(0))
    for command in listed(STARTED):
        if "flevoland" in command and "RADCAL_DATA" not in os.environ:
            continue
        done = CliRunner().invoke(app, ["run", *shlex.split(command)])
        assert done.exit_code == 0, f"{command}: {done.output}"
    commands = [words[4:] for words in started] + [shlex.split(words) for words in listed(SNAKEMAKE)]
    for words in commands:
        options = parse_args(words)[1]
        case = load(options.configfile or ["config/config.yaml"])
        assert len(files_of_stages(options.targets, case, Path("results"))) >= len(options.targets)


def test_options_of_other_commands_are_known():
    group = typer.main.get_command(app)
    for command in listed(PARSED):
        name, *words = shlex.split(command)
        assert group.commands[name].make_context(name, words).params, command
