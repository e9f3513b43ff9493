"""Posterior of one calibrated law, given what the fixed materials say of the effects that all materials share."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.config import Uncertainty
from radcal.posterior.effects import Observed, Shared, common_columns
from radcal.posterior.fixed_laws import CELL_DB, FIELD_SPREAD, half_normal
from radcal.posterior.marginal import Marginal, integrated, normal_draws
from radcal.posterior.sampling import Sample, mixed, sample

Doubles = NDArray[np.float64]

FORMS = 8
"""Number of components of the error of a law's form."""
_CHUNK = 128
_INCREASE = 1e-9


@dataclass(frozen=True)
class Parameters:
    """Parameters of a law and its levels at the knots.

    Attributes
    ----------
    box : ndarray, shape (d, 2)
        Bounds.
    integer : ndarray of bool, shape (d,)
        Whether a parameter is a whole number.
    levels : callable
        Function from X, shape (m, d), to levels with noise at the knots of all passes [dB], shape (m, k).
    log_prior : callable
        Function from X, shape (m, d), to the log density of priors other than the bounds, shape (m,).
    error : callable or None
        Function from X to the standard error of the levels [dB], shape (m,); None for a law with a curve.
    """

    box: Doubles
    integer: NDArray[np.bool_]
    levels: Callable[[Doubles], Doubles]
    log_prior: Callable[[Doubles], Doubles]
    error: Callable[[Doubles], Doubles] | None = None

    def scaled(self, deviates: Doubles) -> Doubles:
        """X at standard normal deviates, whose prior is uniform inside the bounds, shape (m, d)."""
        x = self.box[:, 0] + scipy.special.ndtr(deviates) * (self.box[:, 1] - self.box[:, 0])
        return np.asarray(np.where(self.integer, np.round(x), x))

    def deviates(self, x: Doubles) -> Doubles:
        """Deviates of X, shape (d,)."""
        width = np.maximum(self.box[:, 1] - self.box[:, 0], 1e-12)
        return np.asarray(scipy.special.ndtri(np.clip((x - self.box[:, 0]) / width, 1e-6, 1.0 - 1e-6)))


@dataclass(frozen=True)
class Draws:
    """Draws from the posterior of a law, each with its linear effects.

    Attributes
    ----------
    parameters : ndarray, shape (m, d)
        X.
    field_db, cell_db : ndarray, shape (m,)
        Standard deviations of the effects of fields and cells [dB].
    form : ndarray, shape (m, 8)
        Coefficients of the error of the form.
    linear : ndarray, shape (m, q)
        Coefficients of all linear effects, in the columns of the model from which the draws are.
    common : ndarray, shape (m, 4 p + 1)
        Effects that all materials share.
    fields_db : ndarray, shape (m,)
        Mean effect of the calibrated fields, weighted by their pixels [dB].
    sample : Sample
        Result of the sampler.
    """

    parameters: Doubles
    field_db: Doubles
    cell_db: Doubles
    form: Doubles
    linear: Doubles
    common: Doubles
    fields_db: Doubles
    sample: Sample

    def at(self, some: NDArray[np.intp]) -> Draws:
        """Some of the draws."""
        return replace(self, **{name: value[some] for name, value in vars(self).items() if name != "sample"})

    def thinned(self, most: int) -> Draws:
        """At most a number of draws, taken evenly."""
        return self.at(np.unique(np.linspace(0, len(self.field_db) - 1, most).round().astype(np.intp)))

    @classmethod
    def mixed(cls, each: Sequence[Draws], chances: Sequence[float]) -> Draws:
        """Draws from several posteriors with given probabilities, with the sample that has converged least."""
        taken = mixed(chances, [len(one.field_db) for one in each])
        parts = [vars(one.at(some)) for one, some in zip(each, taken, strict=True)]
        together = {name: np.concatenate([part[name] for part in parts]) for name in parts[0] if name != "sample"}
        return cls(**together, sample=min((one.sample for one in each), key=lambda one: (one.converged, one.ess)))


