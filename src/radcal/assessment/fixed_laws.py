"""What the materials with fixed laws say of the image: level, area of the ground, noise, and errors of their laws.

The cell means of a fixed material, less its simulated level, are the sum of effects that all materials share, of an
error and a slope of its law, of a smooth error of the law's form, and of effects of fields and cells.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.cells import CellMeans, with_noise_db
from radcal.assessment.curves import NORMAL_90
from radcal.assessment.marginal import Marginal, integrated
from radcal.assessment.sampling import sample
from radcal.config import Uncertainty
from radcal.storage.dataclass_groups import About

__all__ = [
    "CELL_DB",
    "FIELD_SPREAD",
    "Common",
    "Observed",
    "apart_db",
    "common_columns",
    "common_of",
    "form_basis",
    "half_normal",
    "normal_draws",
]

Doubles = NDArray[np.float64]

FLATTENING = 0.25
"""Ratio of the relative flattening of a law to the relative error of the resolutions (docs/uncertainty.md)."""

FORM_DEG = 8.0
"""Correlation length of the error of a law's form over the incidence [deg]."""
CELL_DB = 0.4
"""Scale of the half-normal prior on the standard deviation of the cells of a field [dB]."""
_KNOT_DEG = 4.0
_QUANTILES = (0.05, 0.5, 0.95)
_FREEDOM = 4.0  # of the t distributions of the level and of the errors of fixed laws
_UNKNOWN_DB = 20.0  # standard deviation of a level that is removed
_FIELD_LOG_SD = 0.42
FIELD_SPREAD = 1.0
"""Standard deviation of the logarithm of a material's field effects about that of all materials."""
_FORMS = 4
_LEAST_DB = 1e-3  # of the scale of the errors of fixed laws, which may be 0


@dataclass(frozen=True)
class Observed:
    """Cells of one material in all passes, with the law at which the image was simulated.

    Attributes
    ----------
    cells : sequence of CellMeans
        Cells in each pass.
    law_db, slope_db : sequence of ndarray
        Level of the law at each cell [dB], and its slope [dB per degree].
    """

    cells: Sequence[CellMeans]
    law_db: Sequence[Doubles]
    slope_db: Sequence[Doubles]

    @property
    def size(self) -> int:
        """Number of cells in all passes."""
        return sum(one.size for one in self.cells)

    def moved(self, areas: Sequence[float]) -> Observed:
        """Cells of each pass with a number of times the area of the ground taken out of the measured values."""
        return replace(self, cells=[one.moved(area) for one, area in zip(self.cells, areas, strict=True)])

    def together(self, name: str) -> NDArray[Any]:
        """Attribute of the cells of all passes, one after the other."""
        return np.concatenate([getattr(one, name) for one in self.cells])

    @property
    def simulated_db(self) -> Doubles:
        """Level of the law with noise at each cell [dB]."""
        each = zip(self.law_db, self.cells, strict=True)
        return np.concatenate([with_noise_db(law, one.noise_db) for law, one in each])

    @property
    def above_db(self) -> Doubles:
        """Measured minus simulated mean of each cell [dB]."""
        return np.asarray(self.together("measured_db") - self.together("beside_db") - self.simulated_db)


@dataclass(frozen=True)
class Common:
    """Posterior of the effects that all materials share in p passes, as a normal distribution, from fixed materials."""

    mean: Annotated[Doubles, About("level, area exponent, noise, incidence by pass; point spread", shape="4 p + 1")]
    covariance: Annotated[Doubles, About("covariance of the shared effects", shape="4 p + 1, 4 p + 1")]
    field: Annotated[
        tuple[float, ...], About("mean and standard deviation of the logarithm of the common sd of fields", "log dB")
    ]
    laws_db: Annotated[
        Mapping[str, Doubles], About("5, 50 and 95 % quantile of image minus law, less the level, by material", "dB")
    ]
    apart_db: Annotated[
        Mapping[str, Doubles], About("5, 50 and 95 % quantile of image minus law in its first pass, by material", "dB")
    ]
    levels_db: Annotated[Doubles, About("5, 50 and 95 % quantile of the level of each pass", "dB", "p, 3")]
    sampled: Annotated[bool, About("sampler has converged")]


