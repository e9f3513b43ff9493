"""A field and a lake of the built-in simulator in slant range, in three incidence-angle bins."""

from dataclasses import replace

import numpy as np
import pytest
from calibration_samples import BOUNDS, TRUTH
from config_samples import flat

from radcal.calibration.loop import calibrate
from radcal.config import case_from
from radcal.inference.misfit import BinMisfit
from radcal.measurement.sources import make_measurement
from radcal.radar.projection import make_geometry
from radcal.registration.registered import register
from radcal.scene.model import Scene
from radcal.scene.slant_range import flat_incidence_deg
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.speckle.texture import texture_db, texture_order
from radcal.storage.runs import RunStore
from radcal.targets.target_fit import make_targets


@pytest.fixture(scope="session")
def parts():
    material = np.ones((90, 110), dtype=np.uint8)
    material[:, 55:] = 2
    scene = Scene("tiny", ("field", "lake"), material, None, 1.0, flat_incidence_deg(20.0, 45.0, 90))
    case = case_from(
        {
            **flat(far_incidence_deg=45),
            "objective": "classes",
            "materials": {name: {"calibrate": True, "bounds": BOUNDS} for name in TRUTH},
            # displacements are not what is looked at here, and no registration would find them
            "measurement": {"source": "synthetic", "synthetic": {"parameters": TRUTH, "warp_px": 0.0}},
            "registration": {"method": "none"},
            "radar": {"looks": 4, "nesz_db": -40},
            "target": {"pixels": 1000, "incidence_classes": 3},
            "validation": {"rows": 20, "means": 10, "keep": "even"},
            "design": {"size": 2},
            "optimiser": {"population": 20, "evaluations": 100},
            "stop": {"max_runs": 20},
        }
    )
    geometry = make_geometry(scene, case.radar)
    simulator = BuiltinSimulator(geometry, case.radar, case.laws)
    measurement = make_measurement(case, geometry, simulator)
    # texture on one of them: fewer looks than the sensor has
    image = measurement.image_db.copy()
    lake = geometry.material == 2
    u = np.random.default_rng(1).random(int(lake.sum()))
    image[lake] += texture_db(u, texture_order(4.0, 2.5)).astype(np.float32)
    registered = register(image, replace(measurement, image_db=image), case.registration)
    targets = make_targets(case, geometry, registered, image, BinMisfit)
    return case, simulator, geometry, scene, targets


@pytest.fixture(scope="session")
def runner(parts, tmp_path_factory):
    case, simulator, geometry, scene, _ = parts
    return Runner(RunStore(tmp_path_factory.mktemp("runs")), simulator, geometry, scene.identity, case)


@pytest.fixture(scope="session")
def calibrated(parts, runner):
    case, _, _, _, targets = parts
    return calibrate(case, [runner], [targets])
