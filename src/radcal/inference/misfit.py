"""Misfit of a law to measured pixels, as residuals in standard deviations: from statistics or from a likelihood.

Law, noise and speckle alone give expected cumulants of incidence-angle bins. A field has the same effect in all passes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar, Literal

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from radcal.ground.bins import Classes, class_of
from radcal.ground.ground import Ground
from radcal.ground.patches import Spread
from radcal.inference.incidence_error import attenuation, true_nodes
from radcal.inference.moments import from_cumulants, sampling_covariance
from radcal.laws import Law
from radcal.speckle.texture import log_speckle_cumulants

# the skewness depends on the distribution of texture as much as on the backscatter law: in dB, the gamma distribution
# of 2.5 looks has the skewness -0.69, the K distribution of 4 looks with the same variance has -0.36
SKEWNESS_SHAPE = 0.3
_LOG_SD_PATCH = 0.1  # standard deviation of a field's log sd: the looks of fields differ by some 20 %
_BIN_DB = 0.5
_LEVELS = 8  # levels [dB] that represent an incidence-angle bin
Doubles = NDArray[np.float64]


def law_cumulants(
    law: Law, parameters: ArrayLike, nodes_deg: NDArray[np.float64], noise_db: float = -np.inf
) -> NDArray[np.float64]:
    """Mean [dB], variance [dB^2] and third central moment [dB^3] of a law over the angles of each bin.

    Parameters
    ----------
    law : Law
        Backscatter law with a curve.
    parameters : array_like, shape (d,) or (k, d)
        Parameters X of the law; one X, or k.
    nodes_deg : ndarray, shape (n, m)
        Equally likely angles that represent each incidence-angle bin [deg].
    noise_db : float
        Noise-equivalent backscatter [dB], whose power is added to the power of the law.

    Returns
    -------
    ndarray, shape (n, 3), or (k, n, 3) for k X
    """
    per_neper = 10.0 / np.log(10.0)
    phi, x = np.radians(nodes_deg), np.asarray(parameters, dtype=np.float64)
    level = law(phi, x) if x.ndim == 1 else np.stack([law(phi, one) for one in x])
    if np.isfinite(noise_db):
        level = per_neper * np.logaddexp(level / per_neper, noise_db / per_neper)
    mean = level.mean(axis=-1)
    left = level - mean[..., None]
    return np.stack([mean, (left**2).mean(axis=-1), (left**3).mean(axis=-1)], axis=-1)


@dataclass(frozen=True)
class LawForward:
    """Model of a run with law, noise and speckle alone; the cumulants of independent factors add in dB.

    Attributes
    ----------
    law : Law
        Backscatter law with a curve.
    nodes_deg : ndarray, shape (n, m)
        Angles that represent each incidence-angle bin [deg].
    looks : float
        Number of looks of the speckle.
    noise_db : float
        Noise-equivalent backscatter [dB].
    """

    law: Law
    nodes_deg: NDArray[np.float64]
    looks: float
    noise_db: float = -np.inf

    def __call__(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cumulants of each incidence-angle bin, shape (n, 3), at one X, shape (d,); of k X, shape (k, n, 3)."""
        return law_cumulants(self.law, parameters, self.nodes_deg, self.noise_db) + log_speckle_cumulants(self.looks)


def expected_cumulants(
    simulated: NDArray[np.float64],
    nominal: float,
    effective: float,
    patch_variance: NDArray[np.float64] | float = 0.0,
    shift: NDArray[np.float64] | float = 0.0,
) -> NDArray[np.float64]:
    """Simulated cumulants, converted to the material's looks, with variance of fields and error of incidence added.

    Parameters
    ----------
    simulated : ndarray, shape (n, 3)
        Mean [dB], variance [dB^2] and third central moment [dB^3] at the sensor's looks.
    nominal, effective : float
        Number of looks of the sensor, and effective number of looks of the material.
    patch_variance : ndarray, shape (n,), or float
        Variance inside each bin by the effects of fields (patches) and cells [dB^2].
    shift : ndarray, shape (n, 3), or float
        Change of the cumulants by an error of the local incidence.

    Returns
    -------
    ndarray, shape (n, 3)
        Expected cumulants; the variance is at least a thousandth of the simulated variance.
    """
    found = simulated + (log_speckle_cumulants(effective) - log_speckle_cumulants(nominal)) + shift
    found[:, 1] = np.maximum(found[:, 1] + patch_variance, 1e-3 * simulated[:, 1])
    return np.asarray(found)