def form_basis(angles_deg: Doubles, knots_deg: Doubles, count: int) -> Doubles:
    """Columns of a smooth error of a law's form at angles [deg], shape (n, count), of variance 1 at each angle.

    The leading components of a Gaussian process with a squared exponential correlation, interpolated between knots.
    Columns beyond the number of knots are zero.

    References
    ----------
    Rasmussen and Williams, "Gaussian Processes for Machine Learning" (2006), section 4.3: eigenfunctions of a kernel.
    """
    away = (knots_deg[:, None] - knots_deg) / FORM_DEG
    values, vectors = np.linalg.eigh(np.exp(-0.5 * away**2))
    basis = (vectors * np.sqrt(np.maximum(values, 0.0)))[:, ::-1][:, :count]
    columns = [np.interp(angles_deg, knots_deg, column) for column in basis.T]
    return np.stack(columns + [np.zeros(len(angles_deg))] * (count - len(columns)), axis=-1)


def common_columns(of: Observed, areas: Sequence[float], config: Uncertainty) -> Doubles:
    """Columns of the effects that all materials share, for the cells of one material in p passes, shape (n, 4 p + 1).

    ``areas`` holds the mean area of the ground in each pass [dB], about which the area is centred.
    """
    p = len(of.cells)
    found = [np.zeros((one.size, 4 * p + 1)) for one in of.cells]
    middle = float(np.concatenate(of.law_db).mean())
    for k, (one, law, slope, area) in enumerate(zip(of.cells, of.law_db, of.slope_db, areas, strict=True)):
        signal = 1.0 - one.share
        found[k][:, 4 * k] = 1.0
        found[k][:, 4 * k + 1] = signal * (one.area_db - area)
        found[k][:, 4 * k + 2] = config.noise_db * one.share
        found[k][:, 4 * k + 3] = config.incidence_floor_deg * signal * slope
        found[k][:, -1] = -FLATTENING * config.point_spread * signal * (law - middle)
    return np.concatenate(found)


def half_normal(log: Doubles, scale: float) -> Doubles:
    """Log density of a logarithm whose exponential has a half-normal distribution."""
    return np.asarray(log - 0.5 * (np.exp(log) / scale) ** 2)


def _scale_mixture(log: Doubles) -> Doubles:
    """Log density of log w, by which a variance is multiplied to make a normal distribution a t distribution."""
    return np.asarray(-0.5 * _FREEDOM * (log + np.exp(-log)))


