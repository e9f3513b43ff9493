"""Sentences of findings: every template has its numbers, and a warning begins with the word."""

from __future__ import annotations

import pytest

from radcal.findings import Finding
from radcal.words import text

NUMBERS = {"key": "radar.incidence_deg", "declared_deg": 35.5}


def test_a_note_and_a_warning_differ_by_their_first_word() -> None:
    note = Finding("geometry_unchecked", "note", "a.tif", NUMBERS)
    said = text(note)
    assert said.startswith("a.tif was not registered, so that radar.incidence_deg 35.5, ")
    assert text(Finding("geometry_unchecked", "warning", "a.tif", NUMBERS)) == f"warning: {said}"
    assert text(Finding("geometry_unchecked", "refusal", "a.tif", NUMBERS)) == said


def test_a_code_without_words_is_a_bug() -> None:
    with pytest.raises(KeyError):
        text(Finding("nothing", "note", "a.tif"))
