"""One command on a case, without its jobs."""

import logging
import os
from pathlib import Path

import pytest

from radcal.errors import ConfigError, StoreError
from radcal.session.jobs import CASE, COMMAND, FAILURE, OWNER, PROGRESS, STARTED
from radcal.session.session import Session, is_dry_run, open_session


@pytest.fixture(autouse=True)
def _folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in (CASE, COMMAND, FAILURE, OWNER, PROGRESS, STARTED, "PYDANTIC_DISABLE_PLUGINS"):
        monkeypatch.setenv(name, "before")  # put back afterwards, whatever the session sets


def test_a_command_opens_the_session_of_its_case(tmp_path):
    (tmp_path / "mine.yaml").write_text("case: mine\nstop: {rms: 1.0e-3}\n")
    logger = logging.getLogger("of snakemake")
    session = open_session(["mine.yaml"], {"stop": {"rms": 1e-3}, "seed": "7"}, ["seed=7"], False, logger)
    assert (session.case.case, session.case.seed, session.case.stop.rms) == ("mine", 7, 1e-3)
    assert (session.folder, session.inputs) == (Path("results/mine"), {})
    assert logger.filters == [session.messages]
    remote = open_session(["mine.yaml"], {"design": {"reuse": None}}, [], True, logging.getLogger("of a job"))
    assert remote.case.seed == 1
    assert PROGRESS in os.environ


def test_a_case_that_is_refused_ends_in_one_sentence(tmp_path):
    (tmp_path / "mine.yaml").write_text("stop: {rmss: 1}")
    said = r"^radcal: mine.yaml, line 1: unknown key stop.rmss \(did you mean 'rms'\?\).*$"
    with pytest.raises(SystemExit, match=said):
        open_session(["mine.yaml"], {}, [], False, logging.getLogger("of snakemake"))
    assert not Path("results").exists()


def test_the_process_that_plans_jobs_says_which_starts_are_the_truth(tmp_path, capsys):
    law = "{calibrate: true, law: constant_gamma, bounds: [[-20, 0]]}"
    hidden = "  synthetic: {parameters: {dyke: [-8]}, laws: {road: {law: constant_gamma, parameters: [-9]}}}\n"
    (tmp_path / "mine.yaml").write_text(
        f"materials:\n  dyke: {law}\n  grass: {law}\n  road: {law}\n  water: {law}\nmeasurement:\n{hidden}"
    )
    open_session(["mine.yaml"], {}, [], False, logging.getLogger("of a job"), main=False)
    assert capsys.readouterr().err == ""
    open_session(["mine.yaml"], {}, [], False, logging.getLogger("of snakemake"))
    assert capsys.readouterr().err == (
        "radcal: grass, water: measurement.synthetic.parameters gives no hidden law, so that the starting law makes "
        "the measured image, and the search begins at its solution.\n"
    )


def test_only_the_process_that_plans_jobs_checks_that_finished_results_stay(tmp_path, monkeypatch):
    def refuse(case, folder, inputs):
        raise ConfigError(f"{folder} stays")

    monkeypatch.setattr("radcal.session.session.check_replacement", refuse)
    (tmp_path / "mine.yaml").write_text("case: mine\n")
    open_session(["mine.yaml"], {}, [], False, logging.getLogger("of a job"), main=False)
    with pytest.raises(SystemExit, match="^radcal: results/mine stays$"):
        open_session(["mine.yaml"], {}, [], False, logging.getLogger("of snakemake"))

    def unreadable(case, folder, inputs):
        raise PermissionError(13, "Permission denied", f"{folder}/calibration.h5")

    monkeypatch.setattr("radcal.session.session.check_replacement", unreadable)
    with pytest.raises(SystemExit, match="^radcal: results/mine/calibration.h5: Permission denied.$"):
        open_session(["mine.yaml"], {}, [], False, logging.getLogger("of snakemake"))


