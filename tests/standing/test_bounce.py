"""Double bounce against rays from facets that share no code with it, and Fresnel's coefficients in another form."""

import numpy as np
import pytest

from radcal.standing.bounce import alpha_deg, bounce_area_m2, reflected, reflection

SLOPE2 = 0.05  # variance of the ground's slope along each axis


def directions(theta_deg, phi_deg):
    """Unit vectors of the incoming ray, and of the ray after a wall in the plane x = 0 whose normal is -x."""
    theta, phi = np.radians([theta_deg, phi_deg])
    inward = np.array([np.sin(theta) * np.cos(phi), np.sin(theta) * np.sin(phi), -np.cos(theta)])
    return inward, inward * [-1.0, 1.0, 1.0]


def one_order_m2(theta_deg, phi_deg, height_m, length_m, rays=4_000_000):
    """Cross-section of the order wall, ground, by mirror-like facets: power sent back into a narrow cone."""
    rng = np.random.default_rng(3)
    inward, mirrored = directions(theta_deg, phi_deg)
    slopes = np.sqrt(SLOPE2) * rng.standard_normal((rays, 2))
    normal = np.column_stack([-slopes, np.ones(rays)])
    shown = np.maximum(-normal @ mirrored, 0.0)  # area of the facet across the ray, per horizontal area
    normal /= np.linalg.norm(normal, axis=1)[:, None]
    out = mirrored - 2.0 * (normal @ mirrored)[:, None] * normal
    half = np.radians(2.0)
    back = out @ -inward > np.cos(half)
    on_wall_m2 = height_m * length_m * inward[0]  # of the beam that the wall receives
    per_steradian = shown[back].sum() / shown.sum() / (2.0 * np.pi * (1.0 - np.cos(half)))
    assert np.count_nonzero(back) > 500  # standard error 0.2 dB
    return 4.0 * np.pi * on_wall_m2 * per_steradian


@pytest.mark.parametrize("theta_deg", [30.0, 45.0, 60.0])
@pytest.mark.parametrize("phi_deg", [0.0, 8.0, 20.0])
def test_one_order_is_a_quarter_of_the_cross_section(theta_deg, phi_deg):
    """Ground of geometrical optics: sigma0 = exp(-tan^2 / (2 s^2)) / (2 s^2 cos^4) (Ulaby, Moore and Fung, 12-53)."""
    tan2 = np.tan(np.radians(alpha_deg(theta_deg, phi_deg))) ** 2
    sigma0 = (1.0 + tan2) ** 2 * np.exp(-tan2 / (2.0 * SLOPE2)) / (2.0 * SLOPE2)
    whole = sigma0 * bounce_area_m2(theta_deg, phi_deg, 9.0, 21.0)
    rays = one_order_m2(theta_deg, phi_deg, 9.0, 21.0)
    assert 10.0 * np.log10(4.0 * rays / whole) == pytest.approx(0.0, abs=0.5)


@pytest.mark.parametrize("phi_deg", [0.0, 15.0, 40.0])
def test_both_orders_have_one_length_which_is_that_of_the_foot(phi_deg):
    """Equal lengths add in amplitude, to four times the power of one order."""
    rng = np.random.default_rng(1)
    inward, mirrored = directions(35.0, phi_deg)
    for on_wall in np.column_stack([np.zeros(6), rng.uniform(-5.0, 5.0, 6), rng.uniform(0.1, 9.0, 6)]):
        on_ground = on_wall + mirrored * (-on_wall[2] / mirrored[2])
        first = inward @ on_wall + np.linalg.norm(on_ground - on_wall) + inward @ on_ground
        # the other order: from the facet, whose normal halves the angle between its two rays, to the wall
        normal = -inward - mirrored
        normal /= np.linalg.norm(normal)
        to_wall = inward - 2.0 * (inward @ normal) * normal
        hit = on_ground + to_wall * (-on_ground[0] / to_wall[0])
        np.testing.assert_allclose(hit, on_wall, atol=1e-9)
        np.testing.assert_allclose(to_wall * [-1.0, 1.0, 1.0], -inward, atol=1e-12)
        second = inward @ on_ground + np.linalg.norm(hit - on_ground) + inward @ hit
        assert second == pytest.approx(first, abs=1e-9)
        # azimuth is across the incoming ray; the echo lies midway between its two points
        azimuth = np.array([-inward[1], inward[0], 0.0])
        foot = np.array([0.0, 1.0, 0.0]) * (azimuth @ (on_wall + on_ground)) / (2.0 * azimuth[1])
        assert inward @ foot == pytest.approx(first / 2.0, abs=1e-9)


@pytest.mark.parametrize("polarisation", ["perpendicular", "parallel"])
@pytest.mark.parametrize("permittivity", [2.5, 7.0])
def test_reflection_follows_from_the_refracted_angle(polarisation, permittivity):
    """Fresnel's coefficients by incident and refracted angle, Brewster's angle, and normal incidence."""
    i = np.radians([10.0, 38.0, 71.0])
    t = np.arcsin(np.sin(i) / np.sqrt(permittivity))
    ratio = np.sin(i - t) / np.sin(i + t) if polarisation == "perpendicular" else np.tan(i - t) / np.tan(i + t)
    np.testing.assert_allclose(reflection(permittivity, np.degrees(i), polarisation), ratio**2, rtol=1e-9)
    brewster = np.degrees(np.arctan(np.sqrt(permittivity)))
    assert (reflection(permittivity, brewster, polarisation) < 1e-12) == (polarisation == "parallel")
    n = np.sqrt(permittivity)
    assert reflection(permittivity, 0.0, polarisation) == pytest.approx(((n - 1.0) / (n + 1.0)) ** 2)


@pytest.mark.parametrize(("polarisation", "field"), [("HH", "perpendicular"), ("VV", "parallel")])
def test_loss_of_a_wall_that_faces_the_radar(polarisation, field):
    """At phi = 0 the ground's facets mirror at theta, and the wall at 90 - theta."""
    theta = np.array([32.0, 51.0])
    expected = reflection(5.0, 90.0 - theta, field) * reflection(12.0, theta, field) / reflection(12.0, 0.0, field)
    np.testing.assert_allclose(reflected(theta, np.zeros(2), polarisation, (5.0, 12.0)), expected, rtol=1e-9)
    np.testing.assert_array_equal(reflected(theta, np.full(2, 20.0), polarisation, None), 1.0)
    turned = reflected(np.array([45.0]), np.array([25.0]), polarisation, (5.0, 12.0))
    cosine = np.cos(np.radians(45.0)) * np.sqrt(1.0 + np.sin(np.radians(25.0)) ** 2)
    on_wall, beta = (np.degrees(np.arccos(x)) for x in (np.sqrt(0.5) * np.cos(np.radians(25.0)), cosine))
    assert turned[0] == pytest.approx(
        reflection(5.0, on_wall, field) * reflection(12.0, beta, field) / reflection(12.0, 0.0, field)
    )
