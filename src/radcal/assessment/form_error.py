"""Error of a law of the wrong form that the test of its fit would miss.

A fit absorbs a part of the deviation between a true law and the calibrated form of law; the rest stays as an error of
the law. The deviations tried are Gaussian bumps, which lie at five angles over the incidence seen, with standard
deviations of an eighth and a quarter of its range. Each bump is enlarged until the test finds it in nine of ten images.
The errors of the law by these bumps, after the linearised refit, are the errors of form that the test finds reliably.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.linear_fit import STEP, Linearised
from radcal.calibration.misfit import BinMisfit
from radcal.radar.laws import Law

__all__ = ["POWER", "missed_error_db"]

POWER = 0.9
"""Share of images in which the test of the fit finds a deviation."""

Doubles = NDArray[np.float64]

_PLACES = 5  # angles of the bumps
_WIDTHS = (0.125, 0.25)  # standard deviations of the bumps, as shares of the range of incidence seen
_ANGLES = 41  # angles at which the error of the law is computed
_LARGEST_DB = 64.0  # largest bump; the test finds smaller bumps unless the fit absorbs them
_PRECISION = 0.01


def missed_error_db(
    found: Linearised,
    moments: BinMisfit,
    left: Doubles,
    rejected: Callable[[Doubles], NDArray[np.bool_]],
    law: Law,
    parameters: Doubles,
    box: Doubles,
    seen_deg: tuple[float, float],
) -> float:
    """Largest error of a law by a wrong form that the test of the fit finds in fewer than nine of ten images.

    Parameters
    ----------
    found : Linearised
        Linearised fit of the law.
    moments : BinMisfit
        Bins of all passes, with the covariance of their statistics.
    left : ndarray, shape (count, m)
        Residuals of parametric replicates of a right law after their refit.
    rejected : callable
        Function from residuals after a refit, shape (count, m), to whether the test rejects the law, shape (count,).
    law : Law
        Calibrated law, with a curve.
    parameters : ndarray, shape (d,)
        X of the law found.
    box : ndarray, shape (d, 2)
        Bounds of X.
    seen_deg : (float, float)
        5 and 95 % quantiles of the local incidence [deg].

    Returns
    -------
    float
        Largest absolute error of the law over the incidence seen, among the bumps tried, each as large as the test
        finds it in nine of ten images [dB].

    References
    ----------
    Kennedy and O'Hagan, "Bayesian calibration of computer models", J. R. Statist. Soc. B 63 (2001): discrepancy
    between the best law of a form and the truth. Lehmann and Romano, "Testing Statistical Hypotheses", 3rd edition
    (2005), section 3.1: power of a test.
    """
    angle = np.linspace(*seen_deg, _ANGLES)
    width = box[:, 1] - box[:, 0]
    steps = STEP * np.diag(width)
    slopes = np.stack(
        [law(np.radians(angle), parameters + one) - law(np.radians(angle), parameters - one) for one in steps], axis=-1
    ) / (2.0 * STEP)
    nodes = moments.classes.nodes_deg
    worst = 0.0
    for bump in _bumps(*seen_deg):
        means = np.zeros((len(nodes), 3))
        means[:, 0] = bump(nodes).mean(axis=1)
        whitened = moments.whitened(means)
        # change of X that follows the bump, in shares of the intervals
        change = (found.covariance @ found.jacobian.T @ whitened)[: width.size]
        error = float(np.abs(bump(angle) - slopes @ change).max())
        worst = max(worst, error * _found_size(whitened - found.hat @ whitened, left, rejected))
    return worst


def _bumps(low: float, high: float) -> Iterator[Callable[[Doubles], Doubles]]:
    """Bumps of 1 dB, as functions of the local incidence [deg]."""
    for share in _WIDTHS:
        for middle in np.linspace(low, high, _PLACES):
            yield partial(_bump, middle=float(middle), sd=share * (high - low))


def _bump(deg: Doubles, middle: float, sd: float) -> Doubles:
    return np.asarray(np.exp(-0.5 * ((deg - middle) / sd) ** 2))


def _found_size(shift: Doubles, left: Doubles, rejected: Callable[[Doubles], NDArray[np.bool_]]) -> float:
    """Factor on a shift of all residuals, shape (m,), at which the test rejects nine of ten replicates."""
    low, high = 0.0, 1.0
    while high < _LARGEST_DB and rejected(left + high * shift).mean() < POWER:
        low, high = high, 2.0 * high
    while high - low > _PRECISION * high:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if rejected(left + middle * shift).mean() >= POWER else (middle, high)
    return high
