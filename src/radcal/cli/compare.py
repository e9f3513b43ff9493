"""Command ``radcal compare``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from radcal.cli.arguments import Results, sentences


def main(
    first: Annotated[str, typer.Argument(metavar="A", help="One case.", show_default=False)],
    second: Annotated[str, typer.Argument(metavar="B", help="The other case.", show_default=False)],
    results: Results = Path("results"),
) -> None:
    """Compare the laws of two finished cases: one table, and one figure of both laws with their bands.

    A and B are names of cases below results/, results folders, or YAML files. For each material that both have
    calibrated, the table gives the incidence seen by both, the mean and the largest difference B - A of sigma0 there,
    and the share of this incidence at which the two 90 % bands overlap. The figure is written beside the results folder
    of A.
    """
    from radcal.products.comparison import compare
    from radcal.products.showing import results_folder

    with sentences():
        folders = [results_folder(case, results) for case in (first, second)]
        figure = folders[0].with_name(f"{folders[0].name}_and_{folders[1].name}.png")
        typer.echo("\n".join(compare(folders, figure)))
