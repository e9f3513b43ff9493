"""Radiometry: reference area of a pixel (beta0, sigma0, gamma0), and the noise floor in the same radiometry."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.config import Radar

_DB = 10.0 / np.log(10.0)


def of_sigma0(radiometry: str, incidence_deg: ArrayLike) -> NDArray[np.float64]:
    """Factor that converts sigma0 to another radiometry.

    Parameters
    ----------
    radiometry : str
        Radiometry, with its factor in brackets: ``sigma0_local`` or ``sigma0_ref`` (1), ``beta0`` (1 / sin), ``gamma0``
        or ``gamma0_rtc`` (1 / cos).
    incidence_deg : array_like
        Incidence on flat ground at the pixel's slant range, between 0 and 90 [deg].

    Returns
    -------
    ndarray of the shape of ``incidence_deg``
        Factor [linear].

    References
    ----------
    Raney, Freeman, Hawkins and Bamler, "A plea for radar brightness", IGARSS (1994): the echo divided by the pixel's
    area on flat ground (sigma0), in the slant plane (beta0), or across the direction to the radar (gamma0).
    """
    incidence = np.radians(np.asarray(incidence_deg, dtype=np.float64))
    match radiometry:
        case "beta0":
            return np.asarray(1.0 / np.sin(incidence))
        case "gamma0" | "gamma0_rtc":  # terrain flattening does not change level ground
            return np.asarray(1.0 / np.cos(incidence))
        case _:
            return np.ones_like(incidence)


def nesz_db(radar: Radar, incidence_deg: ArrayLike) -> NDArray[np.float64]:
    """Noise-equivalent sigma0 of a pass [dB]: ``radar.nesz_db``, interpolated as :func:`noise_floor_db` says."""
    incidence = np.asarray(incidence_deg, dtype=np.float64)
    if isinstance(radar.nesz_db, float):
        return np.full_like(incidence, radar.nesz_db)
    angles, levels = zip(*radar.nesz_db, strict=True)
    return np.asarray(np.interp(incidence, angles, levels))


def noise_floor_db(radar: Radar, incidence_deg: ArrayLike) -> NDArray[np.float64]:
    """Noise floor: level of an image that contains thermal noise alone.

    Parameters
    ----------
    radar : Radar
        Pass with the keys ``nesz_db`` (a number, or a table over the incidence on flat ground) and ``radiometry``.
    incidence_deg : array_like
        Incidence on flat ground [deg].

    Returns
    -------
    ndarray of the shape of ``incidence_deg``
        Noise level in the image's radiometry [dB]. A table ``nesz_db`` is interpolated linearly in dB between its rows,
        and is constant beyond its ends.
    """
    return np.asarray(nesz_db(radar, incidence_deg) + 10.0 * np.log10(of_sigma0(radar.radiometry, incidence_deg)))


def with_noise_db(law_db: NDArray[np.float64], noise_db: NDArray[np.float64] | float) -> NDArray[np.float64]:
    """Level of a law [dB] to which noise [dB] is added in power."""
    return np.asarray(_DB * np.logaddexp(law_db / _DB, np.asarray(noise_db) / _DB))
