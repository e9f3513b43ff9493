"""Command ``radcal new``."""

from __future__ import annotations

import inspect
from typing import Annotated, Any

import typer

from radcal.cli.arguments import sentences
from radcal.cli.new_entries import ENTRIES

__all__ = ["HELP", "main"]

HELP = """Write a new case from options.

CASE is the YAML file to write, or a name. What the files say is read from them: size, CRS, pixel spacing, bands, codes
of the land cover. A line that is still to be decided is marked FILL_IN; radcal check lists these lines. No file is
overwritten, and with a wrong option none is written. Materials to calibrate start about the levels of the image.

With --image synthetic, the image is simulated with hidden laws; with --image none, the case is for radcal simulate.

\b
Example:
  radcal new config/mine.yaml --elevation dem.tif --landcover cover.tif --image s1.tif
  radcal new config/look.yaml --elevation dem.tif --landcover cover.tif --image none
"""


def main(case: str, **answers: Any) -> None:
    """Write a new case."""
    from radcal.newcase.new_case import NewCase, case_path

    given = {entry.key: answers[entry.name] for entry in ENTRIES if answers[entry.name] not in (None, [], ())}
    with sentences():
        texts = {entry.key: entry.text for entry in ENTRIES}
        new = NewCase(case_path(case), given, texts, {entry.key for entry in ENTRIES if entry.optional})
        written = new.write()
    for line in written:
        typer.echo(line)
    if new.undecided:
        options = ", ".join(entry.option.split(",")[0] for entry in ENTRIES if entry.key in new.undecided)
        typer.echo(f"Still to be decided, marked FILL_IN (or by options in a new case): {options}.")
    path = new.path
    then = f"radcal simulate {path}" if new.forward else f"radcal run {path} reference, and radcal run {path}"
    typer.echo(f"Next: radcal check {path}\nThen: {then}")


def _options() -> dict[str, Any]:
    """Types of the arguments and options of ``radcal new``, which typer reads from the signature of ``main``."""
    types: dict[str, Any] = {
        "case": Annotated[str, typer.Argument(metavar="CASE", help="YAML file to write, or a name.")],
    }
    for entry in ENTRIES:
        kind: Any = list[entry.kind] if entry.several else entry.kind  # type: ignore[name-defined]
        option = typer.Option(*entry.option.split(","), help=entry.text, show_default=False)
        types[entry.name] = Annotated[kind | None, option]
    return types


main.__annotations__ = {**_options(), "return": None}
main.__signature__ = inspect.Signature(  # type: ignore[attr-defined]
    [
        inspect.Parameter(
            name,
            inspect.Parameter.KEYWORD_ONLY,
            annotation=kind,
            default=inspect.Parameter.empty if name == "case" else None,
        )
        for name, kind in _options().items()
    ]
)