def test_a_dry_run_is_known_by_its_words():
    for words in ("-n", "--cores 2 -qnp reference", "--dry-run", "--dryrun --configfile n.yaml"):
        assert is_dry_run(words.split()), words
    for words in ("--cores 2 --nolock design", "--configfile -n.yaml", "-c 2"):
        assert not is_dry_run(words.split()), words


def test_jobs_hear_of_their_case(build_case):
    session = Session(build_case())
    assert session.folder == Path("results/dyke")
    assert (os.environ[CASE], os.environ[OWNER]) == ("dyke", str(os.getpid()))
    assert os.environ[FAILURE] == str(Path("results/dyke/logs/failure.txt").absolute())
    assert float(os.environ[STARTED]) > 0
    assert PROGRESS not in os.environ


def test_jobs_hear_of_the_command_but_not_of_values_that_may_be_secrets(build_case, monkeypatch):
    secret = 'simulator={"environment": {"KEY": "k"}}'
    monkeypatch.setattr("sys.argv", ["/opt/venv/bin/snakemake", "--configfile", "my case.yaml", "--config", secret])
    Session(build_case())
    assert os.environ[COMMAND] == "snakemake --configfile 'my case.yaml' --config ..."


@pytest.mark.parametrize("given", [None, "of-mine"])
def test_jobs_look_for_no_plugins_of_pydantic_unless_the_user_says_which(build_case, monkeypatch, given):
    if given is None:
        monkeypatch.delenv("PYDANTIC_DISABLE_PLUGINS")
    else:
        monkeypatch.setenv("PYDANTIC_DISABLE_PLUGINS", given)
    Session(build_case())
    assert os.environ["PYDANTIC_DISABLE_PLUGINS"] == (given or "__all__")


def test_a_job_on_a_cluster_keeps_the_clock_of_who_submitted_it(build_case):
    Session(build_case(), remote=True)
    assert os.environ[STARTED] == "before"
    assert os.environ[PROGRESS] == str(Path("results/dyke/logs/progress.txt").absolute())


@pytest.mark.parametrize("path", ["results", "results/dyke"])
def test_a_file_in_the_place_of_the_folder_is_a_sentence(build_case, path):
    Path(path).parent.mkdir(exist_ok=True)
    Path(path).write_text("notes")
    with pytest.raises(StoreError, match=rf"^{path} is a file, expected a folder, where results go: rename it"):
        Session(build_case())


def test_a_started_session_holds_the_folder_and_tidies_it(build_case, capsys):
    session = Session(build_case())
    Path("results/dyke/logs").mkdir(parents=True)
    Path(os.environ[FAILURE]).write_text("of an earlier command")
    session.start()
    assert not Path(os.environ[FAILURE]).exists()
    assert Path("results/dyke/.lock").read_text().startswith(f"{os.getpid()} ")
    session.end()
    assert capsys.readouterr().err == ""


def test_a_file_in_the_place_of_the_logs_is_a_sentence(build_case, monkeypatch):
    def leave(text):
        raise SystemExit(text)

    monkeypatch.setattr("radcal.session.session.leave", leave)
    session = Session(build_case())
    Path("results/dyke").mkdir(parents=True)
    Path("results/dyke/logs").write_text("notes")
    with pytest.raises(SystemExit, match=r"^\S+/results/dyke/logs/failure.txt: Not a directory\.$"):
        session.start()
    session.end()


def test_the_end_says_how_to_go_on(build_case, capsys):
    session = Session(build_case())
    session.start()
    session.end(failed=True)
    assert capsys.readouterr().err.startswith("radcal: stopped. Finished runs are kept in results/dyke/runs, logs in ")
    Path("results/dyke/runs").mkdir()
    for name in ("a.h5", "b.h5", ".partial-c.h5"):
        (Path("results/dyke/runs") / name).touch()
    session.messages.terminated = True
    session.end(failed=True)
    assert "stopped by SIGTERM. 2 finished runs are kept in results/dyke/runs; the same" in capsys.readouterr().err
    session.messages.interrupted = True
    session.end(failed=True)
    assert "stopped by Ctrl-C. 2 finished runs are kept in results/dyke/runs; " in capsys.readouterr().err