def drawn(values: Doubles, target: Doubles, slack: Doubles | float) -> Doubles:
    """Differences of values from a target, each brought nearer to 0 by up to ``slack``."""
    difference = values - target
    return np.asarray(difference - np.clip(difference, -np.asarray(slack), slack))


class Misfit(ABC):
    """Misfit of one material's law; ``of_fields`` tells whether it includes the variance between fields."""

    of_fields: ClassVar[bool] = False

    @classmethod
    @abstractmethod
    def of(cls, ground: Ground, classes: Classes, method: Method, spread: Spread) -> Misfit:
        """Misfit of the law in ``method`` to a material's pixels, which lie in incidence-angle bins."""

    @abstractmethod
    def __call__(self, parameters: Doubles, looks: float, simulated: Doubles, slack: Doubles | float = 0.0) -> Doubles:
        """Differences between expected and measured pixels, as residuals of unit variance.

        Parameters
        ----------
        parameters : ndarray, shape (d,)
            Parameters X of the law.
        looks : float
            Effective number of looks of the material.
        simulated : ndarray, shape (n, 3)
            Simulated mean [dB], variance [dB^2] and third central moment [dB^3] of each bin, at the sensor's looks.
        slack : ndarray, shape (n, 3), or 0
            Largest shift of each bin's mean [dB], log sd and skewness towards the measured value.

        Returns
        -------
        ndarray, shape (k,)
        """


