"""Command ``radcal show``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from radcal.cli.arguments import Results, sentences


def main(
    cases: Annotated[
        list[str], typer.Argument(metavar="CASE...", help="Names, results folders or YAML files.", show_default=False)
    ],
    results: Results = Path("results"),
    watch: Annotated[bool, typer.Option("--watch", help="Repeat until no command works on the cases.")] = False,
    html: Annotated[bool, typer.Option("--html", help="With --watch: write live.html in the results folder.")] = False,
) -> None:
    """Show the verdict of cases, their runs, and where report, exports and summary lie.

    CASE is the name of a case below results/, a results folder, or the case's YAML file. If the calibration is not
    finished, the command says what is missing; if another command works on the case at this moment, it gives the
    latest line of progress. With the YAML file and --watch, it also says how many runs are expected.

    \b
    For example:
      radcal show dyke
      radcal show config/mine.yaml config/other.yaml
      radcal show config/mine.yaml --watch          until no command works on it
      radcal show config/mine.yaml --watch --html   as a page, results/mine/live.html
    """  # noqa: D301 - click keeps the lines that follow \b
    from radcal.cli.watching import watched
    from radcal.products.showing import results_folder, show

    failed = False
    if html and not watch:
        typer.echo("radcal: --html is given without --watch, expected both.", err=True)
        raise typer.Exit(1)
    if watch:
        with sentences():
            watched({results_folder(case, results): case for case in cases}, html)
        return
    for number, case in enumerate(cases):
        if number:
            typer.echo()
        try:
            with sentences():
                typer.echo("\n".join(show(results_folder(case, results))))
        except typer.Exit:
            failed = True
    if failed:
        raise typer.Exit(1)
