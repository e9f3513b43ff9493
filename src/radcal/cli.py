"""Command ``radcal``, which checks a case before it starts Snakemake.

Snakemake alone would load the case file before any code of the workflow runs, and would print a traceback if the file
cannot be read. Each command of this module imports slow modules only when it needs them.
"""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

if TYPE_CHECKING:
    from radcal.config import Case

__all__ = ["app", "check_folder", "checked_case", "snakemake_command"]

app = typer.Typer(
    add_completion=False, no_args_is_help=True, rich_markup_mode=None, pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)  # fmt: skip

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

_RUN_HELP = """Check a case and calibrate it, in the folder of your clone.

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


@app.callback()
def _radcal() -> None:
    """Calibrate the backscatter laws of a SAR simulator against a measured image."""


@app.command("run", help=_RUN_HELP)
def _run(
    case: Annotated[
        Path, typer.Argument(metavar="CASE", readable=False, help="The case's YAML file.", show_default=False)
    ],
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
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="One key of the case, as stop.rms=1e-6; may be repeated."),
    ] = None,
) -> None:
    from radcal.errors import RadcalError

    words = targets or []
    first = next((k for k, word in enumerate(words) if word.startswith("-")), len(words))
    try:
        check_folder(Path.cwd(), words[:first])
        overrides = _overrides(settings or [])
        command = snakemake_command(case, words[:first], words[first:], overrides, cores, dry_run)
        checked_case(case, overrides)
    except RadcalError as error:
        typer.echo(f"radcal: {error}", err=True)
        raise typer.Exit(1) from None
    _become(command)


_CHECK_HELP = """Check a case without running anything, and list all of its problems at once.

Keys and values, files, scene, geometry and measured image are checked as the calibration checks them. If all is well,
the command prints what would be read, how many simulator runs the case may take, and how much memory its jobs request.

What only the calibration can find out, such as the registration, is not checked. The exit status is 1 if a problem was
found, else 0.
"""


@app.command("check", help=_CHECK_HELP)
def _check(
    case: Annotated[
        Path, typer.Argument(metavar="CASE", readable=False, help="The case's YAML file.", show_default=False)
    ],
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="One key of the case, as stop.rms=1e-6; may be repeated."),
    ] = None,
) -> None:
    from radcal.errors import RadcalError
    from radcal.running.case_check import check_case

    try:
        found = check_case([case], _overrides(settings or []))
    except RadcalError as error:
        typer.echo(f"radcal: {error}", err=True)
        raise typer.Exit(1) from None
    if found.problems:
        count = len(found.problems)
        typer.echo(f"radcal: {case} cannot be run; {count} problem{'s' if count > 1 else ''} found:", err=True)
        for text in found.problems:
            typer.echo(f"  - {text.removeprefix(f'{case}: ')}", err=True)
        raise typer.Exit(1)
    typer.echo(f"{case}: no problem found.")
    typer.echo(found.summary())


_SHOW_HELP = """Show the verdict of a case, its runs, and where report, exports and summary lie.

CASE is the name of a case below results/, a results folder, or the case's YAML file. The command also says what is
missing if the calibration is not finished.

\b
Examples:
  radcal show dyke
  radcal show config/mine.yaml
"""


@app.command("show", help=_SHOW_HELP)
def _show(
    case: Annotated[str, typer.Argument(metavar="CASE", help="Name, results folder or YAML file.", show_default=False)],
) -> None:
    from radcal.errors import RadcalError
    from radcal.report.showing import results_folder, show

    try:
        typer.echo("\n".join(show(results_folder(case))))
    except RadcalError as error:
        typer.echo(f"radcal: {error}", err=True)
        raise typer.Exit(1) from None


_COMPARE_HELP = """Compare the laws of two finished cases: one table, and one figure of both laws with their bands.