@dataclass(frozen=True)
class BinMisfit(Misfit):
    """Misfit of mean, log sd and skewness in each incidence-angle bin, weighted by their inverse covariance.

    Pixels are correlated inside bins and between bins. Bins also share effects of fields and cells: a field with equal
    shares of all bins shifts all means alike, which does not make the slope of the law less certain. Log sds also vary
    because the variance among a few fields differs by chance from its expectation. The unknown distribution of texture
    changes the skewness of all bins alike; this change has a standard deviation of 0.3.

    Attributes
    ----------
    classes : Classes
        Incidence-angle bins with their measured statistics.
    patch_share : ndarray, shape (n, patches)
        Share of each bin's pixels that lies in each field.
    cell_share : ndarray, shape (n, cells)
        Share of each bin's pixels that lies in each cell (area of one field in one block of the image).
    patch_of_cell : ndarray of int, shape (cells,)
        Column of each cell's field in ``patch_share``.
    between_db, within_db : float
        Between-field and within-field standard deviation [dB].
    method : Method
        Law, number of looks of the sensor, and error of the local incidence, which shifts the expected statistics.
    true_deg : ndarray, shape (n, k)
        Angles with the distribution of the true local incidence in each bin [deg].
    patches : ndarray of int, shape (patches,)
        Label of each field, which is the same in all passes.
    """

    classes: Classes
    patch_share: Doubles
    cell_share: Doubles
    patch_of_cell: NDArray[np.int64]
    between_db: float
    within_db: float
    method: Method
    true_deg: Doubles
    patches: NDArray[np.int64]

    of_fields: ClassVar[bool] = True

    @classmethod
    def of(cls, ground: Ground, classes: Classes, method: Method, spread: Spread) -> BinMisfit:
        """Misfit of the law in ``method`` to a material's pixels, which lie in incidence-angle bins."""
        cells = ground.cells
        patches, patch = np.unique(cells.patch, return_inverse=True)
        shares = classes.shares(patch[cells.of_pixel], int(patch.max()) + 1)
        by_cell = classes.shares(cells.of_pixel, cells.count.size)
        true_deg = true_angles(ground, classes, method, classes.nodes_deg)
        return cls(classes, shares, by_cell, patch, spread.between, spread.within, method, true_deg, patches)

    @property
    def patch_variance(self) -> Doubles:
        """Expected variance inside each incidence-angle bin by the effects of fields and cells [dB^2], shape (n,)."""
        inside = [1.0 - (share**2).sum(axis=1) for share in (self.patch_share, self.cell_share)]
        return np.asarray(self.between_db**2 * inside[0] + self.within_db**2 * inside[1])

    @cached_property
    def log_sds(self) -> Doubles:
        """Covariance of the bins' log sds that arises because the variance among a few fields and cells is random.

        The effects u of the cells add u' S u to the variance of a bin, where S = diag(s) - s s' and s holds the cells'
        shares of its pixels. For bins i and j, the covariance of u' S_i u and u' S_j u is 2 tr(S_i G S_j G). The
        covariance G of u is the between-field variance for cells of one field, plus within-field variance for one cell.

        Returns
        -------
        ndarray, shape (2, 2, n, n)
            Coefficients of the products of two variances, each between^2 (index 0) or within^2 (index 1).

        References
        ----------
        Searle, Casella and McCulloch, "Variance Components" (1992), appendix S.5: covariance of quadratic forms.
        """
        cells, patches = self.cell_share, self.patch_share
        field = patches[:, self.patch_of_cell]
        of_cells, of_patches = cells @ cells.T, patches @ patches.T

        def trace(shares: Doubles, others: Doubles, product: Doubles) -> Doubles:
            both = shares[:, None] * shares  # (n, n, columns)
            left = both.sum(axis=-1) - (both * others[:, None]).sum(axis=-1) - (both * others).sum(axis=-1)
            return np.asarray(left + product)

        alone, mixed = trace(cells, cells, of_cells**2), trace(cells, field, of_cells * of_patches)
        whole = trace(patches, patches, of_patches**2)
        variance = self.classes.cumulants[:, 1]
        # d log sd = d variance / (2 variance)
        return np.array([[whole, mixed], [mixed, alone]]) * 2.0 / (4.0 * np.multiply.outer(variance, variance))

    @cached_property
    def _order(self) -> Doubles:
        """Coefficients that express each bin's statistics by orthogonal polynomials of its pixels, shape (n, 3, 3)."""
        speckle_db2 = self.classes.speckle_db2
        # variance in each bin by differences of level between its pixels, without speckle
        each = zip(speckle_db2, self.classes.cumulants[:, 1] - speckle_db2, strict=True)
        return np.linalg.cholesky(np.stack([sampling_covariance(v, 1.0, of_levels) for v, of_levels in each]))

    @cached_property
    def sampling(self) -> Doubles:
        """Covariance of the bins' means, log sds and skewnesses by speckle alone, shape (3 n, 3 n).

        The orthogonal polynomials of order 1, 2 and 3 of two pixels have the pixels' correlation, its square and its
        cube as correlations. The three correlations are exact for normal values, and within some percent for log-gamma.
        """
        whole = np.einsum("iak,jbk,kij->aibj", self._order, self._order, self.classes.pairs)
        return np.asarray(whole.reshape(3 * self.classes.size, -1))

    @cached_property
    def covariance(self) -> Doubles:
        """Covariance matrix of all bins' means, then log sds, then skewnesses, shape (3 n, 3 n)."""
        n = self.classes.size
        whole = self.sampling.reshape(3, n, 3, n).copy()
        patches = self.patch_share @ self.patch_share.T
        whole[0, :, 0, :] += self.between_db**2 * patches + self.within_db**2 * self.cell_share @ self.cell_share.T
        whole[1, :, 1, :] += _LOG_SD_PATCH**2 * patches
        tau2 = np.array([self.between_db, self.within_db]) ** 2
        whole[1, :, 1, :] += np.einsum("a,b,abij->ij", tau2, tau2, self.log_sds)
        whole[2, :, 2, :] += SKEWNESS_SHAPE**2
        return whole.reshape(3 * n, 3 * n)

    @cached_property
    def _root(self) -> Doubles:
        return np.asarray(np.linalg.cholesky(self.covariance))

    @cached_property
    def _whitening(self) -> Doubles:
        return np.asarray(np.linalg.inv(self._root))

    def whitened(self, differences: Doubles) -> Doubles:
        """Residuals, (..., 3 n), from expected minus measured mean [dB], log sd and skewness of n bins, (..., n, 3)."""
        return np.swapaxes(differences, -1, -2).reshape(*differences.shape[:-2], -1) @ self._whitening.T

    def differences(self, residuals: Doubles) -> Doubles:
        """Expected minus measured statistics, (..., n, 3), from residuals, (..., 3 n): inverse of :meth:`whitened`."""
        return np.swapaxes((residuals @ self._root.T).reshape(*residuals.shape[:-1], 3, -1), -1, -2)

    def __call__(self, parameters: Doubles, looks: float, simulated: Doubles, slack: Doubles | float = 0.0) -> Doubles:
        """Expected minus measured means, log sds and skewnesses, whitened by their covariance, shape (3 n,)."""
        law, mapped = self.method.law, self.classes.nodes_deg
        shift: Doubles | float = 0.0
        if law.has_curve and self.true_deg.shape != mapped.shape:  # the error of the incidence moves the expectation
            shift = law_cumulants(law, parameters, self.true_deg) - law_cumulants(law, parameters, mapped)
        expected = expected_cumulants(simulated, self.method.looks, looks, self.patch_variance, shift)
        return self.whitened(drawn(from_cumulants(expected), from_cumulants(self.classes.cumulants), slack))


