"""What a right case will meet, on small scenes."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from radcal.checking.outlook import hidden_ground, low_track, of_pass, outlook, start_contrast
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


def test_lines_of_several_passes_name_their_pass() -> None:
    lines = ["warning: no relief.", "levels, rough:", "  soil: about -10 dB"]
    assert of_pass(lines, 2, 3) == ["warning: pass 2: no relief.", "pass 2: levels, rough:", "  soil: about -10 dB"]
    assert of_pass(lines, 1, 1) == lines


def test_the_error_of_the_level_is_told_where_no_level_is_removed(build_case: Callable[..., Case]) -> None:
    file = {"source": "file", "path": "a.tif", "scale": "db", "radiometry": "sigma0_local"}
    materials = {"dyke": {"calibrate": True, "start": LEVEL}, "grass": {"parameters": LEVEL}}
    keys = {"measurement": file, "materials": materials, "objective": "density", "registration": {"method": "none"}}
    for normalisation, told in (("none", True), ("offset", False), ("image", False)):
        case = build_case(**keys, target={"normalisation": normalisation})
        # without registration and image, the geometry is not used
        said = outlook(case, None, None)  # type: ignore[arg-type]
        assert any("from this pass alone is narrower than +-0.54 dB" in line for line in said) == told
    # an external law has no sigma0 of which a band could be known
    command = {"kind": "command", "command": ["sim"], "input": {}, "output": {"file": "i.npy", "scale": "db"}}
    law = {"calibrate": True, "law": "external", "names": ["mv"], "bounds": [[0, 1]]}
    external = build_case(**keys | {"materials": {"dyke": law}, "simulator": command})
    assert not any("band of sigma0" in line for line in outlook(external, None, None))  # type: ignore[arg-type]
    both = build_case(**keys | {"materials": {"dyke": law, "grass": materials["dyke"]}, "simulator": command})
    assert any("band of sigma0" in line for line in outlook(both, None, None))  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("factor", "steep", "units"),
    [
        (1.0, None, []),
        (3.281, 45, [("feet", "0.3048", 17), ("decimetres", "0.1", 6)]),
        (10.0, 72, [("decimetres", "0.1", 17), ("centimetres", "0.01", 2)]),
        (100.0, 88, [("centimetres", "0.01", 17)]),
    ],
)
def test_heights_in_another_unit_are_told(
    build_scene: Callable[..., Scene],
    build_case: Callable[..., Case],
    factor: float,
    steep: int | None,
    units: list[tuple[str, str, int]],
) -> None:
    """Hills of 18 m on 250 m of ground, with slopes of up to 24 degrees, multiplied by a factor."""
    scene = build_scene(lambda east, _: factor * 18.0 * np.sin(np.pi * east / 125.0), cells=(20, 50))
    radar = build_case(radar={"altitude_m": 9000.0}).radar
    said = hidden_ground(scene, make_geometry(scene, radar))
    assert bool(said) == bool(units)
    if units:
        asked = " or in ".join(
            f"{unit} (gdal_calc --calc='A*{number}' makes metres, with half of the ground steeper than {deg} degrees)"
            for unit, number, deg in units
        )
        assert said[0].endswith(
            f"half of the ground is steeper than {steep} degrees: are the heights in scene.elevation in {asked}, or is "
            "radar.depression_deg wrong?"
        )


def test_an_altitude_that_may_be_in_km_is_told(
    build_scene: Callable[..., Scene], build_case: Callable[..., Case]
) -> None:
    """200 m of level ground, 593 to 793 m from a track of 693 m."""
    scene = build_scene(lambda east, north: 0 * east)
    for altitude, told in ((693.0, True), (159.0, False), (2000.0, False)):
        radar = build_case(radar={"altitude_m": altitude, "depression_deg": 45 if told else 35}).radar
        said = low_track(radar, make_geometry(scene, radar))
        assert said == told * [
            "radar.altitude_m is 693, a track 693 m above the scene, which sees level ground at 40.6 to 48.8 degrees "
            "of incidence: expected 693000 for a satellite 693 km high."
        ]
