"""Command ``radcal focus``."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from radcal.cli.arguments import sentences


def main(
    path: Annotated[
        Path, typer.Argument(metavar="FILE", readable=False, help="CPHD file of any program.", show_default=False)
    ],
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", file_okay=False, help="Of the image; by default beside FILE.")
    ] = None,
    spacing: Annotated[
        float | None,
        typer.Option(metavar="M", min=1e-3, help="Distance between pixels [m]; by default half of the resolution."),
    ] = None,
    channel: Annotated[
        str | None, typer.Option(metavar="ID", help="Channel; by default the file's reference channel.")
    ] = None,
) -> None:
    """Focus a file of phase history (CPHD 1.x, monostatic) by back-projection on the image plane that it names.

    \b
    For example:
      radcal focus results/dyke/simulated/iq.cphd --out image --spacing 2
    """  # noqa: D301 - click keeps the lines that follow \b
    from radcal.signals.received import write_image

    with sentences():
        typer.echo("\n".join(f"  {one}" for one in write_image(path, out or path.parent, spacing, channel)))
