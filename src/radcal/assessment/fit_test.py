"""Test of the fit of a calibrated law to its measured bins.

The m residuals are whitened differences between expected and measured means, log standard deviations and skewnesses of
all incidence-angle bins, without residuals of priors. If the law is right and X is drawn from its priors and bounds,
the m residuals have the covariance I - H, H being the hat matrix of the linearised fit, and the sum of their squares
has the expectation m - tr(H). The hat matrix is H = J (J'J + Lambda)^-1 J', with the derivatives J of the residuals
with respect to X and looks, and the information Lambda of priors and bounds. The variances between and within fields
are not refitted: they keep the values that were estimated from the residuals of cells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.form_error import missed_error_db
from radcal.assessment.linear_fit import Linearised, linearised
from radcal.calibration.history import Score
from radcal.calibration.law_fit import LOOKS, Residuals
from radcal.calibration.misfit import BinMisfit
from radcal.calibration.objectives import Comparison
from radcal.calibration.shared_fields import SharedFields
from radcal.radar.texture import equal_texture

__all__ = ["DOUBTFUL_SPREAD_DB", "FitTest", "check_fit"]

REPLICATES = 999
LEVEL = 0.01  # p below which a law does not fit; right laws fail up to twice as often: replicates use an estimated law
MEAN_DB, SPREAD = 0.5, 0.15  # misfit of a bin's mean [dB], and of its standard deviation (relative), that matters
DOUBTFUL_SPREAD_DB = 3.0  # a larger standard deviation between fields can hide a misfit
_UNMATCHED = 3.0  # density rms, in sampling errors, above which a density is not called matched
_LIMIT = 1e-3  # largest distance of a value that ends at a limit, in log looks or in shares of the interval of X
_PRESSED = 3.0  # least number of standard errors beyond a limit that the pixels ask for, in looks or X

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class FitTest:
    """Result of the test of the fit of one material's law.

    Attributes
    ----------
    fits : bool or None
        Whether the law fits; None if the law cannot be tested, for example because one density leaves no degree of
        freedom.
    residual_sum : float
        Sum of squared residuals of all bins and passes; if no bins were compared, NaN, like ``expected``, ``p`` and the
        three values of the worst bin.
    expected : float
        Degrees of freedom m - tr(H): expectation of the residual sum of a right law; 0 if the bins have no more values
        than a law without a curve has parameters.
    p : float
        p-value: share of parametric replicates whose residual sum, or whose sum over the means alone, is at least as
        unlikely as that of the law.
    worst_deg : float
        Mean incidence of the worst bin [deg], whose misfit is largest in units of 0.5 dB (mean) or 15 % (standard
        deviation).
    worst_mean_db, worst_spread : float
        Simulated minus measured mean [dB], and ratio of simulated to measured standard deviation, in the worst bin.
    mean_db : float
        Simulated minus measured mean of all target pixels [dB].
    sd_db, measured_sd_db : float
        Standard deviation of the simulated and of the measured target pixels [dB].
    looks_limit : str
        Limit at which the effective looks end although the pixels ask for looks beyond it: ``upper``, ``lower``, or
        empty.
    bounds : tuple of str
        Names of the parameters that end at a bound although the pixels ask for values more than three standard errors
        beyond it.
    distance : float
        Ratio of the density rms to the sampling error of the density.
    missed_db : float
        Largest error of the law by a wrong form that the test finds in fewer than nine of ten images
        (:func:`radcal.assessment.form_error.missed_error_db`) [dB]; NaN for a law that was not tested, does not fit or
        has no curve.
    """

    fits: bool | None
    residual_sum: float
    expected: float
    p: float
    worst_deg: float
    worst_mean_db: float
    worst_spread: float
    mean_db: float
    sd_db: float
    measured_sd_db: float
    looks_limit: str
    bounds: tuple[str, ...]
    distance: float
    missed_db: float = float("nan")

    @property
    def of_density(self) -> bool:
        """Whether no bins were compared, but only densities."""
        return bool(np.isnan(self.residual_sum))

    @property
    def unmatched(self) -> bool:
        """Whether only densities were compared, and the density rms exceeds three times its sampling error."""
        return self.of_density and self.distance > _UNMATCHED


def _all_passes(comparison: Comparison, score: Score) -> tuple[BinMisfit, Residuals] | None:
    """Bins of all passes, and their residuals as a function of X and of the looks in the first pass; None without bins.

    The passes share texture and fields.
    """
    parts = [(k, part) for k, part in enumerate(comparison.passes) if part is not None and part.moments is not None]
    if not parts:
        return None
    shared, sensor = SharedFields([part.moments for _, part in parts if part.moments]), comparison.material.looks
    each = [(part.material.looks, part.moment_residuals(comparison.in_pass(k, score))) for k, part in parts]
    return shared.joined, lambda x, looks: shared.residuals(
        [residuals(x, equal_texture(sensor, looks, there)) for there, residuals in each]
    )


def check_fit(
    comparison: Comparison,
    score: Score,
    pixels_db: tuple[Doubles, Doubles],
    distance: float,
    rng: np.random.Generator,
    names: tuple[str, ...] = (),
) -> FitTest:
    """Test whether the law of a run fits the measured bins of all passes.

    The law does not fit in either of two cases:

    - The p-value of the law is below 1 %, and the misfit matters: the mean of a bin is off by more than 0.5 dB, or its
      standard deviation by more than 15 %. The p-value compares two sums of squared residuals with those of parametric
      replicates: the sum over all statistics, and the sum over the means alone. For the law and for each replicate,
      the less likely of the two sums counts.
    - The effective looks end at a limit of the search, and the pixels ask for looks more than three standard errors
      beyond the limit.

    Parameters
    ----------
    comparison : Comparison
        Objective of the material.
    score : Score
        Score of the best run.
    pixels_db : (ndarray, ndarray)
        Simulated and measured target pixels [dB].
    distance : float
        Ratio of the density rms to the sampling error of the density.
    rng : Generator
        Random numbers of the replicates.
    names : tuple of str
        Names of the parameters.

    Returns
    -------
    FitTest

    References
    ----------
    Hastie, Tibshirani and Friedman, "The Elements of Statistical Learning", 2nd edition (2009), section 7.6: effective
    number of parameters. Davison and Hinkley, "Bootstrap Methods and their Application" (1997), section 4.2: p-values
    of parametric replicates.
    """
    simulated, measured = pixels_db
    levels = (float(np.mean(simulated) - np.mean(measured)), float(np.std(simulated)), float(np.std(measured)))
    bins = _all_passes(comparison, score)
    if bins is None:
        return FitTest(None, *(float("nan"),) * 6, *levels, "", (), distance)
    moments, residuals = bins
    found = _linearised(comparison, score, residuals)
    total, n = float(found.residuals @ found.residuals), moments.classes.size
    left = found.refitted(moments.replicates(REPLICATES, rng), rng)
    sums = _sums(left, n)
    if not comparison.material.law.has_curve:  # all searched values are taken for determined by the pixels
        searched = len(comparison.material.box) + comparison.free_looks
        if searched >= found.residuals.size:  # no degree of freedom is left
            return FitTest(None, total, 0.0, *(float("nan"),) * 4, *levels, "", (), distance)
        sums, expected = sums * (1.0 - searched / found.residuals.size), found.expected - searched
    else:
        expected = found.expected
    p = _p(sums, _sums(found.residuals, n))
    worst, matters = _worst(moments, found.residuals)
    looks_limit, bounds = _limits(comparison, score, found, names)
    fits = not (p < LEVEL and matters) and not looks_limit
    missed = _missed(comparison, score, found, moments, left) if fits else float("nan")
    return FitTest(fits, total, expected, p, *worst, *levels, looks_limit, bounds, distance, missed)


def _missed(comparison: Comparison, score: Score, found: Linearised, moments: BinMisfit, left: Doubles) -> float:
    """Error of the law's form that the test misses [dB], from the residuals of replicates; NaN without a curve."""
    material = comparison.material
    if not material.law.has_curve:
        return float("nan")
    n = moments.classes.size
    sums = _sums(left, n)
    critical = _critical(sums)

    def rejected(residuals: Doubles) -> NDArray[np.bool_]:
        return np.asarray((_sums(residuals, n) > critical).any(axis=-1) & (_sizes(moments, residuals) > 1.0).any(-1))

    angles = [part.material.target.incidence_deg for part in comparison.passes if part is not None]
    quantiles = np.array([np.quantile(one, [0.05, 0.95]) for one in angles])
    seen = float(quantiles[:, 0].min()), float(quantiles[:, 1].max())
    return missed_error_db(
        found, moments, left, rejected, material.law, np.asarray(score.parameters), material.box, seen
    )


