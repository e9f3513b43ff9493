"""The image former of ``benchmarks/outside_image.py``, against formulas and against the simulator."""

import ast
from functools import partial
from pathlib import Path

import numpy as np
import outside_image
import pytest
from outside_image import Changes, Flight, Ground, form_image, mangia, oh, relabelled, smooth, texture
from scipy.ndimage import binary_dilation, gaussian_filter
from scipy.special import polygamma

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


def test_speckle_noise_and_level_are_those_of_the_pass():
    ground, radar = plane(), passing(looks=3, nesz_db=-20.0)
    dark = {"dyke": lambda phi: np.full(phi.shape, -90.0)}
    values = np.concatenate(
        [
            form_image(ground, flying(), radar, dark, Changes(level_db=1.0, noise_db=2.0), np.random.default_rng(seed))
            for seed in range(8)
        ]
    )
    assert db(values) == pytest.approx(-17.0, abs=0.1)
    assert np.mean(values) ** 2 / np.var(values) == pytest.approx(3.0, rel=0.06)


def test_the_response_is_as_wide_as_the_resolution():
    # the rows of the matrix are the same response at other places
    width_px, step = 1.4, 1.0 / outside_image.FINE
    row = outside_image.response(30, width_px).toarray()[15]
    assert np.sum(row**2) * step == pytest.approx(1.0, abs=2e-3)
    places = np.arange(row.size)
    fine = np.linspace(0.0, row.size - 1.0, 200_001)
    shape = np.interp(fine, places, row**2)
    above = fine[shape > shape.max() / 2.0]
    assert np.ptp(above) * step == pytest.approx(width_px, rel=0.02)
    lobes = row[np.abs(places - np.argmax(row)) * step > 2.0 * width_px]
    assert 20.0 * np.log10(np.abs(lobes).max() / row.max()) == pytest.approx(-35.0, abs=1.0)


@pytest.mark.parametrize("x", [(5.0, 0.5, 0.4), (14.0, 2.0, 2.8)])
def test_laws_agree_with_those_of_the_case(x):
    phi = np.radians([12.0, 30.0, 47.0, 66.0])
    soil = LAWS["oh1992"].bound(frequency_ghz=9.6, polarisation="HH")
    assert oh(complex(x[0], -x[1]), x[2], 9.6, phi) == pytest.approx(soil(phi, x), abs=1e-3)
    assert mangia(LAW, phi) == pytest.approx(LAWS["mangia"](phi, LAW), abs=1e-9)


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


def test_texture_has_its_mean_and_its_spread():
    values = texture(1.5, np.random.default_rng(4).standard_normal(200_000))
    assert values.mean() == pytest.approx(1.0, abs=5e-3)
    assert (10.0 * np.log10(values)).std() == pytest.approx(1.5, rel=0.02)
    assert polygamma(1, 1.0 / values.var()) == pytest.approx((1.5 * np.log(10.0) / 10.0) ** 2, rel=0.03)
    assert (texture(0.004, values) == 1.0).all()  # too little for a gamma law of a shape up to a million


def test_fields_have_a_correlation_length():
    values = smooth(np.random.default_rng(4), (900, 900), 5.0)
    assert values.std() == pytest.approx(1.0, abs=0.03)
    small = [smooth(np.random.default_rng(seed), (10, 12), 20.0)[3, 4] for seed in range(400)]
    assert np.sqrt(np.mean(np.square(small))) == pytest.approx(1.0, abs=0.1)
    assert np.mean(values[:, 10:] * values[:, :-10]) == pytest.approx(np.exp(-1.0), abs=0.03)


def test_labels_are_wrong_on_borders_and_in_squares():
    ground = plane()
    material = np.ones_like(ground.material)
    material[:, 30:], material[40:] = 2, 3
    ground = Ground(ground.elevation_m, material, ("a", "b", "c"), 5.0)
    wrong = relabelled(ground, 0.02, np.random.default_rng(1)) != material
    assert 0.02 <= wrong.mean() < 0.025
    border = binary_dilation(material != np.roll(material, 1, 0)) | binary_dilation(material != np.roll(material, 1, 1))
    assert 0.3 < border[wrong].mean() < 0.8


def test_a_change_of_the_image_is_a_change_of_its_level():
    ground, radar, curves = plane(), passing(nesz_db=-60), {"dyke": partial(mangia, LAW)}
    levels = [
        db(form_image(ground, flying(), radar, curves, change, np.random.default_rng(5), looks=8))
        for change in (Changes(), Changes(shifts_db={"dyke": 2.0}), Changes(coarser=1.3), Changes(warp_px=1.0))
    ]
    assert np.subtract(levels, levels[0]) == pytest.approx([0.0, 2.0, 0.0, 0.0], abs=0.15)
    wide = form_image(ground, flying(), radar, curves, Changes(fields_db={"dyke": 5.0}), np.random.default_rng(5))
    assert abs(db(wide) - levels[0]) > 0.5


@pytest.mark.parametrize("radiometry", RADIOMETRIES)
def test_rough_ground_agrees_with_the_simulator(build_scene, radiometry):
    heights = gaussian_filter(np.random.default_rng(7).standard_normal((40, 40)), 2.0, mode="wrap") * 12.0
    material = np.ones((40, 40), dtype=np.uint8)
    material[20:] = 2
    scene = build_scene(lambda east, north: heights + 0.1 * east, names=("dyke", "grass"), material=material)
    radar = passing(radiometry)
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
