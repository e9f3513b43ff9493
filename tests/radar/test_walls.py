"""Walls and roofs that scatter apart, and their double bounce, in a geometry: areas, edges, masks by rays."""

from dataclasses import replace

import numpy as np
import pytest
from geometry_samples import METRE, objects_of

from radcal.config import Radar
from radcal.findings import Finding
from radcal.ground.one_incidence import bounces_on, bounces_outside
from radcal.radar.projection import make_geometry
from radcal.scene.model import Scene
from radcal.scene.objects import Walls

ALTITUDE = 500.0
NX, NY = 160, 60  # cells of 1 m
GROUND, ROOF, WALL = 1, 2, 3  # ids of the materials, and of objects
RADAR = Radar(altitude_m=ALTITUDE, depression_deg=45.0, nesz_db=-200.0, radiometry="beta0", **METRE)


def boxes(bounce=True, permittivity=None, **columns):
    columns = {"x_m": NX / 2, "y_m": NY / 2, "height_m": 8.0, "rcs_dbsm": np.nan} | columns
    n = np.broadcast(*columns.values(), bounce).size
    columns["rcs_dbsm"] = np.broadcast_to(columns["rcs_dbsm"], n)
    roof = np.where(np.isnan(columns["rcs_dbsm"]), 0, -1).astype(np.int16)
    walls = Walls(roof, np.where(roof < 0, np.nan, -5.0), np.broadcast_to(bounce, n).copy(), ("roof",), permittivity)
    return objects_of(walls=walls, **columns)


def seen(radar=RADAR, cell_m=1.0, **keys):
    n = round(NY / cell_m), round(NX / cell_m)
    ground = Scene("flat", ("ground", "roof"), np.ones(n, np.uint8), np.zeros(n), cell_m, objects=boxes(**keys))
    return make_geometry(ground, radar)


def of(geometry, name):
    """Sum of the weights of a material's facets in each pixel [m2 of ground, or of cross-section]."""
    per_facet = np.repeat(geometry.cell_material, np.diff(geometry.facet_start))
    pixel = np.repeat(np.arange(geometry.material.size), np.diff(geometry.cell_start))
    pixel = np.repeat(pixel, np.diff(geometry.facet_start))
    own = per_facet == name
    total = np.bincount(pixel[own], geometry.facet_weight[own].astype(float), geometry.material.size)
    return total.reshape(geometry.shape)


def area(geometry, radiometry):
    """Area of the pixels of each row to which a weight refers [m2]; the rows are 1 m by 1 m in slant range."""
    theta = np.radians(geometry.flat_incidence_deg)[:, None]
    return {"beta0": 1.0 + 0.0 * theta, "gamma0": 1.0 / np.tan(theta)}.get(radiometry, 1.0 / np.sin(theta))


def slant(x, z=0.0):
    return float(np.hypot(ALTITUDE - NX / 2 + x, ALTITUDE - z))


NEAR = slant(0.0)


@pytest.mark.parametrize("radiometry", ["beta0", "sigma0_ref", "gamma0", "sigma0_local"])
@pytest.mark.parametrize(("heading", "look_side"), [(0.0, "right"), (10.0, "left"), (20.0, "right"), (145.0, "right")])
def test_walls_roof_and_bounce_have_their_areas(heading, look_side, radiometry):
    radar = RADAR.model_copy(update={"radiometry": radiometry, "look_side": look_side})
    size = {"length_m": 20.0, "width_m": 8.0, "height_m": 8.0, "heading_deg": heading}
    geometry, without = (seen(radar, bounce=flag, **size) for flag in (True, False))
    per_pixel = area(geometry, radiometry)
    # a face along the track is edge-on, and out of sight
    sides = 20.0 + (8.0 if heading else 0.0)
    assert (of(geometry, WALL) * per_pixel).sum() == pytest.approx(10**-0.5 * 8.0 * sides, rel=2e-3)
    if radiometry != "sigma0_local":
        # the facets of 1 m whose middles lie in the footprint
        assert (of(geometry, ROOF) * per_pixel).sum() == pytest.approx(20.0 * 8.0, rel=0.05)
    turn = np.radians(heading)
    across = 20.0 * abs(np.cos(turn)) + 8.0 * abs(np.sin(turn))  # length times cosine of phi, of both faces
    found = ((of(geometry, GROUND) - of(without, GROUND)) * per_pixel).sum()
    # theta at the foot, 4 to 10 m in front of the scene's centre
    assert found == pytest.approx(4.0 * 8.0 * across * (1.0 - 6.0 / ALTITUDE), rel=0.01)
    alpha = np.degrees(np.arctan(np.abs([np.sin(turn), np.cos(turn)])))
    expected = alpha if heading else alpha[:1]
    off = np.abs(geometry.bounces[2] - expected[:, None])
    assert off.min(axis=0).max() < 1.1
    assert off.min(axis=1).max() < 1.1
    assert (geometry.bounces[1] == GROUND).all()
    # neither roof nor bounce enters the mean incidence of the ground
    ground = np.isfinite(geometry.incidence_deg)
    rows = np.nonzero(ground)[0]
    assert np.abs(geometry.incidence_deg[ground] - geometry.flat_incidence_deg[rows]).max() < 0.1


