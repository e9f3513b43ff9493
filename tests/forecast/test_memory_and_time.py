"""What jobs ask for, against scenes and geometries that are made."""

import json

import numpy as np
import pytest
from raster_files import write_raster
from rasterio.transform import from_origin

from radcal.config import Radar, case_from
from radcal.errors import ConfigError
from radcal.forecast.memory_and_time import memory_mb, runtime_minutes, values_of
from radcal.radar.projection import make_geometry
from radcal.radar.size import refinement


def write(path, values, pixel_m):
    where = {"crs": "EPSG:32631", "transform": from_origin(6e5, 5.8e6, pixel_m, pixel_m)}
    return str(write_raster(path, values, **where))


@pytest.fixture
def rasters(tmp_path):
    """A scene of 40 x 60 pixels of 10 m, its materials twice as fine."""
    (tmp_path / "names.json").write_text('{"1": "dyke"}')
    return {
        "elevation": write(tmp_path / "e.tif", np.zeros((40, 60), dtype=np.float32), 10.0),
        "materials": write(tmp_path / "m.tif", np.ones((80, 120), dtype=np.uint8), 5.0),
        "names": str(tmp_path / "names.json"),
        "vertical_datum": "EGM96",
    }


# peaks measured in whole workflows and in benchmarks/simulator_scale.py, which has objects [MB]
@pytest.mark.parametrize(
    ("stage", "values", "peak_mb"),
    [
        ("scene", 9_000_000, 552),
        ("geometry", 56_250_000, 4012),
        ("measurement", 9_000_000, 1325),
        ("final_runs", 56_250_000, 3072),
        ("target", 9_000_000, 1102),
        ("report", 9_000_000, 971),
        ("registration", 2_250_000, 817),
    ],
)
def test_memory_is_enough_for_what_was_measured_and_not_much_more(stage, values, peak_mb):
    size = {"scene" if stage == "scene" else "image": values}
    assert 1.2 * peak_mb < memory_mb(stage, size) < 2.0 * peak_mb + 1000
    assert memory_mb(stage, size, attempt=3) == 4 * memory_mb(stage, size)


def test_time_is_that_of_the_runs_and_of_the_scene():
    assert runtime_minutes("scores", {"image": 10**8}) == 10
    assert runtime_minutes("train", {"image": 10**8}) == 60
    assert runtime_minutes("verify", {"image": 0}, simulation_s=4 * 900) == 70
    assert runtime_minutes("geometry", {"image": 56_250_000}) == 10 + 29  # 30 s for a million, and it takes one


def test_a_case_has_the_values_of_its_finest_array(rasters):
    def values(range_m, azimuth_m):
        radar = {"range_spacing_m": range_m, "azimuth_spacing_m": azimuth_m}
        radar |= {"range_resolution_m": 60.0, "azimuth_resolution_m": 60.0}
        scene = {"source": "raster", **rasters}
        return values_of(case_from({"scene": scene, "radar": radar, "materials": {"dyke": {"calibrate": True}}}))

    assert values(40.0, 40.0) == {"scene": 4 * 2400, "image": 2400}
    assert json.dumps(values(5.0, 2.5)["image"]) == str(16 * 2400)


def test_pixels_too_small_for_any_machine_are_refused_before_any_is_made(scene):
    fine = Radar(altitude_m=20_000.0, range_spacing_m=0.003, azimuth_spacing_m=2.0)
    facets = scene.material.size * refinement(scene.cell_m, fine) ** 2
    with pytest.raises(ConfigError, match=rf"^radar\.range_spacing_m is 0\.003 and .*_m 2: .* {facets:,} facets and"):
        make_geometry(scene, fine)
