"""Findings as data."""

import json

from radcal.findings import Finding, of_pass


def test_findings_are_read_as_they_were_written():
    each = [
        Finding("level", "warning", "pass 1", {"level_db": 1.25, "p05_db": -0.5}),
        Finding("radiometry", "refusal", "pass 2", {"found": "sigma0_ref"}, "radar.radiometry: sigma0_ref"),
        Finding("parameters_only", "note", "dyke"),
    ]
    assert [Finding.of_json(one.json()) for one in each] == each
    plain = {"code": "level", "severity": "warning", "about": "pass 1", "do": ""}
    assert json.loads(each[0].json()) == {**plain, "numbers": {"level_db": 1.25, "p05_db": -0.5}}


def test_findings_of_one_of_several_passes_have_its_number():
    level = Finding("level", "note", "pass 1", {"level_db": 0.1})
    assert of_pass([level], 1, 1) == [level]
    assert of_pass([level], 2, 3) == [Finding("level", "note", "pass 1", {"level_db": 0.1, "pass": 2})]
