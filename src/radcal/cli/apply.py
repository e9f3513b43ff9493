"""Command ``radcal apply``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from radcal.cli.arguments import Finished, Results, sentences


def main(
    case: Finished,
    to: Annotated[Path, typer.Option("--to", metavar="OTHER", help="YAML file of the other case.", show_default=False)],
    out: Annotated[
        Path | None,
        typer.Option(file_okay=False, help="Folder of the results; by default results/<other>/applied_<case>."),
    ] = None,
    results: Results = Path("results"),
) -> None:
    """Predict the image of another case with the laws of a finished case, and compare it with the measured image.

    OTHER has another scene or another pass, and materials of the same names. Without a measured image, the command only
    predicts.
    """
    from radcal.config import load_forward
    from radcal.config.loading import load_measured
    from radcal.products.applied import apply
    from radcal.products.showing import results_folder

    with sentences():
        folder, other = results_folder(case, results), load_forward([to])
        below = results / other.case
        found = apply(folder, other, load_measured([to]), out or below / f"applied_{folder.name}", below / "runs")
        typer.echo("\n".join(found))
