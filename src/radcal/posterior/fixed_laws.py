"""What the materials with fixed laws say of the image: level, area of the ground, noise, and errors of their laws."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.config import Uncertainty
from radcal.posterior.cells import CellMeans
from radcal.posterior.curves import NORMAL_90
from radcal.posterior.effects import FIXED_FORMS, Observed, Shared, common_columns, expected_effects, law_columns
from radcal.posterior.marginal import Marginal, integrated, normal_draws
from radcal.posterior.radiometry import Radiometry, before_the_image, likely, other_term, shown_by
from radcal.posterior.result import Image
from radcal.posterior.sampling import mixed, sample

Doubles = NDArray[np.float64]

CELL_DB = 0.4
"""Scale of the half-normal prior on the standard deviation of the cells of a field [dB]."""
_QUANTILES = (0.05, 0.5, 0.95)
_FREEDOM = 4.0  # of the t distributions of the level and of the errors of fixed laws
_UNKNOWN_DB = 20.0  # standard deviation of a level that is removed
_ANY_AREA = 1.0  # standard deviation of the exponent on the area where the cells alone shall tell it
_FIELD_LOG_SD = 0.42
FIELD_SPREAD = 1.0
"""Standard deviation of the logarithm of a material's field effects about that of all materials."""
_SCORES = scipy.special.ndtri(np.arange(0.5, 4000.0) / 4000.0)  # of a standard normal distribution
_LEAST_DB = 1e-3  # of the scale of the errors of fixed laws, which may be 0


def half_normal(log: Doubles, scale: float) -> Doubles:
    """Log density of a logarithm whose exponential has a half-normal distribution."""
    return np.asarray(log - 0.5 * (np.exp(log) / scale) ** 2)


def _scale_mixture(log: Doubles) -> Doubles:
    """Log density of log w, by which a variance is multiplied to make a normal distribution a t distribution."""
    return np.asarray(-0.5 * _FREEDOM * (log + np.exp(-log)))


_Given = tuple[Shared, Doubles, dict[str, Doubles]]
"""Shared effects, draws of levels and of the laws' errors [dB]."""


