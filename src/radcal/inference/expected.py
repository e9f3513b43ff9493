"""Expected cumulants of a material's incidence-angle bins, for one X and one number of looks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.laws import Law
from radcal.speckle.texture import log_speckle_cumulants


def law_cumulants(
    law: Law, parameters: ArrayLike, nodes_deg: NDArray[np.float64], noise_db: float = -np.inf
) -> NDArray[np.float64]:
    """Mean [dB], variance [dB^2] and third central moment [dB^3] of a law over the angles of each bin.

    Parameters
    ----------
    law : Law
        Backscatter law with a curve.
    parameters : array_like, shape (d,) or (k, d)
        Parameters X of the law; one X, or k.
    nodes_deg : ndarray, shape (n, m)
        Equally likely angles that represent each incidence-angle bin [deg].
    noise_db : float
        Noise-equivalent backscatter [dB], whose power is added to the power of the law.

    Returns
    -------
    ndarray, shape (n, 3), or (k, n, 3) for k X
    """
    per_neper = 10.0 / np.log(10.0)
    phi, x = np.radians(nodes_deg), np.asarray(parameters, dtype=np.float64)
    level = law(phi, x) if x.ndim == 1 else np.stack([law(phi, one) for one in x])
    if np.isfinite(noise_db):
        level = per_neper * np.logaddexp(level / per_neper, noise_db / per_neper)
    mean = level.mean(axis=-1)
    left = level - mean[..., None]
    return np.stack([mean, (left**2).mean(axis=-1), (left**3).mean(axis=-1)], axis=-1)


@dataclass(frozen=True)
class LawForward:
    """Model of a run with law, noise and speckle alone; the cumulants of independent factors add in dB.

    Attributes
    ----------
    law : Law
        Backscatter law with a curve.
    nodes_deg : ndarray, shape (n, m)
        Angles that represent each incidence-angle bin [deg].
    looks : float
        Number of looks of the speckle.
    noise_db : float
        Noise-equivalent backscatter [dB].
    """

    law: Law
    nodes_deg: NDArray[np.float64]
    looks: float
    noise_db: float = -np.inf

    def __call__(self, parameters: NDArray[np.float64]) -> NDArray[np.float64]:
        """Cumulants of each incidence-angle bin, shape (n, 3), at one X, shape (d,); of k X, shape (k, n, 3)."""
        return law_cumulants(self.law, parameters, self.nodes_deg, self.noise_db) + log_speckle_cumulants(self.looks)


def expected_cumulants(
    simulated: NDArray[np.float64],
    nominal: float,
    effective: float,
    patch_variance: NDArray[np.float64] | float = 0.0,
    shift: NDArray[np.float64] | float = 0.0,
) -> NDArray[np.float64]:
    """Simulated cumulants, converted to the material's looks, with variance of fields and error of incidence added.

    Parameters
    ----------
    simulated : ndarray, shape (n, 3)
        Mean [dB], variance [dB^2] and third central moment [dB^3] at the sensor's looks.
    nominal, effective : float
        Number of looks of the sensor, and effective number of looks of the material.
    patch_variance : ndarray, shape (n,), or float
        Variance inside each bin by the effects of fields (patches) and cells [dB^2].
    shift : ndarray, shape (n, 3), or float
        Change of the cumulants by an error of the local incidence.

    Returns
    -------
    ndarray, shape (n, 3)
        Expected cumulants; the variance is at least a thousandth of the simulated variance.
    """
    found = simulated + (log_speckle_cumulants(effective) - log_speckle_cumulants(nominal)) + shift
    found[:, 1] = np.maximum(found[:, 1] + patch_variance, 1e-3 * simulated[:, 1])
    return np.asarray(found)
