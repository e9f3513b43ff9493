"""Random effects of the fields (patches) of one material: between-field and within-field variance, and predictions.

A *patch* is a connected area of one material in the scene (a field, a pond); all passes show the same patches. A
*cell* is the area of a patch that lies in one block of the image. The mean level of a cell is the sum of four terms:
the level of the law, the random effect of the patch (standard deviation ``between``), the random effect of the cell
(standard deviation ``within``), and the sampling error of a mean over finitely many independent pixels.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

GRID_DB = np.concatenate([[0.0], np.geomspace(0.02, 6.0, 40)])  # grid of both standard deviations
_SCALES_DB = np.geomspace(0.1, 4.0, 40)  # scales of the half-normal distribution that the materials share
_PRIOR_DB = 1.0
_FREEDOM = 10  # pixels besides the first of each cell that an estimate of the variance inside cells needs
_LEAST_DB2 = 1e-6


@dataclass(frozen=True)
class Cells:
    """Cells of one material, each the area of a patch in one block of the image.

    Attributes
    ----------
    of_pixel : ndarray of int, shape (pixels,)
        Cell of each pixel.
    patch : ndarray of int, shape (cells,)
        Label of each cell's patch in the image.
    block : ndarray of int, shape (cells,)
        Number of each cell's block.
    count : ndarray of int, shape (cells,)
        Number of pixels in each cell.
    """

    of_pixel: NDArray[np.int64]
    patch: NDArray[np.int64]
    block: NDArray[np.int64]
    count: NDArray[np.int64]

    def mean(self, values: ArrayLike) -> NDArray[np.float64]:
        """Mean of values over the pixels of each cell: from shape (pixels, ...) to shape (cells, ...)."""
        v = np.asarray(values, dtype=np.float64)
        flat = v.reshape(v.shape[0], -1)
        sums = np.stack([np.bincount(self.of_pixel, column, self.count.size) for column in flat.T], axis=-1)
        return np.asarray((sums / self.count[:, None]).reshape(self.count.size, *v.shape[1:]))

    def sampling_variance(self, values: ArrayLike, independent: float) -> NDArray[np.float64]:
        """Sampling variance of each cell's mean [dB^2] from the pixels' variance inside cells, pooled over cells."""
        v = np.asarray(values, dtype=np.float64)
        left, freedom = v - self.mean(v)[self.of_pixel], v.size - self.count.size
        if freedom < _FREEDOM:  # too few to estimate it; the variance of all pixels is an upper bound
            left, freedom = v - v.mean(), max(v.size - 1, 1)
        pooled = max(float(left @ left) / freedom, _LEAST_DB2)
        return np.asarray(pooled / np.maximum(self.count * independent, 1.0))


@dataclass(frozen=True)
class Spread:
    """Standard deviations of the random effects of patches, and of the random effects of cells within a patch.

    Attributes
    ----------
    between, within : float
        Standard deviation of the effects of patches, and of cells within a patch [dB].
    """

    between: float
    within: float


def pooled(spread: Sequence[Spread]) -> Spread:
    """Spread of one material over several passes: root mean squares of the standard deviations of the passes."""
    each = np.array([[one.between, one.within] for one in spread])
    return Spread(*(float(value) for value in np.sqrt(np.mean(each**2, axis=0))))


def label_patches(mask: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Number the connected areas (four neighbours) of a mask of any shape from 1; pixels outside the mask get 0."""
    labels, _ = scipy.ndimage.label(mask)
    return np.asarray(labels, dtype=np.int64)


def patches_seen(image: NDArray[np.bool_], scene: NDArray[np.bool_], ground: NDArray[np.float32]) -> NDArray[np.int64]:
    """Number of the patch of the scene in which each pixel of one material lies.

    Parameters
    ----------
    image : ndarray of bool, shape (rows, columns)
        Pixels of the material.
    scene : ndarray of bool, shape (y, x)
        Cells of the material.
    ground : ndarray of float32, shape (2, rows, columns)
        Row and column in the scene of the middle of each pixel (:class:`radcal.radar.geometry.Geometry`). NaN for a
        scene in slant range: the patches are then the connected areas of ``image``.

    Returns
    -------
    ndarray of int64, shape (rows, columns)
        Number of the patch, from 1; 0 for pixels of other materials, or with another material in the middle.
    """
    known = np.isfinite(ground[0]) & image
    if not known.any():
        return label_patches(image)
    row, column = (
        np.clip(np.rint(np.where(known, at, 0.0)).astype(np.intp), 0, size - 1)
        for at, size in zip(ground, scene.shape, strict=True)
    )
    return np.where(known, label_patches(scene)[row, column], 0)