class _Scales:
    """Log density of the logarithms of the scales of all effects of the fixed materials.

    A point holds: common sd of fields, sd of cells, scale of the laws' errors, sd of the form error, a factor on the
    variance of each pass's level, a factor on the variance of each law's error, and the sd of each material's fields.

    Parameters
    ----------
    fixed : mapping
        Fixed materials; at least one.
    areas : sequence of float
        Mean area of the ground in each pass [dB].
    config : Uncertainty
        Scales of the priors.
    offset : bool
        Whether the level of the image is unknown.
    """

    def __init__(self, fixed: Mapping[str, Observed], areas: Sequence[float], config: Uncertainty, offset: bool):
        self.config, self.offset, self.passes, n = config, offset, len(areas), len(fixed)
        self.law_db = max(config.fixed_law_db, _LEAST_DB)
        self.common = 4 * self.passes + 1
        self.tables = [self._table(one, areas) for one in fixed.values()]
        self.dimension = 4 + self.passes + 2 * n
        self.level, self.law = slice(4, 4 + self.passes), slice(4 + self.passes, 4 + self.passes + n)
        self.field = slice(4 + self.passes + n, self.dimension)

    def _table(self, one: Observed, areas: Sequence[float]) -> Marginal:
        angle = one.together("incidence_deg")
        knots = np.arange(angle.min() - 0.5, angle.max() + 2.0 * _KNOT_DEG, _KNOT_DEG)
        forms = form_basis(angle, knots, _FORMS)
        own = np.column_stack([np.ones(angle.size), (angle - angle.mean()) / 10.0, forms])
        own *= 1.0 - one.together("share")[:, None]  # near the noise, an error of the law hardly changes the power
        columns = np.column_stack([own, common_columns(one, areas, self.config), one.above_db])
        return Marginal(columns, one.together("variance"), one.together("patch"))

    def start(self, walkers: int, rng: np.random.Generator) -> Doubles:
        """Points dispersed about the scales of the priors."""
        found = rng.normal(0.0, 0.5, (walkers, self.dimension))
        found[:, :4] += np.log([self.config.field_db, 0.5 * CELL_DB, self.law_db, self.config.form_db])
        found[:, self.field] += found[:, :1]
        return found

    def log_prior(self, at: Doubles) -> Doubles:
        """Log density of the priors, shape (m, dimension) to (m,)."""
        config = self.config
        found = -0.5 * ((at[:, 0] - np.log(config.field_db)) / _FIELD_LOG_SD) ** 2
        found += half_normal(at[:, 1], CELL_DB) + half_normal(at[:, 2], self.law_db)
        found += half_normal(at[:, 3], config.form_db)
        found += (_scale_mixture(at[:, self.level]).sum(axis=1)) + _scale_mixture(at[:, self.law]).sum(axis=1)
        found += (-0.5 * ((at[:, self.field] - at[:, :1]) / FIELD_SPREAD) ** 2).sum(axis=1)
        return np.where((np.abs(at) < 9.0).all(axis=1), found, -np.inf)

    def prior_variance(self, at: Doubles) -> Doubles:
        """Prior variances of the common effects, shape (m, dimension) to (m, 4 p + 1)."""
        found = np.ones((len(at), self.common))
        found[:, 0:-1:4] = _UNKNOWN_DB**2 if self.offset else self.config.level_db**2 * np.exp(at[:, self.level])
        found[:, 1:-1:4] = self.config.area**2
        return np.maximum(found, 1e-12)

    def _own_variance(self, at: Doubles, number: int) -> Doubles:
        error = np.exp(2.0 * at[:, 2] + at[:, self.law][:, number])
        columns = [error, self.config.fixed_slope**2 * error, *[np.exp(2.0 * at[:, 3])] * _FORMS]
        return np.asarray(np.maximum(np.stack(columns, axis=1), 1e-12))

    def gram(self, at: Doubles) -> tuple[Doubles, Doubles]:
        """Gram matrix of common effects and values, all else integrated out, and half the log determinant."""
        total, half = np.zeros((len(at), self.common + 1, self.common + 1)), np.zeros(len(at))
        for number, table in enumerate(self.tables):
            gram, log_det = table.at(at[:, 1], at[:, self.field][:, number])
            left, own = integrated(gram, self._own_variance(at, number), 2 + _FORMS)
            total, half = total + left, half + own + 0.5 * log_det
        return total, half

    def log_likelihood(self, at: Doubles) -> Doubles:
        """Log likelihood of the cells, with all effects integrated out, shape (m,)."""
        gram, half = self.gram(at)
        left, own = integrated(gram, self.prior_variance(at), self.common)
        return np.asarray(-0.5 * left[:, 0, 0] - half - own)

    def effects(self, at: Doubles, rng: np.random.Generator) -> Doubles:
        """Draws of the common effects, one for each point, shape (m, 4 p + 1)."""
        gram, _ = self.gram(at)
        return normal_draws(gram, self.prior_variance(at), self.common, rng)

    def law_errors(self, at: Doubles, effects: Doubles, number: int, rng: np.random.Generator) -> Doubles:
        """Draws of the error of one law given the common effects [dB], shape (m,)."""
        gram, _ = self.tables[number].at(at[:, 1], at[:, self.field][:, number])
        own = 2 + _FORMS
        right = gram[:, :own, -1] - np.einsum("mij,mj->mi", gram[:, :own, own:-1], effects)
        joined = np.concatenate([gram[:, :own, :own], right[..., None]], axis=2)
        return normal_draws(joined, self._own_variance(at, number), own, rng)[:, 0]


