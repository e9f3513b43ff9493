"""Forward runs without a measurement."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
import rasterio

from radcal.config import load_forward
from radcal.report.simulated import forward
from radcal.seeds import noise_seed
from radcal.storage.runs import RunStore


@pytest.mark.filterwarnings("ignore::rasterio.errors.NotGeoreferencedWarning")
def test_a_run_that_is_stored_is_not_made_again(tmp_path: Path) -> None:
    """Two passes with the random numbers of final runs; the second time both come from the store."""
    labels = np.ones((30, 40), dtype=np.uint8)
    labels[:, 25:] = 2
    with rasterio.open(tmp_path / "labels.tif", "w", "GTiff", 40, 30, 1, dtype="uint8") as raster:
        raster.write(labels, 1)
    (tmp_path / "names.json").write_text(json.dumps({"1": "field", "2": "lake"}))
    case = tmp_path / "case.yaml"
    case.write_text(
        f"case: small\nscene: {{source: slant_range, labels: {tmp_path}/labels.tif, names: {tmp_path}/names.json, "
        "near_incidence_deg: 20, far_incidence_deg: 45}\n"
        "radar: [{polarisation: HH}, {polarisation: VV}]\n"
        "materials: {field: {parameters: [-20, 8, 6, 4]}, lake: {parameters: [-30, 5, 20, 9]}}\n"
    )
    other = load_forward([case])
    first, second = (forward(other, tmp_path / "out", tmp_path / "runs")[1] for _ in range(2))
    assert [one.kept for one in first] == [False, False]
    assert [one.kept for one in second] == [True, True]
    store = RunStore(tmp_path / "runs")
    for one, again in zip(first, second, strict=True):
        assert one.key == again.key
        np.testing.assert_array_equal(one.image_db, again.image_db)
        assert store.description(one.key)["noise_seed"] == noise_seed(other, fresh=True)
    assert first[0].key != first[1].key
    assert first[0].image_db[:, :25].mean() > first[0].image_db[:, 25:].mean() + 3.0
