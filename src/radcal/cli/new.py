"""Command ``radcal new``."""

from __future__ import annotations

import inspect
from typing import Annotated, Any

import typer

from radcal.cli.arguments import sentences
from radcal.newcase.template import TEMPLATE

_KINDS: dict[str, Any] = {"TEXT": str, "FLOAT": float, "INTEGER": int, "LIST": list[str]}


def main(case: str, **answers: Any) -> None:
    """Write a new case from options.

    CASE is the YAML file to write, or a name. What the files say is read from them: size, CRS, pixel spacing, bands,
    codes of the land cover. A line that is still to be decided is marked FILL_IN; radcal check lists these lines. No
    file is overwritten, and with a wrong option none is written. A material to calibrate starts at the level of its
    land cover (docs/landcover.md) or, if its name tells no land cover, near the median level of the image.

    With --image synthetic, the image is simulated with hidden laws; with --image none, the case is for radcal simulate.

    \b
    For example:
      radcal new config/mine.yaml --elevation dem.tif --landcover cover.tif --image s1.tif
      radcal new config/look.yaml --elevation dem.tif --landcover cover.tif --image none
    """  # noqa: D301 - click keeps the lines that follow \b
    from radcal.newcase.new_case import NewCase, case_path

    values = {key: answers[_name(line.option)] for key, line in TEMPLATE.items() if line.option}
    with sentences():
        new = NewCase(case_path(case), {key: value for key, value in values.items() if value not in (None, [], ())})
        written = new.write()
    for line in written:
        typer.echo(line)
    if options := [TEMPLATE[key].option.split(",")[0] for key in new.undecided if TEMPLATE[key].option]:
        typer.echo(f"Still to be decided, marked FILL_IN (or by options in a new case): {', '.join(options)}.")
    path = new.path
    then = f"radcal simulate {path}" if new.forward else f"radcal run {path} reference, and radcal run {path}"
    typer.echo(f"Next: radcal check {path}\nThen: {then}")


def _name(option: str) -> str:
    """Name of the parameter for an option."""
    return option.split(",")[0].strip("-").replace("-", "_")


def _signature() -> inspect.Signature:
    """Argument and options of ``radcal new``, as typer reads them from the signature of ``main``."""
    types: dict[str, Any] = {}
    for line in TEMPLATE.values():
        if line.option:
            option = typer.Option(*line.option.split(","), help=line.comment, show_default=False)
            types[_name(line.option)] = Annotated[_KINDS[line.kind] | None, option]
    argument = Annotated[str, typer.Argument(metavar="CASE", help="YAML file to write, or a name.")]
    keyword = inspect.Parameter.KEYWORD_ONLY
    options = [inspect.Parameter(name, keyword, annotation=kind, default=None) for name, kind in types.items()]
    return inspect.Signature([inspect.Parameter("case", keyword, annotation=argument), *options])


main.__signature__ = _signature()  # type: ignore[attr-defined]
main.__annotations__ = {name: one.annotation for name, one in _signature().parameters.items()} | {"return": None}
