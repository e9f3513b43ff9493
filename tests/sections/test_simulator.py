"""Section simulator: other people's programs."""

import re
from pathlib import Path

import pytest
from config_samples import COMMAND, NO_TRUTH, SOIL, TRUE_SOIL, WHOLE, X, message, outside

from radcal.config import case_from, load
from radcal.config.stages import STAGES


def test_unquoted_placeholders_are_what_was_meant(tmp_path):
    text = "simulator: {kind: command, command: [sim, {input}, {soil.mv}, a], output: {file: i.npy, scale: db}}"
    (tmp_path / "a.yaml").write_text(text)
    case = load([tmp_path / "a.yaml"])
    assert case.simulator.command == ["sim", "{input}", "{soil.mv}", "a"]
    # what a job gets is what the workflow read
    assert STAGES["simulator"].model.model_validate(STAGES["simulator"].params(case)).simulator == case.simulator


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"materials": {"soil": SOIL}, "simulator": {}}, "materials.soil.law is external, which only simulator.kind"),
        ({"materials": {"soil": SOIL | {"bounds": None}}}, "law external needs names and bounds"),
        ({"materials": {"soil": SOIL | {"names": ["mv", "mv"]}}}, "names are .* expected each once"),
        ({"materials": {"soil": SOIL | {"units": ["cm"]}}}, "units has 1 entries, names 2"),
        ({"materials": {"soil": {"calibrate": True, "names": ["a"]}}}, "names is given, law is 'mangia', which"),
        ({"materials": {"soil": SOIL | {"law": "external", "start": [0.5]}}}, r"start has 1 number, .*names: mv, s"),
        (
            {"materials": {"soil": SOIL | {"start": {"law": "external", "parameters": [0.5, 1]}}}},
            r"materials\.soil\.start: law is 'external', which only an external",
        ),
        (
            {"materials": {"soil": SOIL | {"start": {"law": "mangia", "parameters": X}}}, "measurement": TRUE_SOIL},
            r"materials\.soil\.start is of law 'mangia', .* expected a list of 2 numbers for law 'external'",
        ),
        ({"materials": {"soil": SOIL}, "measurement": {"synthetic": {"parameters": {"soil": [1]}}}}, "names: mv, s"),
        ({"simulator": COMMAND | {"output": {"file": "../i.npy", "scale": "db"}}}, r"simulator\.output\.file: .*own f"),
        ({"simulator": COMMAND | {"files": ["a/i.npy"]}}, r"files\.0 and output\.file are both 'i\.npy'"),
        ({"simulator": COMMAND | {"version": "1", "version_command": ["a"]}}, "version and version_command are both"),
        ({"simulator": COMMAND | {"output": {"file": "i", "scale": "db", "format": "raw"}}}, "expected dtype"),
    ],
)
def test_wrong_external_simulators_end_in_a_sentence(changes, words):
    text = message({"simulator": COMMAND, "materials": {"soil": SOIL}, "measurement": NO_TRUTH} | changes)
    assert re.search(words, text)


def test_another_program_ends_at_the_sampling_error_unless_a_tolerance_is_asked_for():
    assert case_from(outside(WHOLE)).stop.at_sampling_error
    assert case_from(outside(WHOLE, stop={"max_runs": 30})).stop.at_sampling_error
    assert not case_from(outside(WHOLE, stop={"rms": 1e-5})).stop.at_sampling_error
    assert not case_from(outside(WHOLE, stop={"at_sampling_error": False})).stop.at_sampling_error
    assert not case_from({}).stop.at_sampling_error
    for name in ("paper", "paper_small"):
        assert not load([Path(__file__).parents[2] / f"config/{name}.yaml"]).stop.at_sampling_error


def test_the_longest_run_is_that_of_all_attempts_waits_and_draws():
    """Four attempts of 100 s, waits of 2, 4 and 8 s, twice."""
    keys = {"timeout_s": 100, "retries": 3, "retry_wait_s": 2, "draws": 2}
    simulator = case_from(outside(WHOLE, simulator=COMMAND | keys)).simulator
    assert simulator.longest_run_s == 2 * (4 * 100 + 2 + 4 + 8)
    assert case_from({"simulator": {"draws": 3}}).simulator.longest_run_s == 2700
    # 2^20 - 1 waits of the first
    assert case_from(outside(WHOLE, simulator=COMMAND | {"retries": 20, "retry_wait_s": 2})).simulator.retries == 20
    said = message(outside(WHOLE, simulator=COMMAND | {"retries": 20, "retry_wait_s": 3}))
    assert "retry_wait_s is 3 and retries 20: waits that double each time add up to 36.4 days, expected at" in said
