"""Command ``radcal advise``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from radcal.cli.arguments import Finished, Results, sentences


def main(
    case: Finished,
    depression: Annotated[
        list[float] | None, typer.Option(help="Depression angle of a pass to compare [deg]; may be repeated.")
    ] = None,
    between: Annotated[
        tuple[float, float] | None, typer.Option(help="Interval of incidence in which bands are compared [deg].")
    ] = None,
    results: Results = Path("results"),
) -> None:
    """Compare further passes by how far each is expected to narrow the 90 % bands of sigma0 of a finished case."""
    from radcal.products.advice import advise
    from radcal.products.showing import results_folder

    with sentences():
        typer.echo("\n".join(advise(results_folder(case, results), depression or [], between)))
