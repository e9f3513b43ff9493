"""The command radcal run, up to where Snakemake takes over; tests/workflow goes on from there."""

import os
import subprocess
import sys
import tomllib
from pathlib import Path
from types import SimpleNamespace

import pytest
from commands import typed

import radcal
from radcal.cli.run import files_of_stages, snakemake_command, sorted_words
from radcal.config import load
from radcal.config.yaml_file import settings
from radcal.session import workflow_files

ROOT = Path(__file__).parents[2]
IMAGE = {"source": "file", "path": "a.npy", "scale": "db", "radiometry": "sigma0_local"}


@pytest.fixture
def clone(tmp_path, monkeypatch):
    """What a clone has that is looked at."""
    for name in ("Snakefile", "workflow", "config", "profiles"):
        (tmp_path / name).symlink_to(ROOT / name)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.yaml").write_text("case: mine\nstop: {rms: 0.1}\n")
    return tmp_path


@pytest.fixture
def started(monkeypatch):
    """Commands that were to take the place of this process, in a command of one case."""
    commands = []

    def execv(_, words):
        commands.append(words)
        raise SystemExit(0)

    monkeypatch.setattr("radcal.cli.run.os.execv", execv)
    monkeypatch.setenv("RADCAL_RESULTS", "")  # put back after the test
    return commands


def parsed_by_snakemake(command):
    """What Snakemake's own parser makes of a command."""
    from snakemake.cli import parse_args  # only the process that runs these tests loads Snakemake

    return parse_args(command[4:])[1]


def refused(*arguments):
    done = typed("run", *arguments, code=1)
    assert (done.stdout, done.stderr.count("\n")) == ("", 1)
    assert done.stderr.startswith("radcal: ")
    return done.stderr.removeprefix("radcal: ").rstrip("\n")


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["gone.yaml"], "gone.yaml: cannot be read (No such file or directory), expected a YAML file."),
        (["a\nb.yaml"], "a\\nb.yaml: cannot be read (No such file or directory), expected a YAML file."),
        (["mine.yaml", "desing"], "there is no target 'desing' (did you mean 'design'?)."),
        (["mine.yaml", "report", "mine.yaml"], "mine.yaml: case is 'mine', which mine.yaml is called, too, expected"),
        (["mine.yaml", "--results", "{a}"], "--results is '{a}', expected a folder without braces in its name."),
        (["mine.yaml", "--cores", "0"], "--cores is '0', expected a number from 1 on, or all."),
        (["mine.yaml", "--set", "stop.rms"], "--set stop.rms: expected KEY=VALUE such as stop.rms=1e-6."),
        (["mine.yaml", "--set", "stop.rsm=1"], "mine.yaml, command line: unknown key stop.rsm (did you mean 'rms'?)."),
        (
            ["mine.yaml", "--set", "stop.max_runs=1", "--set", "design.size=2"],
            "mine.yaml, command line: stop.max_runs is 1, expected at least design.size",
        ),
        (["mine.yaml", "--", "--config", "seed=3"], "--config after -- would replace the case that is checked: type"),
        (["mine.yaml", "--", "-n", "--configfile=b.yaml"], "--configfile=b.yaml after -- would replace the case"),
    ],
)
def test_wrong_commands_end_in_a_sentence(clone, arguments, said, started):
    assert refused(*arguments).startswith(said)
    assert started == []


def test_a_clones_own_workflow_is_run_in_its_folder(clone, started):
    typed("run", "mine.yaml")
    assert not {"--snakefile", "--workflow-profile"} & set(started[0])
    assert os.environ["RADCAL_RESULTS"] == "results"


def test_stages_are_targets(clone, started):
    settings = ("--set", "design.size=2")
    typed("run", "mine.yaml", "registration", "design", "results/mine/scene.h5", "design_chunk", "posterior", *settings)
    at = "results/mine/"
    targets = parsed_by_snakemake(started[0]).targets
    assert targets[:3] == [f"{at}passes/1/registered.h5", "design", f"{at}scene.h5"]
    assert f"{at}design/0.json" in targets[3:-1]
    assert targets[-1] == f"{at}posterior/dyke.h5"
    assert "'design_chunk' has no jobs in case mine" in refused("mine.yaml", "design_chunk")
    told = refused("mine.yaml", "verify")
    assert "such as results/CASE/iterations/0/verified.json, or one of all, archive, design, " in told
    assert "train" not in told


