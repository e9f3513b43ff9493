"""Test of the fit of a calibrated law to its measured bins.

The residuals are those of the means, log standard deviations and skewnesses of all incidence-angle bins, whitened,
without priors. For a law that is right, with X drawn from priors and bounds, they have the covariance I - H, and the
sum of their squares is m - tr(H) in the mean, where H = J (J'J + Lambda)^-1 J' is the hat matrix of the linearised fit.
The variances between and within fields are held at the values estimated from the residuals of cells.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.calibration.history import Score
from radcal.calibration.law_fit import LOOKS, Residuals
from radcal.calibration.misfit import BinMisfit
from radcal.calibration.objectives import Comparison
from radcal.calibration.shared_fields import SharedFields
from radcal.radar.texture import equal_texture

__all__ = ["DOUBTFUL_SPREAD_DB", "FitTest", "Linearised", "check_fit", "linearised"]

REPLICATES = 999
LEVEL = 0.01  # half of the share of right laws that may be called wrong: replicates are drawn about an estimated law
MEAN_DB, SPREAD = 0.5, 0.15  # misfit of a bin's mean [dB], and of its standard deviation (relative), that matters
DOUBTFUL_SPREAD_DB = 3.0  # a larger standard deviation between fields can hide a misfit
_LIMIT = 1e-3  # log looks, and share of the interval between bounds, within which a value is at its limit
_PRESSED = 3.0  # standard errors by which the pixels ask for looks, or for X, beyond a limit
_STEP = 1e-4  # of the interval between bounds, and of log looks

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class FitTest:
    """Result of the test for one material.

    Attributes
    ----------
    fits : bool or None
        Whether the law fits; None where one density leaves no degree of freedom.
    residual_sum : float
        Sum of squared residuals of all bins and passes; NaN for one density, as are the other numbers of bins.
    expected : float
        Degrees of freedom m - tr(H): mean of that sum for a right law.
    p : float
        Share of parametric replicates of which this sum, or that of the means alone, is as unlikely.
    worst_deg : float
        Mean incidence of the bin with the largest misfit, in units of the misfit that matters [deg].
    worst_mean_db, worst_spread : float
        Simulated minus measured mean [dB], and simulated over measured standard deviation, in that bin.
    mean_db : float
        Simulated minus measured mean of all target pixels [dB].
    sd_db, measured_sd_db : float
        Standard deviation of the simulated and of the measured target pixels [dB].
    looks_limit : str
        Limit at which the effective looks end although the pixels ask for more, or for fewer: ``upper``, ``lower``, or
        empty.
    bounds : tuple of str
        Parameters at a bound beyond which the pixels ask for them, by more than three standard errors.
    distance : float
        Density rms over that of sampling.
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


@dataclass(frozen=True)
class Linearised:
    """Linearised fit: residuals at the law found, and what refits leave of disturbed ones.

    Attributes
    ----------
    residuals : ndarray, shape (m,)
        Whitened, without priors.
    jacobian : ndarray, shape (m, d)
        Their derivatives by the d searched values: X and log looks, in units of their intervals.
    covariance : ndarray, shape (d, d)
        (J'J + Lambda)^-1.
    information : ndarray, shape (d, d)
        Lambda: what priors and bounds say.
    """

    residuals: Doubles
    jacobian: Doubles
    covariance: Doubles
    information: Doubles

    @property
    def hat(self) -> Doubles:
        """Hat matrix H, shape (m, m)."""
        return np.asarray(self.jacobian @ self.covariance @ self.jacobian.T)

    @property
    def expected(self) -> float:
        """Degrees of freedom m - tr(H)."""
        return float(self.residuals.size - np.trace(self.hat))

    def refitted(self, disturbance: Doubles, rng: np.random.Generator) -> Doubles:
        """Residuals of replicates after a refit, (count, m) to (count, m), with X drawn from its prior."""
        left = np.eye(self.residuals.size) - self.hat
        root = np.linalg.inv(np.linalg.cholesky(self.information)) if self.information.size else self.information
        of_x = rng.normal(size=(len(disturbance), len(root))) @ root @ self.jacobian.T
        return np.asarray((disturbance + of_x) @ left)

    def asked(self) -> Doubles:
        """Standard errors by which the data alone ask each searched value to be larger, shape (d,)."""
        pull = -self.jacobian.T @ self.residuals
        return np.asarray(pull * np.sqrt(np.diag(self.covariance)))