class LawModel:
    """Log density of X and of the scales of the effects of one calibrated material.

    A point holds a standard normal deviate for each parameter, and the logarithms of the standard deviations of fields,
    cells and form error. All linear effects are integrated out.

    Parameters
    ----------
    observed : Observed
        Cells in all passes.
    weights : ndarray, shape (n, k)
        Weights of the knots' levels in the level of each cell.
    parameters : Parameters
        Parameters and levels of the law.
    forms : ndarray, shape (n, 8)
        Columns of the error of the form, zero without one.
    flattening : ndarray, shape (n,)
        Change of each cell if the standard error of the incidence is one standard deviation larger [dB].
    common : Shared
        Effects that all materials share, given a radiometry.
    areas : sequence of float
        Mean area of the ground in each pass [dB].
    config : Uncertainty
        Scales of the priors.
    """

    def __init__(
        self,
        observed: Observed,
        weights: Doubles,
        parameters: Parameters,
        forms: Doubles,
        flattening: Doubles,
        common: Shared,
        areas: list[float],
        config: Uncertainty,
    ) -> None:
        self.law, self.config, self.d = parameters, config, len(parameters.box)
        self.observed, self.weights, self.forms = observed, weights, forms
        self.common = common
        self._root = np.linalg.cholesky(common.covariance + _INCREASE * np.eye(len(common.mean)))
        shared = common_columns(observed, areas, config)
        values = observed.together("measured_db") - observed.together("beside_db") - shared @ common.mean
        self.middle = float(values.mean())
        own = [forms, flattening[:, None], shared @ self._root]
        if parameters.error is not None:
            own = [np.ones((len(values), 1)), *own]
        self.linear = np.concatenate(own, axis=1)
        self.values = values - self.middle
        self.patch = observed.together("patch").astype(np.int64)
        self.variance = observed.together("variance")
        self.pixels, self.incidence_deg = observed.together("pixels"), observed.together("incidence_deg")
        self._tabulate()
        self.dimension = self.d + 3
        self.first_form = int(parameters.error is not None)  # column

    def _tabulate(self) -> None:
        self.table = Marginal(np.column_stack([self.linear, self.values, self.weights]), self.variance, self.patch)

    @property
    def measured_db(self) -> Doubles:
        """Measured mean of each cell, less what the simulator adds to its law and the expected common effects [dB]."""
        return np.asarray(self.values + self.middle)

    def part(self, mask: NDArray[np.bool_], config: Uncertainty) -> LawModel:
        """Model of the cells of a mask, shape (n,), with the same knots and priors."""
        found = copy(self)
        for name in ("weights", "forms", "linear", "values", "patch", "variance", "pixels", "incidence_deg"):
            setattr(found, name, getattr(self, name)[mask])
        found.config = config
        found._tabulate()
        return found

    def log_prior(self, at: Doubles) -> Doubles:
        """Log density of the priors, shape (m, dimension) to (m,)."""
        field, cell, form = at[:, self.d :].T
        middle, sd = self.common.field
        found = -0.5 * (at[:, : self.d] ** 2).sum(axis=1)
        found -= 0.5 * (field - middle) ** 2 / (sd**2 + FIELD_SPREAD**2)
        found += half_normal(cell, CELL_DB) + half_normal(form, self.config.form_db)
        return np.where((np.abs(at) < 9.0).all(axis=1), found, -np.inf)

    def _prior_variance(self, at: Doubles) -> Doubles:
        found = np.ones((len(at), self.linear.shape[1]))
        first = self.first_form
        if self.law.error is not None:
            found[:, 0] = np.maximum(self.law.error(self.law.scaled(at[:, : self.d])) ** 2, 1e-12)
        found[:, first : first + FORMS] = np.exp(2.0 * at[:, -1:])
        return found

    def _gram(self, at: Doubles) -> tuple[Doubles, Doubles]:
        """Gram matrices of the linear columns and of the values less the law, and log determinants."""
        gram, log_det = self.table.at(at[:, -2], at[:, -3])
        level = self.law.levels(self.law.scaled(at[:, : self.d])) - self.middle
        p = self.linear.shape[1]
        of_law = (gram[:, :, p + 1 :] @ level[..., None])[..., 0]
        found = gram[:, : p + 1, : p + 1].copy()
        found[:, :p, p] -= of_law[:, :p]
        found[:, p, :p] = found[:, :p, p]
        found[:, p, p] += -2.0 * of_law[:, p] + (of_law[:, p + 1 :] * level).sum(axis=1)
        return found, log_det

    def log_likelihood(self, at: Doubles) -> Doubles:
        """Log likelihood of the cells and of the priors on the curve, shape (m, dimension) to (m,)."""
        gram, log_det = self._gram(at)
        left, half = integrated(gram, self._prior_variance(at), self.linear.shape[1])
        return np.asarray(
            -0.5 * left[:, 0, 0] - half - 0.5 * log_det + self.law.log_prior(self.law.scaled(at[:, : self.d]))
        )

    def start(self, walkers: int, rng: np.random.Generator, best: Doubles | None = None) -> Doubles:
        """Points dispersed about the priors; one of them has the X of the best run."""
        found = rng.normal(0.0, 1.0, (walkers, self.dimension))
        found[:, self.d :] *= 0.5
        found[:, self.d :] += [self.common.field[0], np.log(0.5 * CELL_DB), np.log(self.config.form_db)]
        if best is not None:
            found[0, : self.d] = self.law.deviates(best)
        return found

    def drawn(self, seed: int, best: Doubles | None = None) -> Draws:
        """Draws from the posterior."""
        rng = np.random.default_rng(seed)
        found = sample(
            self.log_prior, self.log_likelihood, self.start(self.config.walkers, rng, best), self.config.steps, seed
        )
        at = found.draws
        parts = [self._gram(at[k : k + _CHUNK])[0] for k in range(0, len(at), _CHUNK)]  # many draws at once are slow
        linear = normal_draws(np.concatenate(parts), self._prior_variance(at), self.linear.shape[1], rng)
        first = self.first_form
        x, (field, cell) = self.law.scaled(at[:, : self.d]), np.exp(at[:, self.d : -1].T)
        common = self.common.mean + linear[:, first + FORMS + 1 :] @ self._root.T
        form_of = linear[:, first : first + FORMS]
        draws = Draws(x, field, cell, form_of, linear, common, np.empty(0), found)
        _, effects = self.field_effects(draws, rng)
        pixels = np.bincount(np.unique(self.patch, return_inverse=True)[1], self.pixels)
        return replace(draws, fields_db=effects @ pixels / pixels.sum())

    def levels(self, draws: Draws) -> Doubles:
        """Means of the cells by law and linear effects, without those of fields and cells [dB], shape (m, n)."""
        return np.asarray(self.law.levels(draws.parameters) @ self.weights.T + draws.linear @ self.linear.T)

    def field_effects(self, draws: Draws, rng: np.random.Generator) -> tuple[NDArray[np.int64], Doubles]:
        """Numbers of the fields, shape (f,), and draws of their effects given all else [dB], shape (m, f)."""
        labels, of = np.unique(self.patch, return_inverse=True)
        member = np.equal(of[:, None], np.arange(labels.size)).astype(np.float64)
        weight = 1.0 / (self.variance + draws.cell_db[:, None] ** 2)
        precision = weight @ member + 1.0 / draws.field_db[:, None] ** 2
        mean = (weight * (self.measured_db - self.levels(draws))) @ member / precision
        return labels, mean + rng.standard_normal(precision.shape) / np.sqrt(precision)