def test_permittivities_reduce_the_bounce():
    size = {"length_m": 20.0, "width_m": 8.0}
    without = of(seen(bounce=False, **size), GROUND).sum()
    whole, lossy = (of(seen(permittivity=one, **size), GROUND).sum() - without for one in (None, (5.0, 12.0)))
    # at 45 degrees and HH, Fresnel's coefficients have sqrt(epsilon - 1/2)
    wall, ground = (((np.sqrt(0.5) - np.sqrt(e - 0.5)) / (np.sqrt(0.5) + np.sqrt(e - 0.5))) ** 2 for e in (5.0, 12.0))
    level = ((1.0 - np.sqrt(12.0)) / (1.0 + np.sqrt(12.0))) ** 2
    assert lossy / whole == pytest.approx(wall * ground / level, rel=0.01)


@pytest.mark.parametrize("polarisation", ["HV", "VH"])
def test_cross_polarised_images_have_no_bounce(polarisation):
    size = {"length_m": 20.0, "width_m": 8.0, "heading_deg": 7.0}
    crossed = seen(RADAR.model_copy(update={"polarisation": polarisation}), **size)
    np.testing.assert_array_equal(of(crossed, GROUND), of(seen(bounce=False, **size), GROUND))
    assert not crossed.bounces.size


@pytest.mark.parametrize(("gap", "share"), [(30.0, 1.0), (11.0, 0.625), (3.0, 0.0)])
def test_what_stands_in_front_hides_the_foot_and_its_ground(gap, share):
    """Under 45 degrees a screen of 6 m shades 6 m; the bounce of a wall of 8 m needs 8 m of ground in front of it."""
    front = NX / 2 - 4.0
    columns = {
        "x_m": [front - gap - 1.0, NX / 2], "length_m": [60.0, 20.0], "width_m": [2.0, 8.0], "height_m": [6.0, 8.0],
        "rcs_dbsm": [-90.0, np.nan],
    }  # fmt: skip
    far = RADAR.model_copy(update={"altitude_m": 2e5, "radiometry": "beta0"})
    keys = {"radar": far, "cell_m": 0.25, **columns}
    found = of(seen(bounce=[False, True], **keys), GROUND) - of(seen(bounce=[False, False], **keys), GROUND)
    assert found.sum() == pytest.approx(4.0 * 8.0 * 20.0 * share, rel=0.03, abs=1e-3)
    # of the wall, the ray over the screen lights what lies above it
    lit = min(8.0, 8.0 - max(0.0, 6.0 - gap))
    wall = of(seen(bounce=False, **keys), WALL)[:, 30]
    assert wall.sum() == pytest.approx(10**-0.5 * lit, rel=0.03)


def test_a_box_with_a_cross_section_bounces_where_its_row_says_so():
    size = {"length_m": 20.0, "width_m": 8.0, "rcs_dbsm": 13.0}
    geometry, without = seen(bounce=True, **size), seen(bounce=False, **size)
    assert of(geometry, WALL).sum() == pytest.approx(10**1.3, rel=2e-3)
    assert not of(geometry, ROOF).any()
    found = of(geometry, GROUND) - of(without, GROUND)
    assert found.sum() == pytest.approx(4.0 * 8.0 * 20.0 * (1.0 - 4.0 / ALTITUDE), rel=2e-3)


def test_walls_whose_law_is_not_seen_at_alpha_are_named():
    geometry = seen(x_m=[40.0, 110.0], length_m=15.0, width_m=9.0, heading_deg=[0.0, 45.0])
    first = bounces_on(geometry, ["ground", "roof"])
    found = bounces_outside([first])
    assert [(one.about, one.severity) for one in found] == [("ground", "note")]
    # the ground lies at 42 to 48 degrees; alpha is 0 and 36 degrees
    assert found[0].numbers["objects"] == "1, 2"
    assert isinstance(found[0], Finding)
    # a second pass shows the ground from 30 degrees on, and a third box at alpha of 18 and 33 degrees
    steeper = RADAR.model_copy(update={"depression_deg": 54.0})
    second = bounces_on(seen(steeper, x_m=80.0, length_m=15.0, width_m=9.0, heading_deg=26.0), ["ground", "roof"])
    second["ground"] = replace(second["ground"], number=second["ground"].number + 2)
    both = bounces_outside([first, second])[0].numbers
    assert (both["objects"], both["walls"], both["of"]) == ("1, 3", 2, 3)
    assert both["low_deg"] == pytest.approx(second["ground"].low_deg)
    assert both["high_deg"] == pytest.approx(first["ground"].high_deg)
    shown = {"ground": replace(first["ground"], alpha_deg=np.full(first["ground"].number.shape, 45.0))}
    assert not bounces_outside([shown])


