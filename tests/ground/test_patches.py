"""Spread among patches and their effects, against dense linear algebra and simulation."""

import numpy as np
import pytest

from radcal.ground import patches
from radcal.ground.patches import Residuals, Spread, label_patches, make_cells, patches_seen, spreads


def covariance(patch, sampling, spread):
    return np.diag(sampling + spread.within**2) + spread.between**2 * (patch[:, None] == patch)


def test_restricted_likelihood_is_the_marginal_one():
    rng, patch = np.random.default_rng(5), np.array([4, 4, 4, 7, 7, 9])
    information, sampling = np.diag([0.5, 2.0]), rng.uniform(0.01, 0.3, 6)
    example = Residuals(rng.normal(size=6), sampling, patch, rng.normal(size=(6, 2)), information)

    # the law's parameters, normal about 0 with the inverse of the information, are one more random effect
    def dense(between, within):
        c = covariance(example.patch, example.sampling, Spread(between, within))
        c = c + example.slopes @ np.linalg.inv(example.information) @ example.slopes.T
        r = example.residual_db
        return -0.5 * (np.linalg.slogdet(c)[1] + r @ np.linalg.solve(c, r))

    table = patches.spread_log_likelihood(example)
    grid = patches.GRID_DB
    places = [(0, 0), (10, 5), (30, 0), (3, 35)]
    wanted = np.array([dense(grid[i], grid[j]) for i, j in places])
    found = np.array([table[i, j] for i, j in places])
    np.testing.assert_allclose(found - found[0], wanted - wanted[0], atol=1e-9)


def test_cells_are_parts_of_patches_in_blocks():
    mask = np.array([[1, 1, 0, 1], [0, 1, 0, 1]], dtype=bool)
    labels = label_patches(mask)
    assert np.unique(labels).tolist() == [0, 1, 2]
    cells = make_cells(labels[mask], np.nonzero(mask)[0])
    assert cells.count.sum() == 5
    assert sorted(cells.count.tolist()) == [1, 1, 1, 2]
    values = np.arange(5.0)
    two = cells.mean(np.stack([values, 2.0 * values], axis=-1))
    np.testing.assert_allclose(two[:, 1], 2.0 * cells.mean(values))
    assert sorted(cells.mean(values).tolist()) == [0.5, 2.0, 3.0, 4.0]


def test_sampling_variance_by_hand():
    """Sums of squares inside cells of 7, 4 and 2 values over 13 - 3 degrees of freedom; at least one value counts."""
    values = np.array([1.0, 2, 3, 4, 5, 6, 7, -2, -2, 2, 2, 9, 12])
    cells = make_cells(np.ones(13, dtype=int), np.repeat([0, 1, 2], [7, 4, 2]))
    pooled = (28.0 + 16.0 + 4.5) / 10.0
    np.testing.assert_allclose(cells.sampling_variance(values, 0.3), pooled / np.array([2.1, 1.2, 1.0]))
    # with nine degrees of freedom cells say nothing, and the variance of all pixels bounds that inside
    few = make_cells(np.ones(12, dtype=int), np.repeat([0, 1, 2], [7, 4, 1]))
    np.testing.assert_allclose(few.sampling_variance(values[:12], 0.5), values[:12].var(ddof=1) / [3.5, 2.0, 1.0])


def test_without_information_the_spread_is_the_priors():
    """Scale s with density exp(-s^2 / 2) from 0.1 to 4 dB, and a half-normal spread, whose mean is s sqrt(2 / pi)."""
    blind = Residuals(np.zeros(3), np.full(3, 1e9), np.array([1, 2, 2]), np.ones((3, 1)), np.eye(1))
    (found,) = spreads([blind])
    s = np.linspace(0.1, 4.0, 4000)
    expected = np.sqrt(2.0 / np.pi) * np.average(s, weights=np.exp(-0.5 * s**2))
    assert found.between == pytest.approx(expected, rel=0.02)
    assert found.within == pytest.approx(expected, rel=0.02)


def test_two_passes_number_a_field_alike():
    """Two fields of the scene; a shadow cuts the second one in the images, which are seen from opposite sides."""
    scene = np.zeros((4, 9), dtype=np.bool_)
    scene[1:, 0:3] = scene[:3, 5:9] = True
    image = np.array([[1, 1, 0, 1, 0, 1]], dtype=np.bool_)
    row = np.full((1, 6), 1.4)
    ground = np.stack([row, [[0.6, 1.8, 3.5, 5.4, 6.5, 7.6]]]).astype(np.float32)
    assert label_patches(image).tolist() == [[1, 1, 0, 2, 0, 3]]
    first = patches_seen(image, scene, ground)
    second = patches_seen(image[:, ::-1], scene, ground[..., ::-1])
    upper, lower = label_patches(scene)[[0, 3], [8, 0]]
    assert first.tolist() == [[lower, lower, 0, upper, 0, upper]]
    np.testing.assert_array_equal(second, first[:, ::-1])
    # the middle of a pixel on other ground belongs to no field; in slant range the pixels are the cells
    off = ground.copy()
    off[1, 0, 3] = 3.6
    assert patches_seen(image, scene, off).tolist() == [[lower, lower, 0, 0, 0, upper]]
    assert patches_seen(image, image, np.full_like(ground, np.nan)).tolist() == [[1, 1, 0, 2, 0, 3]]
