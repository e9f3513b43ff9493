"""Arguments and error handling that several commands of ``radcal`` share."""

from __future__ import annotations

import errno
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer

from radcal.errors import RadcalError

CaseFiles = Annotated[
    list[Path], typer.Argument(metavar="CASE...", readable=False, help="YAML files of cases.", show_default=False)
]
_NAMED = "Name, results folder or YAML file of the case."
Finished = Annotated[str, typer.Argument(metavar="CASE", help=_NAMED, show_default=False)]
Results = Annotated[
    Path,
    typer.Option("--results", metavar="FOLDER", envvar="RADCAL_RESULTS", help="Folder of the results of all cases."),
]
Settings = Annotated[
    list[str] | None,
    typer.Option(
        "--set", metavar="KEY=VALUE", help="Change one key of the case, such as stop.law_db=0.02; may be repeated."
    ),
]


@contextmanager
def sentences() -> Iterator[None]:
    """Context that prints the message of a RadcalError or of the operating system as one line; exit status 1."""
    try:
        yield
    except RadcalError as error:
        text = str(error)
    except OSError as error:
        if error.errno == errno.EPIPE:  # the reader of the output has ended, which is no failure
            raise
        text = f"{error.filename or 'the current folder'}: {error.strerror or error}."
    else:
        return
    typer.echo(f"radcal: {text}", err=True)
    raise typer.Exit(1)


def overrides(words: Sequence[str] | None) -> dict[str, Any]:
    """Settings of the option ``--set``, each ``key=value``, parsed and merged section by section.

    Raises
    ------
    ConfigError
        A setting is not of the form ``key=value``, or a key is given twice.
    """
    from radcal.config.yaml_file import settings

    return settings(words or [], "--set")
