"""The loop with laws of one, three and six parameters, and a start of another law."""

import numpy as np
import pytest

from radcal.calibration.loop import calibrate
from radcal.calibration.steps import noise_seed
from radcal.config import case_from
from radcal.image.model import Measurement
from radcal.radar.projection import make_geometry
from radcal.scene.model import Scene
from radcal.scene.slant_range import flat_incidence_deg
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore
from radcal.targets.target import Targets
from radcal.targets.target_fit import make_target

LAWS = {
    "constant_gamma": ({"bounds": [[-30, 0]]}, [-11.3]),
    "tabulated": ({"angles_deg": [15, 25, 40], "bounds": [[-20, 0]] * 3}, [-4.0, -9.5, -12.0]),
    "ulaby_dobson": (
        {"bounds": [[-25, -15], [5, 15], [1, 4], [0, 4], [1, 3], [-2, 0]]},
        [-19.0, 11.0, 2.5, 2.0, 2.0, -1.0],
    ),
}


def case_of(law, rms=0.005, max_runs=40, **keys):
    settings, hidden = LAWS[law]
    ends = {"near_incidence_deg": 15, "far_incidence_deg": 40}
    return case_from(
        {
            "scene": {"source": "slant_range", "labels": "-", "names": "-", **ends},
            "materials": {"field": {"calibrate": True, "law": law, **settings, **keys}},
            "measurement": {"source": "synthetic", "synthetic": {"parameters": {"field": hidden}, "warp_px": 0}},
            "registration": {"method": "none"},
            "objective": "density",
            "target": {"pixels": 500},
            "design": {"size": 2},
            "optimiser": {"population": 20, "evaluations": 200},
            "stop": {"rms": rms, "max_runs": max_runs},
        }
    )


def run(case, folder):
    scene = Scene("tiny", ("field",), np.ones((70, 60), np.uint8), None, 1.0, flat_incidence_deg(15.0, 40.0, 70))
    geometry = make_geometry(scene, case.radar)
    store = RunStore(folder)

    def runner(of):
        return Runner(store, BuiltinSimulator(geometry, of.radar, of.laws), geometry, scene.identity, of)

    # the hidden truth with the noise of the runs: it can be reached exactly
    hidden = case.measurement.synthetic.parameters
    image_db = BuiltinSimulator(geometry, case.radar, case.laws).run(hidden, noise_seed(case))
    measurement = Measurement(image_db, "the runs' noise", hidden)
    target = make_target("field", geometry, measurement, case.target, case.seed)
    history, decision = calibrate(case, runner(case), Targets({"field": target}), reference=runner(case.at_start))
    return history, decision, target


def test_a_law_of_three_parameters_from_a_start_of_another_law(tmp_path):
    case = case_of("tabulated", start={"law": "mangia", "parameters": [-10.0, 2.0, 4.0, 3.0]})
    history, decision, _ = run(case, tmp_path)
    assert decision.converged, decision
    assert history.runs[0].scores["field"].parameters == [-10.0, 2.0, 4.0, 3.0]
    assert [run.scores["field"].own_law for run in history.runs] == [False] + [True] * (len(history.runs) - 1)
    assert history.training("field")[0].shape == (len({run.keys[0] for run in history.runs}) - 1, 3)


def test_more_parameters_than_moments_do_not_stop_the_loop(tmp_path):
    history, decision, _ = run(case_of("ulaby_dobson", rms=1e-9, max_runs=4), tmp_path)
    assert decision.reason == "max_runs"
    assert len(history.best("field").parameters) == 6


def test_a_start_of_another_law_asks_for_its_runner():
    case = case_of("tabulated", start={"law": "mangia", "parameters": [-10.0, 2.0, 4.0, 3.0]})
    with pytest.raises(ValueError, match=r"\['field'\] start with another law"):
        calibrate(case, None, Targets({}))