def normal_draws(gram: Doubles, prior: Doubles, count: int, rng: np.random.Generator) -> Doubles:
    """Draws of the first ``count`` coefficients from their normal distribution; the last column belongs to the values.

    Parameters
    ----------
    gram : ndarray, shape (m, count or more, k)
        Gram matrices.
    prior : ndarray, shape (m, count)
        Prior variances.

    Returns
    -------
    ndarray, shape (m, count)
    """
    inner = gram[:, :count, :count].copy()
    inner[:, np.arange(count), np.arange(count)] += 1.0 / prior
    mean = np.linalg.solve(inner, gram[:, :count, -1:])
    root = np.swapaxes(np.linalg.cholesky(inner), 1, 2)
    return np.asarray((mean + np.linalg.solve(root, rng.standard_normal((len(gram), count, 1))))[..., 0])


def apart_db(cells: CellMeans, law_db: Doubles, field_db: float) -> Doubles:
    """Mean of image minus law over the cells of a fixed material: 5, 50 and 95 % quantile by speckle and fields [dB].

    Parameters
    ----------
    cells : CellMeans
        Cells in one pass.
    law_db : ndarray, shape (n,)
        Level of the law at each cell [dB].
    field_db : float
        Standard deviation of the effects of fields [dB].

    Returns
    -------
    ndarray, shape (3,)
    """
    share = cells.pixels / cells.pixels.sum()
    of_field = np.bincount(np.unique(cells.patch, return_inverse=True)[1], share)
    half = NORMAL_90 * np.sqrt(share**2 @ cells.variance + field_db**2 * of_field @ of_field)
    above = cells.measured_db - cells.beside_db - with_noise_db(law_db, cells.noise_db)
    return np.asarray(share @ above + half * np.array([-1.0, 0.0, 1.0]))


def _apart_db(one: Observed, field_db: float) -> Doubles:
    cells, law = next(pair for pair in zip(one.cells, one.law_db, strict=True) if pair[0].size)
    return apart_db(cells, law, field_db)


def common_of(
    fixed: Mapping[str, Observed], areas: Sequence[float], config: Uncertainty, offset: bool, seed: int
) -> Common:
    """Posterior of the effects that all materials share, from the fixed materials; without any, their priors.

    Parameters
    ----------
    fixed : mapping
        Cells of each fixed material.
    areas : sequence of float
        Mean area of the ground in each pass [dB].
    config : Uncertainty
        Scales of the priors, and settings of the sampler.
    offset : bool
        Whether the level of the image is unknown, because it is removed.
    seed : int
        Seed of the random numbers.
    """
    p, rng = len(areas), np.random.default_rng(seed)
    if not fixed:
        variance = np.ones(4 * p + 1)
        level = _UNKNOWN_DB if offset else config.level_db * np.sqrt(_FREEDOM / (_FREEDOM - 2.0))
        variance[0:-1:4], variance[1:-1:4] = level**2, config.area**2
        levels = level * NORMAL_90 * np.array([[-1.0, 0.0, 1.0]] * p)
        return Common(
            np.zeros(4 * p + 1), np.diag(variance), (np.log(config.field_db), _FIELD_LOG_SD), {}, {}, levels, True
        )
    scales = _Scales(fixed, areas, config, offset)
    found = sample(scales.log_prior, scales.log_likelihood, scales.start(config.walkers, rng), config.steps, seed)
    at = found.draws
    effects = scales.effects(at, rng)
    errors = {name: scales.law_errors(at, effects, k, rng) for k, name in enumerate(fixed)}
    return Common(
        mean=effects.mean(axis=0),
        covariance=np.cov(effects, rowvar=False),
        field=(float(at[:, 0].mean()), float(at[:, 0].std())),
        laws_db={name: np.quantile(error, _QUANTILES) for name, error in errors.items()},
        apart_db={name: _apart_db(one, config.field_db) for name, one in fixed.items()},
        levels_db=np.quantile(effects[:, 0:-1:4], _QUANTILES, axis=0).T,
        sampled=found.converged,
    )
