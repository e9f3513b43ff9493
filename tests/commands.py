"""Commands in this process."""

from typer.testing import CliRunner

from radcal.cli import app


def typed(*words, code=0):
    """A command that ends with an exit code."""
    done = CliRunner().invoke(app, [str(word) for word in words])
    assert done.exit_code == code, done.output
    return done
