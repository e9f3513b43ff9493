"""The image former of ``benchmarks/outside_image.py``, against formulas and against the simulator."""

import ast
from functools import partial
from pathlib import Path

import numpy as np
import outside_image
import pytest
from outside_image import Flight, Ground, form_image, mangia
from scipy.ndimage import binary_dilation, gaussian_filter

from radcal.config import Radar
from radcal.laws import LAWS
from radcal.radar.projection import make_geometry
from radcal.simulators.builtin import BuiltinSimulator

HEIGHT_M = 4000.0
LAW = (-14.0, 6.0, 9.0, 3.5)
RADIOMETRIES = ("sigma0_ref", "sigma0_local", "beta0")


def passing(radiometry="sigma0_ref", **changed):
    return Radar.model_validate({"radiometry": radiometry, **changed})


def flying(shape=(60, 60), extent_m=200.0, near_m=None, level_m=0.0):
    """Flight past ground whose middle is seen at 45 degrees, in the middle of the image."""
    near_m = near_m or HEIGHT_M * np.sqrt(2.0) - (shape[0] - 1) / 2.0 * 1.5
    return Flight(extent_m / 2.0 - HEIGHT_M, level_m + HEIGHT_M, HEIGHT_M, near_m, shape)


def plane(across=0.0, along=0.0, cells=60, cell_m=5.0):
    y, x = np.meshgrid(*[(np.arange(cells) + 0.5 - cells / 2) * cell_m] * 2, indexing="ij")
    return Ground(across * x + along * y, np.ones((cells, cells), dtype=np.int64), ("dyke",), cell_m, (-50.0, -50.0))


def db(values):
    return 10.0 * np.log10(np.mean(values))


def test_nothing_of_the_simulator_is_imported():
    tree = ast.parse(Path(outside_image.__file__).read_text(encoding="utf-8"))
    modules = {node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)}
    modules |= {name.name for node in ast.walk(tree) if isinstance(node, ast.Import) for name in node.names}
    assert {name for name in modules if name and name.startswith("radcal")} == {"radcal.config"}


@pytest.mark.parametrize("radiometry", RADIOMETRIES)
@pytest.mark.parametrize(("across", "along"), [(0.0, 0.0), (0.2, 0.1), (-0.3, 0.25)])
def test_a_plane_has_the_level_of_the_formula(radiometry, across, along):
    ground, radar, law = plane(across, along), passing(radiometry, nesz_db=-80), partial(mangia, LAW)
    image = form_image(ground, flying((60, 100)), radar, {"dyke": law}, rng=np.random.default_rng(3), looks=24)
    theta = np.pi / 4.0
    normal = np.array([-across, -along, 1.0]) / np.sqrt(1.0 + across**2 + along**2)
    phi = np.arccos(normal @ [-np.sin(theta), 0.0, np.cos(theta)])
    cos_psi = normal @ [np.cos(theta), 0.0, np.sin(theta)]
    factor = {"sigma0_ref": np.sin(theta) / cos_psi, "sigma0_local": 1.0, "beta0": 1.0 / cos_psi}[radiometry]
    middle = image[20:-20, 10:-10]
    # the same number of pixels before and behind the middle, where the angles are those of the formula
    assert db(middle) == pytest.approx(float(mangia(LAW, phi)) + 10.0 * np.log10(factor), abs=0.09)


def test_ground_in_shadow_is_dark_and_layover_bright():
    ground, radar = plane(), passing(nesz_db=-60)
    height = np.zeros(ground.material.shape)
    height[:, 28:32] = 30.0  # a wall: its front lies over the ground before it, and it hides the ground behind it
    walled = Ground(height, ground.material, ground.names, ground.cell_m, ground.corner_m)
    law = {"dyke": lambda phi: np.full(phi.shape, -10.0)}
    image = form_image(walled, flying(), radar, law, rng=np.random.default_rng(2), looks=10)
    level = 10.0 * np.log10(image[:, 10:-10].mean(axis=1))
    # the middle of the wall, at x = 100, is row 29.5 of level ground; its top is nearer by 30 cos(45) m = 14 rows
    assert level[16:20].mean() > -8.5
    assert level[36:42].mean() < -30.0
    assert level[[2, 3, 4, -5, -4, -3]] == pytest.approx(-10.0, abs=0.8)


def test_rough_ground_agrees_with_the_simulator(build_scene):
    heights = gaussian_filter(np.random.default_rng(7).standard_normal((40, 40)), 2.0, mode="wrap") * 12.0
    material = np.ones((40, 40), dtype=np.uint8)
    material[20:] = 2
    scene = build_scene(lambda east, north: heights + 0.1 * east, names=("dyke", "grass"), material=material)
    radar = passing()
    geometry = make_geometry(scene, radar)
    parameters = {"dyke": [*LAW], "grass": [-22.0, 9.0, 12.0, 5.0]}
    simulator = BuiltinSimulator(geometry, radar, dict.fromkeys(parameters, LAWS["mangia"]))
    runs = np.mean([10.0 ** (simulator.run(parameters, seed) / 10.0) for seed in range(1, 25)], axis=0)
    near = HEIGHT_M / np.cos(np.radians(geometry.flat_incidence_deg[0]))
    image = form_image(
        Ground(scene.elevation_m, scene.material.astype(np.int64), scene.names, scene.cell_m),
        flying(geometry.shape, near_m=near, level_m=float(scene.elevation_m.mean())),
        radar,
        {name: partial(mangia, tuple(x)) for name, x in parameters.items()},
        rng=np.random.default_rng(11),
        looks=96,
    )
    masked = binary_dilation(geometry.layover | geometry.shadow, np.ones((5, 5))).ravel()
    for name in parameters:
        pixels = geometry.pixels(name, 2)
        pixels = pixels[~masked[pixels]]
        seen = geometry.incidence_deg.ravel()[pixels]
        assert np.ptp(np.percentile(seen, [5.0, 95.0])) > 15.0
        assert db(image.ravel()[pixels]) == pytest.approx(db(runs.ravel()[pixels]), abs=0.1)
        for half in (pixels[seen < np.median(seen)], pixels[seen >= np.median(seen)]):
            assert db(image.ravel()[half]) == pytest.approx(db(runs.ravel()[half]), abs=0.15)
