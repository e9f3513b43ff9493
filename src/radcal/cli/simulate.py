"""Command ``radcal simulate``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from radcal.cli.arguments import Results, Settings, overrides, sentences
from radcal.products import PRODUCTS

if TYPE_CHECKING:
    from radcal.config.part import Part


def main(
    case: Annotated[
        Path, typer.Argument(metavar="CASE", readable=False, help="The case's YAML file.", show_default=False)
    ],
    materials: Annotated[
        Path | None,
        typer.Option(
            metavar="FILE",
            help="File, such as calibrated.yaml, whose materials replace those of the same names in the case.",
        ),
    ] = None,
    settings: Settings = None,
    out: Annotated[
        Path | None,
        typer.Option(
            metavar="FOLDER", file_okay=False, help="Folder of the images; by default results/<case>/simulated."
        ),
    ] = None,
    product: Annotated[
        Literal[tuple(PRODUCTS)],  # type: ignore[valid-type]  # evaluated when the command starts
        typer.Option(
            help="What is written besides the image: "
            + "; ".join(f"{name}: {one.adds}" for name, one in PRODUCTS.items() if one)
            + ".",
        ),
    ] = "intensity",
    draws: Annotated[
        int,
        typer.Option(
            metavar="N",
            min=0,
            help="Also simulate N draws of the laws from the posterior of the calibration that wrote FILE; without "
            "--materials, of the calibration in results/<case>.",
        ),
    ] = 0,
    replace: Annotated[bool, typer.Option("--replace", help="Replace images of other runs in the folder.")] = False,
    results: Results = Path("results"),
) -> None:
    """Simulate the image of a case with the parameters of its materials; no measured image is needed.

    A material with calibrate: true is simulated at its start. With --materials, the materials of FILE replace those of
    the same names, and the others keep the case's laws. An image of another run in the folder is replaced only with
    --replace.

    \b
    For example:
      radcal simulate config/mine.yaml
      radcal simulate config/mine.yaml --materials results/mine/export/calibrated.yaml --out found
      radcal simulate config/mine.yaml --product complex
      radcal simulate config/mine.yaml --product gmti --draws 20
    """  # noqa: D301 - click keeps the lines that follow \b
    from radcal.products.simulated import simulate

    with sentences():
        archive = None
        if draws:
            from radcal.products.applied import members_of
            from radcal.results.archive import read_finished

            own = results / forward_case(case, overrides(settings))[0].case / "export/calibrated.yaml"
            materials = materials or own
            archive = read_finished(materials.parent.parent)
        found, remarks = forward_case(case, overrides(settings), materials)
        folder = results / found.case
        members = [] if archive is None else members_of(archive, found, draws)
        lines = simulate(found, out or folder / "simulated", folder / "runs", replace, product, members)
        typer.echo("\n".join([*remarks, *lines]))


def forward_case(
    file: Path, overrides: Mapping[str, Any] | None = None, materials: Path | None = None
) -> tuple[Part, list[str]]:
    """Case of a forward run, in which materials of another file may replace materials of the same names.

    Parameters
    ----------
    file : path
        Case file.
    overrides : mapping, optional
        Keys that the command line changes.
    materials : path, optional
        File with a section ``materials``.

    Returns
    -------
    case : Part
        Sections that a forward run needs.
    remarks : list of str
        Sentences on the materials that keep the case's own law, and on those at their starting parameters.

    Raises
    ------
    ConfigError
        As for :func:`radcal.config.load_forward`.
    """
    from radcal.config import expand_path, load_forward
    from radcal.config.yaml_file import read_case_file

    case, remarks = load_forward([file], overrides, materials), []
    if materials is not None:
        others = read_case_file(expand_path(str(materials), "--materials"))["materials"]
        if kept := [name for name in case.materials if name not in others]:
            remarks.append(
                f"{materials} has the laws of {', '.join(others)}; the other materials keep the laws of {file}: "
                f"{', '.join(kept)}."
            )
    if case.calibrated:
        remarks.append(f"Simulated at the start, because of calibrate: true: {', '.join(case.calibrated)}.")
    return case, remarks
