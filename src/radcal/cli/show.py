"""Command ``radcal show``."""

from __future__ import annotations

from typing import Annotated

import typer

from radcal.cli.arguments import sentences

__all__ = ["HELP", "main"]

HELP = """Show the verdict of a case, its runs, and where report, exports and summary lie.

CASE is the name of a case below results/, a results folder, or the case's YAML file. The command also says what is
missing if the calibration is not finished.

\b
Examples:
  radcal show dyke
  radcal show config/mine.yaml
"""


def main(
    case: Annotated[str, typer.Argument(metavar="CASE", help="Name, results folder or YAML file.", show_default=False)],
) -> None:
    """Show the results of a case."""
    from radcal.report.showing import results_folder, show

    with sentences():
        typer.echo("\n".join(show(results_folder(case))))
