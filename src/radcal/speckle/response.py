"""Impulse response of a look, and the statistics of its speckle."""

from __future__ import annotations

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.bands import WIDTH_FACTOR

_NBAR, _SIDELOBE_DB = 4, 35
_SHARES = 20_001  # number of rows in a table of quantiles of the beta distribution
_REACH = 8.0  # distance [resolution widths] at which the impulse response, there below -45 dB, is cut off


def taylor_weights(frequency: NDArray[np.float64]) -> NDArray[np.float64]:
    """Taylor weighting of a signal's frequency band, with nbar = 4 and sidelobes at -35 dB.

    Parameters
    ----------
    frequency : ndarray
        Frequency divided by the bandwidth, between -0.5 and 0.5.

    Returns
    -------
    ndarray of the same shape
        Weights of mean 1.

    Notes
    -----
    ``scipy.signal.windows.taylor`` gives the same weights (a test compares them). This function of scipy is not used,
    because the import of scipy.signal takes longer than a small run.

    References
    ----------
    Carrara, Goodman and Majewski, "Spotlight Synthetic Aperture Radar" (1995), appendix D.
    """
    a = np.arccosh(10.0 ** (_SIDELOBE_DB / 20.0)) / np.pi
    m = np.arange(1, _NBAR, dtype=np.float64)
    widening = _NBAR**2 / (a**2 + (_NBAR - 0.5) ** 2)
    weights = np.ones_like(frequency)
    for k in m:
        zeros = np.prod(1.0 - k**2 / widening / (a**2 + (m - 0.5) ** 2))
        poles = np.prod(1.0 - k**2 / m[m != k] ** 2)
        weights += (-1.0) ** (k + 1) * zeros / poles * np.cos(2.0 * np.pi * k * frequency)
    return weights


def impulse_response(resolution_m: float, spacing_m: float) -> NDArray[np.float64]:
    """Sampled impulse response in one direction of the image, slant range or azimuth.

    Parameters
    ----------
    resolution_m : float
        -3 dB width of the impulse response after weighting [m].
    spacing_m : float
        Pixel spacing [m].

    Returns
    -------
    ndarray, shape (2 m + 1,)
        Real filter taps whose squares sum to 1, so that filtered white noise has the mean power of the unfiltered
        noise.
    """
    bandwidth = WIDTH_FACTOR / resolution_m
    m = int(np.ceil(_REACH * resolution_m / spacing_m))
    away_m, n = np.arange(-m, m + 1, dtype=np.float64) * spacing_m, 1024
    frequency = (np.arange(n) + 0.5) / n - 0.5
    weights = taylor_weights(frequency)
    turns = np.multiply.outer(away_m, frequency * min(bandwidth, 1.0 / spacing_m))
    taps = np.cos(2.0 * np.pi * turns) @ weights / weights.sum()
    return np.asarray(taps / np.sqrt((taps**2).sum()))


def speckle_correlation(distance: NDArray[np.float64]) -> NDArray[np.float64]:
    """Autocorrelation of the power of speckle along one direction of an image.

    Parameters
    ----------
    distance : ndarray
        Distance divided by the -3 dB width of the impulse response.

    Returns
    -------
    ndarray of the same shape
        Squared autocorrelation of the impulse response: 1 at the distance 0, 0.18 at the distance 1, and below 0.002
        from the distance 1.8 on. The autocorrelation is the same for any number of looks.

    References
    ----------
    Goodman, "Speckle Phenomena in Optics" (2007), section 4.4.
    """
    n = 256
    frequency = (np.arange(n) + 0.5) / n - 0.5
    power = taylor_weights(frequency) ** 2
    amplitude = np.cos(2.0 * np.pi * WIDTH_FACTOR * np.multiply.outer(distance, frequency)) @ power / power.sum()
    return np.asarray(amplitude**2)


def border_gain(taps: NDArray[np.floating], n: int) -> NDArray[np.float32]:
    """Gain of the amplitudes near the image's border, so that uniform ground has the same mean power up to the border.

    Parameters
    ----------
    taps : ndarray, shape (2 m + 1,)
        Impulse response of unit energy.
    n : int
        Number of pixels of the image in this direction.

    Returns
    -------
    ndarray of float32, shape (n,)
        For each pixel, the inverse square root of the energy of those taps that lie inside the image; 1 if all taps lie
        inside. With this gain, filtered white noise that begins at the border has the same mean power up to the border.
        Without the gain, the outermost pixel has 0.85 of the mean power (-0.7 dB) if the impulse response is 1.5 pixels
        wide.
    """
    half_width = len(taps) // 2
    total = np.concatenate([[0.0], np.cumsum(np.asarray(taps, dtype=np.float64) ** 2)])
    at = np.arange(n)
    energy = total[np.minimum(half_width + n - at, len(taps))] - total[np.maximum(half_width - at, 0)]
    inside = (at >= half_width) & (at < n - half_width)
    return np.where(inside, 1.0, 1.0 / np.sqrt(energy)).astype(np.float32)


def beta_share(power: NDArray[np.float32], looks: float, whole: int) -> NDArray[np.float32]:
    """Random numbers with a beta distribution, computed from the power of speckle.

    Parameters
    ----------
    power : ndarray
        Power of single-look speckle of mean 1, which has an exponential distribution.
    looks : float
        Number of looks L.
    whole : int
        Number of looks n, larger than L.

    Returns
    -------
    ndarray of float32, shape of ``power``
        Random numbers of mean 1: n / L times a quantile of the beta distribution of shapes L and n - L. The quantile is
        taken at the probability that the power of speckle is smaller than the given power, so that the random numbers
        grow with the power.
    """
    # exp(-power) is the probability of a larger power. As a function of the fourth root of this probability, the
    # quantile is smooth at 0 and steep at 1, and the rows of the table are close to each other at 1.
    root = 1.0 - np.linspace(1.0, 0.0, _SHARES) ** 3
    shares = scipy.special.betainccinv(looks, whole - looks, root**4) * (whole / looks)
    return np.asarray(np.interp(np.exp(-0.25 * power), root, shares), dtype=np.float32)
