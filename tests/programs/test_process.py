"""Ends of programs, and their last words, in a sentence."""

import sys

import pytest

from radcal.errors import SimulatorError
from radcal.programs import process
from radcal.programs.process import STDOUT, Ended, output_tail, run_program


def test_how_a_program_ended():
    assert str(Ended(-11, 12.3456)) == "was ended by signal 11 (SIGSEGV)"
    assert str(Ended(-99, 12.3456)) == "was ended by signal 99"
    assert str(Ended(None, 12.3456)) == "was not done after 12.3 s and was killed"


@pytest.mark.parametrize(("name", "then"), [("stdout", "time.sleep(60)"), ("stderr", "pass")])
def test_a_program_that_prints_without_end_is_killed(tmp_path, monkeypatch, name, then):
    monkeypatch.setattr(process, "_MOST_BYTES", 50_000)
    text = f"import sys, time; sys.{name}.write(7000 * 'mangia! '); sys.{name}.flush(); {then}"
    said = rf"^python.* was killed, because radcal\.{name} has 56000 bytes, expected at most 50000, its last output on"
    with pytest.raises(SimulatorError, match=said):
        run_program([sys.executable, "-c", text], tmp_path, {}, 30.0)
    assert (tmp_path / f"radcal.{name}").stat().st_size == 50_000


def test_a_program_may_print_up_to_the_limit(tmp_path, monkeypatch):
    monkeypatch.setattr(process, "_MOST_BYTES", 56_000)
    ended = run_program([sys.executable, "-c", "print(7000 * 'mangia! ', end='')"], tmp_path, {}, 30.0)
    assert ended.code == 0
    assert (tmp_path / STDOUT).stat().st_size == 56_000


def test_a_long_line_is_quoted_from_its_end(tmp_path):
    text = "".join(f"{k:04d}" for k in range(2000))
    (tmp_path / STDOUT).write_text(text)
    assert output_tail(tmp_path) == f'its last output on stdout: "... {text[-300:]}"'
    (tmp_path / STDOUT).write_text(text[:300])
    assert output_tail(tmp_path) == f'its last output on stdout: "{text[:300]}"'
    (tmp_path / STDOUT).unlink()
    assert output_tail(tmp_path) == "it printed nothing"
