import json

import numpy as np
import pytest
from raster_files import write_raster

from radcal.config import SlantRangeScene
from radcal.errors import ConfigError, SceneError
from radcal.scene.slant_range import slant_range_scene

LABELS = np.array([[0, 1, 1, 3], [3, 3, 1, 0], [1, 0, 0, 3]], dtype=np.uint8)


@pytest.fixture
def write(tmp_path):
    """Write the two files and return the configuration that names them."""

    def write(labels=LABELS, names=None, **keys):
        write_raster(tmp_path / "labels.tif", labels)
        text = names if isinstance(names, str) else json.dumps(names or {"0": "none", "1": "grass", "3": "bare soil"})
        (tmp_path / "names.json").write_text(text)
        data = {
            "labels": str(tmp_path / "labels.tif"), "names": str(tmp_path / "names.json"),
            "near_incidence_deg": 20.0, "far_incidence_deg": 50.0,
        }  # fmt: skip
        return SlantRangeScene(**(data | keys))

    return write


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "int16", "int32"])
def test_labels_are_read(write, dtype):
    scene = slant_range_scene(write(LABELS.astype(dtype)))
    np.testing.assert_array_equal(scene.material, LABELS)
    assert scene.material.dtype == np.uint8
    assert scene.names == ("grass", "id 2", "bare soil")
    assert scene.elevation_m is None
    # from 20 to 50 degrees in equal steps of slant range
    slant = np.linspace(*1.0 / np.cos(np.radians([20.0, 50.0])), 3)
    np.testing.assert_allclose(scene.incidence_deg, np.degrees(np.arccos(1.0 / slant)), rtol=1e-6)


def test_identity_changes_with_content_only(write, tmp_path):
    identity = slant_range_scene(write()).identity
    other = LABELS.copy()
    other[0, 0] = 1
    assert slant_range_scene(write(other)).identity != identity
    assert slant_range_scene(write(names={"1": "grass", "3": "rock"})).identity != identity
    assert slant_range_scene(write(near_incidence_deg=21.0)).identity != identity
    moved = write()
    (tmp_path / "labels.tif").rename(tmp_path / "moved.tif")
    again = moved.model_copy(update={"labels": str(tmp_path / "moved.tif")})
    assert slant_range_scene(again).identity == identity


@pytest.mark.parametrize(
    ("labels", "words"),
    [
        (LABELS.astype("float32"), "holds float32 from 0.0 to 3.0, expected whole material ids from 0 to 255"),
        (LABELS.astype("int16") - 1, "holds int16 from -1 to 2"),
        (LABELS.astype("uint16") + 300, "holds uint16 from 300 to 303"),
    ],
)
def test_rasters_that_are_no_labels(write, labels, words):
    with pytest.raises(SceneError, match=rf"scene.labels: .*labels\.tif {words}"):
        slant_range_scene(write(labels))


def test_file_that_is_no_raster_or_cut_short(write, tmp_path):
    config = write(np.ones((200, 200), dtype=np.uint8), {"1": "a"})
    path = tmp_path / "labels.tif"
    for content in (b"not a raster", path.read_bytes()[: path.stat().st_size // 2]):
        path.write_bytes(content)
        with pytest.raises(SceneError, match=r"scene.labels: .*labels\.tif cannot be read as a raster"):
            slant_range_scene(config)


@pytest.mark.parametrize("key", ["labels", "names"])
def test_missing_files(write, key):
    with pytest.raises(ConfigError, match=rf"scene\.{key}: the file .*nothing does not exist"):
        slant_range_scene(write().model_copy(update={key: "/nowhere/nothing"}))