def linearised(
    residuals: Residuals, parameters: Doubles, looks: float, box: Doubles, sensor: float | None, information: Doubles
) -> Linearised:
    """Linearise the fit of a law.

    Parameters
    ----------
    residuals : callable
        (X, looks) to whitened residuals without priors.
    parameters, looks : ndarray of shape (k,), float
        Law found.
    box : ndarray, shape (k, 2)
        Bounds of X.
    sensor : float or None
        Looks of the sensor, where the effective looks are searched.
    information : ndarray, shape (k + 1, k + 1)
        What priors and bounds say of X and log looks (inverse covariance).
    """
    width = np.append(box[:, 1] - box[:, 0], [] if sensor is None else [np.log(LOOKS[1] * sensor / LOOKS[0])])
    middle = np.append(parameters, [] if sensor is None else [np.log(looks)])

    def at(value: Doubles) -> Doubles:
        return residuals(value[: len(box)], looks if sensor is None else float(np.exp(value[-1])))

    # one step beyond a bound is no law that anybody simulates, but the same smooth function
    steps = _STEP * np.diag(width)
    columns = [(at(middle + step) - at(middle - step)) / (2.0 * _STEP) for step in steps]
    jacobian = np.stack(columns, axis=-1)
    inside = slice(width.size)
    known = information[inside, inside] * np.multiply.outer(width, width)
    return Linearised(at(middle), jacobian, np.linalg.inv(jacobian.T @ jacobian + known), known)


def _all_passes(comparison: Comparison, score: Score) -> tuple[BinMisfit, Residuals] | None:
    """Bins of all passes with their residuals by X and the looks in the first; None without bins.

    Texture and fields are shared.
    """
    parts = [(k, part) for k, part in enumerate(comparison.passes) if part is not None]
    moments = [part.moments for _, part in parts if part.moments is not None]
    if not moments:
        return None
    shared, sensor = SharedFields(moments), comparison.material.looks
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

    It does not fit where the sum of squared residuals, or that of the means alone, is larger than those of all but 1 %
    of parametric replicates (the smaller of both shares, and its law among the replicates) and the misfit matters (a
    bin's mean off by more than 0.5 dB, or its standard deviation by more than 15 %), or where the effective looks end
    at a limit beyond which the pixels ask for them by more than three standard errors.

    Parameters
    ----------
    comparison : Comparison
        Objective of the material.
    score : Score
        The best run's.
    pixels_db : (ndarray, ndarray)
        Simulated and measured target pixels [dB].
    distance : float
        Density rms over that of sampling.
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
    sums = _sums(found.refitted(moments.replicates(REPLICATES, rng), rng), n)
    if not comparison.material.law.has_curve:  # all searched values are taken for determined by the pixels
        searched = len(comparison.material.box) + comparison.free_looks
        if searched >= found.residuals.size:  # no degree of freedom is left
            return FitTest(None, *(float("nan"),) * 6, *levels, "", (), distance)
        sums, expected = sums * (1.0 - searched / found.residuals.size), found.expected - searched
    else:
        expected = found.expected
    p = _p(sums, _sums(found.residuals, n))
    worst, matters = _worst(moments, found.residuals)
    looks_limit, bounds = _limits(comparison, score, found, names)
    fits = not (p < LEVEL and matters) and not looks_limit
    return FitTest(fits, total, expected, p, *worst, *levels, looks_limit, bounds, distance)


def _sums(residuals: Doubles, n: int) -> Doubles:
    """Sums of squares of all residuals, and of those of the n means, shape (..., m) to (..., 2)."""
    # whitening by Cholesky's factor leaves the first statistic, the means, to themselves
    return np.stack([(residuals**2).sum(axis=-1), (residuals[..., :n] ** 2).sum(axis=-1)], axis=-1)


def _p(replicates: Doubles, found: Doubles) -> float:
    """Share of replicates, shape (count, 2), of which one of the two sums is as unlikely as those found, shape (2,)."""
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
    size = np.maximum(np.abs(difference[:, 0]) / MEAN_DB, np.abs(difference[:, 1]) / np.log1p(SPREAD))
    k = int(size.argmax())
    return (float(middle[k]), float(difference[k, 0]), float(np.exp(difference[k, 1]))), bool(size[k] > 1.0)


def _limits(
    comparison: Comparison, score: Score, found: Linearised, names: tuple[str, ...]
) -> tuple[str, tuple[str, ...]]:
    """Limit of the looks, and parameters at their bounds, where the pixels ask for values beyond."""
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
