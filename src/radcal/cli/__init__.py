"""Command ``radcal``, with one module for each subcommand; slow libraries are imported only when a command needs them.

A new subcommand is a module with a function ``main``, whose docstring is the help, and a name at the end of this file.
"""

from __future__ import annotations

import typer

from radcal.cli import advise, apply, check, compare, focus, new, run, show, simulate

__all__ = ["app"]

app = typer.Typer(
    no_args_is_help=True, rich_markup_mode=None, pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)  # fmt: skip


@app.callback()
def _radcal() -> None:
    """Calibrate the backscatter laws of a SAR simulator against a measured image."""


for _command in (new, check, run, show, compare, simulate, focus, apply, advise):
    app.command(_command.__name__.rpartition(".")[2])(_command.main)
