"""Samples of a posterior by an ensemble of walkers, with the tests of their convergence."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["ESS", "R_HAT", "Sample", "sample", "split_r_hat"]

Doubles = NDArray[np.float64]
LogDensity = Callable[[Doubles], Doubles]
"""Points, shape (m, d), to log densities, shape (m,)."""

ESS, R_HAT = 400.0, 1.05
_LEAST_TIMES = 20.0  # autocorrelation times; a shorter chain underestimates them
_GROUPS = 8  # of walkers, for R-hat
_DROPPED = 0.25  # of the steps, at the start
_POWERS = (0.003, 0.01, 0.03, 0.1, 0.3)  # of the likelihood, on the way from prior to posterior
_WARM_UP = 40  # steps at each
_CHUNK = 500  # steps between two tests
_DRAWS = 4000  # kept


@dataclass(frozen=True)
class Sample:
    """Sample of a density.

    Attributes
    ----------
    draws : ndarray, shape (k, d)
        Points, thinned.
    ess : float
        Smallest effective sample size of a coordinate.
    r_hat : float
        Largest split R-hat of a coordinate.
    steps : int
        Steps of each walker.
    converged : bool
        Whether the effective sample size is 400 or more, R-hat below 1.05 and the steps 20 autocorrelation times or
        more, or the steps are 50 autocorrelation times.
    best : ndarray, shape (d,)
        Point of the largest log density.
    """

    draws: Doubles
    ess: float
    r_hat: float
    steps: int
    converged: bool
    best: Doubles


def split_r_hat(chains: Doubles) -> Doubles:
    """Potential scale reduction of eight groups of walkers, each split in halves, shape (steps, walkers, d) to (d,).

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


def sample(log_prior: LogDensity, log_likelihood: LogDensity | None, start: Doubles, steps: int, seed: int) -> Sample:
    """Sample prior times likelihood; without a likelihood, the prior alone.

    The walkers start dispersed over the prior, and the likelihood's power grows from 0 to 1 in five stages, so that
    walkers reach every mode that is worth it. Most moves are differences of two other walkers (ter Braak 2006), which
    suit curved and several modes better than the stretches of the rest. The first quarter of the steps is dropped.

    Parameters
    ----------
    log_prior, log_likelihood : callable
        Log densities; the likelihood is asked only where the prior is positive.
    start : ndarray, shape (walkers, d)
        Points of positive prior.
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
        if log_likelihood is not None and inside.any():
            found[inside] += power * log_likelihood(points[inside])
        return np.where(np.isnan(found), -np.inf, found)

    state = State(start, random_state=np.random.RandomState(seed % 2**32).get_state())
    for power in (*(_POWERS if log_likelihood is not None else ()), 1.0):
        # without DESnookerMove, whose jumps emcee 3.1.6 does not scale as ter Braak and Vrugt (2008): it is biased
        moves = [(DEMove(), 0.7), (DEMove(gamma0=1.0), 0.1), (StretchMove(), 0.2)]
        sampler = EnsembleSampler(walkers, d, lambda points, p=power: density(points, p), moves=moves, vectorize=True)
        if power < 1.0:
            state = sampler.run_mcmc(state, _WARM_UP, skip_initial_state_check=True)
            state = State(state.coords, random_state=state.random_state)
    while True:
        state = sampler.run_mcmc(state, min(_CHUNK, steps - sampler.iteration), skip_initial_state_check=True)
        found = _judged(sampler.get_chain(), sampler.get_log_prob())
        if found.converged or sampler.iteration >= steps:
            return found


def _judged(chain: Doubles, log_density: Doubles) -> Sample:
    """Last three quarters of the steps, and whether they have converged."""
    from emcee.autocorr import integrated_time

    kept = chain[int(_DROPPED * len(chain)) :]
    # all steps of a coordinate that does not move are one
    moving = np.ptp(kept.reshape(-1, kept.shape[-1]), axis=0) > 0.0
    times = np.ones(kept.shape[-1])
    with np.errstate(invalid="ignore"):  # a walker that does not move has no autocorrelation: the times are then NaN
        times[moving] = integrated_time(kept[..., moving], tol=0, has_walkers=True)
    longest = float(np.nanmax(np.where(np.isfinite(times), times, np.inf)))
    ess, r_hat = kept.shape[0] * kept.shape[1] / longest, float(split_r_hat(kept).max())
    flat = kept.reshape(-1, kept.shape[-1])
    place = np.unravel_index(int(np.argmax(log_density)), log_density.shape)
    return Sample(
        draws=flat[:: max(1, len(flat) // _DRAWS)],
        ess=ess,
        r_hat=r_hat,
        steps=len(chain),
        converged=ess >= ESS and r_hat < R_HAT and len(kept) >= _LEAST_TIMES * longest,
        best=chain[place],
    )
