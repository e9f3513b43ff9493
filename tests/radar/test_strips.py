"""Strips of an image in azimuth against the whole image, bit for bit."""

import math
from dataclasses import replace

import numpy as np
import pytest

from radcal.config import Radar
from radcal.errors import ConfigError, StoreError
from radcal.laws import LAWS
from radcal.radar.geometry import Frame, joined, read_geometry, write_geometry
from radcal.radar.projection import make_frame, make_geometry, strips_of
from radcal.scene.model import Scene, scene_on_disk
from radcal.scene.object_generator import generate_objects
from radcal.scene.objects import Walls
from radcal.simulators.builtin import BuiltinSimulator
from radcal.storage.dataclass_groups import same

ROWS, COLUMNS = 700, 60
FINE = Radar(
    altitude_m=3000.0, range_spacing_m=0.7, azimuth_spacing_m=1.1, range_resolution_m=1.0, azimuth_resolution_m=1.6,
    looks=1.5,
)  # fmt: skip
PASSES = {
    "right": FINE,
    "left": FINE.model_copy(update={"look_side": "left", "radiometry": "gamma0_rtc"}),
    "divided": FINE.model_copy(update={"range_spacing_m": 0.4, "depression_deg": 20.0, "radiometry": "sigma0_local"}),
    "curved": Radar.model_validate({**FINE.described(), "earth": "curved", "altitude_m": 600e3, "nesz_db": -20.0}),
}


@pytest.fixture(scope="module")
def rough():
    """Hills and walls with layover and shadow, boxes and points everywhere, some across the borders of strips."""
    rng = np.random.default_rng(1)
    walls = np.kron(rng.standard_normal((ROWS // 10, COLUMNS // 10)) * 4.0, np.ones((10, 10)))
    material = np.kron(1 + rng.integers(0, 3, (ROWS // 20, COLUMNS // 20)), np.ones((20, 20))).astype(np.uint8)
    made = generate_objects((COLUMNS, ROWS), 1, trees=300, cars=150, buildings=25)
    at_borders = np.linspace(250.0, 262.0, len(made))
    objects = replace(made, y_m=np.where(np.arange(len(made)) % 5 == 0, at_borders, made.y_m))
    # half of the buildings scatter by roof and walls apart, all of them have a double bounce
    number = np.arange(len(made))  # buildings, trees, cars
    apart, building = (number < 25) & (number % 2 == 0), number < 25
    upright = Walls(np.where(apart, 0, -1).astype(np.int16), np.where(apart, -6.0, np.nan), building, ("c",))
    size = {name: np.where(number >= 325, 0.0, getattr(made, name)) for name in ("length_m", "width_m")}  # cars: points
    objects = replace(objects, rcs_dbsm=np.where(apart, np.nan, made.rcs_dbsm), walls=upright, **size)
    mixed = rng.random((ROWS, COLUMNS)) > 0.999
    elevation = walls + rng.standard_normal((ROWS, COLUMNS)) * 0.2 + 300.0
    return Scene("rough", ("a", "b", "c"), material, elevation, 1.0, objects=objects, mixed=mixed)


@pytest.mark.parametrize("name", PASSES)
@pytest.mark.parametrize("number", [2, 3])  # the first strips have 256 rows, the last one of two has 444
def test_strips_are_the_whole_image_bit_for_bit(rough, name, number, tmp_path):
    radar = PASSES[name]
    rough.write(tmp_path / "scene.h5")
    with scene_on_disk(tmp_path / "scene.h5") as scene:
        frame = make_frame(scene, radar)
    whole = make_geometry(rough, radar)
    assert whole.point_row.size > 20
    assert whole.bounces.shape[1] > 10
    assert 0.02 < whole.layover.mean() < 0.9
    laws, x = dict.fromkeys("abc", LAWS["mangia"]), {"a": [-9, 3, 2, 1], "b": [-20, 4, 1, 2], "c": [-5, 1, 0, 0]}
    strips, images = [], []
    for k, strip in enumerate(strips_of(ROWS, 1.0, radar, number, frame)):
        write_geometry(tmp_path / f"{k}.h5", make_geometry(rough, radar, strip=strip), radar)
        strips.append(read_geometry(tmp_path / f"{k}.h5"))
        images.append(strip.cut(BuiltinSimulator(strips[-1], radar, laws).run(x, 7)))
    assert same(joined(strips), whole)
    np.testing.assert_array_equal(np.hstack(images), BuiltinSimulator(whole, radar, laws).run(x, 7))
    for others in (strips[1:], strips[:-1], [make_geometry(rough, radar)]):
        with pytest.raises(StoreError, match="do not belong together"):
            joined(others)


def test_the_mean_elevation_of_a_frame_is_that_of_all_cells():
    elevation = np.random.default_rng(2).normal(300.0, 50.0, (701, 60))
    elevation[::2] *= -1.0
    scene = Scene("rough", ("a",), np.ones(elevation.shape, np.uint8), elevation, 1.0)
    frame = make_frame(scene, FINE.model_copy(update={"altitude_m": 90e3}))
    assert frame.mean_m == pytest.approx(math.fsum(elevation.ravel()) / elevation.size, abs=1e-13)
    assert frame.highest_m == elevation.max()


def test_a_strip_has_256_rows_or_more():
    radar, frame = Radar(azimuth_spacing_m=4.0), Frame(0.0, 1.0, 900.0, 1900.0)
    strips = strips_of(1000, 2.0, radar, 3, frame)
    assert [(strip.first, strip.last) for strip in strips] == [(0, 128), (128, 256), (256, 500)]
    with pytest.raises(ConfigError, match=r"^simulator\.strips is 5: the scene has 1000 rows .* at most 4 strips"):
        strips_of(1000, 2.0, radar, 5, frame)