def test_a_stage_of_several_passes_is_made_in_each(build_case):
    radar = {"radiometry": "sigma0_local"}
    case = build_case(case="two", radar=[radar] * 2, measurement=[IMAGE] * 2, design={"size": 4, "chunk": 2})
    files = files_of_stages(["target", "design_chunk"], case, Path("found"))
    assert files[:2] == ["found/two/passes/1/target.h5", "found/two/passes/2/target.h5"]
    assert files[2:] == [f"found/two/design/{k}.json" for k in range(4)]


def test_a_profile_of_the_current_folder_is_taken_before_radcals(clone, started, monkeypatch):
    (clone / "elsewhere/profiles/slurm").mkdir(parents=True)
    monkeypatch.chdir(clone / "elsewhere")
    typed("run", "../mine.yaml", "--", "--profile", "profiles/slurm")
    assert started[0][-2:] == ["--profile", "profiles/slurm"]


@pytest.mark.parametrize("folder", ["elsewhere", "others"])
def test_elsewhere_radcals_own_workflow_is_run(clone, folder, started, monkeypatch):
    (clone / folder).mkdir()
    if folder == "others":
        (clone / "others/Snakefile").write_text("rule all:\n    input: []\n")
    monkeypatch.chdir(clone / folder)
    done = typed("run", "../mine.yaml", "--results", "found", "--", "--profile", "profiles/slurm")
    own = Path(radcal.__file__).resolve().parents[2]
    assert started[0][-2:] == ["--profile", str(own / "profiles/slurm")]
    started[0][-2:] = []
    found = parsed_by_snakemake(started[0])
    assert (Path(found.snakefile), Path(found.workflow_profile)) == (own / "Snakefile", own / "profiles/default")
    assert found.nolock  # radcal's own lock dies with its process; from the profile
    assert os.environ["RADCAL_RESULTS"] == "found"
    assert done.stderr == f"radcal: results go to {clone / folder / 'found'}\n"
    monkeypatch.setattr(workflow_files, "radcal", SimpleNamespace(__file__=str(clone / "a/b/c/radcal.py")))
    monkeypatch.setattr(workflow_files.metadata, "files", lambda _: None)
    said = f"{clone / folder} is not the folder of a clone of radcal, and radcal was installed without its workflow"
    assert refused("../mine.yaml").startswith(said)


def test_the_workflow_of_a_wheel_is_found_by_its_list_of_files(clone, monkeypatch):
    share = clone / "share/radcal"
    share.mkdir(parents=True)
    for name in ("Snakefile", "workflow", "config", "profiles"):
        (clone / name).rename(share / name)
    entry = SimpleNamespace(name="Snakefile", locate=lambda: share / "Snakefile")
    monkeypatch.setattr(workflow_files, "radcal", SimpleNamespace(__file__=str(clone / "lib/python/site/radcal.py")))
    monkeypatch.setattr(workflow_files.metadata, "files", lambda _: [SimpleNamespace(name="METADATA"), entry])
    assert workflow_files.workflow_folder(clone) == share.resolve()
    assert workflow_files.carried_case(Path("config/paper.yaml")) == share.resolve() / "config/paper.yaml"
    assert workflow_files.carried_case(Path("config/none.yaml")) == Path("config/none.yaml")
    assert workflow_files.carried_case(Path("mine.yaml")) == Path("mine.yaml")


def test_a_wheel_has_all_that_a_clone_has():
    globs = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["setuptools"]["data-files"]
    packed = {path for patterns in globs.values() for pattern in patterns for path in ROOT.glob(pattern)}
    tracked = subprocess.run(
        ["git", "ls-files", "Snakefile", "workflow", "profiles", "config"], cwd=ROOT, capture_output=True, text=True
    ).stdout.split()
    assert {ROOT / name for name in tracked} <= packed
    assert len(packed) > 30


def test_words_are_sorted_into_cases_targets_and_options():
    words = ["a", "design", "b.yml", "results/a/x.h5", "C.YAML", "--", "d.yaml", "-n"]
    assert sorted_words(words[:5]) == (
        [Path("a"), Path("b.yml"), Path("C.YAML")],
        ["design", "results/a/x.h5"],
        [],
    )
    assert sorted_words(["a", "--forcerun", "b.yaml"]) == ([Path("a")], [], ["--forcerun", "b.yaml"])


