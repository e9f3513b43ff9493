"""Command ``radcal run``, which checks a case before it starts Snakemake.

Snakemake alone would load the case file before any code of the workflow runs, and would print a traceback if the file
cannot be read.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from radcal.cli.arguments import CaseFile, Settings, overrides, sentences

if TYPE_CHECKING:
    from radcal.config import Case

__all__ = ["HELP", "check_folder", "checked_case", "main", "snakemake_command"]

_TARGETS = ("all", "reference", "design")  # documented targets; every other rule of the workflow is also a valid target
_OURS = ("--conf", "-C")  # prefixes of Snakemake's options --configfile and --config, however they are abbreviated
_ELSEWHERE = (
    "--cores",
    "-c",
    "--jobs",
    "-j",
    "--profile",
    "--executor",
    "-e",
)  # with any of these options, --cores all is not added

HELP = """Check a case and calibrate it, in the folder of your clone.

The case is checked first; a fault in it is reported in one sentence. Then Snakemake runs the workflow, up to the
TARGETS if any are named: reference (one run, to test the setup), design (the initial runs), all (the default),
any other rule of the workflow or a file below results/. Stop it at any time: the same command continues.

\b
Examples:
  radcal run config/mine.yaml --dry-run             what would run
  radcal run config/mine.yaml reference             one run
  radcal run config/mine.yaml                       the whole calibration
  radcal run config/mine.yaml --set stop.rms=1e-6   one key changed: goes on from there
  radcal run config/mine.yaml -- --forcerun report  what follows -- is for Snakemake

The exit status is Snakemake's: 0 when all is done.
"""


def main(
    case: CaseFile,
    targets: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="TARGETS", help="Where to stop, and after -- options for Snakemake.", show_default=False
        ),
    ] = None,
    cores: Annotated[
        str | None, typer.Option("--cores", "-c", metavar="N", help="Cores to use; all of this machine if missing.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", "-n", help="Say what would run, and run nothing.")] = False,
    settings: Settings = None,
) -> None:
    """Check a case and calibrate it."""
    words = targets or []
    first = next((k for k, word in enumerate(words) if word.startswith("-")), len(words))
    with sentences():
        check_folder(Path.cwd(), words[:first])
        changes = overrides(settings)
        command = snakemake_command(case, words[:first], words[first:], changes, cores, dry_run)
        checked_case(case, changes)
    _become(command)


def check_folder(folder: Path, targets: Iterable[str] = ()) -> None:
    """Raise an error if a folder does not contain radcal's workflow, or if the workflow lacks a target.

    Parameters
    ----------
    folder : path
        Folder in which Snakemake will run.
    targets : iterable of str
        Names of rules, or paths of files below ``results/``.

    Raises
    ------
    ConfigError
        The folder has no Snakefile of radcal, or a target is neither a rule nor a path with a slash.
    """
    from radcal.config import nearest
    from radcal.errors import ConfigError

    try:
        pages = [(folder / "Snakefile").read_text(encoding="utf-8")]
        pages += [path.read_text(encoding="utf-8") for path in (folder / "workflow/rules").glob("*.smk")]
    except (OSError, UnicodeDecodeError):
        pages = [""]
    if '"""radcal' not in pages[0]:
        raise ConfigError(
            f"{folder} is not the folder of a clone of radcal, with Snakefile, workflow and config: go there with cd."
        )
    rules = set(re.findall(r"^(?:rule|checkpoint) (\w+):", "\n".join(pages), re.MULTILINE))
    for target in targets:
        if target not in rules and "/" not in target:
            raise ConfigError(f"there is no target {target!r}{nearest(target, _TARGETS)}.")


def checked_case(path: Path, overrides: dict[str, Any]) -> Case:
    """Load a case file and check its keys, values and input files.

    Parameters
    ----------
    path : path
        The case file.
    overrides : dict
        Keys that the command line changes, section by section.

    Raises
    ------
    ConfigError
        The case is wrong; the message names the first problem.
    """
    from radcal.config import input_files, load

    case = load([path], overrides)
    input_files(case)
    return case


def snakemake_command(
    case: Path,
    targets: Sequence[str],
    further: Sequence[str],
    overrides: dict[str, Any],
    cores: str | None,
    dry_run: bool,
) -> list[str]:
    """Snakemake command that runs the workflow, as a list of arguments.

    Parameters
    ----------
    case : path
        The case file.
    targets : sequence of str
        Targets. They precede all options, because an option with several arguments would consume them.
    further : sequence of str
        Further options for Snakemake.
    overrides : dict
        Keys that the command line changes, section by section.
    cores : str or None
        Number of cores, or ``all``. None means ``all``, unless ``further`` gives cores, jobs, a profile or an executor.
    dry_run : bool
        Whether Snakemake only lists the jobs, without running them.

    Raises
    ------
    ConfigError
        The number of cores is invalid, or an option would replace the checked case.
    """
    from radcal.errors import ConfigError

    if cores is not None and cores != "all" and not re.fullmatch("0*[1-9][0-9]{0,5}", cores):
        raise ConfigError(f"--cores is {cores!r}, expected a number from 1 on, or all.")
    for word in further:
        if word.startswith(_OURS):
            raise ConfigError(
                f"{word} after -- would replace the case that is checked: type --set KEY=VALUE before --."
            )
    if cores is None and not any(word.partition("=")[0] in _ELSEWHERE for word in further):
        cores = "all"
    # -P removes the current folder from Python's path, because a file there might have the name of a library
    command = [sys.executable, "-P", "-m", "snakemake", *targets, "--configfile", str(case)]
    if overrides:
        command += ["--config", *(f"{key}={_for_snakemake(value)}" for key, value in overrides.items())]
    if cores is not None:
        command += ["--cores", cores]
    return [*command, *["--dry-run"] * dry_run, *further]


def _for_snakemake(value: Any) -> str:
    """Text of a value for Snakemake's option ``--config``, in JSON.

    A section is one text in quotes, because Snakemake would convert every value inside a section to text. The blanks
    at both ends prevent Snakemake from removing the quotes.
    """
    import json

    text = json.dumps(value, ensure_ascii=False, default=str)
    return f" {json.dumps(text, ensure_ascii=False)} " if isinstance(value, dict | list) else text


def _become(command: Sequence[str]) -> NoReturn:
    """Replace this process by another program, which then receives Ctrl-C and determines the exit status."""
    sys.stdout.flush()
    sys.stderr.flush()
    os.execv(command[0], list(command))  # noqa: S606 - a list of arguments, never a shell
