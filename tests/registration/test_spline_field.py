import numpy as np
import pytest
from scipy import sparse, special
from scipy.linalg import LinAlgError

from radcal.registration.spline_field import Data, Lattice, Prior

LATTICE = Lattice((150, 210))
TRUE = Prior(spread_px=1.7, length_px=110.0)


def dense(lattice, bands):
    """A matrix of its upper diagonals, in the order of the coefficients."""
    n, width = bands.shape[1], bands.shape[0] - 1
    matrix = np.zeros((n, n))
    for k in range(width + 1):
        matrix[np.arange(n - k), np.arange(k, n)] = bands[width - k, k:]
    matrix = matrix + np.triu(matrix, 1).T
    back = np.argsort(lattice.order)
    return matrix[np.ix_(back, back)]


def seen(noise, seed=5, prior=TRUE):
    """Data of a field drawn from a prior, with each coefficient measured to a standard error."""
    rng = np.random.default_rng(seed)
    covariance = np.linalg.inv(dense(LATTICE, LATTICE.precision(prior)[0]))
    truth = rng.multivariate_normal(np.zeros(LATTICE.order.size), covariance)
    measured = truth + noise * rng.standard_normal(truth.size)
    bands = LATTICE.bands(sparse.eye_array(truth.size, format="csr") / noise**2)
    return truth, Data(LATTICE, bands, (measured / noise**2)[LATTICE.order])


def test_a_priors_field_has_its_spread_and_length():
    bands, log_determinant = LATTICE.precision(TRUE)
    matrix = dense(LATTICE, bands)
    assert log_determinant == pytest.approx(np.linalg.slogdet(matrix)[1], rel=1e-8)
    rows, columns = LATTICE.size
    covariance = np.linalg.inv(matrix)[: rows * columns, : rows * columns]
    assert np.sqrt(np.diag(covariance).mean()) == pytest.approx(1.7, rel=1e-6)


def test_a_field_is_correlated_over_its_length():
    """Whittle-Matern field of smoothness 2: correlation (k d)^2 K_2(k d) / 2 at a distance d, k = sqrt(12) / length."""
    wide = Lattice((510, 540))
    rows, columns = wide.size
    assert wide.spacing_px == 24.0
    length = 5 * 24.0
    matrix = dense(wide, wide.precision(Prior(1.7, length))[0])[: rows * columns, : rows * columns]
    middle = rows // 2 * columns + columns // 2  # far from the borders, whose reflection adds to it
    unit = np.zeros(rows * columns)
    unit[middle] = 1.0
    covariance = np.linalg.solve(matrix, unit).reshape(rows, columns)
    correlation = covariance / covariance[rows // 2, columns // 2]
    for step in (2, 5, 8):  # the differences of a lattice of five points in a length lower it by up to 0.036
        distance = np.sqrt(12.0) * 24.0 * step / length
        expected = distance**2 * special.kv(2, distance) / 2
        assert correlation[rows // 2, columns // 2 + step] == pytest.approx(expected, abs=0.04)
        assert correlation[rows // 2 - step, columns // 2] == pytest.approx(expected, abs=0.04)


def test_the_posterior_is_that_of_dense_algebra():
    _, data = seen(0.4)
    posterior = data.given(TRUE)
    precision = dense(LATTICE, data.curvature) + dense(LATTICE, LATTICE.precision(TRUE)[0])
    pull = data.pull[np.argsort(LATTICE.order)]
    np.testing.assert_allclose(
        posterior.coefficients().ravel(), np.linalg.solve(precision, pull), rtol=1e-8, atol=1e-10
    )
    covariance = np.linalg.inv(precision)
    rows, columns = (axis.toarray() for axis in LATTICE._axes(1.0, 1))
    row, column = 60, 100
    weights = np.outer(rows[row], columns[column]).ravel()
    half = weights.size
    variance = sum(weights @ covariance[a : a + half, a : a + half] @ weights for a in (0, half))
    # 64 draws of two components: a standard error of 6 %
    assert posterior.standard_error_px()[row, column] == pytest.approx(np.sqrt(variance), rel=0.2)
    assert posterior.standard_error_px().shape == (150, 210)


@pytest.mark.parametrize("prior", [TRUE, Prior(0.3, 60.0), Prior(5.0, 250.0)])
def test_the_best_prior_is_near_the_one_that_made_the_field(prior):
    _, data = seen(0.1 * prior.spread_px, prior=prior)
    found = data.best(Prior(3.0, 128.0))
    assert prior.spread_px / 1.9 < found.prior.spread_px < 1.9 * prior.spread_px
    assert prior.length_px / 1.6 < found.prior.length_px < 1.6 * prior.length_px
    # no neighbour has more evidence
    for spread, length in ((1.5, 1.0), (1 / 1.5, 1.0), (1.0, 1.5), (1.0, 1 / 1.5)):
        other = data.given(Prior(found.prior.spread_px * spread, found.prior.length_px * length))
        assert other.evidence < found.evidence


def test_the_evidence_is_the_probability_of_the_data():
    _, data = seen(0.4)
    measured = data.pull[np.argsort(LATTICE.order)] * 0.4**2

    def expected(prior):
        covariance = np.linalg.inv(dense(LATTICE, LATTICE.precision(prior)[0])) + 0.4**2 * np.eye(measured.size)
        return -0.5 * np.linalg.slogdet(covariance)[1] - 0.5 * measured @ np.linalg.solve(covariance, measured)

    other = Prior(0.8, 70.0)
    difference = data.given(TRUE).evidence - data.given(other).evidence
    assert difference == pytest.approx(expected(TRUE) - expected(other), rel=1e-6)


def test_a_prior_that_numbers_do_not_hold_is_passed_over():
    empty = Data(LATTICE, np.zeros_like(LATTICE.precision(TRUE)[0]), np.zeros(LATTICE.order.size))
    with pytest.raises(LinAlgError):
        empty.given(Prior(1e6, 1e7))
    assert not empty.best(TRUE).coefficients().any()


@pytest.mark.parametrize("scale", [1, 2])
def test_coefficients_of_a_plane_make_that_plane(scale):
    """Cubic B-splines reproduce what is linear: the spline of number j has its middle at j - 1 spacings."""
    row, column = (24.0 * (np.arange(n) - 1.0) for n in LATTICE.size)
    plane = 3.0 + 0.2 * row[:, None] - 0.7 * column
    y, x = ((np.arange(n // scale) + 0.5) * scale for n in LATTICE.shape)
    found = LATTICE.field(np.stack([plane, -2.0 * plane]), scale) * scale
    expected = 3.0 + 0.2 * y[:, None] - 0.7 * x
    np.testing.assert_allclose(found, [expected, -2.0 * expected], atol=1e-9)