def _critical(sums: Doubles) -> Doubles:
    """Sums of replicates, shape (count, 2) to (2,): if a law exceeds either of them, its ``_p`` is below ``LEVEL``."""
    ranks = [len(one) - np.searchsorted(np.sort(one), one, side="left") for one in sums.T]
    # the law counts among the replicates; so many replicates may be at least as unlikely as the law
    allowed = int(np.ceil(LEVEL * (len(sums) + 1))) - 2
    found = []
    for one, own, other in zip(sums.T, ranks, reversed(ranks), strict=True):
        # a law of this rank precedes the replicates whose own sum has the same rank
        unlikely = [np.sum((own < rank) | (other <= rank)) for rank in range(1, allowed + 2)]
        found.append(np.sort(one)[-int(np.sum(np.array(unlikely) <= allowed))])
    return np.array(found)


def _sums(residuals: Doubles, n: int) -> Doubles:
    """Sum of squares of all m residuals, and sum of squares of the residuals of the n means, shape (..., 2)."""
    # whitening by the Cholesky factor computes the residuals of the means, which come first, from the means alone
    return np.stack([(residuals**2).sum(axis=-1), (residuals[..., :n] ** 2).sum(axis=-1)], axis=-1)


def _p(replicates: Doubles, found: Doubles) -> float:
    """Share of replicates whose sums, shape (count, 2), are at least as unlikely as those found, shape (2,)."""
    every = np.concatenate([found[None], replicates])
    # rank 1 is the largest; equal sums share the rank of the last
    ranks = [len(sums) - np.searchsorted(np.sort(sums), sums, side="left") for sums in every.T]
    least = np.minimum(*ranks)
    return float(np.mean(least <= least[0]))