A and B are names of cases below results/, results folders, or YAML files. The figure is written beside the results
folder of A.
"""


@app.command("compare", help=_COMPARE_HELP)
def _compare(
    first: Annotated[str, typer.Argument(metavar="A", help="Name, results folder or YAML file.", show_default=False)],
    second: Annotated[str, typer.Argument(metavar="B", help="The same of the other case.", show_default=False)],
) -> None:
    from radcal.errors import RadcalError
    from radcal.report.comparison import compare
    from radcal.report.showing import results_folder

    try:
        folders = [results_folder(first), results_folder(second)]
        figure = folders[0].with_name(f"{folders[0].name}_and_{folders[1].name}.png")
        typer.echo("\n".join(compare(folders, figure)))
    except RadcalError as error:
        typer.echo(f"radcal: {error}", err=True)
        raise typer.Exit(1) from None


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


def _overrides(words: Sequence[str]) -> dict[str, Any]:
    """Parse the settings of the command line and merge them, section by section."""
    from radcal.config.yaml_file import check_words, merged, setting

    check_words(words, "--set")
    data: dict[str, Any] = {}
    for word in words:
        data = merged(data, setting(word, "--set"))
    return data


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


_CASE = Annotated[
    Path, typer.Argument(metavar="CASE", readable=False, help="The case's YAML file.", show_default=False)
]
_SETTINGS = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="KEY=VALUE", help="One key of the case, as stop.rms=1e-6; may be repeated."),
]


@app.command("simulate")
def _simulate(
    case: _CASE,
    calibrated: Annotated[
        Path | None, typer.Option("--materials", help="File with materials in place of the case's, as calibrated.yaml.")
    ] = None,
    settings: _SETTINGS = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the images; by default results/<case>/simulated.")] = None,
) -> None:
    """Simulate the image of a case with the parameters of its materials; it needs no measured image."""
    from radcal.config import load_forward
    from radcal.report.simulated import simulate

    def lines() -> list[str]:
        found = load_forward([case], _overrides(settings or []), calibrated)
        folder = Path("results") / found.case
        return simulate(found, out or folder / "simulated", folder / "runs")

    _told(lines)


@app.command("apply")
def _apply(
    case: Annotated[str, typer.Argument(metavar="CASE", help="Name, results folder or YAML file.", show_default=False)],
    to: Annotated[Path, typer.Option("--to", metavar="OTHER", help="YAML file of the other case.", show_default=False)],
    out: Annotated[Path | None, typer.Option(help="By default results/<other>/applied_<case>.")] = None,
) -> None:
    """Predict the image of another scene or pass from the laws of a finished case, and compare it with its image."""
    from radcal.config import load_forward, load_measured
    from radcal.report.applied import apply
    from radcal.report.showing import results_folder

    def lines() -> list[str]:
        folder, other = results_folder(case), load_forward([to])
        results = Path("results") / other.case
        return apply(folder, other, load_measured([to]), out or results / f"applied_{folder.name}", results / "runs")

    _told(lines)


@app.command("advise")
def _advise(
    case: Annotated[str, typer.Argument(metavar="CASE", help="Name, results folder or YAML file.", show_default=False)],
    depression: Annotated[
        list[float] | None, typer.Option(help="Depression to compare [deg]; may be repeated.")
    ] = None,
    between: Annotated[tuple[float, float] | None, typer.Option(help="Incidence of interest [deg].")] = None,
) -> None:
    """Compare further passes by how far they are expected to narrow the bands of a finished case."""
    from radcal.report.advice import advise
    from radcal.report.showing import results_folder

    _told(lambda: advise(results_folder(case), depression or [], between))


def _told(lines: Callable[[], Iterable[str]]) -> None:
    """Print the lines of a command, or the sentence of its error."""
    from radcal.errors import RadcalError

    try:
        typer.echo("\n".join(lines()))
    except RadcalError as error:
        typer.echo(f"radcal: {error}", err=True)
        raise typer.Exit(1) from None
