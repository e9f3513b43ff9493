"""Summary of a sample of laws: band of sigma0, incidence at which it is known, combinations of X, modes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.curves import GRID_DEG

__all__ = [
    "Band",
    "Directions",
    "Level",
    "Modes",
    "band_of",
    "degrees",
    "directions",
    "known_between",
    "level_found",
    "level_words",
    "modes_of",
    "why_unknown",
]

Doubles = NDArray[np.float64]

_LEVELS = (0.05, 0.5, 0.95)
_OF_PRIOR = 0.5
_APART_DB = 1.0  # least rms difference, over the incidence seen, of the nearest curves of two modes
_LEAST_SHARE = 0.05
_COMPARED = 400  # curves
_LAST_DEG = 85.0


@dataclass(frozen=True)
class Band:
    """Pointwise 90 % band of curves of sigma0 at k angles.

    Attributes
    ----------
    incidence_deg, median_db, p05_db, p95_db : ndarray, shape (k,)
        Local incidence [deg]; median, 5 % and 95 % quantile of sigma0 [dB].
    """

    incidence_deg: Doubles
    median_db: Doubles
    p05_db: Doubles
    p95_db: Doubles

    @property
    def half_width_db(self) -> Doubles:
        """Half of the width of the 90 % band [dB], shape (k,)."""
        return np.asarray(0.5 * (self.p95_db - self.p05_db))


@dataclass(frozen=True)
class Level:
    """Sigma0 of a material at the middle of the incidence of one pass, with its 90 % interval.

    Attributes
    ----------
    incidence_deg : float
        Middle between the 5 and 95 % quantiles of the local incidence [deg].
    median_db, p05_db, p95_db : float
        Median, 5 % and 95 % quantile of sigma0 at ``incidence_deg`` [dB].
    """

    incidence_deg: float
    median_db: float
    p05_db: float
    p95_db: float

    def __str__(self) -> str:
        return f"{self.median_db:.1f} dB (90 %: {self.p05_db:.1f} to {self.p95_db:.1f})"


def degrees(low: float, high: float) -> str:
    """Text "between a and b degrees", rounded into the interval [deg]; the ends of a narrow one have two decimals."""
    inner = math.ceil(low), math.floor(high)
    if inner[0] < inner[1]:
        return f"between {inner[0]} and {inner[1]} degrees"
    return f"between {low:.2f} and {high:.2f} degrees"


def level_words(levels: Sequence[Level]) -> str:
    """Text with the levels, and with their incidences if there are several levels; empty if there is no level."""
    several = len(levels) > 1
    return ", ".join(f"{level}{f' at {level.incidence_deg:.1f} degrees' * several}" for level in levels)


def level_found(levels: Sequence[Level]) -> str:
    """Text with the levels of a material that does not fit; empty if there is no level."""
    return f"level found {level_words(levels)} (not to be used: does not fit)" if levels else ""


@dataclass(frozen=True)
class Directions:
    """Linear combinations of X; those that the data fix best come first.

    Attributes
    ----------
    weights : ndarray, shape (d, d)
        Weights of the combinations, one row of unit length for each; X is in standard deviations of its prior.
    ratio : ndarray, shape (d,)
        Ratio of the posterior to the prior standard deviation of each combination.
    """

    weights: Doubles
    ratio: Doubles

    def sentence(self, names: Sequence[str]) -> str:
        """Sentence that lists the combinations of X that the pixels fix, and those that they do not fix."""

        def said(row: Doubles) -> str:
            # a sign that makes the largest weight positive
            row = row * np.sign(row[np.argmax(np.abs(row))])
            large = [k for k in np.argsort(-np.abs(row)) if abs(row[k]) > _SAID * np.abs(row).max()]
            return " ".join(f"{'+' if row[k] > 0 else '-'}{abs(row[k]):.2g} {names[k]}" for k in large)

        fixed = [f"{said(w)} ({r:.2g})" for w, r in zip(self.weights, self.ratio, strict=True) if r <= _FIXED]
        loose = [f"{said(w)} ({r:.2g})" for w, r in zip(self.weights, self.ratio, strict=True) if r > _FIXED]
        parts = [("fixed by the pixels", fixed), ("not fixed", loose)]
        each = "; ".join(f"{text}: {', '.join(which)}" for text, which in parts if which)
        return f"{each} (each in standard deviations of the prior; in brackets, the standard deviation left)."


_SAID = 0.25  # least weight of a parameter that is named, as a share of the largest weight
_FIXED = 0.3


@dataclass(frozen=True)
class Modes:
    """Modes of a sample of laws: distinct groups of curves, the largest first.

    Attributes
    ----------
    share : ndarray, shape (g,)
        Share of the sample that is in each group.
    parameters : ndarray, shape (g, d)
        X of the curve in each group that is nearest to the median curve of the group.
    """

    share: Doubles
    parameters: Doubles


def band_of(curves_db: Doubles, step_deg: float = 1.0) -> Band:
    """90 % band of curves on the grid, shape (m, 361), at angles from 0 to 85 degrees in steps of ``step_deg``."""
    every = round(step_deg / (GRID_DEG[1] - GRID_DEG[0]))
    which = np.flatnonzero(GRID_DEG <= _LAST_DEG)[::every]
    low, middle, high = np.quantile(curves_db[:, which], _LEVELS, axis=0)
    return Band(GRID_DEG[which], middle, low, high)


def known_between(
    band: Band, prior: Band, seen_deg: Sequence[tuple[float, float]], known_db: float
) -> tuple[float, float] | None:
    """Largest interval of the incidence seen in which sigma0 is known.

    Parameters
    ----------
    band, prior : Band
        Bands of sigma0 by the posterior and by the prior, at the same angles.
    seen_deg : sequence of (float, float)
        5 and 95 % quantiles of the incidence in each pass [deg].
    known_db : float
        Largest half-width of the posterior's band [dB]; the prior's band must also be more than twice as wide.

    Returns
    -------
    (float, float) or None
        First and last angle of the interval [deg]; None if it holds fewer than two angles of the band.
    """
    angle, half = band.incidence_deg, band.half_width_db
    seen = np.any([(angle >= low) & (angle <= high) for low, high in seen_deg], axis=0)
    known = seen & (half <= known_db) & (half < _OF_PRIOR * prior.half_width_db)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], known, [False]]).astype(np.int8)))
    runs = edges.reshape(-1, 2)
    if not runs.size:
        return None
    first, after = runs[np.argmax(runs[:, 1] - runs[:, 0])]
    return (float(angle[first]), float(angle[after - 1])) if after - first > 1 else None


def why_unknown(
    incidence_deg: Doubles,
    half_width_db: Doubles,
    prior_half_width_db: Doubles,
    seen_deg: Sequence[Sequence[float]] | Doubles,
    known_db: float,
    withheld: str = "",
) -> str:
    """Reason why sigma0 is called known at no angle of the incidence seen.

    Parameters
    ----------
    incidence_deg, half_width_db, prior_half_width_db : ndarray, shape (k,)
        Local incidence [deg], and half-widths of the 90 % bands of posterior and prior there [dB].
    seen_deg : sequence of (float, float)
        5 and 95 % quantiles of the incidence in each pass [deg].
    known_db : float
        Largest half-width at which sigma0 is called known [dB].
    withheld : str
        Reason why sigma0 is not called known whatever its band, such as a law that does not fit; otherwise empty.

    Returns
    -------
    str
        Text with the reason: ``withheld``, or the band of the posterior is too wide, or at least half as wide as the
        band of the prior, or both. If neither is true at some angle, such angles span less than half a degree.
    """
    if withheld:
        return withheld
    inside = [np.linspace(low, high, 21) for low, high in seen_deg]
    angle = np.concatenate(inside)
    half = np.interp(angle, incidence_deg, half_width_db)
    prior = np.interp(angle, incidence_deg, prior_half_width_db)
    wide, near = half > known_db, half >= _OF_PRIOR * prior
    if not np.all(wide | near):
        return "its 90 % band is narrow enough only over less than half a degree"
    narrowest = int(np.argmin(half))
    said = [
        f"its 90 % band is nowhere narrower than +-{half[narrowest]:.3g} dB, wider than uncertainty.known_db "
        f"(+-{known_db:.3g} dB)"
    ] * bool(wide.all())
    prior_alone = f"the priors alone leave +-{prior[narrowest]:.2g} dB, so that the pixels do not even halve it"
    return " and ".join([*said, *[prior_alone] * bool(near[narrowest] or not said)])


def directions(posterior: Doubles, prior: Doubles) -> Directions:
    """Combinations of X, ordered by how well the data fix them, from draws of posterior, (m, d), and prior, (k, d).

    References
    ----------
    Spantini et al., "Optimal low-rank approximations of Bayesian linear inverse problems", SIAM J. Sci. Comput. 37
    (2015): the generalised eigenvalue problem of the covariances of posterior and prior.
    """
    from scipy.linalg import eigh

    scale = np.maximum(prior.std(axis=0), 1e-12)
    before, after = (np.atleast_2d(np.cov(one / scale, rowvar=False)) for one in (prior, posterior))
    before = before + 1e-9 * np.eye(len(before))
    values, vectors = eigh(after, before)
    # an eigenvector holds the weights of a combination, whose variance relative to the prior is the eigenvalue
    weights = (vectors / np.linalg.norm(vectors, axis=0)).T
    return Directions(np.asarray(weights), np.sqrt(np.maximum(values, 0.0)))


def modes_of(curves_db: Doubles, parameters: Doubles, seen_deg: Sequence[tuple[float, float]]) -> Modes:
    """Groups of curves that differ by 1 dB (rms over the incidence seen) or more, each with at least 5 % of the sample.

    Parameters
    ----------
    curves_db : ndarray, shape (m, 361)
        Curves [dB] on the grid.
    parameters : ndarray, shape (m, d)
        X of each curve.
    seen_deg : sequence of (float, float)
        5 and 95 % quantiles of the incidence in each pass [deg].

    References
    ----------
    Gower and Ross, "Minimum spanning trees and single linkage cluster analysis", Applied Statistics 18 (1969).
    """
    from scipy.cluster.hierarchy import fclusterdata

    every = max(1, len(curves_db) // _COMPARED)
    seen = np.any([(low <= GRID_DEG) & (high >= GRID_DEG) for low, high in seen_deg], axis=0)
    seen = seen if seen.any() else np.ones(GRID_DEG.size, dtype=np.bool_)
    curves, x = curves_db[::every][:, seen], parameters[::every]
    group = fclusterdata(curves / np.sqrt(curves.shape[1]), _APART_DB, criterion="distance", method="single")
    share = np.array([np.mean(group == k) for k in np.unique(group)])
    order = [k for k in np.argsort(-share, kind="stable") if share[k] >= _LEAST_SHARE]
    found = []
    for k in order:
        members = group == np.unique(group)[k]
        away = ((curves[members] - np.median(curves[members], axis=0)) ** 2).sum(axis=1)
        found.append(x[members][int(np.argmin(away))])
    return Modes(share[order], np.array(found).reshape(len(order), -1))
