"""Section simulator: other people's programs."""

from pathlib import Path

from config_samples import COMMAND, WHOLE, outside

from radcal.config import case_from, load
from radcal.config.stages import STAGES


def test_unquoted_placeholders_are_what_was_meant(tmp_path):
    text = "simulator: {kind: command, command: [sim, {input}, {soil.mv}, a], output: {file: i.npy, scale: db}}"
    (tmp_path / "a.yaml").write_text(text)
    case = load([tmp_path / "a.yaml"])
    assert case.simulator.command == ["sim", "{input}", "{soil.mv}", "a"]
    # what a job gets is what the workflow read
    assert STAGES["simulator"].model.model_validate(STAGES["simulator"].params(case)).simulator == case.simulator


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
