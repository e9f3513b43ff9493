"""Command ``python -m radcal``, which is the command ``radcal``."""

from radcal.cli import app

app(prog_name="radcal")
