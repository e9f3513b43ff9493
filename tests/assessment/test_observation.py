"""Cells of all materials in one pass: masks, leaks, and parts of the ground that are held out."""

from types import SimpleNamespace

import numpy as np
import pytest
from assessment_samples import LINE, LINE_X
from geometry_samples import of_pixels

from radcal.assessment.observation import observe
from radcal.config import Radar, RegistrationConfig, TargetConfig, Validation
from radcal.image.model import Measurement
from radcal.laws import law_for
from radcal.posterior.cells import Simulated
from radcal.registration.registered import register
from radcal.sections.simulator import BuiltinSimulation

SHAPE = (96, 120)
ROW, COLUMN = np.indices(SHAPE)
INCIDENCE = (26.1 + 0.125 * ROW).astype(np.float32)
"""Three degrees in each block of 24 rows."""
LEVEL = np.asarray(LINE(np.radians(INCIDENCE.astype(np.float64)), LINE_X))
NAMES = ("dyke", "wood", "program", "pond")


def geometry(area=None):
    """Four materials side by side, 48 columns of the first and of the second each, and a pond of 25 pixels."""
    material = np.where(COLUMN < 48, 1, np.where(COLUMN < 96, 2, 3)).astype(np.uint8)
    material[:5, 100:105] = 4
    weight = {} if area is None else {"facet_weight": area.ravel().astype(np.float32)}
    return of_pixels(NAMES, material, INCIDENCE, **weight)


def found(measured_db=LEVEL, simulated_db=LEVEL, *, area=None, simulator=None, validation=None, **radar):
    """Cells of the measured image, with speckle of 4 looks, and a simulated image without speckle."""
    rng = np.random.default_rng(3)
    speckle = 10.0 * np.log10(rng.gamma(4.0, 0.25, SHAPE))
    image = (measured_db + speckle).astype(np.float32)
    law, external = LINE, law_for("external", names=["mv"])
    case = SimpleNamespace(
        laws={"dyke": law, "wood": law, "program": external, "pond": law},
        materials={name: SimpleNamespace(calibrate=name in ("dyke", "pond")) for name in NAMES},
        target=TargetConfig(margin_px=0, snr_db=6.0, leave_out_point_targets=False),
        radar=Radar(nesz_db=-22.0, radiometry="sigma0_local").model_copy(update=radar),
        simulator=BuiltinSimulation() if simulator is None else simulator,
        validation=validation,
    )
    registered = register(
        simulated_db.astype(np.float32), Measurement(image, "a.tif"), RegistrationConfig(method="none")
    )
    simulated = [Simulated(simulated_db.astype(np.float32), dict.fromkeys(NAMES, LINE_X))]
    levels = SimpleNamespace(normalisation="none")
    return observe(case, geometry(area), registered, simulated, levels, None)


def blocks(cells):
    """Block of 24 rows of each cell."""
    return np.unique(((cells.incidence_deg - 26.1) / 3.0).astype(int)).tolist()


def test_materials_with_few_pixels_and_fixed_ones_without_a_curve_are_absent():
    cells = found()
    assert list(cells) == ["dyke", "wood"]
    for own in cells.values():
        assert own.pixels.sum() == 48 * 96
        assert blocks(own) == [0, 1, 2, 3]
        assert own.looks == pytest.approx(4.0, rel=0.05)
        assert np.all(own.noise_db > -30.0)


def test_pixels_are_in_the_noise_by_the_simulated_level_alone():
    """The first block is dark in the measured image, the last one in the simulated image."""
    measured = np.where(ROW < 24, -25.0, LEVEL)
    simulated = np.where(ROW >= 72, -25.0, LEVEL)
    for own in found(measured, simulated).values():
        # the local level is that of nine pixels
        assert 48 * 68 <= own.pixels.sum() <= 48 * 76
        assert own.incidence_deg.max() < INCIDENCE[76, 0]
        assert own.incidence_deg.min() < INCIDENCE[24, 0]
        assert own.measured_db.min() < -23.0
    program = SimpleNamespace(own=False)
    dark = found(measured, simulated, simulator=program)["dyke"]
    assert blocks(dark) == [0, 1, 2, 3]
    assert np.isneginf(dark.noise_db).all()


def test_cells_into_which_other_ground_leaks_are_left_out_of_fixed_materials_only():
    leaking = (ROW < 24) & (COLUMN % 48 < 24)
    cells = found(simulated_db=LEVEL + 1.2 * leaking)
    assert cells["dyke"].pixels.sum() == 48 * 96
    assert cells["dyke"].beside_db.max() > 0.8
    assert cells["wood"].pixels.sum() == 48 * 96 - 24 * 24
    assert cells["wood"].beside_db.max() < 0.4


def test_the_area_of_the_ground_is_no_leak_where_the_radiometry_has_it():
    raised = (ROW < 24) & (COLUMN % 48 < 24)
    area = np.where(raised, 10.0**0.12, 1.0)
    for radiometry, kept in (("sigma0_ref", 48 * 96), ("sigma0_local", 48 * 96 - 24 * 24)):
        cells = found(simulated_db=LEVEL + 1.2 * raised, area=area, radiometry=radiometry)["wood"]
        assert cells.pixels.sum() == kept
    assert found(area=area, radiometry="sigma0_ref")["dyke"].area_db.max() == pytest.approx(1.2, abs=1e-5)


@pytest.mark.parametrize(
    ("validation", "held"),
    [
        (None, []),
        ({"keep": "even"}, [1, 3]),
        ({"keep": "odd"}, [0, 2]),
        ({"keep": "both"}, [1, 3]),
        ({"keep": "fields"}, []),
    ],
)
def test_blocks_that_are_held_out_are_a_fold_of_calibrated_materials(validation, held):
    config = None if validation is None else Validation(rows=24, means=12, **validation)
    cells = found(validation=config)
    assert blocks(cells["dyke"].part(cells["dyke"].fold == 1)) == held
    assert blocks(cells["dyke"].part(cells["dyke"].fold == 0)) == [k for k in range(4) if k not in held]
    assert not cells["wood"].fold.any()
