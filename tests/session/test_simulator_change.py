import numpy as np
import pytest

from radcal.radar import SIMULATOR_VERSION, simulator_version
from radcal.session.salvage import simulator_change
from radcal.storage.records import write_json
from radcal.storage.runs import Record, RunStore

FLAT, ORBIT = {"altitude_m": 1000.0}, {"altitude_m": 7e5, "incidence_deg": 33.0}


def reference_run(folder, simulator):
    RunStore(folder / "runs").put(
        Record("a" * 20, {"dyke": np.ones(3, np.float32)}, None, 1.0), {"simulator": simulator}
    )
    write_json(folder / "passes/1/reference.json", [{"key": "a" * 20, "parameters": {}}])


@pytest.mark.parametrize(
    ("radar", "simulator", "told"),
    [
        (FLAT, {"kind": "builtin", "version": SIMULATOR_VERSION - 1}, True),
        # the reference run is the first to be made anew: it is said once
        (FLAT, {"kind": "builtin", "version": SIMULATOR_VERSION}, False),
        # passes over a curved earth have a version of their own
        (ORBIT, {"kind": "builtin", "version": SIMULATOR_VERSION}, True),
        (FLAT, {"kind": "command", "version": "2"}, False),
        (FLAT, {}, False),
    ],
)
def test_runs_of_an_earlier_version_are_said_to_be_made_anew(tmp_path, build_case, radar, simulator, told):
    reference_run(tmp_path, simulator)
    said = simulator_change(tmp_path, build_case(radar=radar))
    assert len(said) == told
    if told:
        now, then = simulator_version("curved" if radar is ORBIT else "flat"), simulator["version"]
        assert f"simulator is version {now} now, the runs of {tmp_path} are of version {then}" in said[0]
        assert f"runs are made anew, and the old ones are kept in {tmp_path}/runs" in said[0]


def test_nothing_is_said_where_there_are_no_runs(tmp_path, case):
    assert simulator_change(tmp_path / "new", case) == []
    write_json(tmp_path / "passes/1/reference.json", [{"key": "b" * 20, "parameters": {}}])
    assert simulator_change(tmp_path, case) == []
