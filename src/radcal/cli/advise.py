"""Command ``radcal advise``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from radcal.cli.arguments import Finished, Results, sentences


def main(
    case: Finished,
    depression: Annotated[
        list[float] | None, typer.Option(help="Depression to compare [deg]; may be repeated.")
    ] = None,
    between: Annotated[tuple[float, float] | None, typer.Option(help="Incidence of interest [deg].")] = None,
    results: Results = Path("results"),
) -> None:
    """Compare further passes by how far they are expected to narrow the bands of a finished case."""
    from radcal.products.advice import advise
    from radcal.products.showing import results_folder

    with sentences():
        typer.echo("\n".join(advise(results_folder(case, results), depression or [], between)))
