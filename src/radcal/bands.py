"""Radar frequency bands: their letters, and the width of the impulse response of a band."""

from __future__ import annotations

# IEEE Std 521-2019, table 1; P is not in that standard: it is the usual name of the part of UHF that SAR uses
# (Moreira et al., "A tutorial on synthetic aperture radar", IEEE GRSM 1 (2013), table 1)
LETTER_BANDS_GHZ = {
    "VHF": (0.03, 0.3),
    "UHF": (0.3, 1.0),
    "L": (1.0, 2.0),
    "S": (2.0, 4.0),
    "C": (4.0, 8.0),
    "X": (8.0, 12.0),
    "Ku": (12.0, 18.0),
    "K": (18.0, 27.0),
    "Ka": (27.0, 40.0),
    "V": (40.0, 75.0),
    "W": (75.0, 110.0),
    "P": (0.25, 0.5),
}

# Product of -3 dB width and bandwidth of the Taylor-weighted impulse response (radar.speckle), found by linear
# interpolation of its power on 20,001 points from 0 to 1; a test computes the product again. The number is fixed
# because every simulated pixel depends on its last digit, which would differ between BLAS libraries.
WIDTH_FACTOR = 1.1841552900179924


def _bare(label: str) -> str:
    return label.strip().casefold().removesuffix("band").rstrip(" -_")


def same_label(first: str, second: str) -> bool:
    """Whether two labels name the same frequency band, for example "X" and "x-band"."""
    return _bare(first) == _bare(second)


def letter_band(frequency_hz: float) -> str | None:
    """Letter of the frequency band that contains a frequency.

    Parameters
    ----------
    frequency_hz : float
        Carrier frequency [Hz].

    Returns
    -------
    str or None
        Letter of the band; None for a frequency outside of 30 MHz to 110 GHz.

    References
    ----------
    IEEE Std 521-2019, "IEEE standard letter designations for radar-frequency bands", table 1.
    """
    ghz = frequency_hz / 1e9
    return next((label for label, (low, high) in LETTER_BANDS_GHZ.items() if low <= ghz < high), None)


def limits_ghz(label: str) -> tuple[float, float] | None:
    """Limits of the frequency band that a label names, such as "X" or "X-band" [GHz]; None if it names no known one."""
    return next((limits for known, limits in LETTER_BANDS_GHZ.items() if same_label(label, known)), None)


def within_band(label: str, frequency_hz: float) -> bool | None:
    """Whether a frequency lies in the band that a label names.

    Parameters
    ----------
    label : str
        Label such as "X" or "X-band"; "P" is 0.25 to 0.5 GHz.
    frequency_hz : float
        Carrier frequency [Hz].

    Returns
    -------
    bool or None
        Whether the frequency lies in the band; None if the label names no known band.
    """
    limits = limits_ghz(label)
    return None if limits is None else limits[0] <= frequency_hz / 1e9 < limits[1]
