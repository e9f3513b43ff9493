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


def test_where_nothing_is_left_nothing_is_cancelled(queue, tmp_path):
    (tmp_path / "scancel").unlink()
    remember(tmp_path / ".slurm", "ended")
    assert cancel_leftovers(tmp_path / ".slurm") == 0
    # where no name is noted, nothing is asked
    (tmp_path / "squeue").unlink()
    assert cancel_leftovers(tmp_path / ".slurm") == 0


@pytest.mark.parametrize(
    ("program", "text", "said"),
    [
        ("squeue", None, r"no squeue here: go on where it was started, or, .* delete .*\.slurm\.$"),
        ("squeue", "echo 'Unable to contact' >&2\nexit 1", r"^squeue failed \(Unable to contact\)"),
        ("scancel", "exit 0", r"^jobs 11, 12 of an earlier snakemake do not end"),
    ],
    ids=["no slurm", "no answer", "no end"],
)
def test_a_queue_that_cannot_be_emptied_is_a_sentence(queue, tmp_path, monkeypatch, program, text, said):
    monkeypatch.setattr("radcal.session.slurm._PATIENCE_S", 0.0)
    remember(tmp_path / ".slurm", "mine")
    (tmp_path / program).unlink()
    if text is not None:
        (tmp_path / program).write_text(f"#!/bin/sh\n{text}\n")
        (tmp_path / program).chmod(0o755)
    with pytest.raises(ClusterError, match=said):
        cancel_leftovers(tmp_path / ".slurm")
    assert (tmp_path / ".slurm").exists()
