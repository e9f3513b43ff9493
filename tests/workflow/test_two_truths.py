"""Two laws with the same density: classes of incidence tell them apart on rough ground, a second pass on flat."""

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter
from scipy.optimize import least_squares

from radcal import skewnormal
from radcal.calibration.loop import calibrate
from radcal.calibration.steps import noise_seed
from radcal.config import case_from
from radcal.image.model import Measurement
from radcal.laws import LAWS
from radcal.objectives import make_objectives, objective_class
from radcal.radar.projection import make_geometry
from radcal.registration.registered import register
from radcal.scene.model import Scene
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore
from radcal.targets.target_fit import make_targets, sampling_rms

LAW = LAWS["mangia"]
FIRST = [6.1, 14.2, 21.5, 3.3]
BOUNDS = [[-60.0, 50.0], [0.0, 50.0], [0.0, 200.0], [0.0, 60.0]]
CELLS = 120


class Ground:
    """A square of 600 m of one material, flat or with relief, seen by one pass."""

    def __init__(self, relief_m, depression_deg=45.0, **keys):
        heights = gaussian_filter(np.random.default_rng(3).standard_normal((CELLS, CELLS)), 6, mode="wrap")
        self.case = case_from(
            {
                "materials": {"field": {"calibrate": True, "bounds": BOUNDS}},
                "measurement": {"synthetic": {"parameters": {"field": FIRST}, "warp_px": 0}},
                "registration": {"method": "none"},
                "radar": {"depression_deg": depression_deg, "radiometry": "sigma0_local"},
                "target": {"pixels": 4000},
                "design": {"size": 2},
                "optimiser": {"population": 20, "evaluations": 400},
                **keys,
            }
        )
        elevation = heights * (relief_m / heights.std())
        self.scene = Scene("square", ("field",), np.ones((CELLS, CELLS), np.uint8), elevation, 5.0)
        self.geometry = make_geometry(self.scene, self.case.radar)
        self.simulator = BuiltinSimulator(self.geometry, self.case.radar, self.case.laws)
        self.pixels = self.geometry.pixels("field")

    def image_db(self, x, seed):
        return self.simulator.run({"field": list(x)}, seed)

    def density(self, x, seed=1):
        return skewnormal.fit(self.image_db(x, seed).ravel()[self.pixels]).dp

    def twin(self, x4, start):
        """Another law with the same density as the first."""
        wanted = skewnormal.centred(self.density(FIRST))
        low, high = np.array(BOUNDS[:3]).T
        found = least_squares(
            lambda x: skewnormal.centred(self.density([*x, x4])) - wanted,
            start,
            bounds=(low, high),
            diff_step=1e-4,
            max_nfev=60,
        )
        return [*(float(v) for v in found.x), x4]


@pytest.fixture(scope="module")
def rough():
    return Ground(8.0, objective="classes")


@pytest.fixture(scope="module")
def twin(rough):
    return rough.twin(12.0, [1.5, 25.0, 85.0])


def measured(ground, truth):
    """Targets of an image of that truth, with speckle of its own."""
    case = ground.case
    image = ground.image_db(truth, 20)
    measurement = Measurement(image, "another truth", {"field": truth})
    registered = register(image, measurement, case.registration)
    return case, make_targets(case, ground.geometry, registered, image, objective_class(case.objective).misfit)


def test_one_density_does_not_tell_them_apart(rough, twin):
    incidence = rough.geometry.incidence_deg.ravel()[rough.pixels]
    assert skewnormal.density_rms(rough.density(FIRST), rough.density(twin)) < 1e-6
    assert LAW.largest_difference_db(FIRST, twin, incidence) > 1.2


@pytest.mark.parametrize("which", ["first", "second"])
def test_classes_of_incidence_do_on_rough_ground(rough, twin, which, tmp_path):
    truth, other = (FIRST, twin) if which == "first" else (twin, FIRST)
    case, targets = measured(rough, truth)
    target, objective = targets["field"], make_objectives(case, [targets])["field"]
    runs = [(x, rough.image_db(x, noise_seed(case)).ravel()[target.pixels]) for x in (truth, other)]
    costs = [objective.worth(x, objective.statistics(values))[1] for x, values in runs]
    # half a difference in chi squared: odds of e^5 for the truth
    assert costs[1] - costs[0] > 5.0
    # and the law found is the one and not the other
    runner = Runner(RunStore(tmp_path), rough.simulator, rough.geometry, rough.scene.identity, case)
    history, decision = calibrate(case, [runner], [targets])
    assert decision.reason == "settled"
    found = history.best("field").parameters
    incidence = target.incidence_deg
    assert LAW.largest_difference_db(found, truth, incidence) < 0.5 < LAW.largest_difference_db(found, other, incidence)


def test_a_second_pass_does_on_flat_ground():
    first, second = Ground(0.0), Ground(0.0, depression_deg=62.0)
    twin = first.twin(18.0, [-6.0, 35.0, 50.0])
    enough = sampling_rms(first.density(FIRST), 4000, np.random.default_rng(1))
    assert skewnormal.density_rms(first.density(FIRST), first.density(twin)) < 0.1 * enough
    # not even classes of incidence: the two laws are the same where flat ground is seen
    incidence = first.geometry.incidence_deg.ravel()[first.pixels]
    assert LAW.largest_difference_db(FIRST, twin, incidence) < 0.1
    assert skewnormal.density_rms(second.density(FIRST), second.density(twin)) > 10.0 * enough
