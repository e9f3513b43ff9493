"""Predicted memory against peaks of processes (VmHWM) that were measured in whole calibrations."""

from __future__ import annotations

import pytest

from radcal.config import Case, case_from
from radcal.forecast.expected_memory import expected_mb, peaks_mb
from radcal.radar.size import ImageSize
from radcal.scene.size import SceneSize

CHIP = (SceneSize(274_248, 8.86, 1_096_992), ImageSize(1_096_992, 274_055))
DYKE = (SceneSize(160_000, 5.0, 160_000), ImageSize(1_440_000, 754_248))
MIDDLE = (SceneSize(3_240_000, 5.0, 3_240_000), ImageSize(3_240_000, 2_548_748))
LARGE = (SceneSize(9_000_000, 5.0, 9_000_000), ImageSize(9_000_000, 7_079_855))
JOBS = ("scene", "geometry", "measurement", "run", "registration", "target", "archive", "export", "report")
# the default case and a Sentinel-1 chip; rasters of 1800 x 1800 and 3000 x 3000 cells [MB]
MEASURED = {
    "chip": (CHIP, (173, 289, 248, 281, 186, 175, 158, 195, 246)),
    "dyke": (DYKE, (131, 391, 431, 299, 333, 230, 219, 205, 328)),
    "middle": (MIDDLE, (359, 476, 576, 423, 882, 517, 438, 659, 572)),
    "large": (LARGE, (618, 992, 1284, 748, 1935, 1223, 973, 1669, 1275)),
}


@pytest.mark.parametrize("name", MEASURED)
def test_every_job_takes_what_is_predicted_within_30_percent(name: str) -> None:
    (scene, image), measured = MEASURED[name]
    predicted = peaks_mb(scene, [image], registered=True, on_map=name != "dyke", simulated=name != "chip")
    assert tuple(predicted) == JOBS
    for job, taken in zip(JOBS, measured, strict=True):
        assert predicted[job] == pytest.approx(taken, rel=0.3), job
    assert max(predicted.values()) == pytest.approx(max(measured), rel=0.2)


def test_a_cases_own_settings_count() -> None:
    scene, image = DYKE
    assert expected_mb(Case()) == peaks_mb(scene, [image], registered=True, on_map=False, simulated=True)
    alone = expected_mb(case_from({"registration": {"method": "none"}}))
    assert alone["registration"] < 0.7 * expected_mb(Case())["registration"]


def test_fields_in_slant_range_take_less_in_small_jobs() -> None:
    """Flevoland: in the largest jobs as predicted, in the others up to 60 % less."""
    scene, image = SceneSize(768_000, None, 768_000), ImageSize(768_000, 768_000)
    predicted = peaks_mb(scene, [image], registered=False, on_map=False, simulated=False)
    for job, taken in {"measurement": 257, "run": 287, "registration": 168, "target": 229}.items():
        assert predicted[job] == pytest.approx(taken, rel=0.3), job
    for job, taken in {"scene": 117, "geometry": 173}.items():
        assert taken < predicted[job] < 1.7 * taken


def test_passes_add_where_a_job_holds_all_of_them() -> None:
    scene, image = MIDDLE
    other = ImageSize(1_000_000, 3_000_000)
    one, both = (
        peaks_mb(scene, images, registered=True, on_map=True, simulated=True) for images in ([image], [image, other])
    )
    assert both["geometry"] == one["geometry"]
    assert both["run"] == pytest.approx(one["run"] + 56)
    assert both["archive"] == pytest.approx(one["archive"] + 3 * 118)
    assert both["registration"] == pytest.approx(one["registration"] + 285 * (3_000_000 - image.pixels) / 1e6)
