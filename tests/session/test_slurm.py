"""What is left in the queue, with squeue and scancel as programs that keep it in a file."""

import sys
from types import SimpleNamespace

import pytest

from radcal.errors import ClusterError
from radcal.session.slurm import cancel_leftovers, job_name, remember

SQUEUE = """#!{python}
import sys
name = next(a for a in sys.argv if a.startswith("--name=")).removeprefix("--name=")
for line in open("{queue}"):
    number, of = line.split()
    if of == name:
        print(number)
"""
SCANCEL = """#!{python}
import sys
lines = [line for line in open("{queue}") if line.split()[0] not in sys.argv[1:]]
open("{queue}", "w").writelines(lines)
"""


@pytest.fixture
def queue(tmp_path, monkeypatch):
    path = tmp_path / "queue"
    path.write_text("11 mine\n12 mine\n13 another\n")
    for name, text in (("squeue", SQUEUE), ("scancel", SCANCEL)):
        (tmp_path / name).write_text(text.format(python=sys.executable, queue=path))
        (tmp_path / name).chmod(0o755)
    monkeypatch.setenv("PATH", str(tmp_path))
    return path


@pytest.mark.parametrize(("executor", "expected"), [("slurm", "b1f6"), ("local", None), ("cluster-generic", None)])
def test_only_jobs_on_slurm_have_a_name_in_its_queue(executor, expected):
    scheduler = SimpleNamespace(_executor=SimpleNamespace(run_uuid="b1f6"))
    assert job_name(SimpleNamespace(executor_plugin=SimpleNamespace(name=executor), scheduler=scheduler)) == expected


def test_the_jobs_of_the_name_are_cancelled_and_no_others(queue, tmp_path):
    remember(tmp_path / ".slurm", "mine")
    assert cancel_leftovers(tmp_path / ".slurm") == 2
    assert queue.read_text() == "13 another\n"
    assert not (tmp_path / ".slurm").exists()


def test_where_nothing_is_noted_nothing_is_asked(queue, tmp_path):
    (tmp_path / "squeue").unlink()
    assert cancel_leftovers(tmp_path / ".slurm") == 0


def test_where_nothing_is_left_nothing_is_cancelled(queue, tmp_path):
    remember(tmp_path / ".slurm", "ended")
    (tmp_path / "scancel").unlink()
    assert cancel_leftovers(tmp_path / ".slurm") == 0


def test_without_slurm_it_says_what_to_do(queue, tmp_path):
    remember(tmp_path / ".slurm", "mine")
    (tmp_path / "squeue").unlink()
    with pytest.raises(ClusterError, match=r"no squeue here: go on where it was started, or, .* delete .*\.slurm\.$"):
        cancel_leftovers(tmp_path / ".slurm")
    assert (tmp_path / ".slurm").exists()


def test_a_controller_that_does_not_answer_is_named(queue, tmp_path):
    remember(tmp_path / ".slurm", "mine")
    (tmp_path / "squeue").write_text("#!/bin/sh\necho 'Unable to contact slurm controller' >&2\nexit 1\n")
    with pytest.raises(ClusterError, match=r"^squeue failed \(Unable to contact slurm controller\)"):
        cancel_leftovers(tmp_path / ".slurm")
    assert (tmp_path / ".slurm").exists()


def test_jobs_that_do_not_end_are_named(queue, tmp_path, monkeypatch):
    monkeypatch.setattr("radcal.session.slurm._PATIENCE_S", 0.0)
    remember(tmp_path / ".slurm", "mine")
    (tmp_path / "scancel").write_text("#!/bin/sh\nexit 0\n")
    with pytest.raises(ClusterError, match=r"^jobs 11, 12 of an earlier snakemake do not end"):
        cancel_leftovers(tmp_path / ".slurm")
