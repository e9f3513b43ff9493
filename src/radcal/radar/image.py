"""Image formation: reflectivity of facets to a multilooked intensity image."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import fft

from radcal.config import Radar
from radcal.errors import ConfigError
from radcal.radar.geometry import Geometry
from radcal.radar.laws import Law
from radcal.radar.speckle import circular_gaussian, impulse_response, width_factor

__all__ = ["ImageFormation", "reflectivity"]

SPECKLE, THERMAL = 0, 1


def reflectivity(
    geometry: Geometry, laws: Mapping[str, Law], parameters: Mapping[str, ArrayLike]
) -> NDArray[np.float32]:
    """Expected sigma0 of each pixel, without noise or resolution.

    Parameters
    ----------
    geometry : Geometry
        Facets of the pass.
    laws, parameters : mapping
        Backscatter law and its parameters by material.

    Returns
    -------
    ndarray of float32, shape ``geometry.shape``
        Mean over the pixel's visible facets of sigma0(phi) [linear power]: radiometry
        ``sigma0_local``, no area term (the paper's eq. 3). Zero where nothing is visible.
    """
    n = geometry.shape[0] * geometry.shape[1]
    total = np.zeros(n)
    ids = np.arange(1, len(geometry.names) + 2)
    first = np.searchsorted(geometry.facet_material, ids)
    for k, name in enumerate(geometry.names):
        part = slice(first[k], first[k + 1])
        if part.start == part.stop or name not in laws:
            continue
        sigma0_db = laws[name](geometry.facet_incidence_rad[part], parameters[name])
        total += np.bincount(geometry.facet_pixel[part], 10.0 ** (sigma0_db / 10.0), minlength=n)
    total /= np.maximum(geometry.facets.ravel(), 1)
    return total.reshape(geometry.shape).astype(np.float32)


class ImageFormation:
    """Multilooked intensity of a reflectivity map, with common random numbers.

    Each look is h * (sqrt(sigma0) u + sqrt(nesz) v): u and v white circular Gaussian,
    h the impulse response; thermal noise is added before detection and passes through the
    same band limit. Looks are averaged in power.

    Parameters
    ----------
    radar : Radar
        Resolutions, spacings, looks, noise-equivalent sigma0.
    shape : (int, int)
        Image size, slant range by azimuth.

    Raises
    ------
    ConfigError
        A resolution is too fine for the pixel spacing.
    """

    def __init__(self, radar: Radar, shape: tuple[int, int]) -> None:
        for axis in ("range", "azimuth"):
            resolution = getattr(radar, f"{axis}_resolution_m")
            finest = width_factor() * getattr(radar, f"{axis}_spacing_m")
            if resolution < finest * (1 - 1e-9):
                raise ConfigError(
                    f"radar.{axis}_resolution_m is {resolution:g}, expected at least {finest:.2f} at a spacing of "
                    f"{getattr(radar, f'{axis}_spacing_m'):g} m (the image must be sampled above its bandwidth)."
                )
        self._radar = radar
        self._shape = shape
        taps = (
            impulse_response(radar.range_resolution_m, radar.range_spacing_m),
            impulse_response(radar.azimuth_resolution_m, radar.azimuth_spacing_m),
        )
        # zero padding by the taps' length makes the circular convolution a linear one
        self._padded = tuple(fft.next_fast_len(n + len(t)) for n, t in zip(shape, taps, strict=True))
        kernel = np.zeros(self._padded, dtype=np.float32)
        kernel[: len(taps[0]), : len(taps[1])] = np.outer(*taps)
        kernel = np.roll(kernel, (-(len(taps[0]) // 2), -(len(taps[1]) // 2)), axis=(0, 1))
        # a symmetric kernel has a real spectrum
        self._transfer = fft.fft2(kernel).real.astype(np.float32)
        self._noise_seed: int | None = None
        self._speckle: list[NDArray[np.complex64]] = []
        self._thermal: list[NDArray[np.complex64]] = []

    def intensity_db(self, sigma0: NDArray[np.float32], noise_seed: int) -> NDArray[np.float32]:
        """Form the image.

        Parameters
        ----------
        sigma0 : ndarray of float32, shape (rows, columns)
            Reflectivity [linear power].
        noise_seed : int
            Seed of speckle and thermal noise.

        Returns
        -------
        ndarray of float32, shape (rows, columns)
            Mean intensity of the looks [dB].
        """
        self._draw(noise_seed)
        amplitude = np.sqrt(sigma0)
        power = np.zeros(self._shape, dtype=np.float32)
        for speckle, thermal in zip(self._speckle, self._thermal, strict=True):
            look = self._filtered(amplitude * speckle) + thermal
            power += look.real**2 + look.imag**2
        power /= self._radar.looks
        return np.asarray(10.0 * np.log10(np.maximum(power, np.finfo(np.float32).tiny)), dtype=np.float32)

    def _draw(self, noise_seed: int) -> None:
        """Draw the random numbers once: they are the same in every run of a calibration."""
        if self._noise_seed == noise_seed:
            return
        level = np.float32(10.0 ** (self._radar.nesz_db / 20.0))
        looks = range(self._radar.looks)
        self._speckle = [circular_gaussian(noise_seed, look, SPECKLE, self._shape) for look in looks]
        self._thermal = [
            self._filtered(level * circular_gaussian(noise_seed, look, THERMAL, self._shape)) for look in looks
        ]
        self._noise_seed = noise_seed

    def _filtered(self, field: NDArray[np.complex64]) -> NDArray[np.complex64]:
        spectrum = fft.fft2(field, s=self._padded, workers=1)
        spectrum *= self._transfer
        rows, columns = self._shape
        return np.asarray(fft.ifft2(spectrum, overwrite_x=True, workers=1)[:rows, :columns])