@dataclass(frozen=True)
class LikelihoodMisfit(Misfit):
    """Misfit by the gamma likelihood of the pixels in each incidence-angle bin, without variance between fields.

    Each bin has a histogram of its pixels with intervals of 0.5 dB. The squares of the deviance residuals of the counts
    add up to minus twice the histogram's log likelihood, up to a constant. Counts are multiplied by the ratio of
    effective to nominal sample size, because pixels are correlated. The expected distribution in a bin is a mixture,
    over its incidence angles, of gamma speckle with the material's looks.

    Attributes
    ----------
    classes : Classes
        Incidence-angle bins with their measured statistics.
    values_db : ndarray, shape (pixels,)
        Measured pixels of the material [dB].
    method : Method
        Law and settings of the fit.
    true_deg : ndarray, shape (n, k)
        Angles with the distribution of the true local incidence in each bin [deg].

    References
    ----------
    McCullagh and Nelder, "Generalized Linear Models", 2nd edition (1989), section 2.4: deviance residuals.
    """

    classes: Classes
    values_db: Doubles
    method: Method
    true_deg: Doubles

    @classmethod
    def of(cls, ground: Ground, classes: Classes, method: Method, spread: Spread) -> LikelihoodMisfit:
        """Misfit of the law in ``method`` to a material's pixels, which lie in incidence-angle bins."""
        return cls(classes, ground.values_db, method, true_angles(ground, classes, method, classes.nodes_deg))

    def __call__(self, parameters: Doubles, looks: float, simulated: Doubles, slack: Doubles | float = 0.0) -> Doubles:
        """Deviance residuals of the law's levels, shifted to the simulated mean of each bin; ``slack`` is ignored."""
        m = self.method
        levels = m.law(np.radians(self.true_deg), parameters)
        # the simulated mean replaces the law's: it includes the area of facets, noise and neighbouring materials
        mean = simulated[:, 0] - log_speckle_cumulants(m.looks)[0]
        moved = mean[:, None] - law_cumulants(m.law, parameters, self.classes.nodes_deg)[:, :1]
        return self.residuals(levels + moved, looks)

    @cached_property
    def _bins(self) -> Doubles:
        low, high = float(self.values_db.min()), float(self.values_db.max())
        return np.arange(np.floor(low / _BIN_DB), np.ceil(high / _BIN_DB) + 1.0) * _BIN_DB

    @cached_property
    def _counts(self) -> Doubles:
        """Histogram counts, scaled to the effective sample size, shape (n, intervals); end intervals are open."""
        place = np.clip(np.searchsorted(self._bins, self.values_db, side="right") - 1, 0, self._bins.size - 2)
        width = self._bins.size - 1
        joint = np.bincount(self.classes.member * width + place, minlength=self.classes.size * width)
        # the sum over all bins includes the correlation of a bin's pixels with the pixels of other bins
        temper = self.classes.count / (self.classes.count * (self.classes.pairs[0] @ self.classes.count))
        return np.asarray(joint.reshape(self.classes.size, -1) * temper[:, None])

    def residuals(self, level_db: Doubles, looks: float) -> Doubles:
        """Deviance residuals of the histogram of each incidence-angle bin.

        Parameters
        ----------
        level_db : ndarray, shape (n, m)
            Levels of mean power that represent each incidence-angle bin [dB].
        looks : float
            Effective looks of the material.

        Returns
        -------
        ndarray, shape (n * intervals,)
        """
        levels = np.sort(level_db, axis=1)
        if levels.shape[1] % _LEVELS == 0:
            levels = levels.reshape(len(levels), _LEVELS, -1).mean(axis=2)
        below = scipy.special.gammainc(looks, looks * 10.0 ** ((self._bins[1:-1] - levels[..., None]) / 10.0)).mean(
            axis=1
        )
        ends = np.zeros((self.classes.size, 1))
        share = np.diff(np.concatenate([ends, below, ends + 1.0], axis=1), axis=1)
        observed = self._counts
        wanted = np.maximum(share, 1e-12) * observed.sum(axis=1, keepdims=True)
        log = np.log(np.where(observed > 0.0, observed, 1.0) / wanted)
        deviance = 2.0 * (np.where(observed > 0.0, observed * log, 0.0) - (observed - wanted))
        return np.asarray((np.sign(observed - wanted) * np.sqrt(np.maximum(deviance, 0.0))).ravel())


