"""Session of one Snakemake command on a case, which handles lock, damaged files, old Slurm jobs and messages."""

from __future__ import annotations

import logging
import os
import re
import shlex
import sys
import time
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

from radcal.config import Case
from radcal.config.inputs import check_reuse
from radcal.config.loading import load_with_inputs
from radcal.config.yaml_file import settings
from radcal.errors import RadcalError, StoreError
from radcal.forecast.runs_and_time import standing
from radcal.programs.command_plan import check_command
from radcal.sections.measurement import starts_as_truth
from radcal.session.jobs import CASE, COMMAND, FAILURE, OWNER, PASSES, PROGRESS, RESULTS, STARTED, Follower, elapsed
from radcal.session.replacement import check_replacement
from radcal.session.salvage import files_of, salvage, simulator_change
from radcal.session.slurm import cancel_leftovers, remember
from radcal.session.terminal import BAR, Bar, Guarded, Messages, Repeated, can_draw, guard, write_protected
from radcal.storage.files import unwritable
from radcal.storage.lock import CaseLock, leave
from radcal.storage.records import read_json
from radcal.words import sentence

_SNAKEMAKE = Path(".snakemake")
_RESULTS = "results"
_BAR_WIDTH = 20
_PLUGINS = "PYDANTIC_DISABLE_PLUGINS"  # environment variable of pydantic


def open_session(
    files: Sequence[str | Path],
    config: Mapping[str, Any],
    words: Sequence[str],
    remote: bool,
    logger: logging.Logger,
    main: bool = True,
) -> Session:
    """Load and check the case of a Snakemake command, and return the session of this command.

    If the case is invalid, the process exits with a one-line error message.

    Parameters
    ----------
    files : sequence of path
        Configuration files.
    config : mapping
        Configuration that Snakemake has merged from the files and the command line.
    words : sequence of str
        Arguments of Snakemake's option ``--config`` on the command line.
    remote : bool
        Whether this process is a job on a cluster.
    logger : logging.Logger
        Snakemake's logger, to which the session adds its filter of messages.
    main : bool
        Whether this process plans the jobs. Only this process checks that finished results are not replaced.
    """
    guard(logger)
    results = os.environ.get(RESULTS) or _RESULTS
    try:
        settings(words)
        case, inputs = load_with_inputs(files, config)
        check_command(case)
        check_reuse(case, results)
        if main:
            check_replacement(case, Path(results) / case.case, inputs)
        session = Session(case, remote, results, inputs)
    except RadcalError as error:
        sys.exit(f"radcal: {error}")
    except OSError as error:
        sys.exit(f"radcal: {error.filename}: {error.strerror}.")
    for finding in starts_as_truth(case.calibrated, [one.measurement for one in case.passes]) if main else ():
        say(sentence(finding))
    logger.addFilter(session.messages)
    return session


def is_dry_run(words: Iterable[str]) -> bool:
    """Whether a command line contains the dry-run option, which a Snakefile cannot query from Snakemake."""
    return any(re.fullmatch("--dry-?run|-[a-z]*n[a-z]*", word) for word in words)


def is_planned(workflow: Any) -> bool:
    """Whether a Snakemake command is a dry run for which Snakemake has planned the jobs.

    Parameters
    ----------
    workflow : snakemake.workflow.Workflow
        Workflow at the end of its command.
    """
    # a command that lists rules or unlocks has no executor, and a command that failed early has no scheduler
    return workflow._executor_plugin is not None and workflow.dryrun and workflow.scheduler is not None


def is_finished(workflow: Any) -> bool:
    """Whether a Snakemake command has asked for the whole case, and has found nothing to do.

    Parameters
    ----------
    workflow : snakemake.workflow.Workflow
        Workflow at the end of its command.
    """
    if workflow._executor_plugin is None or workflow.dryrun or workflow.scheduler is None:
        return False
    return len(workflow.dag) == 0 and [rule.name for rule in workflow.dag.targetrules] == ["all"]


def _command_line(words: Sequence[str]) -> str:
    """Command line that can be typed again, without values that may be secrets."""
    kept = ["..." if "environment" in word else word for word in words[1:]]
    return shlex.join([Path(words[0]).name, *kept])


