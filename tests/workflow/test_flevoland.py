"""The measured image of Flevoland against the table that comes with it."""

import os
from pathlib import Path

import numpy as np
import pytest
from calibration_samples import drawn_target
from raster_files import read_image
from scipy import stats

from radcal.config import load
from radcal.ground.pixels import point_targets
from radcal.image.looks import estimate_looks
from radcal.image.model import Measurement
from radcal.radar.projection import make_geometry
from radcal.scene.sources import make_scene
from radcal.targets.target import Targets

pytestmark = pytest.mark.skipif("RADCAL_DATA" not in os.environ, reason="RADCAL_DATA is not set: no measured data")

ROOT = Path(__file__).resolve().parents[2]


def table():
    """Pixels, mean, standard deviation and skewness by class, from the data's own description."""
    rows = {}
    for line in (Path(os.environ["RADCAL_DATA"]) / "README.md").read_text().splitlines():
        cells = [cell.strip() for cell in line.strip("|").split("|")]
        if len(cells) == 7 and cells[0].isdigit():
            rows[cells[1]] = (int(cells[2].replace(",", "")), *(float(cell) for cell in cells[4:]))
    return rows


@pytest.fixture(scope="module")
def parts():
    case = load([ROOT / "config" / "flevoland.yaml"])
    geometry = make_geometry(make_scene(case.scene, list(case.materials)), case.radar)
    path = Path(os.environ["RADCAL_DATA"]) / "flevoland" / "sigma0_hh.tif"
    return case, geometry, Measurement(read_image(path, case.measurement, geometry.shape).image_db, path.name)


def test_classes_have_the_moments_of_the_table(parts):
    expected, (_, geometry, measurement) = table(), parts
    assert len(expected) == 15
    assert list(expected) == list(geometry.names)
    for name, (pixels, *moments) in expected.items():
        values = measurement.image_db.ravel()[geometry.pixels(name)].astype(float)
        assert values.size == pixels
        found = [values.mean(), values.std(), stats.skew(values)]
        np.testing.assert_allclose(found, moments, atol=0.0051, err_msg=name)


def test_looks_are_those_of_the_literature_less_what_processing_takes(parts):
    case, geometry, measurement = parts
    looks = estimate_looks(measurement.image_db, geometry.material, case.radar)
    assert 2.5 < looks.low < looks.looks < looks.high < 3.5


def test_buildings_are_flagged_and_surfaces_are_not(parts):
    case, geometry, measurement = parts
    case = case.model_copy(update={"validation": None})
    flags = {"point targets": point_targets(measurement.image_db, geometry.material, case.radar)}
    found = estimate_looks(measurement.image_db, geometry.material, case.radar)
    targets = Targets(
        {name: drawn_target(case, name, geometry, measurement, flags) for name in geometry.names},
        looks=found.looks,
    )
    assert [name for name in targets if targets.textured(name)] == ["buildings"]
    # most surfaces are described by a skew normal, as far as a thousand pixels tell
    assert sum(target.goodness.ad_p > 0.05 for target in targets.values()) >= 10
