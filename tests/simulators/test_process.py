"""Ends of programs, and their last words, in a sentence."""

from __future__ import annotations

from pathlib import Path

import pytest

from radcal.simulators.process import STDERR, STDOUT, Ended, output_tail


@pytest.mark.parametrize(
    ("code", "said"),
    [
        (0, "ended with exit code 0"),
        (3, "ended with exit code 3"),
        (-11, "was ended by signal 11 (SIGSEGV)"),
        (-99, "was ended by signal 99"),
        (None, "was not done after 12.3 s and was killed"),
    ],
)
def test_how_a_program_ended(code: int | None, said: str) -> None:
    assert str(Ended(code, 12.3456)) == said


def test_the_last_three_lines_are_quoted(tmp_path: Path) -> None:
    (tmp_path / STDERR).write_text("first\n\nsecond\nthird \x07bell\n  fourth\n")
    (tmp_path / STDOUT).write_text("\n \n")
    assert output_tail(tmp_path) == 'its last output on stderr: "second / third  bell / fourth"'


def test_a_long_line_is_quoted_from_its_end(tmp_path: Path) -> None:
    text = "".join(f"{k:04d}" for k in range(2000))
    (tmp_path / STDOUT).write_text(text)
    assert output_tail(tmp_path) == f'its last output on stdout: "... {text[-300:]}"'
    (tmp_path / STDOUT).write_text(text[:300])
    assert output_tail(tmp_path) == f'its last output on stdout: "{text[:300]}"'
    (tmp_path / STDOUT).unlink()
    assert output_tail(tmp_path) == "it printed nothing"
