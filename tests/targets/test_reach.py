"""Bounds that cannot reach the measured level."""

import numpy as np
import pytest
from calibration_samples import make_target
from config_samples import synthetic

from radcal.config import case_from
from radcal.errors import ConfigError
from radcal.laws import LAWS
from radcal.targets.reach import check_reach, law_range_db
from radcal.targets.target import Targets

LAW = LAWS["mangia"]


def case_with(**material):
    materials = {"crops": {"calibrate": True, **material}}
    return case_from({"materials": materials, "radar": {"looks": 4}, **synthetic(parameters={"crops": [1, 2, 3, 4]})})


def targets_at(level_db, **changes):
    """Pixels whose level of law is this, without spread but for four looks' mean."""
    values = level_db - 0.5655 + np.linspace(-1.0, 1.0, 60)
    return Targets({"crops": make_target(values, np.linspace(30.0, 40.0, 60), dp=[0.0, 1.0, 0.0], **changes)})


def test_range_of_a_law_over_its_bounds():
    box = [[-20.0, -5.0], [0.0, 30.0], [0.0, 10.0], [1.0, 5.0]]
    angle = np.array([30.0, 40.0, 63.0])
    low, high = law_range_db(LAW, box, angle)
    np.testing.assert_allclose(low, -20.0)
    np.testing.assert_allclose(high, LAW(np.radians(angle), [-5.0, 30.0, 10.0, 1.0]))


def test_the_mean_of_the_logarithm_of_speckle_is_no_part_of_the_level():
    """Ground of -9 dB with four looks, whose dB values have a mean of -9.57 dB, and a law 3 dB below it or less."""
    values = 10.0 * np.log10(np.random.default_rng(1).gamma(4.0, 0.25, 200_000)) - 9.0
    angle = np.linspace(30.0, 40.0, values.size)
    for highest, refused in ((-11.9, False), (-12.1, True)):
        low = [[highest - 0.2, highest], [0, 1e-3], [0, 1e-3], [0, 1]]
        case = case_with(bounds=low, start=[highest, 0, 0, 0])
        targets = Targets({"crops": make_target(values, angle, dp=[0.0, 1.0, 0.0])})
        if not refused:
            check_reach(case, targets)
            continue
        with pytest.raises(ConfigError, match="the measured level is -9.0 dB"):
            check_reach(case, targets)


@pytest.mark.parametrize(("level", "refused"), [(-2.9, False), (-3.1, True), (12.0, False)])
def test_a_level_more_than_3_db_below_all_laws_is_refused(level, refused):
    case, targets = case_with(bounds=[[0, 50]] * 4), targets_at(level)
    if not refused:
        check_reach(case, targets)
        return
    with pytest.raises(ConfigError) as error:
        check_reach(case, targets)
    said = str(error.value)
    assert said.startswith("materials.crops.bounds: inside them the law 'mangia' gives 0.0 to 1")
    assert "the measured level is -3.1 dB" in said
    assert "expected bounds between which the law reaches it to within 3 dB" in said


def test_a_level_above_all_laws_is_refused_unless_it_is_the_noises():
    low = [[-40, -30], [0, 5], [0, 5], [1, 5]]
    case = case_with(bounds=low, start=[-35, 2, 2, 2])
    with pytest.raises(ConfigError, match="the measured level is -15.0 dB"):
        check_reach(case, targets_at(-15.0))
    check_reach(case, targets_at(-15.0, noise_db=-16.0))
    # up to 3 dB above the highest level of the law, -30 + 5 cos(phi) + 5 exp(-phi^2), is allowed
    at = np.radians(np.linspace(30.0, 40.0, 60))
    highest = float(np.mean(-30.0 + 5.0 * np.cos(at) + 5.0 * np.exp(-(at**2))))
    check_reach(case, targets_at(highest + 2.9))
    with pytest.raises(ConfigError, match="the measured level is"):
        check_reach(case, targets_at(highest + 3.1))


def test_normalised_images_and_external_laws_have_no_level():
    image = case_with(bounds=[[0, 50]] * 4).model_copy(deep=True)
    image = image.model_copy(update={"target": image.target.model_copy(update={"normalisation": "image"})})
    check_reach(image, targets_at(-30.0))
    outside = image.model_copy(
        update={
            "target": image.target.model_copy(update={"normalisation": "none"}),
            "materials": {"crops": image.materials["crops"].model_copy(update={"law": "external", "names": ["p"]})},
        }
    )
    assert not outside.laws["crops"].has_curve
    check_reach(outside, targets_at(-30.0))