class _Scales:
    """Log density of the logarithms of the scales of all effects of the fixed materials, whatever the radiometry.

    A point holds: common sd of fields, sd of cells, scale of the laws' errors, sd of the form error, a factor on the
    variance of each pass's level, a factor on the variance of each law's error, and the sd of each material's fields.

    Parameters
    ----------
    fixed : mapping
        Fixed materials.
    areas : sequence of float
        Mean area of the ground in each pass [dB].
    config : Uncertainty
        Scales of the priors.
    offset : bool
        Whether the level of the image is unknown.
    chances : mapping
        Probability of each combination of area terms of the passes, before the values of the images are seen.
    """

    def __init__(
        self,
        fixed: Mapping[str, Observed],
        areas: Sequence[float],
        config: Uncertainty,
        offset: bool,
        chances: Mapping[tuple[int, ...], float],
    ) -> None:
        self.config, self.offset, self.passes, n = config, offset, len(areas), len(fixed)
        self.law_db = max(config.fixed_law_db, _LEAST_DB)
        self.common = 4 * self.passes + 1
        self.names, self.log_chances = list(fixed), np.log(list(chances.values()))
        self.expected = [expected_effects(areas, terms) for terms in chances]
        self.tables = [self._table(one, areas) for one in fixed.values()]
        self.dimension = 4 + self.passes + 2 * n
        self.level, self.law = slice(4, 4 + self.passes), slice(4 + self.passes, 4 + self.passes + n)
        self.field = slice(4 + self.passes + n, self.dimension)

    def _table(self, one: Observed, areas: Sequence[float]) -> Marginal:
        # near the noise, an error of the law hardly changes the power
        own = law_columns(one.together("incidence_deg")) * (1.0 - one.together("share")[:, None])
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

    def prior_variance(self, at: Doubles, area: float | None = None) -> Doubles:
        """Prior variances of the common effects, shape (m, dimension) to (m, 4 p + 1)."""
        found = np.ones((len(at), self.common))
        found[:, 0:-1:4] = _UNKNOWN_DB**2 if self.offset else self.config.level_db**2 * np.exp(at[:, self.level])
        found[:, 1:-1:4] = (self.config.area if area is None else area) ** 2
        return np.maximum(found, 1e-12)

    def _own_variance(self, at: Doubles, number: int) -> Doubles:
        error = np.exp(2.0 * at[:, 2] + at[:, self.law][:, number])
        columns = [error, self.config.fixed_slope**2 * error, *[np.exp(2.0 * at[:, 3])] * FIXED_FORMS]
        return np.asarray(np.maximum(np.stack(columns, axis=1), 1e-12))

    def gram(self, at: Doubles) -> tuple[Doubles, Doubles]:
        """Gram matrix of common effects and values, all else integrated out, and half the log determinant."""
        total, half = np.zeros((len(at), self.common + 1, self.common + 1)), np.zeros(len(at))
        for number, table in enumerate(self.tables):
            gram, log_det = table.at(at[:, 1], at[:, self.field][:, number])
            left, own = integrated(gram, self._own_variance(at, number), 2 + FIXED_FORMS)
            total, half = total + left, half + own + 0.5 * log_det
        return total, half

    def log_densities(self, at: Doubles) -> Doubles:
        """Log likelihood of the cells with each combination of area terms, and log of its probability, shape (m, c)."""
        gram, half = self.gram(at)
        variance, found = self.prior_variance(at), []
        for expected in self.expected:
            left, own = integrated(_less(gram, expected), variance, self.common)
            found.append(-0.5 * left[:, 0, 0] - half - own)
        return np.stack(found, axis=1) + self.log_chances

    def log_likelihood(self, at: Doubles) -> Doubles:
        """Log likelihood of the cells, with all effects and the area terms integrated out, shape (m,)."""
        return np.asarray(scipy.special.logsumexp(self.log_densities(at), axis=1))

    def effects(self, at: Doubles, expected: Doubles, rng: np.random.Generator, area: float | None = None) -> Doubles:
        """Draws of the common effects with given expected ones, one for each point, shape (m, 4 p + 1)."""
        gram, _ = self.gram(at)
        return expected + normal_draws(_less(gram, expected), self.prior_variance(at, area), self.common, rng)

    def law_errors(self, at: Doubles, effects: Doubles, number: int, rng: np.random.Generator) -> Doubles:
        """Draws of the error of one law given the common effects [dB], shape (m,)."""
        gram, _ = self.tables[number].at(at[:, 1], at[:, self.field][:, number])
        own = 2 + FIXED_FORMS
        right = gram[:, :own, -1] - np.einsum("mij,mj->mi", gram[:, :own, own:-1], effects)
        joined = np.concatenate([gram[:, :own, :own], right[..., None]], axis=2)
        return normal_draws(joined, self._own_variance(at, number), own, rng)[:, 0]

    def given(self, at: Doubles, chance: float, expected: Doubles, rng: np.random.Generator) -> _Given:
        """Effects by one combination of area terms, from draws of the scales that this combination has."""
        effects = self.effects(at, expected, rng)
        errors = {name: self.law_errors(at, effects, k, rng) for k, name in enumerate(self.names)}
        field = float(at[:, 0].mean()), float(at[:, 0].std())
        shared = Shared(chance, effects.mean(axis=0), np.cov(effects, rowvar=False), field)
        return shared, (effects - expected)[:, 0:-1:4], errors

    def from_priors(self) -> _Given:
        """Effects without fixed materials."""
        config, variance = self.config, np.ones(self.common)
        level = _UNKNOWN_DB if self.offset else config.level_db * np.sqrt(_FREEDOM / (_FREEDOM - 2.0))
        variance[0:-1:4], variance[1:-1:4] = level**2, config.area**2
        shared = Shared(1.0, self.expected[0], np.diag(variance), (float(np.log(config.field_db)), _FIELD_LOG_SD))
        return shared, np.repeat(level * _SCORES[:, None], self.passes, axis=1), {}


def _less(gram: Doubles, expected: Doubles) -> Doubles:
    """Gram matrices of common columns and values, shape (m, q + 1, q + 1), with the values less expected effects."""
    turn = np.eye(gram.shape[1])
    turn[:-1, -1] = -expected
    return np.asarray(turn.T @ gram @ turn)


