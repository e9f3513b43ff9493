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
    size: Annotated[
        float | None,
        typer.Option(metavar="M", min=1e-3, help="Side of a square [m]; by default the file's whole image area."),
    ] = None,
    centre: Annotated[
        tuple[float, float] | None,
        typer.Option(metavar="LAT LON", help="Middle of the square [deg]; by default the file's reference point."),
    ] = None,
) -> None:
    """Focus a file of phase history (CPHD 1.x, monostatic) by back-projection on the image plane that it names.

    \b
    For example:
      radcal focus results/dyke/simulated/iq.cphd --out image --spacing 2
      radcal focus spotlight.cphd --size 500 --centre 40.4168 -3.7038
    """  # noqa: D301 - click keeps the lines that follow \b
    from radcal.signals.received import write_image

    with sentences():
        paths = write_image(path, out or path.parent, spacing, channel, size, centre)
        typer.echo("\n".join(f"  {one}" for one in paths))
