"""Sampling of a posterior by an ensemble of walkers, with tests of its convergence."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import scipy
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
_LEAST_VARIANCE = 1e-4  # added to the variances of a component
_DROPPED = 0.125  # share of the steps after the last fit that is dropped at the start
_CHUNK = 250  # steps between two tests of convergence
_DRAWS = 4000  # kept


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
    stretch, or to a point of a normal mixture, fitted twice to clusters of earlier steps. The mixture is needed
    because the parameters of a law often lie in a thin bent region, in which differences of distant walkers are seldom
    accepted. The sample is taken from the steps after the last fit, without their first eighth. No stage before
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
    """Move whose proposals are drawn from a normal mixture: a normal density for each cluster of points, (k, d)."""
    from emcee.moves import RedBlueMove

    class MixtureMove(RedBlueMove):  # type: ignore[misc]
        """Metropolis-Hastings move to a point that does not depend on the position of the walker."""

        def get_proposal(self, sample: Doubles, complement: Any, random: Any) -> tuple[Doubles, Doubles]:  # noqa: ARG002
            place = random.choice(len(roots), size=len(sample), p=weights)
            steps = (roots[place] @ random.standard_normal(sample.shape)[..., None])[..., 0]
            proposed = means[place] + steps
            before, after = density(np.concatenate([sample, proposed])).reshape(2, -1)
            return proposed, before - after

    def density(at: Doubles) -> Doubles:
        """Log density of the mixture up to a constant; one product of matrices in place of one for each component."""
        away = (at @ across - shifts).reshape(len(at), *means.shape)
        each = levels - 0.5 * (away**2).sum(axis=2)
        most = each.max(axis=1)
        return np.asarray(most + np.log(np.exp(each - most[:, None]).sum(axis=1)))

    points = points[:: max(1, len(points) // _DRAWS)]
    spread = points.std(axis=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # a cluster may be empty
        alike = points / np.where(spread > 0.0, spread, 1.0)
        _, label = scipy.cluster.vq.kmeans2(alike, _COMPONENTS, minit="++", rng=seed)
    parts = [points[label == k] for k in np.unique(label)]
    means = np.array([part.mean(axis=0) for part in parts])
    covariances = [np.atleast_2d(np.cov(part, rowvar=False, bias=True)) for part in parts]
    roots = np.linalg.cholesky(_WIDENED * (np.array(covariances) + _LEAST_VARIANCE * np.eye(len(spread))))
    precise = np.swapaxes(np.linalg.inv(roots), 1, 2)
    weights = np.array([len(part) for part in parts]) / len(points)
    levels = np.log(weights) + np.log(np.diagonal(precise, axis1=1, axis2=2)).sum(axis=1)
    across = np.concatenate(list(precise), axis=1)
    shifts = np.einsum("kd,kde->ke", means, precise).ravel()
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
