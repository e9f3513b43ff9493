"""Collections over a few scatterers, without a scene."""

import numpy as np

from radcal.bands import WIDTH_FACTOR
from radcal.signals.platform import LIGHT_MPS, Collection
from radcal.signals.scatterers import Scatterers


def collection(
    slant_m=5000.0, incidence_deg=45.0, length_m=100.0, swath_m=200.0, carrier_hz=10e9, range_m=2.0, azimuth_m=3.5,
    looks=1, bend_m=0.0, noise_m2=0.0, bits=None, antenna_m=None, squint_deg=0.0, spot=False,
):  # fmt: skip
    """Collection over ``length_m`` of ground whose swath is ``swath_m`` wide; the track may bend."""
    wavelength, band = LIGHT_MPS / carrier_hz, looks * WIDTH_FACTOR / azimuth_m
    edge, antenna, squint = 0.25 * band * wavelength, antenna_m or 2.0 / band, np.sin(np.radians(squint_deg))
    behind, ahead = np.tan(np.arcsin([squint - edge, squint + edge]))
    first, last, half = (0.5 * length_m, 0.5 * length_m, 0.0) if spot else (0.0, length_m, swath_m)
    prf = 110.0 * ((1.0 / antenna if spot else 0.5 * band) + 2.0 / antenna)
    ends = first - (slant_m + half) * ahead, last - (slant_m - half if behind > 0.0 else slant_m + half) * behind
    along = np.arange(*ends, 100.0 / prf)
    incidence = np.radians(incidence_deg)
    track = np.zeros((along.size, 3)) + [0.0, 0.0, slant_m * np.cos(incidence)]
    reference = np.zeros_like(track) + [0.0, slant_m * np.sin(incidence), 0.0]
    track[:, 0] = along
    reference[:, 0] = 0.5 * length_m if spot else along + slant_m * np.tan(np.radians(squint_deg))
    track[:, 1] += bend_m * np.sin(2.0 * np.pi * along / (along[-1] - along[0]))
    track[:, 2] += 0.5 * bend_m * np.cos(5.0 * along / (along[-1] - along[0]))
    bandwidth = 0.5 * LIGHT_MPS * WIDTH_FACTOR / range_m
    cosine = np.sqrt(1.0 - squint**2)
    migration = slant_m * (1.0 / np.sqrt(1.0 - (abs(squint) + wavelength / antenna) ** 2) - 1.0 / cosine)
    if spot:
        migration = 0.5 * length_m * (abs(squint) + edge)
    samples = int(
        np.ceil(4.0 * (0.6 * swath_m / cosine + migration + 5.0 * bend_m + 10.0 * range_m) * bandwidth / LIGHT_MPS)
    )
    return Collection(
        track, reference, prf, 100.0, carrier_hz, bandwidth / samples, samples, antenna, band, looks,
        slant_m / cosine, noise_m2, bits, squint, reference[0] if spot else None,
    )  # fmt: skip


def nominal(one):
    """Slant range of the middle of the swath at zero Doppler."""
    return one.range_m * np.sqrt(1.0 - one.middle_sine**2)


def at(one, azimuth_m, slant_m, height_m=0.0):
    """Place at a slant range from the nominal track."""
    height = np.sqrt(nominal(one) ** 2 - one.reference_m[0, 1] ** 2)
    return [azimuth_m, np.sqrt(slant_m**2 - (height - height_m) ** 2), height_m]


def ground(one, n, azimuth_m, swath_m, seed, relief_m=10.0, rcs_m2=1.0):
    """Scatterers at random places, with Gaussian amplitudes of a mean cross-section."""
    rng = np.random.default_rng(seed)
    slant = nominal(one) + rng.uniform(-0.5 * swath_m, 0.5 * swath_m, n)
    heights = rng.uniform(-relief_m, relief_m, n)
    place = np.array([at(one, x, r, z) for x, r, z in zip(rng.uniform(*azimuth_m, n), slant, heights, strict=True)])
    amplitude = (rng.standard_normal(n) + 1j * rng.standard_normal(n)) * np.sqrt(0.5 * rcs_m2)
    return Scatterers.sorted(place, amplitude.astype(np.complex64))


def errors_of(checker):
    """Failed checks of a file's standard, by their names."""
    checker.check()
    wrong = {
        name: [one["details"] for one in found["details"] if one["severity"] == "Error" and not one["passed"]]
        for name, found in checker.failures().items()
    }
    return {name: texts for name, texts in wrong.items() if texts}
