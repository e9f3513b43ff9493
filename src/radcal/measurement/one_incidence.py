"""Recognition of a material that is seen at one incidence only, from which no angular law can be known."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

__all__ = ["LEAST_SPAN_DEG", "incidence_span_deg", "seen_at_one_incidence"]

# Over one degree even the steepest natural surface changes by about 1 dB (calm water, 27 dB between 20 and 44 degrees;
# land 0.1 to 0.5 dB), which is what fields of one material differ by: a slope is then not told from fields.
LEAST_SPAN_DEG = 1.0
_NORMAL_SPAN = 3.2897  # standard deviations between the 5 % and 95 % quantiles of a normal distribution


def incidence_span_deg(incidence_deg: ArrayLike, error_deg: float = 0.0) -> float:
    """Width of the range of incidence at which a material is seen.

    Parameters
    ----------
    incidence_deg : array_like, shape (pixels,)
        Mapped local incidence [deg].
    error_deg : float
        Standard error of the mapped incidence [deg], such as that of an elevation model in whole metres.

    Returns
    -------
    float
        Width between the 5 % and 95 % quantiles [deg], less the part that the error explains: the squares of the
        widths of independent distributions add.

    References
    ----------
    Carroll, Ruppert, Stefanski and Crainiceanu, "Measurement Error in Nonlinear Models", 2nd edition (2006), chapter 1:
    the variance of the mapped values is that of the true ones plus that of the error.
    """
    low, high = np.percentile(np.asarray(incidence_deg, dtype=np.float64), [5.0, 95.0])
    return float(np.sqrt(max(0.0, (high - low) ** 2 - (_NORMAL_SPAN * error_deg) ** 2)))


def seen_at_one_incidence(incidence_deg: ArrayLike, error_deg: float = 0.0) -> bool:
    """Whether a material's level can be known, but not its law.

    Parameters
    ----------
    incidence_deg, error_deg
        Arguments of :func:`incidence_span_deg`.

    Returns
    -------
    bool
        Whether the width of the range of incidence is below 1 degree, over which the laws of natural surfaces change
        by 0.1 to 1 dB, no more than fields of one material differ.

    References
    ----------
    Ulaby and Dobson, "Handbook of Radar Scattering Statistics for Terrain" (1989): levels over incidence, with their
    spread, by material.
    """
    return incidence_span_deg(incidence_deg, error_deg) < LEAST_SPAN_DEG
