"""Command ``radcal check``."""

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Any

import typer

from radcal.cli.arguments import CaseFiles, Results, Settings, overrides, sentences
from radcal.errors import RadcalError


def main(cases: CaseFiles, settings: Settings = None, results: Results = Path("results")) -> None:
    """Check cases without running anything.

    All wrong keys, missing files and values that are still to be decided (FILL_IN) are listed at once, with line and
    expected value. If there are none, the command makes scene, geometry and measured image in memory, as a calibration
    does, and prints what it finds wrong or remarkable; it writes nothing. If all is well, it prints how many simulator
    runs the case may take, the memory and, as far as stored runs show it, the time. Warnings come first; a case with
    warnings can be run.

    If the measured image is a product with an annotation, such as a Sentinel-1 SAFE folder, the command also prints the
    section radar that the annotation gives, even if the case has problems.

    A case without a measured image and without a material to calibrate is checked for radcal simulate.

    What only the calibration can find out, such as the registration, is not checked. The exit status is 1 if a problem
    was found, else 0.
    """
    with sentences():
        changed = overrides(settings)
    wrong = [case for case in cases if not _is_right(case, changed, results)]
    if wrong and len(cases) > 1:
        names = ", ".join(str(case) for case in wrong)
        typer.echo(f"radcal: {len(wrong)} of {len(cases)} cases cannot be run: {names}", err=True)
    if wrong:
        raise typer.Exit(1)


def _is_right(case: Path, changed: dict[str, Any], results: Path) -> bool:
    """Whether a case can be run; the result of its check is printed."""
    from radcal.checking.case_check import check_case
    from radcal.session.jobs import clock
    from radcal.session.workflow_files import carried_case

    began = time.monotonic()

    def say(line: str) -> None:
        if sys.stderr.isatty():
            typer.echo(f"[{clock(time.monotonic() - began):>6}] {line}", err=True)

    try:
        found = check_case([carried_case(case)], changed, results, say)
    except RadcalError as error:  # the other cases are checked as well
        typer.echo(f"radcal: {case}: {str(error).removeprefix(f'{case}: ')}", err=True)
        return False
    if found.problems:
        count = len(found.problems)
        typer.echo(f"radcal: {case} cannot be run; {count} problem{'s' if count > 1 else ''} found:", err=True)
        for text in found.problems:
            typer.echo(f"  - {text.removeprefix(str(case)).lstrip(':, ')}", err=True)
        if found.unseen:
            typer.echo(f"Not looked at yet, because of the above: {'; '.join(found.unseen)}.", err=True)
        for line in (*found.warnings(), *found.remarks()):
            typer.echo(line)
        return False
    warnings = found.warnings()
    more = f", {len(warnings)} warning{'s' * (len(warnings) > 1)}:" if warnings else "."
    typer.echo("\n".join([f"{case}: no mistake found{more}", *warnings, *found.summary()]))
    return True
