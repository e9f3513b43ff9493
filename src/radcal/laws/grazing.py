"""Clutter at grazing angles: a law of the sea, and a table of land clutter that takes the place of law and speckle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from radcal.laws.base import Law

# c1 to c5 of the formula of nrl_sea
_NRL = {
    "HH": (-73.0, 20.781, 7.351, 25.65, 0.0054),
    "VV": (-50.796, 25.93, 0.7093, 21.588, 0.00211),
}
_GRAZING_DEG = (0.1, 60.0)

LandClutter = Sequence[tuple[float, float, float]]
"""Rows of smallest depression angle [deg], mean sigma0 [dB] and Weibull spread, by falling angle."""

RURAL: LandClutter = (
    (4.0, -25.0, 2.6),
    (1.5, -27.0, 2.7),
    (0.75, -30.0, 3.0),
    (0.25, -32.0, 3.5),
    (0.0, -33.0, 3.8),
)
"""Interim model of rural ground of low relief.

From Billingsley, "Low-Angle Radar Land Clutter", William Andrew (2002), p. 295, at second hand: by public code that
cites this page.
"""


def nrl_sea(
    phi_rad: ArrayLike, parameters: ArrayLike, *, frequency_ghz: float, polarisation: str
) -> NDArray[np.float64]:
    r"""Empirical law of the mean backscatter of the sea by the Naval Research Laboratory.

    With the grazing angle :math:`\alpha` in degrees, the frequency :math:`f` in GHz and the sea state :math:`S`:

    .. math::

        \sigma^0_{dB} = c_1 + c_2 \lg\sin\alpha + \frac{(27.5 + c_3 \alpha) \lg f}{1 + 0.95 \alpha}
            + c_4 (1 + S)^{1 / (2 + 0.085 \alpha + 0.033 S)} + c_5 \alpha^2

    Parameters
    ----------
    phi_rad : array_like
        Local incidence angle [rad], any shape: 90 degrees minus the grazing angle, which is limited to 0.1 to 60
        degrees, the angles of the law's data.
    parameters : array_like, shape (1,) or (1, m)
        Sea state, 0 to 6: one, or m sea states if the last axis of ``phi_rad`` has the length 1.
    frequency_ghz : float
        Carrier frequency [GHz].
    polarisation : {'HH', 'VV'}
        Transmitted and received polarisation.

    Returns
    -------
    ndarray
        sigma0 [dB], shape of ``phi_rad``; for m sea states, the last axis has the length m.

    Raises
    ------
    KeyError
        The polarisation is neither HH nor VV.

    References
    ----------
    Gregers-Hansen and Mital, "An improved empirical model for radar sea clutter reflectivity", Naval Research
    Laboratory, NRL/MR/5310-12-9346 (2012).
    """
    c1, c2, c3, c4, c5 = _NRL[polarisation]
    (state,) = np.asarray(parameters, dtype=np.float64)
    angle = np.clip(90.0 - np.degrees(np.asarray(phi_rad, dtype=np.float64)), *_GRAZING_DEG)
    swell = c4 * (1.0 + state) ** (1.0 / (2.0 + 0.085 * angle + 0.033 * state))
    frequency = (27.5 + c3 * angle) * np.log10(frequency_ghz) / (1.0 + 0.95 * angle)
    return np.asarray(c1 + c2 * np.log10(np.sin(np.radians(angle))) + frequency + swell + c5 * angle**2)


def land_clutter(depression_deg: ArrayLike, table: LandClutter) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Mean sigma0 and Weibull spread of land at low depression angles.

    Parameters
    ----------
    depression_deg : array_like
        Depression angle of the antenna's line of sight to the ground [deg]; below the last row its values hold.
    table : sequence of (float, float, float)
        Rows as of :data:`RURAL`.

    Returns
    -------
    mean_db : ndarray
        Mean sigma0 [dB].
    spread : ndarray
        Spread a: the power of a resolution cell is Weibull distributed with the exponent 1 / a. a = 1 is speckle alone.
    """
    rows = np.asarray(table, dtype=np.float64)[::-1]
    row = np.maximum(np.searchsorted(rows[:, 0], depression_deg, side="right") - 1, 0)
    return rows[row, 1], rows[row, 2]


def weibull_power(exponential: ArrayLike, spread: ArrayLike) -> NDArray[np.float64]:
    """Weibull power of mean 1 from an exponential number of mean 1, for a spread of :func:`land_clutter`."""
    shape = np.asarray(spread, dtype=np.float64)
    return np.asarray(np.asarray(exponential) ** shape / scipy.special.gamma(1.0 + shape))


GRAZING: dict[str, Law] = {
    "nrl_sea": Law(
        nrl_sea,
        names=("sea_state",),
        units=("",),
        bounds=((0.0, 6.0),),
        limits=((0.0, 6.0),),
        valid_deg=(90.0 - _GRAZING_DEG[1], 90.0 - _GRAZING_DEG[0]),
        needs=("frequency_ghz", "polarisation"),
        polarisations=tuple(_NRL),
        formula="c1 + c2 lg sin(g) + (27.5 + c3 g) lg f / (1 + 0.95 g) + c4 (1 + S)^(1 / (2 + 0.085 g + 0.033 S)) "
        "+ c5 g^2",
        source="Gregers-Hansen and Mital, NRL/MR/5310-12-9346 (2012)",
    ),
}
