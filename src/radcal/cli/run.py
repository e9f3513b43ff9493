"""Command ``radcal run``, which checks a case before it starts Snakemake.

Snakemake alone would load the case file before any code of the workflow runs, and would print a traceback if the file
cannot be read.
"""

from __future__ import annotations

import os
import re
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from radcal.cli.arguments import Results, Settings, overrides, sentences

if TYPE_CHECKING:
    from radcal.config import Case

_OURS = ("--conf", "-C")  # prefixes of Snakemake's options --configfile and --config, however they are abbreviated
# with any of these options, --cores all is not added
_ELSEWHERE = ("--cores", "-c", "--jobs", "-j", "--profile", "--executor", "-e")

_MILESTONES = ("all", "reference", "design")  # rules without outputs of their own


def main(
    words: Annotated[
        list[str],
        typer.Argument(
            metavar="CASE... [TARGETS]",
            help="YAML files of cases, targets at which to stop, and options for Snakemake after --.",
            show_default=False,
        ),
    ],
    cores: Annotated[
        str | None, typer.Option("--cores", "-c", metavar="N", help="Number of cores; by default all of this machine.")
    ] = None,
    dry_run: Annotated[bool, typer.Option("--dry-run", "-n", help="Say what would run, and run nothing.")] = False,
    settings: Settings = None,
    results: Results = Path("results"),
) -> None:
    """Check cases and calibrate them, in the folder of your clone or anywhere else.

    The cases are checked first. If one has a fault, the command reports it in one sentence and runs no case. Then
    Snakemake runs the workflow of one case after the other, up to the TARGETS if any are named. A target is reference
    (one run, to test the setup), registration, target, design (the initial runs), all (the default), products (of the
    calibrated laws), any other stage of docs/architecture.md outside the loop of iterations, or a file below results/.
    A case that fails does not stop the next one. Stop the command at any time: the same command continues.

    Results go to results/<case> below the current folder, or below the folder of --results.

    \b
    For example:
      radcal run config/mine.yaml --dry-run             what would run, and how many simulator runs at most
      radcal run config/mine.yaml reference             one run
      radcal run config/mine.yaml registration          up to the registered image
      radcal run config/mine.yaml                       the whole calibration
      radcal run config/mine.yaml --set stop.law_db=0.02   one key changed: goes on from there
      radcal run config/a.yaml config/b.yaml            two cases
      radcal run config/mine.yaml -- --forcerun report  what follows -- is for Snakemake

    The exit status is Snakemake's: 0 when all is done. Of several cases it is that of the first that failed.
    """  # noqa: D301 - click keeps the lines that follow \b
    from radcal.errors import ConfigError
    from radcal.session.workflow_files import carried_case, workflow_folder

    cases, targets, further = sorted_words(words)
    with sentences():
        folder = workflow_folder(here := Path.cwd())
        if "{" in str(results) or "}" in str(results):
            raise ConfigError(f"--results is {str(results)!r}, expected a folder without braces in its name.")
        changes = overrides(settings)
        files = [carried_case(case) for case in cases]
        elsewhere = None if folder == here else folder
        if elsewhere is not None:  # radcal's own profiles, by the name that they have in a clone
            own = {word: str(folder / word) for word in further if word.startswith("profiles/")}
            further = [word if Path(word).exists() else own.get(word, word) for word in further]
        checked = _checked(files, changes)
        commands = [
            snakemake_command(
                file, files_of_stages(targets, case, results), further, changes, cores, dry_run, elsewhere
            )
            for file, case in zip(files, checked, strict=True)
        ]
    os.environ["RADCAL_RESULTS"] = str(results)  # radcal.session.jobs.RESULTS, whose import takes a second
    if elsewhere is not None:
        typer.echo(f"radcal: results go to {(here / results).resolve()}", err=True)
    if len(commands) == 1:
        sys.stdout.flush()
        sys.stderr.flush()
        # this process becomes Snakemake, which then receives Ctrl-C and determines the exit status
        os.execv(commands[0][0], commands[0])  # noqa: S606 - a list of arguments, never a shell
    raise typer.Exit(
        _one_after_the_other({case.case: command for case, command in zip(checked, commands, strict=True)})
    )