def make_cells(patch: NDArray[np.int64], block: NDArray[np.int64]) -> Cells:
    """Cells of a material, from arrays of shape (pixels,) that hold the patch and the block of each pixel."""
    pairs, of_pixel, count = np.unique(np.stack([patch, block]), axis=1, return_inverse=True, return_counts=True)
    return Cells(np.ravel(of_pixel).astype(np.int64), pairs[0], pairs[1], count)


@dataclass(frozen=True)
class Residuals:
    """Cell means of one material minus the cell means of its law, and derivatives with respect to the law's parameters.

    Attributes
    ----------
    residual_db : ndarray, shape (cells,)
        Measured cell means minus cell means of the law [dB].
    sampling : ndarray, shape (cells,)
        Sampling variances of the cell means [dB^2].
    patch : ndarray of int, shape (cells,)
        Label of each cell's patch.
    slopes : ndarray, shape (cells, d)
        Derivatives of the law's cell means with respect to the law's parameters.
    information : ndarray, shape (d, d)
        Inverse covariance matrix of the law's parameters from other knowledge than the cell means, such as a prior.
    expected : ndarray, shape (d,), optional
        ``information`` times the change of the parameters that this other knowledge expects; 0 if missing.
    """

    residual_db: NDArray[np.float64]
    sampling: NDArray[np.float64]
    patch: NDArray[np.int64]
    slopes: NDArray[np.float64]
    information: NDArray[np.float64]
    expected: NDArray[np.float64] | None = None


def spread_log_likelihood(data: Residuals) -> NDArray[np.float64]:
    """Restricted log likelihood of each pair (between, within) of standard deviations on the grid ``GRID_DB``.

    The parameters of the law are integrated out of the likelihood.
    """
    labels, of = np.unique(data.patch, return_inverse=True)
    columns = np.column_stack([data.slopes, data.residual_db])
    between = GRID_DB[:, None, None] ** 2
    table = np.empty((GRID_DB.size, GRID_DB.size))
    for k, within in enumerate(GRID_DB):
        variance = data.sampling + within**2
        weight = np.bincount(of, 1.0 / variance)
        pulled = np.stack([np.bincount(of, column / variance, labels.size) for column in columns.T], axis=-1)
        # Sherman and Morrison's inverse (diagonal plus rank one) for each patch, whose cells share its effect
        shared = 1.0 + between * weight[:, None]
        product = (columns / variance[:, None]).T @ columns - np.einsum(
            "tpi,pj->tij", between / shared * pulled, pulled
        )
        known = product[:, :-1, :-1] + data.information
        cross = product[:, :-1, -1] + (0.0 if data.expected is None else data.expected)
        quadratic = product[:, -1, -1] - np.einsum("ti,ti->t", cross, np.linalg.solve(known, cross[..., None])[..., 0])
        determinants = np.log(variance).sum() + np.log(shared).sum(axis=(1, 2)) + np.linalg.slogdet(known)[1]
        table[:, k] = -0.5 * (determinants + quadratic)
    return table


def half_normal(scales_db: NDArray[np.float64]) -> NDArray[np.float64]:
    """Probabilities of the standard deviations ``GRID_DB`` by half-normal distributions of k scales, shape (k, grid).

    The rows are not normalised: each has the factor sqrt(pi / 2).
    """
    # weights of the trapezium rule on an uneven grid
    step = np.gradient(GRID_DB)
    step[[0, -1]] = 0.5 * np.diff(GRID_DB)[[0, -1]]
    scale = scales_db[:, None]
    return np.asarray(np.exp(-0.5 * (GRID_DB / scale) ** 2) / scale * step)


def scale_log_evidence(likelihood: NDArray[np.float64], prior: NDArray[np.float64]) -> NDArray[np.float64]:
    """Log evidence of one material for all pairs of the scales of its half-normal priors, shape (k, k).

    Rows belong to the scale of the standard deviation between patches, columns to the scale within patches.
    ``likelihood`` holds the likelihood on ``GRID_DB``, and ``prior`` the rows of :func:`half_normal`.
    """
    return np.asarray(np.log(np.maximum(prior @ likelihood @ prior.T, 1e-300)))