class Session:
    """Session of one Snakemake command: it locks the results folder, prepares it for the jobs, and filters messages.

    Environment variables (:mod:`radcal.session.jobs`) pass the settings of the session to the jobs.

    Parameters
    ----------
    case : Case
        Configuration of the case.
    remote : bool
        Whether this process is a job on a cluster; such a job executes the Snakefile again.
    results : path
        Folder that contains the results folders of all cases.
    inputs : mapping, optional
        Input files of the case by configuration key.

    Attributes
    ----------
    case, inputs
        Configuration and input files, the same as the parameters of these names.
    folder : Path
        Results folder of the case, ``results/<case>``.
    messages : Messages
        Filter for Snakemake's log.

    Raises
    ------
    StoreError
        ``results`` or ``results/<case>`` is a file instead of a folder.
    """

    def __init__(
        self, case: Case, remote: bool = False, results: str | Path = _RESULTS, inputs: Mapping[str, Path] | None = None
    ) -> None:
        self.folder = Path(results) / case.case
        for path in (self.folder.parent, self.folder):
            if os.path.lexists(path) and not path.is_dir():
                raise StoreError(
                    f"{path} is a file, expected a folder, where results go: rename it, or give the case another name "
                    "(case: ...)."
                )
        self.case, self.inputs = case, dict(inputs or {})
        self._lock = CaseLock(self.folder)
        self._shown: list[Repeated] = []
        self._failure, self._progress = (
            (self.folder / "logs" / name).absolute() for name in ("failure.txt", "progress.txt")
        )
        self._slurm = self.folder / ".slurm"
        self._started = remote
        # before the first job starts, an existing file of failures belongs to an earlier command
        self.messages = Messages(lambda: self._started and self._failure.exists())
        environment = {
            CASE: case.case,
            COMMAND: os.environ.get(COMMAND) if remote else _command_line(sys.argv),
            PASSES: str(len(case.passes)),
            OWNER: str(os.getpid()),
            FAILURE: str(self._failure),
            PROGRESS: str(self._progress) if remote else None,
            BAR: None,
            # otherwise pydantic looks for plugins in the metadata of all installed distributions, in each job
            _PLUGINS: os.environ.get(_PLUGINS, "__all__"),
            # a remote job keeps the start time of the process that submitted it
            STARTED: os.environ.get(STARTED, str(time.time())) if remote else str(time.time()),
        }
        for name, value in environment.items():
            os.environ.pop(name, None)
            if value is not None:
                os.environ[name] = value

    def set_damaged_aside(self) -> None:
        """Rename damaged results and print a message for each, before Snakemake plans the jobs that make them again.

        A message is also printed if the version of the built-in simulator has changed since the earlier runs.
        """
        try:
            sentences = salvage(self.folder, self.case.case)
        except OSError as error:
            path, why = error.filename or self.folder, error.strerror or error
            leave(f"{path} cannot be read ({why}); results are there, so make it readable.")
        for text in [*sentences, *simulator_change(self.folder, self.case)]:
            say(text)

    def start(self, cluster: str | None = None, remote_jobs: bool = False) -> None:
        """Lock the results folder of the case and prepare this folder for the first job.

        The preparation also cancels jobs of an earlier command that are still in Slurm's queue. If the lock or the
        preparation fails, the process exits with a one-line error message.

        Parameters
        ----------
        cluster : str, optional
            Common name of all jobs of this command in Slurm's queue.
        remote_jobs : bool
            Whether jobs run on other machines.
        """
        self._lock.acquire()
        if refusal := self._refusal():
            leave(refusal)
        try:
            if cancelled := cancel_leftovers(self._slurm):
                say(f"{cancelled} jobs of an earlier snakemake cancelled; finished runs are kept.")
            self._failure.unlink(missing_ok=True)
        except RadcalError as error:
            leave(str(error))
        except OSError as error:
            leave(f"{error.filename}: {error.strerror}.")
        self._started = True
        if remote_jobs:
            self._shown.append(Follower(self._progress))
        if cluster is not None:
            remember(self._slurm, cluster)
        if isinstance(sys.stderr, Guarded) and can_draw(sys.stderr):
            self._shown.append(Bar(sys.stderr, self._foot))

    def end(self, failed: bool = False) -> None:
        """Release the lock after the last job; after a failure, Ctrl-C or SIGTERM, also print how to continue."""
        while self._shown:
            self._shown.pop().stop()
        self._slurm.unlink(missing_ok=True)
        self._lock.release()
        runs = self.folder / "runs"
        by = "Ctrl-C" if self.messages.interrupted else "SIGTERM" if self.messages.terminated else None
        if by is not None:
            kept = standing(self.case, self.folder).done
            say(f"stopped by {by}. {kept} finished runs are kept in {runs}; the same command goes on from there.")
        elif failed:
            say(
                f"stopped. Finished runs are kept in {runs}, logs in {self.folder / 'logs'}; once the cause is "
                "removed, the same command continues."
            )

    def _foot(self) -> str:
        """Bar at the foot of the terminal: how far the runs of the case are."""
        now = standing(self.case, self.folder)
        filled = _BAR_WIDTH * now.done // max(now.expected or now.done, 1)
        return f"[{'#' * filled}{'.' * (_BAR_WIDTH - filled)}] {elapsed()} {now}"

    def say_verdict(self) -> None:
        """Print the verdict of a finished case and the path of its report."""
        try:
            say(read_json(self.folder / "summary.json")["verdict"])
        except RadcalError as error:
            say(str(error))
        say(f"report: {self.folder / 'report.html'}")

    def _refusal(self) -> str | None:
        """Message about the first folder or result file that is not writable; None if all are writable."""
        for folder, what in ((self.folder, "results"), (_SNAKEMAKE, "Snakemake's records")):
            if (path := unwritable(folder)) is not None:
                return f"{path} cannot be written (Permission denied); {what} go there, so make it writable."
        # Snakemake detects a write-protected file only when the job that writes it starts, perhaps after hours
        for path in files_of(self.folder):
            if not os.access(path, os.W_OK):
                return write_protected(path)
        return None


def say(sentence: str) -> None:
    """Print a sentence on the terminal."""
    sys.stderr.write(f"radcal: {sentence}\n")
    sys.stderr.flush()
