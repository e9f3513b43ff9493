import hashlib

import numpy as np
import pytest

from radcal.config import Case
from radcal.errors import SceneError
from radcal.radar.projection import make_geometry
from radcal.scene.builtin import MATERIALS, builtin_scene
from radcal.scene.model import Scene
from radcal.scene.sources import make_scene


@pytest.mark.parametrize(
    ("seed", "landscape", "hashes"),
    [
        (1, "open", ("e5c93f15c98f3767", "56175130c6f384cd")),
        (1, "enclosed", ("21a2ac0c1e3c7d53", "e3c6466cb0ca5ccd")),
        (2, "open", ("2147a5b9f1d1cda2", "096165c6bd0496ea")),
    ],
)
def test_the_same_seed_gives_the_same_scene(seed, landscape, hashes):
    scene = builtin_scene(seed, landscape)
    # to the millimetre: processors with and without AVX-512 differ in the last bits of numpy's functions
    arrays = (np.round(scene.elevation_m, 3), scene.material)
    assert tuple(hashlib.sha256(one.tobytes()).hexdigest()[:16] for one in arrays) == hashes
    assert (scene.names, scene.cell_m, scene.elevation_m.shape) == (MATERIALS, 5.0, (400, 400))


def test_default_case_has_a_law_for_every_material():
    made = make_scene(Case().scene, list(Case().materials))
    assert made.identity == builtin_scene(1, "enclosed").identity != builtin_scene(1).identity


@pytest.mark.slow
def test_the_default_dyke_is_seen_over_25_degrees_beside_layover_and_shadow():
    geometry = make_geometry(builtin_scene(1, "enclosed"), Case().radar)
    pixels = geometry.pixels("dyke", 1)
    assert pixels.size > 5000
    low, high = np.percentile(geometry.incidence_deg.ravel()[pixels], [5, 95])
    assert (low, high) == pytest.approx((13.4, 40.5), abs=1.0)
    assert geometry.layover.mean() == pytest.approx(0.003, rel=0.3)
    assert geometry.shadow.mean() == pytest.approx(0.015, rel=0.3)


@pytest.mark.parametrize(
    ("materials", "words"),
    [
        (["dyke", "grass", "gras"], r"materials.gras: not in the scene, which has dyke, grass, rock\.$"),
        (["dyke", "gras"], r"which has dyke, grass, rock \(did you mean 'grass'\?\)\.$"),
        (["dyke", "grass", "rock"], "materials.rock: covers no cell of the scene"),
        (["dyke"], "the scene's 'grass' has no law; add materials.grass with parameters"),
    ],
)
def test_scene_and_configuration_must_name_the_same_materials(materials, words):
    labels = np.array([[0, 1, 2]], dtype=np.uint8)
    scene = Scene("x", ("dyke", "grass", "rock"), labels, np.zeros((1, 3)), 1.0)
    scene.require(["dyke", "grass"])
    with pytest.raises(SceneError, match=words):
        scene.require(materials)
