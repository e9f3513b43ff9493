"""Command ``radcal show``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from radcal.cli.arguments import Results, sentences

__all__ = ["HELP", "main"]

HELP = """Show the verdict of cases, their runs, and where report, exports and summary lie.

CASE is the name of a case below results/, a results folder, or the case's YAML file. The command also says what is
missing if the calibration is not finished, and where it stands if a command works on it at this moment.

\b
Examples:
  radcal show dyke
  radcal show config/mine.yaml config/other.yaml
"""


def main(
    cases: Annotated[
        list[str], typer.Argument(metavar="CASE...", help="Names, results folders or YAML files.", show_default=False)
    ],
    results: Results = Path("results"),
) -> None:
    """Show the verdict, the runs and the files of cases."""
    from radcal.products.showing import results_folder, show

    failed = False
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
