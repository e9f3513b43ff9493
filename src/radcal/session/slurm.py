"""Cancellation of jobs that remain in Slurm's queue after Snakemake was killed."""

from __future__ import annotations

import os
import shutil
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from radcal.errors import ClusterError
from radcal.storage.files import atomic

_PATIENCE_S = 120.0  # by default Slurm gives a cancelled job 30 s to end (KillWait)


def job_name(workflow: Any) -> str | None:
    """Common name of all Slurm jobs of a Snakemake command in the queue; None if jobs do not run on Slurm.

    Parameters
    ----------
    workflow : snakemake.workflow.Workflow
        Workflow whose scheduler exists already, as in ``onstart``. Snakemake's plugin for Slurm chooses the name.
    """
    if workflow.executor_plugin.name != "slurm":
        return None
    name: str | None = getattr(workflow.scheduler._executor, "run_uuid", None)
    return name


def remember(file: str | Path, name: str) -> None:
    """Write the common name of a command's Slurm jobs to a file, before the first of these jobs is submitted.

    Parameters
    ----------
    file : path
        File in the results folder of the case.
    name : str
        Common name of the jobs in Slurm's queue.
    """
    with atomic(file) as partial:  # an incomplete name might match other jobs
        partial.write_text(name + "\n", encoding="utf-8")


def cancel_leftovers(file: str | Path) -> int:
    """Cancel the jobs of an earlier command that remain in Slurm's queue, and wait until they have ended.

    Without the cancellation, the jobs of the earlier command would write the same files as the present jobs.

    Parameters
    ----------
    file : path
        File written by :func:`remember`; if the file is missing, no job is cancelled.

    Returns
    -------
    int
        Number of jobs cancelled.

    Raises
    ------
    ClusterError
        Slurm does not answer, or a cancelled job does not end within two minutes.
    """
    file = Path(file)
    try:
        name = file.read_text(encoding="utf-8").strip()
    except FileNotFoundError:
        return 0
    found = _jobs(name, file)
    if found:
        _ask(["scancel", *found], file)
        deadline = time.monotonic() + _PATIENCE_S
        while left := _jobs(name, file):
            if time.monotonic() > deadline:
                raise ClusterError(
                    f"jobs {', '.join(left)} of an earlier snakemake do not end: wait for them, then type the same "
                    "command again."
                )
            time.sleep(0.5)
    file.unlink(missing_ok=True)
    return len(found)


def _jobs(name: str, file: Path) -> list[str]:
    """Job numbers of all queued, running or ending Slurm jobs with the given name."""
    return _ask(["squeue", "--noheader", f"--user={os.geteuid()}", f"--name={name}", "--format=%A"], file).split()


def _ask(command: Sequence[str], file: Path) -> str:
    """Standard output of a Slurm command; a failure raises a ClusterError."""
    program = shutil.which(command[0])
    if program is None:
        raise ClusterError(
            f"jobs of an earlier snakemake may be in the queue of a cluster, and there is no {command[0]} here: go on "
            f"where it was started, or, if none is left, delete {file}."
        )
    try:
        done = subprocess.run([program, *command[1:]], capture_output=True, text=True, timeout=60, check=False)  # noqa: S603
    except subprocess.TimeoutExpired:
        raise ClusterError(f"{command[0]} does not answer: is the cluster's controller up (scontrol ping)?") from None
    if done.returncode != 0:
        words = (done.stderr.strip() or "no message").splitlines()[-1]
        raise ClusterError(
            f"{command[0]} failed ({words}): jobs of an earlier snakemake may be in the cluster's queue; try again "
            "once it answers."
        )
    return done.stdout