def sorted_words(words: Sequence[str]) -> tuple[list[Path], list[str], list[str]]:
    """Words of a command line, sorted into case files, targets and options for Snakemake.

    Parameters
    ----------
    words : sequence of str
        The first word is a case, and so is every later word that ends with .yaml or .yml. The first word that starts
        with a dash, and all words after it, are for Snakemake.
    """
    first = next((k for k, word in enumerate(words) if word.startswith("-")), len(words))
    ours = words[:first]
    is_case = [k == 0 or word.lower().endswith((".yaml", ".yml")) for k, word in enumerate(ours)]
    cases = [Path(word) for word, case in zip(ours, is_case, strict=True) if case]
    return cases, [word for word, case in zip(ours, is_case, strict=True) if not case], list(words[first:])


def files_of_stages(targets: Sequence[str], case: Case, results: Path) -> list[str]:
    """Targets for Snakemake: the outputs of each stage, because a rule with wildcards is no target for Snakemake.

    Parameters
    ----------
    targets : sequence of str
        Names of stages, or paths of files below ``results/``.
    case : Case
        The case.
    results : path
        Folder that contains the results folders of all cases.

    Raises
    ------
    ConfigError
        A target is neither a stage outside the loop nor a path with a slash.
    """
    from radcal.config.stages import STAGES
    from radcal.errors import ConfigError
    from radcal.sections.errors import nearest

    first = {name: next(iter(stage.outputs.values())) for name, stage in STAGES.items()}
    looped = {name: path for name, path in first.items() if "{k}" in path}
    rules = sorted({*STAGES, *_MILESTONES} - looped.keys())
    found = []
    for target in targets:
        if target in looped:
            raise ConfigError(
                f"the target {target!r} is made in each iteration, expected a file of one iteration, such as "
                f"results/CASE/{looped[target].format(k=0)}, or one of {', '.join(rules)}."
            )
        if target not in rules and "/" not in target:
            raise ConfigError(f"there is no target {target!r}{nearest(target, rules)}.")
        if target in STAGES:
            files = STAGES[target].files(case)
            if not files:
                raise ConfigError(f"the target {target!r} has no jobs in case {case.case}, expected another.")
            found += [f"{results / case.case}/{path}" for path in files]
        else:
            found.append(target)
    return found


def snakemake_command(
    case: Path,
    targets: Sequence[str],
    further: Sequence[str],
    overrides: dict[str, Any],
    cores: str | None,
    dry_run: bool,
    elsewhere: Path | None = None,
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
    elsewhere : path, optional
        Folder of the workflow, if this is not the current folder.

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
    if elsewhere is not None:
        # a profile of that name in the current folder would belong to another workflow
        command += ["--snakefile", str(elsewhere / "Snakefile")]
        command += ["--workflow-profile", str(elsewhere / "profiles" / "default")]
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


def _checked(files: Sequence[Path], changes: dict[str, Any]) -> list[Case]:
    """Cases in the given files, whose input files exist; if any case is wrong, one error reports every wrong case."""
    from radcal.config.loading import load_with_inputs
    from radcal.errors import ConfigError

    names: dict[str, Path] = {}
    cases, problems = [], []
    for file in files:
        try:
            case, _ = load_with_inputs([file], changes)
            name = case.case
            if name in names:
                raise ConfigError(f"{file}: case is {name!r}, which {names[name]} is called, too, expected another.")
            names[name] = file
            cases.append(case)
        except ConfigError as error:
            problems.append(str(error))
    if problems:
        raise ConfigError("\nradcal: ".join(problems))
    return cases


def _one_after_the_other(commands: Mapping[str, Sequence[str]]) -> int:
    """Run the commands of several cases one by one, and return the exit status.

    A case that fails does not stop the next one; Ctrl-C stops all.
    """
    ended: dict[str, int] = {}
    children: list[subprocess.Popen[bytes]] = []
    stopped = False

    def stop(number: int, _: object) -> None:
        nonlocal stopped
        stopped = True
        if number == signal.SIGTERM and children:  # the terminal sends Ctrl-C to the child, too
            children[-1].terminate()

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        for name, command in commands.items():
            typer.echo(f"radcal: case {name} ({len(ended) + 1} of {len(commands)})", err=True)
            children.append(subprocess.Popen(command))  # noqa: S603 - a list of arguments, never a shell
            ended[name] = children[-1].wait()
            if stopped:
                break
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
    for name in commands:
        status = ended.get(name)
        state = "not begun" if status is None else "done" if status == 0 else f"failed (exit status {status})"
        if stopped and status not in (None, 0) and name == list(ended)[-1]:
            state = "stopped; the same command continues"
        typer.echo(f"radcal: {name}: {state}", err=True)
    failed = [status for status in ended.values() if status != 0]
    return 130 if stopped else failed[0] if failed else 0