def apart_db(cells: CellMeans, above_db: Doubles, field_db: float) -> Doubles:
    """Mean of image minus law over the cells of a fixed material: 5, 50 and 95 % quantile by speckle and fields [dB].

    Parameters
    ----------
    cells : CellMeans
        Cells in one pass.
    above_db : ndarray, shape (n,)
        Measured minus simulated mean of each cell [dB].
    field_db : float
        Standard deviation of the effects of fields [dB].

    Returns
    -------
    ndarray, shape (3,)
    """
    share = cells.pixels / cells.pixels.sum()
    of_field = np.bincount(np.unique(cells.patch, return_inverse=True)[1], share)
    half = NORMAL_90 * np.sqrt(share**2 @ cells.variance + field_db**2 * of_field @ of_field)
    return np.asarray(share @ above_db + half * np.array([-1.0, 0.0, 1.0]))


def image_from(
    fixed: Mapping[str, Observed],
    areas: Sequence[float],
    declared: Sequence[str],
    config: Uncertainty,
    offset: bool,
    seed: int,
) -> Image:
    """What the fixed materials say of effects that all materials share; without any, the priors of these effects.

    The other radiometry of a pass adds the area of the ground to the declared one, or takes it out. Its probability is
    its share of the likelihood, averaged over the scales of all effects.

    Parameters
    ----------
    fixed : mapping
        Cells of each fixed material.
    areas : sequence of float
        Mean area of the ground in each pass [dB].
    declared : sequence of str
        Declared radiometry of each pass.
    config : Uncertainty
        Scales of the priors, and settings of the sampler.
    offset : bool
        Whether the level of the image is unknown, because it is removed.
    seed : int
        Seed of the random numbers.

    References
    ----------
    Gelman et al., "Bayesian Data Analysis", 3rd edition (2013), section 7.4: probabilities of discrete models.
    """
    shown = [shown_by({name: one.cells[k] for name, one in fixed.items()}) for k in range(len(declared))]
    chances = before_the_image(declared, shown)
    scales = _Scales(fixed, areas, config, offset, chances)
    exponent, error, converged = np.full(len(declared), np.nan), np.full(len(declared), np.inf), True
    if fixed:
        rng = np.random.default_rng(seed)
        found = sample(scales.log_prior, scales.log_likelihood, scales.start(config.walkers, rng), config.steps, seed)
        at, converged = found.draws, found.converged
        share = scipy.special.softmax(scales.log_densities(at), axis=1)
        chances = dict(zip(chances, share.mean(axis=0).tolist(), strict=True))
        alone = scales.effects(at, np.zeros(scales.common), rng, _ANY_AREA)[:, 1:-1:4]
        exponent, error = alone.mean(axis=0), alone.std(axis=0)
        kept, column = likely(chances), {terms: number for number, terms in enumerate(chances)}
        each = [
            scales.given(at[_evenly(share[:, column[terms]])], chance, scales.expected[column[terms]], rng)
            for terms, chance in kept.items()
        ]
    else:
        kept, each = chances, [scales.from_priors()]
    taken = mixed(list(kept.values()), [len(levels) for _, levels, _ in each])

    def quantiles(*draws: Doubles) -> Doubles:
        mixture = np.concatenate([one[some] for one, some in zip(draws, taken, strict=True)])
        return np.asarray(np.quantile(mixture, _QUANTILES, axis=0))

    radiometry = {
        str(k + 1): Radiometry(
            float(exponent[k]),
            float(error[k]),
            other_term(declared[k]),
            sum(chance for terms, chance in chances.items() if terms[k]),
            names,
        )
        for k, names in enumerate(shown)
    }
    return Image(
        shared={" ".join(map(str, terms)): one[0] for terms, one in zip(kept, each, strict=True)},
        laws_db={name: quantiles(*(errors[name] for _, _, errors in each)) for name in fixed},
        apart_db={name: _apart_db(one, areas, config, next(iter(kept))) for name, one in fixed.items()},
        levels_db=quantiles(*(levels for _, levels, _ in each)).T,
        sampled=converged,
        radiometry=radiometry,
    )


def _evenly(weights: Doubles) -> NDArray[np.intp]:
    """Indices of as many draws as there are weights, each as often as its weight asks (systematic resampling)."""
    sums = np.cumsum(weights)
    places = (np.arange(weights.size) + 0.5) / weights.size * sums[-1]
    return np.asarray(np.searchsorted(sums, places), dtype=np.intp)


def _apart_db(one: Observed, areas: Sequence[float], config: Uncertainty, terms: Sequence[int]) -> Doubles:
    """Image minus law in the first pass that has cells, without the expected effect of the area."""
    cells = next(own for own in one.cells if own.size)
    above = one.above_db - common_columns(one, areas, config) @ expected_effects(areas, terms)
    return apart_db(cells, above[: cells.size], config.field_db)
