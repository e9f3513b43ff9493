"""Sampling of a posterior by an ensemble of walkers, with tests of its convergence.

The effects of cells and fields are integrated out of the likelihood of the cells of one material.

The cell means y of a material are y = Z b + u[field] + c[cell] + e, with normal effects u of the fields (standard
deviation tau) and c of the cells (standard deviation s), and speckle e of known variance. The normal equations of all
columns are tabulated over s and tau, so that a step of the sampler costs the same whatever the number of cells. What is
interpolated is relative to cells of one common variance, which changes little from one s to the next.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Doubles = NDArray[np.float64]
LogDensity = Callable[[Doubles], Doubles]
"""Function from points, shape (m, d), to the logarithms of their densities, shape (m,)."""

ESS, R_HAT = 400.0, 1.05
_LEAST_TIMES = 15.0  # least length of a chain in autocorrelation times, which a shorter chain underestimates
_GROUPS = 8  # groups of walkers that R-hat compares
_POWERS = (0.003, 0.01, 0.03, 0.1, 0.3)  # exponents of the likelihood in the stages from prior to posterior
_WARM_UP = 40  # steps of each stage
_FITTED = (100, 200)  # steps before each fit of the mixture, of which the first half is dropped
_COMPONENTS, _WIDENED = 12, 2.0  # number of components of the mixture, and factor on their covariances
_DROPPED = 0.125  # share of the steps after the last fit that is dropped at the start
_CHUNK = 250  # steps between two tests of convergence
_DRAWS = 4000  # kept
_CELL = np.log(np.geomspace(0.01, 3.0, 32))
_FIELD = np.log(np.geomspace(0.01, 8.0, 32))
_LEAST = 1e-10  # share added to the sum of squares, which rounding could make negative


class Marginal:
    """Normal equations of columns of cells, over the standard deviations of cells and fields.

    Parameters
    ----------
    columns : ndarray, shape (n, k)
        Columns Z, with the values y among them.
    variance : ndarray, shape (n,)
        Variance of each cell's speckle [dB^2].
    patch : ndarray of int, shape (n,)
        Field of each cell.

    References
    ----------
    Searle, Casella and McCulloch, "Variance Components" (1992), appendix M: inverse and determinant of a diagonal
    matrix plus one of rank one for each field.
    """

    def __init__(self, columns: Doubles, variance: Doubles, patch: NDArray[np.int64]) -> None:
        labels, field = np.unique(patch, return_inverse=True)
        k = columns.shape[1]
        self._cells, self._speckle = variance.size, float(np.exp(np.log(variance).mean()))
        self._gram = np.empty((_CELL.size, _FIELD.size, k, k))
        self._log_det = np.empty((_CELL.size, _FIELD.size))
        for i, cell in enumerate(np.exp(2.0 * _CELL)):
            weight = 1.0 / (variance + cell)
            weighted = columns * weight[:, None]
            own = columns.T @ weighted
            of_field = np.zeros((labels.size, k))
            np.add.at(of_field, field, weighted)
            total = np.bincount(field, weight, labels.size)
            for j, between in enumerate(np.exp(2.0 * _FIELD)):
                pulled = of_field * np.sqrt(between / (1.0 + between * total))[:, None]
                self._gram[i, j] = own - pulled.T @ pulled
                self._log_det[i, j] = np.log1p(between * total).sum() - np.log(weight).sum()
            self._gram[i] *= self._speckle + cell
            self._log_det[i] -= self._cells * np.log(self._speckle + cell)

    def at(self, log_cell: Doubles, log_field: Doubles) -> tuple[Doubles, Doubles]:
        """Gram matrices of the columns, (m, k, k), and log determinants, (m,), at logarithms of s and tau, (m,)."""
        (i, u), (j, v) = (_place(log_cell, _CELL), _place(log_field, _FIELD))
        corners = (i * _FIELD.size + j)[:, None] + np.array([0, 1, _FIELD.size, _FIELD.size + 1])
        shares = np.stack([(1 - u) * (1 - v), (1 - u) * v, u * (1 - v), u * v], axis=1)
        k = self._gram.shape[-1]
        gram = (shares[:, None] @ self._gram.reshape(-1, k * k)[corners]).reshape(-1, k, k)
        log_det = (shares * self._log_det.ravel()[corners]).sum(axis=1)
        common = self._speckle + np.exp(2.0 * np.clip(log_cell, _CELL[0], _CELL[-1]))
        return np.asarray(gram / common[:, None, None]), np.asarray(log_det + self._cells * np.log(common))


def _place(values: Doubles, grid: Doubles) -> tuple[NDArray[np.intp], Doubles]:
    """Grid point below each value, and distance from it in steps of the grid; values outside take the ends."""
    at = np.clip((values - grid[0]) / (grid[1] - grid[0]), 0.0, grid.size - 1.0)
    below = np.minimum(at.astype(np.intp), grid.size - 2)
    return below, at - below


def integrated(gram: Doubles, prior: Doubles, count: int) -> tuple[Doubles, Doubles]:
    """Gram matrices with the first ``count`` columns integrated out, and their half log determinants.

    Parameters
    ----------
    gram : ndarray, shape (m, k, k)
        Gram matrices.
    prior : ndarray, shape (m, count)
        Prior variance of each column's coefficient; its prior mean is 0.
    count : int
        Number of columns.

    Returns
    -------
    ndarray, shape (m, k - count, k - count)
        Schur complements.
    ndarray, shape (m,)
        Half of the log determinant of the precision, times the prior variance.
    """
    diagonal, of_prior = np.arange(count), 0.5 * np.log(prior).sum(axis=1)
    if gram.shape[1] == count + 1:  # one decomposition gives both results
        full = gram.copy()
        full[:, diagonal, diagonal] += 1.0 / prior
        full[:, count, count] += _LEAST * (1.0 + full[:, count, count])
        root = np.diagonal(np.linalg.cholesky(full), axis1=1, axis2=2)
        return root[:, count:, None] ** 2, np.log(root[:, :count]).sum(axis=1) + of_prior
    inner = gram[:, :count, :count].copy()
    inner[:, diagonal, diagonal] += 1.0 / prior
    root = np.linalg.cholesky(inner)
    left = np.linalg.solve(root, gram[:, :count, count:])
    half = np.log(np.diagonal(root, axis1=1, axis2=2)).sum(axis=1) + of_prior
    return gram[:, count:, count:] - np.swapaxes(left, 1, 2) @ left, half


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


@dataclass(frozen=True)
class Sample:
    """Sample of a probability density, with measures of its convergence.

    Attributes
    ----------
    draws : ndarray, shape (k, d)
        Points of the sample, thinned.
    ess : float
        Smallest effective sample size of all coordinates.
    r_hat : float
        Largest split R-hat of all coordinates.
    steps : int
        Number of steps of each walker.
    converged : bool
        Whether the effective sample size is 400 or more, R-hat below 1.05 and the kept steps 15 autocorrelation times
        or more.
    """

    draws: Doubles
    ess: float
    r_hat: float
    steps: int
    converged: bool


def split_r_hat(chains: Doubles) -> Doubles:
    """Split R-hat (potential scale reduction) over eight groups of walkers, shape (steps, walkers, d) to (d,).

    References
    ----------
    Gelman et al., "Bayesian Data Analysis", 3rd edition (2013), section 11.4.
    """
    size = chains.shape[1] // _GROUPS
    groups = np.swapaxes(chains[:, : size * _GROUPS].reshape(len(chains), size, _GROUPS, -1), 0, 1)
    half = len(chains) // 2
    halves = np.concatenate([groups[:, :half], groups[:, -half:]], axis=2).reshape(size * half, 2 * _GROUPS, -1)
    n = len(halves)
    within = halves.var(axis=0, ddof=1).mean(axis=0)
    between = n * halves.mean(axis=0).var(axis=0, ddof=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        found = np.sqrt(((n - 1) / n * within + between / n) / within)
    return np.where(within > 0.0, found, np.where(between > 0.0, np.inf, 1.0))


def sample(log_prior: LogDensity, log_likelihood: LogDensity, start: Doubles, steps: int, seed: int) -> Sample:
    """Sample from the product of prior and likelihood.

    The walkers start dispersed over the prior. The exponent of the likelihood grows to 1 in stages, so that walkers
    reach all modes of notable probability. A walker moves by the difference of two other walkers (ter Braak 2006), by a
    stretch, or to a point of a normal mixture, which is fitted twice to earlier steps. The normal mixture is
    needed because the parameters of a law often lie in a thin bent region, in which differences of distant walkers are
    seldom accepted. The sample is taken from the steps after the last fit, without their first eighth. No stage before
    the last fit is longer than a fifth of ``steps``.

    Parameters
    ----------
    log_prior, log_likelihood : callable
        Functions that give log densities; the likelihood is evaluated only where the prior density is positive.
    start : ndarray, shape (walkers, d)
        First point of each walker; its prior density must be positive.
    steps : int
        Largest number of steps of each walker.
    seed : int
        Seed of the random numbers.

    Returns
    -------
    Sample

    References
    ----------
    Foreman-Mackey et al., "emcee: the MCMC hammer", PASP 125 (2013); Goodman and Weare, "Ensemble samplers with affine
    invariance", Comm. App. Math. Comp. Sci. 5 (2010).
    """
    from emcee import EnsembleSampler, State
    from emcee.moves import DEMove, StretchMove

    walkers, d = start.shape

    def density(points: Doubles, power: float) -> Doubles:
        found = log_prior(points)
        inside = np.isfinite(found)
        if inside.any():
            found[inside] += power * log_likelihood(points[inside])
        return np.where(np.isnan(found), -np.inf, found)

    # DESnookerMove is left out: emcee 3.1.6 does not scale its jumps as ter Braak and Vrugt (2008) do, which is biased
    moves = [(DEMove(), 0.7), (DEMove(gamma0=1.0), 0.1), (StretchMove(), 0.2)]

    def sampler(power: float) -> EnsembleSampler:
        return EnsembleSampler(walkers, d, lambda points: density(points, power), moves=moves, vectorize=True)

    state = State(start, random_state=np.random.RandomState(seed % 2**32).get_state())
    stages = [(power, _WARM_UP) for power in _POWERS] + [(1.0, n) for n in _FITTED]
    for power, count in stages:
        walk = sampler(power)
        state = walk.run_mcmc(state, min(count, max(1, steps // 5)), skip_initial_state_check=True)
        state = State(state.coords, random_state=state.random_state)
        if power == 1.0:
            chain = walk.get_chain()
            mixture = _mixture_move(chain[len(chain) // 2 :].reshape(-1, d), seed)
            moves = [(mixture, 0.6), (DEMove(), 0.2), (DEMove(gamma0=1.0), 0.05), (StretchMove(), 0.15)]
    walk = sampler(1.0)
    while True:
        state = walk.run_mcmc(state, min(_CHUNK, steps - walk.iteration), skip_initial_state_check=True)
        found = _judged(walk.get_chain())
        if found.converged or walk.iteration >= steps:
            return found


def mixed(chances: Sequence[float], sizes: Sequence[int]) -> list[NDArray[np.intp]]:
    """Indices of draws to take, evenly, from each of several samples, so that together they have given chances."""
    most = min(size / chance for size, chance in zip(sizes, chances, strict=True))
    each = zip(chances, sizes, strict=True)
    return [np.linspace(0, size - 1, round(chance * most)).round().astype(np.intp) for chance, size in each]


def _mixture_move(points: Doubles, seed: int) -> Any:
    """Move whose proposals are drawn from a normal mixture fitted to points, shape (k, d)."""
    from emcee.moves import RedBlueMove
    from sklearn.mixture import GaussianMixture

    class MixtureMove(RedBlueMove):  # type: ignore[misc]
        """Metropolis-Hastings move to a point that does not depend on the position of the walker."""

        def get_proposal(self, sample: Doubles, complement: Any, random: Any) -> tuple[Doubles, Doubles]:  # noqa: ARG002
            place = random.choice(len(roots), size=len(sample), p=fitted.weights_)
            steps = (roots[place] @ random.standard_normal(sample.shape)[..., None])[..., 0]
            proposed = fitted.means_[place] + steps
            before, after = density(np.concatenate([sample, proposed])).reshape(2, -1)
            return proposed, before - after

    def density(at: Doubles) -> Doubles:
        """Log density of the mixture up to a constant; one product of matrices in place of one for each component."""
        away = (at @ across - shifts).reshape(len(at), *fitted.means_.shape)
        each = levels - 0.5 * (away**2).sum(axis=2)
        most = each.max(axis=1)
        return np.asarray(most + np.log(np.exp(each - most[:, None]).sum(axis=1)))

    # k-means++ takes some of the points as first centres; unlike k-means, it has no sums over threads
    fitted = GaussianMixture(
        _COMPONENTS, random_state=seed % 2**32, init_params="k-means++", reg_covar=1e-4, tol=1e-2, max_iter=50
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a mixture that has not converged gives valid proposals, too
        fitted.fit(points[:: max(1, len(points) // _DRAWS)])
    fitted.covariances_ *= _WIDENED
    fitted.precisions_cholesky_ /= np.sqrt(_WIDENED)
    roots = np.linalg.cholesky(fitted.covariances_)
    precise = fitted.precisions_cholesky_
    levels = np.log(fitted.weights_) + np.log(np.diagonal(precise, axis1=1, axis2=2)).sum(axis=1)
    across = np.concatenate(list(precise), axis=1)
    shifts = np.einsum("kd,kde->ke", fitted.means_, precise).ravel()
    return MixtureMove()


def _judged(chain: Doubles) -> Sample:
    """Sample from the steps of a chain without their first eighth, and the test of its convergence."""
    from emcee.autocorr import integrated_time

    kept = chain[int(_DROPPED * len(chain)) :]
    # the autocorrelation time of a coordinate that does not move is set to 1
    moving = np.ptp(kept.reshape(-1, kept.shape[-1]), axis=0) > 0.0
    times = np.ones(kept.shape[-1])
    with np.errstate(invalid="ignore"):  # a walker that does not move has no autocorrelation: the times are then NaN
        times[moving] = integrated_time(kept[..., moving], tol=0, has_walkers=True)
    longest = float(np.nanmax(np.where(np.isfinite(times), times, np.inf)))
    ess, r_hat = kept.shape[0] * kept.shape[1] / longest, float(split_r_hat(kept).max())
    flat = kept.reshape(-1, kept.shape[-1])
    return Sample(
        draws=flat[:: max(1, len(flat) // _DRAWS)],
        ess=ess,
        r_hat=r_hat,
        steps=len(chain),
        converged=ess >= ESS and r_hat < R_HAT and len(kept) >= _LEAST_TIMES * longest,
    )