def test_the_bounce_lies_at_the_foot_and_roofs_have_the_incidence_of_level_ground():
    size = {"length_m": 12.0, "width_m": 8.0}
    geometry = seen(**size)
    bounce = (of(geometry, GROUND) - of(seen(bounce=False, **size), GROUND))[:, NY // 2]
    assert np.flatnonzero(bounce > 0).tolist() == [int(slant(NX / 2 - 4.0) - NEAR)]
    roof = np.repeat(geometry.cell_material, np.diff(geometry.facet_start)) == ROOF
    # 45 degrees at the scene's centre; the roof is 8 m nearer to the track's height, and 4 m to each side
    expected = np.degrees(np.arctan2(ALTITUDE + np.array([-3.5, 3.5]), ALTITUDE - 8.0))
    found = geometry.facet_incidence[roof] * (90.0 / 65535.0)
    assert [found.min(), found.max()] == pytest.approx(expected, abs=0.01)


LINES = 11  # rays to a column


def rays(columns, shape, spacing=0.04):
    """Masks of a flat scene by rays: seen, in shadow, and of no target."""
    rows, count = shape
    seen_rows, shade, standing = (np.zeros(shape, dtype=bool) for _ in range(3))
    x = np.arange(spacing / 2, NX, spacing)
    for line in range(LINES * count):
        column, middle = line // LINES, (line + 0.5) / LINES
        top, owner = np.zeros(x.size), np.full(x.size, -1)
        for i, (cx, cy, length, width, heading, height) in enumerate(zip(*columns, strict=True)):
            turn = np.radians(heading)
            east, north = x - cx, middle - cy
            inside = (np.abs(east * np.sin(turn) + north * np.cos(turn)) <= length / 2) & (
                np.abs(east * np.cos(turn) - north * np.sin(turn)) <= width / 2
            )
            top[inside & (height > top)] = height
            owner[inside & (top == height)] = i
        away, down = ALTITUDE - NX / 2 + x, ALTITUDE - top
        before = np.maximum.accumulate(np.concatenate([[0.0], (away / down)[:-1]]))
        visible = away / down >= before
        row = np.floor(np.hypot(away, down) - NEAR).astype(int)
        inside = (row >= 0) & (row < rows)
        seen_rows[row[visible & inside], column] = True
        shade[row[~visible & inside & (owner < 0)], column] = True
        standing[row[visible & inside & (owner >= 0)], column] = True
        for k in np.flatnonzero(np.diff(top) > 0.0) + 1:  # walls, in steps of the same length
            low = max(top[k - 1], ALTITUDE - away[k] / before[k] if before[k] > 0.0 else 0.0)
            heights = np.arange(low, top[k], spacing)
            at = np.floor(np.hypot(away[k], ALTITUDE - heights) - NEAR).astype(int)
            at = at[(at >= 0) & (at < rows)]
            seen_rows[at, column], standing[at, column] = True, True
            if top[k - 1] == 0.0 and low <= 1e-3:
                begin = away[k] - top[k] * away[k] / ALTITUDE
                strip = np.floor(np.hypot(np.arange(begin, away[k], spacing), ALTITUDE) - NEAR).astype(int)
                standing[strip[(strip >= 0) & (strip < rows)], column] = True
    return seen_rows, shade, standing


@pytest.mark.parametrize(("seed", "look_side"), [(1, "right"), (2, "left"), (3, "right")])
def test_masks_are_those_of_rays(seed, look_side):
    """At most 0.5 % of the pixels differ, on facets of an eighth of a metre."""
    rng, n = np.random.default_rng(seed), 6
    x, y = rng.uniform(15.0, 145.0, n), rng.uniform(5.0, 55.0, n)
    length, width = rng.uniform(8.0, 25.0, n), rng.uniform(6.0, 15.0, n)
    heading, height = rng.uniform(-60.0, 60.0, n), rng.uniform(3.0, 14.0, n)
    geometry = seen(
        RADAR.model_copy(update={"look_side": look_side}), cell_m=0.125, x_m=x, y_m=y, length_m=length, width_m=width,
        heading_deg=heading, height_m=height,
    )  # fmt: skip
    if look_side == "left":
        x, heading = NX - x, -heading
    visible, shade, standing = rays((x, y, length, width, heading, height), geometry.shape)
    assert standing.mean() > 0.05
    assert (shade | ~visible).mean() > 0.02
    assert (geometry.visible != visible).mean() <= 0.005
    assert (geometry.shadow != (shade | ~visible)).mean() <= 0.005
    assert ((geometry.material == 0) != (standing | ~visible)).mean() <= 0.005