@dataclass(frozen=True)
class Method:
    """Settings of the fit of one material's law.

    Attributes
    ----------
    law : Law
        Backscatter law; it may lack a curve only if simulator runs give the statistics.
    bounds : array_like, shape (d, 2)
        Bounds of the parameters X.
    looks : float
        Number of looks of the sensor.
    misfit : type of Misfit
        Misfit that the fit minimises.
    classes : int or 'auto'
        Number of incidence-angle bins; ``auto`` derives it from the range of incidence.
    free_looks : bool
        Whether the effective number of looks is fitted together with X.
    priors : bool
        Whether weak priors on the curve and on the number of looks enter the fit.
    incidence_error_deg : float
        Standard deviation of the error of the local incidence [deg] (:mod:`radcal.inference.incidence_error`).
    """

    law: Law
    bounds: ArrayLike
    looks: float
    misfit: type[Misfit] = BinMisfit
    classes: int | Literal["auto"] = "auto"
    free_looks: bool = True
    priors: bool = True
    incidence_error_deg: float = 0.0


def true_angles(ground: Ground, classes: Classes, method: Method, nodes_deg: Doubles) -> Doubles:
    """Angles with the distribution of the true local incidence of a material, given its mapped incidence.

    Parameters
    ----------
    ground : Ground
        Pixels of the material; errors of single pixels are replaced by their root mean square in each bin.
    classes : Classes
        Incidence-angle bins of these pixels.
    method : Method
        Standard deviation of the error of the local incidence, if all pixels share one.
    nodes_deg : ndarray, shape (n, m)
        Mapped angles [deg]; each row lies in one incidence-angle bin.

    Returns
    -------
    ndarray, shape (n, k)
        True angles [deg]; the k angles of a row are equally likely.
    """
    mapped, error, rms = ground.incidence_deg, np.asarray(method.incidence_error_deg), None
    if ground.error_deg is not None:
        square = ground.error_deg**2
        each = np.sqrt(np.bincount(classes.member, square, classes.size) / classes.count)
        error, rms = each[class_of(nodes_deg.mean(axis=1), classes.edges_deg)], float(np.sqrt(square.mean()))
    share = attenuation(mapped, error, rms)
    return true_nodes(nodes_deg, error, float(mapped.mean()), share)


def together(misfits: Sequence[BinMisfit]) -> BinMisfit:
    """Misfit of the bins of all passes, one pass after the other.

    Fields with the same label are one field. The effect of a field on the level, its texture, and the shape of the
    texture are the same in all passes. Parts of fields (cells) lie at different places in each image. The effects of
    cells and the sampling errors are therefore independent in different passes.

    Parameters
    ----------
    misfits : sequence of BinMisfit
        Misfit of each pass; the standard deviations between and within fields are the same in all passes.

    Returns
    -------
    BinMisfit
        Misfit with the covariance of all passes, which does not shift expected statistics. With it, differences that
        one effect of a field explains in all passes make the sum of squared residuals smaller; differences between
        passes on one field make the sum larger.
    """
    every = [one.classes for one in misfits]
    patches = np.unique(np.concatenate([one.patches for one in misfits]))
    columns = [np.searchsorted(patches, one.patches) for one in misfits]
    shares = np.zeros((sum(one.size for one in every), patches.size))
    ends = np.cumsum([0, *(one.size for one in every)])
    for one, own, start in zip(misfits, columns, ends[:-1], strict=True):
        shares[start : start + one.classes.size, own] = one.patch_share
    nodes = np.concatenate([one.nodes_deg for one in every])
    return replace(
        misfits[0],
        classes=Classes(
            edges_deg=np.concatenate([one.edges_deg for one in every]),
            member=np.concatenate([one.member + start for one, start in zip(every, ends[:-1], strict=True)]),
            count=np.concatenate([one.count for one in every]),
            pairs=np.stack([scipy.linalg.block_diag(*(one.pairs[k] for one in every)) for k in range(3)]),
            cumulants=np.concatenate([one.cumulants for one in every]),
            nodes_deg=nodes,
            speckle_db2=np.concatenate([one.speckle_db2 for one in every]),
        ),
        patch_share=shares,
        cell_share=scipy.linalg.block_diag(*(one.cell_share for one in misfits)),
        patch_of_cell=np.concatenate([own[one.patch_of_cell] for one, own in zip(misfits, columns, strict=True)]),
        true_deg=nodes,
        patches=patches,
    )
