"""What a right case will meet, on small scenes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from radcal.checking.outlook import hidden_ground, outlook, start_contrast
from radcal.config import Case
from radcal.radar.projection import make_geometry
from radcal.scene.model import Scene

LEVEL = [10.0, 14.0, 6.0, 4.0]


def test_pixels_without_ground_are_no_contrast(
    build_scene: Callable[..., Scene], build_case: Callable[..., Case]
) -> None:
    """Ground 40 dB above the noise, of two materials that start alike, beside no ground."""
    material = np.ones((40, 40), dtype=np.uint8)
    material[20:] = 2
    material[:, :12] = 0
    scene = build_scene(lambda east, north: 0 * east, names=("dyke", "grass"), material=material)
    for start, told in ((LEVEL, True), ([0.0, *LEVEL[1:]], False)):
        materials = {"dyke": {"calibrate": True, "start": start}, "grass": {"parameters": LEVEL}}
        case = build_case(materials=materials, registration={"method": "ilk"})
        geometry = make_geometry(scene, case.radar)
        angle = np.where(geometry.material > 0, geometry.incidence_deg, np.nan).astype(np.float32)
        said = start_contrast(case, replace(geometry, incidence_deg=angle))
        assert (said is not None) == told
        assert not told or "no contrast between materials" in str(said)


def test_the_error_of_the_level_is_told_where_no_level_is_removed(build_case: Callable[..., Case]) -> None:
    file = {"source": "file", "path": "a.tif", "scale": "db", "radiometry": "sigma0_local"}
    materials = {"dyke": {"calibrate": True, "start": LEVEL}, "grass": {"parameters": LEVEL}}
    keys = {"measurement": file, "materials": materials, "objective": "density", "registration": {"method": "none"}}
    for normalisation, told in (("none", True), ("offset", False), ("image", False)):
        case = build_case(**keys, target={"normalisation": normalisation})
        # without registration and image, the geometry is not used
        said = outlook(case, None, None)  # type: ignore[arg-type]
        assert any("from this pass alone is narrower than +-0.54 dB" in line for line in said) == told


def test_heights_in_decimetres_are_told(build_scene: Callable[..., Scene], build_case: Callable[..., Case]) -> None:
    """Hills of 20 m on 250 m of ground: slopes of up to 27 degrees, or of 79."""
    radar = build_case().radar
    for unit, told in ((1.0, False), (10.0, True)):
        scene = build_scene(lambda east, _, unit=unit: unit * 20.0 * np.sin(np.pi * east / 125.0), cells=(20, 50))
        said = hidden_ground(scene, make_geometry(scene, radar))
        assert [("half of the ground is steeper than 7" in text, "decimetres" in text) for text in said] == [
            (True, True)
        ] * told