def spreads(residuals: Sequence[Residuals]) -> list[Spread]:
    """Between-patch and within-patch standard deviations of several materials, estimated together.

    The standard deviations between and within the patches of a material have half-normal priors. All materials share
    the scales of the two half-normal priors, and each scale has a half-normal prior with a scale of 1 dB. The estimates
    of a material with a single patch therefore depend more on the other materials. For a material that differs from the
    others, such as water among fields, the estimates depend mainly on the cells of this material.

    Parameters
    ----------
    residuals : sequence of Residuals
        Residuals of each material.

    Returns
    -------
    list of Spread
        Posterior means of the standard deviations, in the order of ``residuals``.

    References
    ----------
    Gelman, "Prior distributions for variance parameters in hierarchical models", Bayesian Analysis 1
    (2006): half-normal priors, and that few groups need them.
    """
    prior = half_normal(_SCALES_DB)
    likelihoods = []
    for data in residuals:
        table = spread_log_likelihood(data)
        likelihoods.append(np.exp(table - table.max()))
    log_evidence = sum(scale_log_evidence(table, prior) for table in likelihoods)
    hyper = -0.5 * (_SCALES_DB / _PRIOR_DB) ** 2
    posterior = np.exp(log_evidence - np.max(log_evidence) + hyper[:, None] + hyper)
    weight = posterior * np.gradient(_SCALES_DB)[:, None] * np.gradient(_SCALES_DB)
    weight /= weight.sum()
    found = []
    for table in likelihoods:
        evidence = np.maximum(prior @ table @ prior.T, 1e-300)
        between = ((prior * GRID_DB) @ table @ prior.T) / evidence
        within = (prior @ table @ (prior * GRID_DB).T) / evidence
        found.append(Spread(float((weight * between).sum()), float((weight * within).sum())))
    return found


def gls_mean(
    mean_db: NDArray[np.float64], sampling: NDArray[np.float64], patch: NDArray[np.int64], spread: Spread
) -> tuple[float, float]:
    r"""Generalised least squares mean of cell means, with random effects of the fields and of the cells.

    The mean of a field f has the weight :math:`(\tau^2 + 1 / w_f)^{-1}`, where :math:`\tau^2` is the between-field
    variance and :math:`w_f = \sum_c (s_c^2 + \sigma^2)^{-1}` is a sum over the cells of the field. The mean of cell c
    has the sampling variance :math:`s_c^2`, and :math:`\sigma^2` is the within-field variance.

    Parameters
    ----------
    mean_db : ndarray, shape (cells,)
        Cell means [dB].
    sampling : ndarray, shape (cells,)
        Sampling variances of the cell means [dB^2].
    patch : ndarray of int, shape (cells,)
        Label of each cell's patch.
    spread : Spread
        Standard deviations of the random effects of patches and of cells.

    Returns
    -------
    mean_db, variance : float
        Weighted mean [dB] and its variance [dB^2].

    References
    ----------
    Searle, Casella and McCulloch, "Variance Components" (1992), section 3.3.
    """
    labels, of = np.unique(patch, return_inverse=True)
    precision = 1.0 / np.maximum(sampling + spread.within**2, 1e-12)
    inside = np.bincount(of, precision, labels.size)
    weight = 1.0 / (spread.between**2 + 1.0 / inside)
    means = np.bincount(of, precision * mean_db, labels.size) / inside
    return float(weight @ means / weight.sum()), float(1.0 / weight.sum())


def patch_effects(
    residual_db: NDArray[np.float64], sampling: NDArray[np.float64], patch: NDArray[np.int64], spread: Spread
) -> tuple[NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
    """Best linear unbiased predictions of the random effects of the patches that have at least one cell.

    Parameters
    ----------
    residual_db : ndarray, shape (cells,)
        Measured cell means minus cell means of the law [dB].
    sampling : ndarray, shape (cells,)
        Sampling variances of the cell means [dB^2].
    patch : ndarray of int, shape (cells,)
        Label of each cell's patch.
    spread : Spread
        Standard deviations of the random effects of patches and of cells.

    Returns
    -------
    patch : ndarray of int, shape (p,)
        Labels of the patches, increasing.
    effect_db, variance : ndarray, shape (p,)
        Predicted effect [dB] and its variance [dB^2], if the law is known without error.

    References
    ----------
    Robinson, "That BLUP is a good thing: the estimation of random effects", Statistical Science 6 (1991).
    """
    labels, of = np.unique(patch, return_inverse=True)
    precision = 1.0 / np.maximum(sampling + spread.within**2, 1e-12)
    tau2 = spread.between**2
    shared = 1.0 + tau2 * np.bincount(of, precision)
    weight = tau2 * precision / shared[of]
    effect_db = np.asarray(np.bincount(of, weight * residual_db), dtype=np.float64)
    return labels, effect_db, np.asarray(tau2 / shared, dtype=np.float64)
