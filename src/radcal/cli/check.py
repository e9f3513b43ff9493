"""Command ``radcal check``."""

from __future__ import annotations

import typer

from radcal.cli.arguments import CaseFile, Settings, overrides, sentences

__all__ = ["HELP", "main"]

HELP = """Check a case without running anything, and list all of its problems at once.

Keys and values, files, scene, geometry and measured image are checked as the calibration checks them. If all is well,
the command prints what would be read, how many simulator runs the case may take, and how much memory its jobs request.

What only the calibration can find out, such as the registration, is not checked. The exit status is 1 if a problem was
found, else 0.
"""


def main(case: CaseFile, settings: Settings = None) -> None:
    """Check a case."""
    from radcal.running.case_check import check_case

    with sentences():
        found = check_case([case], overrides(settings))
    if found.problems:
        count = len(found.problems)
        typer.echo(f"radcal: {case} cannot be run; {count} problem{'s' if count > 1 else ''} found:", err=True)
        for text in found.problems:
            typer.echo(f"  - {text.removeprefix(f'{case}: ')}", err=True)
        raise typer.Exit(1)
    typer.echo(f"{case}: no problem found.")
    typer.echo(found.summary())
