"""Collections over a few scatterers, without a scene."""

import numpy as np

from radcal.bands import WIDTH_FACTOR
from radcal.signals.platform import LIGHT_MPS, Collection
from radcal.signals.scatterers import Scatterers


def collection(
    slant_m=5000.0, incidence_deg=45.0, length_m=100.0, swath_m=200.0, carrier_hz=10e9, range_m=2.0, azimuth_m=3.5,
    looks=1, bend_m=0.0, noise_m2=0.0, bits=None, antenna_m=None,
):  # fmt: skip
    """Collection over ``length_m`` of track whose swath is ``swath_m`` wide; the track may bend."""
    wavelength, band = LIGHT_MPS / carrier_hz, looks * WIDTH_FACTOR / azimuth_m
    edge, antenna = 0.25 * band * wavelength, antenna_m or 2.0 / band
    reach = (slant_m + swath_m) * edge / np.sqrt(1.0 - edge**2)
    prf = 110.0 * (0.5 * band + 2.0 / antenna)
    along = np.arange(-reach, length_m + reach, 100.0 / prf)
    incidence = np.radians(incidence_deg)
    track = np.zeros((along.size, 3)) + [0.0, 0.0, slant_m * np.cos(incidence)]
    reference = np.zeros_like(track) + [0.0, slant_m * np.sin(incidence), 0.0]
    track[:, 0] = reference[:, 0] = along
    track[:, 1] += bend_m * np.sin(2.0 * np.pi * along / (along[-1] - along[0]))
    track[:, 2] += 0.5 * bend_m * np.cos(5.0 * along / (along[-1] - along[0]))
    bandwidth = 0.5 * LIGHT_MPS * WIDTH_FACTOR / range_m
    migration = slant_m * (1.0 / np.sqrt(1.0 - (wavelength / antenna) ** 2) - 1.0)
    samples = int(np.ceil(4.0 * (0.6 * swath_m + migration + 5.0 * bend_m + 10.0 * range_m) * bandwidth / LIGHT_MPS))
    return Collection(
        track, reference, prf, 100.0, carrier_hz, bandwidth / samples, samples, antenna, band, looks, slant_m,
        noise_m2, bits,
    )  # fmt: skip


def at(one, azimuth_m, slant_m, height_m=0.0):
    """Place at a slant range from the nominal track."""
    height = one.reference_m[0, 1] / np.tan(np.arcsin(one.reference_m[0, 1] / one.range_m))
    return [azimuth_m, np.sqrt(slant_m**2 - (height - height_m) ** 2), height_m]


def ground(one, n, azimuth_m, swath_m, seed, relief_m=10.0, rcs_m2=1.0):
    """Scatterers at random places, with Gaussian amplitudes of a mean cross-section."""
    rng = np.random.default_rng(seed)
    slant = one.range_m + rng.uniform(-0.5 * swath_m, 0.5 * swath_m, n)
    heights = rng.uniform(-relief_m, relief_m, n)
    place = np.array([at(one, x, r, z) for x, r, z in zip(rng.uniform(*azimuth_m, n), slant, heights, strict=True)])
    amplitude = (rng.standard_normal(n) + 1j * rng.standard_normal(n)) * np.sqrt(0.5 * rcs_m2)
    return Scatterers.sorted(place, amplitude.astype(np.complex64))
