"""Backscatter laws: sigma0 in dB as a function of the local incidence angle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

__all__ = ["LAWS", "Law", "mangia"]


def mangia(phi_rad: ArrayLike, parameters: ArrayLike) -> NDArray[np.float64]:
    r"""Four-parameter law, equation 1 of the paper.

    .. math:: \sigma^0_{dB}(\phi; X) = X_1 + X_2 \cos\phi + X_3 \exp(-X_4 \phi^2)

    Parameters
    ----------
    phi_rad : array_like
        Local incidence angle [rad], any shape.
    parameters : array_like, shape (4,)
        X1, X2, X3 [dB] and X4 [1/rad^2].

    Returns
    -------
    ndarray
        sigma0 [dB], shape of ``phi_rad``.

    References
    ----------
    "Calibration of a Radar Cross-section Model using a Surrogate Model Optimization
    Algorithm", eq. 1.
    """
    phi = np.asarray(phi_rad, dtype=np.float64)
    x1, x2, x3, x4 = np.asarray(parameters, dtype=np.float64)
    return np.asarray(x1 + x2 * np.cos(phi) + x3 * np.exp(-x4 * phi**2))


@dataclass(frozen=True)
class Law:
    """A backscatter law and what is known about its parameters.

    Attributes
    ----------
    function : callable
        ``(phi_rad, parameters) -> sigma0 [dB]``.
    names, units : tuple of str
        One per parameter.
    bounds : tuple of (float, float)
        Default search box.
    """

    function: Callable[[ArrayLike, ArrayLike], NDArray[np.float64]]
    names: tuple[str, ...]
    units: tuple[str, ...]
    bounds: tuple[tuple[float, float], ...]

    def __call__(self, phi_rad: ArrayLike, parameters: ArrayLike) -> NDArray[np.float64]:
        """Evaluate the law: angle [rad] to sigma0 [dB]."""
        return self.function(phi_rad, parameters)


LAWS: dict[str, Law] = {
    "mangia": Law(
        mangia,
        names=("X1", "X2", "X3", "X4"),
        units=("dB", "dB", "dB", "1/rad2"),
        bounds=((0.0, 50.0),) * 4,
    ),
}
