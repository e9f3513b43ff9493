"""Findings as data."""

from __future__ import annotations

import json
from dataclasses import FrozenInstanceError

import pytest

from radcal.findings import Finding, from_json, to_json


def test_findings_are_read_as_they_were_written():
    each = [
        Finding("level", "warning", "pass 1", {"level_db": 1.25, "p05_db": -0.5}),
        Finding("radiometry", "refusal", "pass 2", {"found": "sigma0_ref"}, "radar.radiometry: sigma0_ref"),
        Finding("parameters_only", "note", "dyke"),
    ]
    text = to_json(each)
    assert from_json(text) == each
    assert json.loads(text)[0] == {
        "code": "level",
        "severity": "warning",
        "about": "pass 1",
        "numbers": {"level_db": 1.25, "p05_db": -0.5},
        "do": "",
    }
    assert from_json(to_json([])) == []


def test_findings_do_not_change():
    with pytest.raises(FrozenInstanceError):
        Finding("level", "note", "pass 1").code = "other"
