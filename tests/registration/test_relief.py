"""Slope of an image on relief, against the slope that it was made with, and from the wrong side."""

from dataclasses import replace

import numpy as np
import pytest
from registration_samples import RADAR, hills

from radcal.errors import MeasurementError
from radcal.radar.projection import make_geometry
from radcal.registration.relief import ReliefSlope, check_relief, relief_slopes


@pytest.fixture(scope="module")
def seen(build_scene):
    """Two materials on hills with slopes of 10 degrees (sd), from either side."""
    material = np.where(np.add.outer(np.arange(220) // 30, np.arange(220) // 40) % 2, 1, 2).astype(np.uint8)
    rough = hills((220, 220), 10.0)
    scene = build_scene(lambda *_: rough, cells=(220, 220), names=("dyke", "grass"), material=material)
    return {side: make_geometry(scene, RADAR.model_copy(update={"look_side": side})) for side in ("right", "left")}


def image_of(geometry, angle, db_per_deg):
    """Four looks, a level of each material and a slope over an angle."""
    speckle = 10.0 * np.log10(np.random.default_rng(2).gamma(4.0, 0.25, geometry.shape))
    return (speckle - 15.0 * (geometry.material == 1) + db_per_deg * angle).astype(np.float32)


def relief_slope(image, geometry, radar):
    """Slope of one image, None without enough relief."""
    return next(iter(relief_slopes([image], geometry, radar)), None)


def test_slope_is_that_of_the_image(seen):
    found = relief_slope(image_of(seen["right"], seen["right"].incidence_deg, -0.23), seen["right"], RADAR)
    assert found.db_per_deg == pytest.approx(-0.23, abs=4 * found.error)
    assert 0.0 < found.error < 0.02
    # independent speckle of sd 2.3 dB in as many pixels has about this standard error
    pixels = np.count_nonzero(seen["right"].material)
    assert found.error == pytest.approx(2.3 / (found.spread_deg * np.sqrt(pixels)), rel=0.35)
    # tan and tan + cot of angles about 45 degrees, 0.0758 dB per degree each
    local = RADAR.model_copy(update={"radiometry": "sigma0_local"})
    alone = relief_slope(image_of(seen["right"], seen["right"].incidence_deg, -0.23), seen["right"], local)
    assert found.least == pytest.approx(-0.16, rel=0.1)
    assert alone.least == pytest.approx(-0.08, rel=0.15)
    assert check_relief(found, RADAR, "a.tif", 0.0) == []


def test_relief_that_says_nothing(seen):
    image = image_of(seen["right"], seen["right"].incidence_deg, 0.2)
    assert relief_slope(image, seen["right"], RADAR.model_copy(update={"radiometry": "gamma0_rtc"})) is None
    flat = replace(seen["right"], incidence_deg=45.0 + (seen["right"].incidence_deg - 45.0) / 20.0)
    assert relief_slope(image, flat, RADAR) is None
    assert relief_slope(np.full_like(image, np.nan), seen["right"], RADAR) is None
    few = image.copy()
    few[:, 90:] = np.nan  # 18 blocks
    assert relief_slope(few, seen["right"], RADAR) is None


def test_an_image_of_the_other_side_is_refused(seen):
    right, left = seen["right"], seen["left"]
    known = np.isfinite(right.ground[0])
    on_ground = np.full((220, 220), np.nan)
    on_ground[tuple(np.rint(right.ground[:, known]).astype(int))] = right.incidence_deg[known]
    there = np.isfinite(left.ground[0])
    angle = np.full(left.shape, np.nan)
    angle[there] = on_ground[tuple(np.rint(left.ground[:, there]).astype(int))]
    wrong = RADAR.model_copy(update={"look_side": "left"})
    found = relief_slope(image_of(left, angle, -0.2), left, wrong)
    said = r"^measurement\.path: a\.tif changes by \+0\.\d\d dB \(standard error 0\.0\d\) .* with "
    with pytest.raises(MeasurementError, match=said):
        check_relief(found, wrong, "a.tif", 0.0)


@pytest.mark.parametrize(
    ("slope", "error", "slope_error", "said"),
    [
        (0.09, 0.015, 0.0, "refused"), (0.09, 0.019, 0.0, "told"), (0.07, 0.001, 0.0, "told"),
        (-0.01, 0.02, 0.0, "told"), (-0.01, 0.025, 0.0, ""),
        (-0.01, 0.02, 3.0, ""), (-0.01, 0.02, 2.5, "told"), (-0.3, 0.001, 0.0, ""),
    ],
)  # fmt: skip
def test_only_what_is_certain_is_told(slope, error, slope_error, said):
    """Constant gamma has -0.16 dB per degree: half of it is 0.08, and five or three standard errors are asked for."""
    found = ReliefSlope(slope, error, -0.16, 4.0)
    if said == "refused":
        with pytest.raises(MeasurementError, match="radar.look_side right and radar.heading_deg 0; set the side"):
            check_relief(found, RADAR, "a.tif", slope_error)
        return
    told = [(one.code, one.severity) for one in check_relief(found, RADAR, "a.tif", slope_error)]
    assert told == [("relief_not_followed", "warning")] * bool(said)
