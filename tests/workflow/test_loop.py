"""The loop in one process, on a scene of a few thousand pixels."""

from __future__ import annotations

import numpy as np
import pytest

from radcal.calibration.loop import calibrate
from radcal.calibration.steps import design_line, progress_line, propose_all, train_all
from radcal.config import Stop, case_from
from radcal.measurement.sources import make_measurement
from radcal.objectives import make_objectives
from radcal.objectives.history import History
from radcal.radar.projection import make_geometry
from radcal.scene.model import Scene
from radcal.scene.slant_range import flat_incidence_deg
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore
from radcal.targets.target import Targets
from radcal.targets.target_fit import make_target

TRUTH = {"field": [6.1, 14.2, 21.5, 3.3], "lake": [10.0, 20.0, 5.0, 8.0]}


@pytest.fixture(scope="module")
def parts():
    material = np.ones((70, 90), dtype=np.uint8)
    material[:, 45:] = 2
    scene = Scene("tiny", ("field", "lake"), material, None, 1.0, flat_incidence_deg(15.0, 40.0, 70))
    case = case_from(
        {
            "scene": {
                "source": "slant_range",
                "labels": "-",
                "names": "-",
                "near_incidence_deg": 15,
                "far_incidence_deg": 40,
            },
            "materials": {name: {"calibrate": True, "start": [5, 5, 5, 5]} for name in TRUTH},
            "measurement": {"source": "synthetic", "synthetic": {"parameters": TRUTH}},
            "objective": "density",
            "target": {"pixels": 500},
            "design": {"size": 3},
            "optimiser": {"population": 20, "evaluations": 400},
            "stop": {"rms": 1e-4, "max_runs": 30},
        }
    )
    geometry = make_geometry(scene, case.radar)
    simulator = BuiltinSimulator(geometry, case.radar, {name: m.law for name, m in case.materials.items()})
    measurement = make_measurement(case, geometry, simulator)
    targets = Targets({name: make_target(name, geometry, measurement, case.target, case.seed) for name in TRUTH})
    return case, simulator, geometry, scene, targets


@pytest.fixture(scope="module")
def calibrated(parts, tmp_path_factory):
    case, simulator, geometry, scene, targets = parts
    store = RunStore(tmp_path_factory.mktemp("runs"))
    seen = []
    history, decision = calibrate(case, Runner(store, simulator, geometry, scene.identity, case), targets, seen.append)
    return history, decision, store, seen


def before_infill(history):
    return History(run for run in history.runs if run.kind != "infill")


def test_both_materials_end_for_a_reason(parts, calibrated):
    case, *_, targets = parts
    history, decision, store, seen = calibrated
    assert decision.ended
    for name in targets:
        best = history.best(name).rms
        assert best < 0.2 * history.runs[0].scores[name].rms
        if decision.materials[name].reason == "rms":
            assert best <= case.stop.rms
    assert [run.kind for run in history.runs[:4]] == ["reference"] + ["design"] * 3
    assert len(history.infill) >= 2
    assert len(list(store.folder.glob("*.h5"))) == len({run.key for run in history.runs})
    assert len(seen) == 1 + len(history.infill)


def test_again_from_the_store_is_the_same_without_a_run(parts, calibrated):
    case, _, geometry, scene, targets = parts
    history, _, store, _ = calibrated

    class Never:
        identity = parts[1].identity

        def run(self, parameters, noise_seed):
            raise AssertionError("a finished run was made again")

    case = case.model_copy(update={"stop": Stop(rms=1e-4, max_runs=5)})  # two iterations of the same
    again, _ = calibrate(case, Runner(store, Never(), geometry, scene.identity, case), targets)
    assert again.runs == tuple(run for run in history.runs if run.kind != "infill" or run.index < 2)


def test_results_do_not_depend_on_the_number_of_processes(parts, calibrated):
    case, *_, targets = parts
    design = before_infill(calibrated[0])
    objectives = make_objectives(case, targets)
    one, two = (train_all(design, case, objectives, processes) for processes in (1, 2))
    for name in targets:
        assert len(np.unique(one[name].scales)) > 4  # those that were found, and not their start
        np.testing.assert_array_equal(one[name].scales, two[name].scales)
        np.testing.assert_array_equal(one[name].q2, two[name].q2)
        assert one[name].status == two[name].status
    first, second = (
        propose_all(trained, objectives, design, case, 0, Stop(rms=1e-9), processes)
        for trained, processes in ((one, 1), (two, 2))
    )
    assert first == second
    assert {proposal.mode for proposal in first.values()} <= {"exploit", "explore"}


def test_an_ended_material_repeats_its_best(parts, calibrated):
    case, *_, targets = parts
    design = before_infill(calibrated[0])
    proposals = propose_all({}, make_objectives(case, targets), design, case, 0, Stop(rms=10.0))
    for name in targets:
        assert proposals[name].mode == "ended"
        assert proposals[name].parameters == design.best(name).parameters


def test_the_progress_line_counts_and_names_the_worst(parts, calibrated):
    *_, targets = parts
    design = before_infill(calibrated[0])
    several = progress_line(design, list(targets), Stop(rms=1e-9), "density")
    assert several.startswith("run   3 (iteration 0): 0 of 2 materials within tolerance, worst ")
    assert "best rms" in progress_line(design, ["field"], Stop(rms=1e-9), "density")


def test_the_line_of_a_design_run_tells_how_near_it_is(parts, calibrated):
    *_, targets = parts
    history, _, store, _ = calibrated
    run = history.runs[3]
    record = store.get(run.key, list(targets))
    rms = {name: score.rms for name, score in run.scores.items()}
    (low, best), (high, worst) = sorted(rms.items(), key=lambda item: item[1])
    line = f"design run 3 of 12: {record.seconds:.1f} s, rms "
    assert design_line(3, 12, record, targets) == f"{line}{best:.2e} ({low}) to {worst:.2e} ({high})"
    one = Targets({"lake": targets["lake"]})
    assert design_line(3, 12, record, one) == f"{line}{rms['lake']:.2e}"