STANDS_IN = """
import os, pathlib, signal, sys, time
case = pathlib.Path(sys.argv[sys.argv.index("--configfile") + 1]).read_text().split()[1]
print("ran", case, flush=True)
if case == "stopped":  # by Ctrl-C, which reaches radcal, too
    os.kill(os.getppid(), signal.SIGINT)
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    time.sleep(0.2)
    os.kill(os.getpid(), signal.SIGINT)
sys.exit({"mine": 0, "bad": 3, "last": 4}.get(case, 0))
"""


def test_a_case_that_fails_does_not_stop_the_next(clone, monkeypatch, capfd):
    for name in ("bad", "last"):
        (clone / f"{name}.yaml").write_text(f"case: {name}\n")
    # Snakemake's place is taken by a program that ends as the case is named: what is tested comes before and after
    (clone / "end.py").write_text(STANDS_IN)
    monkeypatch.setattr(
        "radcal.cli.run.snakemake_command",
        lambda case, *_: [sys.executable, "end.py", "--configfile", str(case)],
    )
    monkeypatch.setenv("RADCAL_RESULTS", "")
    done = typed("run", "bad.yaml", "mine.yaml", "last.yaml", code=3)
    assert capfd.readouterr().out.split() == ["ran", "bad", "ran", "mine", "ran", "last"]
    assert "radcal: case mine (2 of 3)\n" in done.stderr
    assert done.stderr.splitlines()[-3:] == [
        "radcal: bad: failed (exit status 3)",
        "radcal: mine: done",
        "radcal: last: failed (exit status 4)",
    ]
    (clone / "stopped.yaml").write_text("case: stopped\n")
    done = typed("run", "mine.yaml", "stopped.yaml", "last.yaml", code=130)
    assert capfd.readouterr().out.split() == ["ran", "mine", "ran", "stopped"]
    assert done.stderr.splitlines()[-3:] == [
        "radcal: mine: done",
        "radcal: stopped: stopped; the same command continues",
        "radcal: last: not begun",
    ]
    (clone / "wrong.yaml").write_text("case: wrong\nsede: 1\n")
    done = typed("run", "mine.yaml", "wrong.yaml", "gone.yaml", code=1)
    assert capfd.readouterr().out == "", "no case is run if one is wrong"
    assert [line[:25] for line in done.stderr.splitlines()] == [
        "radcal: wrong.yaml, line ",
        "radcal: gone.yaml: cannot",
    ]


def parsed(*words, overrides=None, cores=None, further=""):
    """What Snakemake's own parser makes of the command."""
    command = snakemake_command(Path("mine.yaml"), words, further.split(), overrides or {}, cores, dry_run=True)
    assert command[:4] == [sys.executable, "-P", "-m", "snakemake"]
    return parsed_by_snakemake(command)


def test_targets_case_and_options_reach_snakemake_as_what_they_are():
    found = parsed("design", "results/mine/scene.h5", overrides={"seed": 7}, cores="2", further="--forcerun report -p")
    assert found.targets == ["design", "results/mine/scene.h5"]
    assert [str(path) for path in found.configfile] == ["mine.yaml"]
    assert (found.cores, found.dryrun, found.config) == (2, True, ["seed=7"])
    assert (set(found.forcerun), found.printshellcmds) == ({"report"}, True)
    # all cores are used unless somebody says where jobs run
    assert parsed().cores >= 1
    assert parsed(further="--jobs 50").cores is parsed(further="--jobs=50").cores is None
    assert parsed(further="--cores=5").cores == 5


@pytest.mark.parametrize(
    "overrides",
    [
        {"stop": {"rms": 1e-6, "max_runs": 30}, "seed": 7, "objective": "density"},
        {"validation": None, "radar": {"frequency_ghz": None, "band": "X"}, "replace": True, "case": "other"},
        {"measurement": {**IMAGE, "path": 'it\'s "ü" \U0001f4e1.tif', "radiometry": "sigma0_ref"}},
    ],
)
def test_settings_arrive_as_they_were_meant(clone, overrides):
    from snakemake.cli import parse_config

    words = parsed(overrides=overrides).config
    settings(words)
    assert load(["mine.yaml"], parse_config(words)) == load(["mine.yaml"], overrides)


def test_help_is_there_at_once():
    code = "import sys, radcal.cli; print({'numpy', 'pydantic', 'yaml', 'snakemake', 'h5py'} & set(sys.modules))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout == "set()\n"
    shown = typed("run", "--help")
    assert "  radcal run config/mine.yaml --set stop.law_db=0.02   one key changed" in shown.output
