"""The loop with a law of six parameters, more than the moments of a density."""

import numpy as np
import pytest
from calibration_samples import drawn_target

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

BOUNDS = [[-25, -15], [5, 15], [1, 4], [0, 4], [1, 3], [-2, 0]]


@pytest.fixture
def case():
    ends = {"near_incidence_deg": 15, "far_incidence_deg": 40}
    hidden = {"parameters": {"field": [-19.0, 11.0, 2.5, 2.0, 2.0, -1.0]}, "warp_px": 0}
    return case_from(
        {
            "scene": {"source": "slant_range", "labels": "-", "names": "-", **ends},
            "materials": {"field": {"calibrate": True, "law": "ulaby_dobson", "bounds": BOUNDS}},
            "measurement": {"source": "synthetic", "synthetic": hidden},
            "registration": {"method": "none"},
            "objective": "density",
            "target": {"pixels": 500},
            "design": {"size": 2},
            "optimiser": {"population": 20, "evaluations": 200},
            "stop": {"rms": 1e-9, "max_runs": 4},
        }
    )


def test_more_parameters_than_moments_do_not_stop_the_loop(case, tmp_path):
    scene = Scene("tiny", ("field",), np.ones((70, 60), np.uint8), None, 1.0, flat_incidence_deg(15.0, 40.0, 70))
    geometry = make_geometry(scene, case.radar)
    simulator = BuiltinSimulator(geometry, case.radar, case.laws)
    # the hidden truth with the noise of the runs: it can be reached exactly
    hidden = case.measurement.synthetic.parameters
    measurement = Measurement(simulator.run(hidden, noise_seed(case)), "the runs' noise", hidden)
    target = drawn_target(case, "field", geometry, measurement)
    runner = Runner(RunStore(tmp_path), simulator, geometry, scene.identity, case)
    history, decision = calibrate(case, [runner], [Targets({"field": target})])
    assert decision.reason == "max_runs"
    assert len(history.best("field").parameters) == 6
