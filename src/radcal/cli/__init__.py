"""Command ``radcal``, with one module for each subcommand; slow libraries are imported only when a command needs them.

A new subcommand is a module with a text ``HELP`` and a function ``main``, and one line at the end of this file.
"""

from __future__ import annotations

import typer

from radcal.cli import advise, apply, check, compare, new, run, show, simulate

__all__ = ["app"]

app = typer.Typer(
    no_args_is_help=True, rich_markup_mode=None, pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)  # fmt: skip


@app.callback()
def _radcal() -> None:
    """Calibrate the backscatter laws of a SAR simulator against a measured image."""


app.command("new", help=new.HELP)(new.main)
app.command("check", help=check.HELP)(check.main)
app.command("run", help=run.HELP)(run.main)
app.command("show", help=show.HELP)(show.main)
app.command("compare", help=compare.HELP)(compare.main)
app.command("simulate", help=simulate.HELP)(simulate.main)
app.command("apply", help=apply.HELP)(apply.main)
app.command("advise", help=advise.HELP)(advise.main)
