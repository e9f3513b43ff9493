"""Command ``radcal new``."""

from __future__ import annotations

import inspect
import re
import sys
from typing import TYPE_CHECKING, Annotated, Any

import typer

from radcal.cli.arguments import sentences
from radcal.cli.new_entries import ENTRIES, Entry
from radcal.errors import RadcalError

if TYPE_CHECKING:
    from radcal.newcase.new_case import NewCase

__all__ = ["HELP", "main"]

HELP = """Write a new case, from questions at a terminal or from options.

CASE is the YAML file to write, or a name. What the files say is read from them: size, CRS, pixel spacing, bands, codes
of the land cover. A line that is still to be decided is marked FILL_IN; radcal check lists these lines. No file is
overwritten, and with a wrong option none is written.

With --image synthetic, the image is simulated with hidden laws; with --image none, the case is for radcal simulate.

\b
Example:
  radcal new config/mine.yaml --elevation dem.tif --landcover cover.tif --image s1.tif
  radcal new config/look.yaml --elevation dem.tif --landcover cover.tif --image none
"""


def main(case: str, **answers: Any) -> None:
    """Write a new case."""
    from radcal.config import FILL_IN
    from radcal.config.sensors import SENSORS
    from radcal.newcase.new_case import NewCase, case_path

    known = f"{', '.join(SENSORS)}; empty for another one"
    given = {entry.key: answers[entry.name] for entry in ENTRIES if answers[entry.name] not in (None, [], ())}
    asked = not answers["no_questions"] and _at_terminal()
    with sentences():
        path = case_path(case)
        keys = {entry.key: entry.optional for entry in ENTRIES}
        new = NewCase(path, given, keys)
        seen = set(given)
        if asked:
            typer.echo(f"An empty answer leaves a line open ({FILL_IN}); Ctrl-C ends without a file.", err=True)
        # an answer may settle later questions: the file tells the bands, the band tells the scale
        while asked and (left := [one for one in ENTRIES if one.key not in seen and _is_open(one, new)]):
            remark = {"scene.landcover": new.offered, "radar.sensor": known}.get(left[0].key, "")
            answered = given | _asked(left[0], remark)
            try:
                new = NewCase(path, answered, keys)
            except RadcalError as error:  # the same question comes again
                typer.echo(f"radcal: {error}", err=True)
                continue
            seen.add(left[0].key)
            given = answered
        written = new.write({entry.key: entry.text for entry in ENTRIES})
    for line in written:
        typer.echo(line)
    if new.undecided:
        options = ", ".join(entry.option.split(",")[0] for entry in ENTRIES if entry.key in new.undecided)
        typer.echo(f"Still to be decided, marked FILL_IN (or by options in a new case): {options}.")
        if decided := new.decided_by_sensors():
            typer.echo(f"--sensor decides up to {len(decided)} of them: {', '.join(SENSORS)} (docs/sensors.md).")
    then = f"radcal simulate {path}" if new.forward else f"radcal run {path} reference, and radcal run {path}"
    typer.echo(f"Next: radcal check {path}\nThen: {then}")


def _at_terminal() -> bool:
    return sys.stdin.isatty()


def _is_open(entry: Entry, new: NewCase) -> bool:
    """Whether to ask for a key: it has no value yet, or it is a choice with a default, or it decides other keys."""
    if entry.key == "scene.landcover":
        return new.offered != ""
    if entry.key == "radar.sensor":
        return new.decided_by_sensors() != []
    if entry.key == "materials.calibrated":
        return new.materials != [] and not new.forward
    return entry.key in new.undecided


def _asked(entry: Entry, remark: str) -> dict[str, Any]:
    """Answer at the terminal, by key; an empty answer leaves the key undecided."""
    question = f"{entry.text} ({remark})" if remark else entry.text
    while text := typer.prompt(question, default="", show_default=False).strip():
        try:
            # commas separate materials, and also the parameters of one law
            parts = re.split(r",(?=[^,]*=)" if "=" in text else ",", text)
            return {entry.key: [part.strip() for part in parts] if entry.several else entry.kind(text)}
        except ValueError:
            typer.echo(f"{text!r} is not a number.", err=True)
    return {}


def _options() -> dict[str, Any]:
    """Types of the arguments and options of ``radcal new``, which typer reads from the signature of ``main``."""
    types: dict[str, Any] = {
        "case": Annotated[str, typer.Argument(metavar="CASE", help="YAML file to write, or a name.")],
        "no_questions": Annotated[bool, typer.Option("--no-questions", help="Ask nothing, even at a terminal.")],
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
            default={"case": inspect.Parameter.empty, "no_questions": False}.get(name),
        )
        for name, kind in _options().items()
    ]
)