def _linearised(comparison: Comparison, score: Score, residuals: Residuals) -> Linearised:
    """Linearised fit of all passes; without a law's curve the residuals alone."""
    material, x = comparison.material, np.asarray(score.parameters, dtype=np.float64)
    if not material.law.has_curve:
        at, nothing = residuals(x, score.looks), np.empty((0, 0))
        return Linearised(at, np.empty((at.size, 0)), nothing, nothing)
    information = comparison.law_in(0, score).fit.prior_information
    sensor = material.looks if comparison.free_looks else None
    return linearised(residuals, x, score.looks, material.box, sensor, information)


def _worst(moments: BinMisfit, residuals: Doubles) -> tuple[tuple[float, float, float], bool]:
    """Incidence [deg], mean difference [dB] and ratio of spreads of the worst bin, and whether its misfit matters."""
    difference, middle = moments.differences(residuals), moments.classes.nodes_deg.mean(axis=1)
    size = _sizes(moments, residuals)
    k = int(size.argmax())
    return (float(middle[k]), float(difference[k, 0]), float(np.exp(difference[k, 1]))), bool(size[k] > 1.0)


def _sizes(moments: BinMisfit, residuals: Doubles) -> Doubles:
    """Misfit of each bin, in units of 0.5 dB (mean) or 15 % (standard deviation), from shape (..., m) to (..., n)."""
    difference = moments.differences(residuals)
    return np.asarray(np.maximum(np.abs(difference[..., 0]) / MEAN_DB, np.abs(difference[..., 1]) / np.log1p(SPREAD)))


def _limits(
    comparison: Comparison, score: Score, found: Linearised, names: tuple[str, ...]
) -> tuple[str, tuple[str, ...]]:
    """Limit of the looks and parameters at bounds, if a fit beyond limit or bound would be better."""
    box, asked = comparison.material.box, found.asked()
    if not asked.size:
        return "", ()
    looks_limit = ""
    if comparison.free_looks:
        for limit, end, sign in (("lower", LOOKS[0], -1.0), ("upper", LOOKS[1] * comparison.material.looks, 1.0)):
            if abs(np.log(score.looks / end)) <= _LIMIT and sign * asked[-1] > _PRESSED:
                looks_limit = limit
    x = (np.asarray(score.parameters) - box[:, 0]) / (box[:, 1] - box[:, 0])
    beyond = ((x <= _LIMIT) & (asked[: x.size] < -_PRESSED)) | ((x >= 1.0 - _LIMIT) & (asked[: x.size] > _PRESSED))
    called = names or tuple(comparison.material.law.names)
    return looks_limit, tuple(name for name, suffers in zip(called, beyond, strict=True) if suffers)
