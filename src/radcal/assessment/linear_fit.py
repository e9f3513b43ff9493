"""Fit of a law to measured bins, linearised at the law found."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.calibration.law_fit import LOOKS, Residuals

__all__ = ["STEP", "Linearised", "linearised"]

STEP = 1e-4
"""Step of the derivatives, in shares of the intervals of X and of log looks."""

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class Linearised:
    """Fit of a law, linearised at the law found: residuals, derivatives and covariance.

    Attributes
    ----------
    residuals : ndarray, shape (m,)
        Whitened residuals of the data, without priors.
    jacobian : ndarray, shape (m, d)
        Derivatives of the residuals with respect to d searched values: X and log looks, in units of their intervals.
    covariance : ndarray, shape (d, d)
        Covariance of the searched values, (J'J + Lambda)^-1.
    information : ndarray, shape (d, d)
        Information of priors and bounds on the searched values, Lambda (inverse covariance).
    """

    residuals: Doubles
    jacobian: Doubles
    covariance: Doubles
    information: Doubles

    @property
    def hat(self) -> Doubles:
        """Hat matrix H = J (J'J + Lambda)^-1 J' of the linearised fit, shape (m, m)."""
        return np.asarray(self.jacobian @ self.covariance @ self.jacobian.T)

    @property
    def expected(self) -> float:
        """Degrees of freedom of the m residuals after the fit, m - tr(H), H the hat matrix."""
        return float(self.residuals.size - np.trace(self.hat))

    def refitted(self, disturbance: Doubles, rng: np.random.Generator) -> Doubles:
        """Residuals of parametric replicates after a refit, shape (count, m), with X drawn from its prior."""
        left = np.eye(self.residuals.size) - self.hat
        root = np.linalg.inv(np.linalg.cholesky(self.information)) if self.information.size else self.information
        of_x = rng.normal(size=(len(disturbance), len(root))) @ root @ self.jacobian.T
        return np.asarray((disturbance + of_x) @ left)

    def asked(self) -> Doubles:
        """Number of standard errors by which the data alone would increase each searched value, shape (d,)."""
        pull = -self.jacobian.T @ self.residuals
        return np.asarray(pull * np.sqrt(np.diag(self.covariance)))


def linearised(
    residuals: Residuals, parameters: Doubles, looks: float, box: Doubles, sensor: float | None, information: Doubles
) -> Linearised:
    """Linearise the fit of a law.

    Parameters
    ----------
    residuals : callable
        Function of X and looks that returns whitened residuals without priors.
    parameters, looks : ndarray of shape (k,), float
        X and effective looks of the law found.
    box : ndarray, shape (k, 2)
        Bounds of X.
    sensor : float or None
        Looks of the sensor; None if the effective looks are fixed.
    information : ndarray, shape (k + 1, k + 1)
        Information of priors and bounds on X and log looks (inverse covariance).
    """
    width = np.append(box[:, 1] - box[:, 0], [] if sensor is None else [np.log(LOOKS[1] * sensor / LOOKS[0])])
    middle = np.append(parameters, [] if sensor is None else [np.log(looks)])

    def at(value: Doubles) -> Doubles:
        return residuals(value[: len(box)], looks if sensor is None else float(np.exp(value[-1])))

    # a step beyond a bound needs no simulation: the formula of the law is smooth there, too
    steps = STEP * np.diag(width)
    columns = [(at(middle + step) - at(middle - step)) / (2.0 * STEP) for step in steps]
    jacobian = np.stack(columns, axis=-1)
    inside = slice(width.size)
    known = information[inside, inside] * np.multiply.outer(width, width)
    return Linearised(at(middle), jacobian, np.linalg.inv(jacobian.T @ jacobian + known), known)
