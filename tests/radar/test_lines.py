"""Facets of planes in both directions against the distances of their edges."""

import numpy as np
import pytest

from radcal.radar.earth import LineOfSight
from radcal.radar.lines import Lines, fill_lines


@pytest.mark.parametrize("k", [1, 3])
@pytest.mark.parametrize(("across", "along"), [(0.21, -0.4), (-0.33, 0.15)])
def test_lines_of_a_plane_begin_and_end_at_its_edges(k, across, along):
    ny, nx, cell, track, base = 6, 11, 4.0, 900.0, 1000.0
    north, east = (np.arange(ny)[:, None] + 0.5) * cell, (np.arange(nx) + 0.5) * cell
    step = cell / k
    edges = 700.0 + np.arange(nx * k + 1) * step
    lines, sight = Lines.empty(ny * k, nx * k), LineOfSight(track, 700.0, track, np.inf)
    near, far = fill_lines(
        across * east + along * north, 0, ny * k, k, step, edges, track, base, 1.0, lines, None, sight
    )
    y = (np.arange(ny * k) + 0.5)[:, None] * step
    slant = np.hypot(track - across * (edges - 700.0) - along * y, edges)
    # every line has ground between the furthest of the first edges and the nearest of the last ones
    assert near == pytest.approx(slant[:, 0].max(), abs=1e-6)
    assert far == pytest.approx(slant[:, -1].min(), abs=1e-6)
    np.testing.assert_allclose(lines.near_m, slant[:, :-1] - base, atol=1e-3)
    np.testing.assert_allclose(lines.far_m, slant[:, 1:] - base, atol=1e-3)
    np.testing.assert_allclose(lines.area, step**2 * np.sqrt(1.0 + across**2 + along**2), rtol=1e-5)
