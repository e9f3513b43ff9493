"""Command ``radcal simulate``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from radcal.cli.arguments import Results, Settings, overrides, sentences

__all__ = ["HELP", "main"]

HELP = "Simulate the image of a case with the parameters of its materials; it needs no measured image."


def main(
    case: Annotated[
        Path, typer.Argument(metavar="CASE", readable=False, help="The case's YAML file.", show_default=False)
    ],
    materials: Annotated[
        Path | None, typer.Option(help="File with materials in place of the case's, as calibrated.yaml.")
    ] = None,
    settings: Settings = None,
    out: Annotated[Path | None, typer.Option(help="Folder of the images; by default results/<case>/simulated.")] = None,
    results: Results = Path("results"),
) -> None:
    """Simulate the images of a case without a measured image."""
    from radcal.config import load_forward
    from radcal.report.simulated import simulate

    with sentences():
        found = load_forward([case], overrides(settings), materials)
        folder = results / found.case
        typer.echo("\n".join(simulate(found, out or folder / "simulated", folder / "runs")))
