import numpy as np
import pytest

from radcal.radar import SIMULATOR_VERSION, simulator_version
from radcal.session.salvage import simulator_change
from radcal.storage.records import write_json
from radcal.storage.runs import Record, RunStore


def reference_run(folder, simulator):
    RunStore(folder / "runs").put(
        Record("a" * 20, {"dyke": np.ones(3, np.float32)}, None, 1.0), {"simulator": simulator}
    )
    write_json(folder / "passes/1/reference.json", [{"key": "a" * 20, "parameters": {}}])


def test_runs_of_an_earlier_version_are_said_to_be_made_anew(tmp_path, case):
    reference_run(tmp_path, {"kind": "builtin", "version": SIMULATOR_VERSION - 1})
    (sentence,) = simulator_change(tmp_path, case)
    assert (
        f"simulator is version {SIMULATOR_VERSION} now, the runs of {tmp_path} are of version {SIMULATOR_VERSION - 1}"
        in sentence
    )
    assert f"identity has changed, runs are made anew, and the old ones are kept in {tmp_path}/runs" in sentence
    # once: the reference run is the first to be made anew
    reference_run(tmp_path, {"kind": "builtin", "version": SIMULATOR_VERSION})
    assert simulator_change(tmp_path, case) == []


def test_passes_over_a_curved_earth_have_a_version_of_their_own(tmp_path, build_case):
    orbit = build_case(radar={"altitude_m": 7e5, "incidence_deg": 33.0})
    assert (simulator_version("flat"), simulator_version("curved")) == (SIMULATOR_VERSION, SIMULATOR_VERSION + 1)
    reference_run(tmp_path, {"kind": "builtin", "version": SIMULATOR_VERSION})
    assert len(simulator_change(tmp_path, orbit)) == 1
    assert simulator_change(tmp_path, build_case()) == []


@pytest.mark.parametrize("simulator", [{"kind": "command", "version": "2"}, {}])
def test_nothing_is_said_of_other_simulators(tmp_path, case, simulator):
    reference_run(tmp_path, simulator)
    assert simulator_change(tmp_path, case) == []


def test_nothing_is_said_where_there_are_no_runs(tmp_path, case):
    assert simulator_change(tmp_path / "new", case) == []
    write_json(tmp_path / "passes/1/reference.json", [{"key": "b" * 20, "parameters": {}}])
    assert simulator_change(tmp_path, case) == []
