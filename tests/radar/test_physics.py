"""The image's statistics, a point target, layover, shadow and normals against theory.

Tolerances are those that a radar engineer asks for; the sample sizes make each a 3 sigma statement.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy import special, stats
from scipy.signal import windows

from radcal.config import Radar
from radcal.radar.image import ImageFormation
from radcal.radar.projection import make_geometry
from radcal.radar.reflectivity import Reflectivity, uniform
from radcal.scene.model import Scene
from radcal.simulators.builtin import BuiltinSimulator
from radcal.speckle.gaussian import circular_gaussian
from radcal.speckle.response import impulse_response

Build = Callable[..., Scene]
DARK = -200.0  # [dB] no noise at all
# four pixels are over two and a half resolutions: below the -35 dB sidelobes, so uncorrelated
APART = np.s_[12:-12:4, 12:-12:4]
SHAPE = (1070, 1070)  # (3 / (0.05 dB in linear))^2 = 67,000 independent values, and the border
SD_DB = 10.0 / np.log(10.0)


@pytest.mark.slow
def test_flat_ground_of_one_material(build_scene: Build) -> None:
    """Mean, distribution and spread of the whole chain: scene, facets, law, looks."""
    radar = Radar(
        altitude_m=20_000.0, looks=2, nesz_db=DARK, range_spacing_m=1.5, range_resolution_m=2.0, azimuth_spacing_m=2.5,
        azimuth_resolution_m=3.3,
    )  # fmt: skip
    scene = build_scene(lambda east, north: 0.0 * east, cells=(540, 460))
    geometry = make_geometry(scene, radar)
    simulator = BuiltinSimulator(geometry, radar, {"dyke": "mangia"})
    x = [-20.0, 5.0, 10.0, 3.0]
    images = [simulator.run({"dyke": x}, seed).astype(np.float64) for seed in (1, 2)]
    law = x[0] + x[1] * np.cos(phi := np.radians(geometry.incidence_deg)) + x[2] * np.exp(-x[3] * phi**2)
    ratio_db = np.concatenate([(image - law)[APART].ravel() for image in images])
    ratio = 10 ** (ratio_db / 10)
    looks, n = radar.looks, ratio.size
    assert looks * n >= 67_000 * 2
    assert abs(10 * np.log10(ratio.mean())) < 0.05
    assert stats.kstest(ratio, stats.gamma(looks, scale=1 / looks).cdf).pvalue > 0.003
    spread = SD_DB * np.sqrt(special.polygamma(1, looks))
    # the sample sd's own: (kurtosis - 1) / (4 n), from the cumulants of the log-gamma distribution
    kurtosis = 3 + special.polygamma(3, looks) / special.polygamma(1, looks) ** 2
    assert 3 * np.sqrt((kurtosis - 1) / (4 * n)) < 0.02
    assert ratio_db.std() == pytest.approx(spread, rel=0.02)


def test_zero_reflectivity_measures_the_noise() -> None:
    image = ImageFormation(Radar(looks=1), SHAPE, -23.0).intensity(uniform(np.zeros(SHAPE, np.float32)), 3)
    power = image[APART].astype(np.float64).ravel()
    assert power.size >= 67_000
    assert 10 * np.log10(power.mean()) == pytest.approx(-23.0, abs=0.05)
    assert stats.kstest(power / 10**-2.3, stats.expon.cdf).pvalue > 0.003


@pytest.mark.parametrize(("sigma0_db", "nesz_db"), [(-8.0, DARK), (DARK, -13.0), (-8.0, -13.0)])
def test_even_ground_is_even_up_to_the_border(sigma0_db: float, nesz_db: float) -> None:
    """Mean level of every row and column, the outermost too, over ground and noise of one level."""
    shape, radar = (300, 340), Radar(looks=64)
    even = uniform(np.full(shape, 10 ** (sigma0_db / 10), np.float32))
    power = ImageFormation(radar, shape, nesz_db).intensity(even, 8).astype(np.float64)
    expected = 10 ** (sigma0_db / 10) + 10 ** (nesz_db / 10)
    for axis, (spacing, resolution) in enumerate([(2.5, 3.5), (1.5, 2.0)], start=1):
        taps = impulse_response(resolution, spacing)
        # variance of the mean of n correlated intensities: sum of the squared correlations of the field (Siegert)
        correlation = np.correlate(taps, taps, mode="full") ** 2
        n = power.shape[axis % 2]
        sd = np.sqrt(correlation.sum() / (radar.looks * n))
        # 640 rows and columns in all: 4.5 sigma; the border was 14 % (0.65 and 0.74 dB) dark
        assert 4.5 * sd < 0.05
        np.testing.assert_allclose(power.mean(axis=axis % 2) / expected, 1.0, atol=4.5 * sd)


def test_power_of_materials_adds() -> None:
    """Two materials in every pixel: the mean power is the sum of theirs."""
    shape = (420, 430)  # 10,000 pixels that are apart, of four looks: a standard error of half a percent
    first = np.full(shape, 0.3, np.float32)
    formation = ImageFormation(Radar(looks=4), shape, DARK)
    alone = formation.intensity(uniform(first), 5)
    both = Reflectivity(
        shape,
        np.arange(0, 2 * first.size + 1, 2, dtype=np.int32),
        np.tile(np.array([1, 2], np.uint8), first.size),
        np.repeat(np.float32(0.3), 2 * first.size) * np.tile(np.array([1, 2], np.float32), first.size),
    )
    power = formation.intensity(both, 5)[APART].astype(np.float64)
    assert power.mean() == pytest.approx(0.9, rel=3 / np.sqrt(4 * power.size))
    assert alone[APART].mean() == pytest.approx(0.3, rel=3 / np.sqrt(4 * power.size))


@pytest.mark.parametrize("spacing", [(1.0, 1.0), (1.6, 2.7)])
def test_point_target(spacing: tuple[float, float]) -> None:
    """Widths, highest sidelobe and energy of a lone bright pixel against scipy's Taylor window."""
    resolutions = (2.0, 3.5)
    radar = Radar(
        looks=1, range_spacing_m=spacing[0], azimuth_spacing_m=spacing[1], range_resolution_m=resolutions[0],
        azimuth_resolution_m=resolutions[1],
    )  # fmt: skip
    sigma0 = np.zeros((129, 129), dtype=np.float32)
    sigma0[64, 64] = 1e4
    look = ImageFormation(radar, sigma0.shape, DARK).look(uniform(sigma0), 2).astype(np.complex128)
    # the pixel's own speckle scales the whole response, which has unit energy
    speckle = np.abs(circular_gaussian(2, 0, 1, sigma0.shape)[64, 64]) ** 2
    assert (np.abs(look) ** 2).sum() == pytest.approx(1e4 * speckle, rel=1e-5)
    window = np.fft.fftshift(np.abs(np.fft.fft(windows.taylor(512, nbar=4, sll=35, norm=False), 512 * 64)))
    window = 20 * np.log10(window / window.max() + 1e-12)
    theory_db = highest_sidelobe(window[window.argmax() :])
    for axis, (profile, resolution) in enumerate(zip((look[:, 64], look[64, :]), resolutions, strict=True)):
        fine = np.abs(interpolated(profile, 64)) ** 2
        peak = int(fine.argmax())
        db = 10 * np.log10(fine / fine[peak] + 1e-20)
        right = np.interp(3.0103, -db[peak : peak + 64 * 6], np.arange(64 * 6))
        left = np.interp(3.0103, -db[peak : peak - 64 * 6 : -1], np.arange(64 * 6))
        assert (left + right) / 64 * spacing[axis] == pytest.approx(resolution, rel=0.02)
        assert highest_sidelobe(db[peak : peak + 64 * 20]) == pytest.approx(theory_db, abs=0.5)


def interpolated(profile: np.ndarray, times: int) -> np.ndarray:
    """A band-limited line at so many times its samples, by zeros in the middle of its spectrum."""
    n = profile.size
    spectrum = np.fft.fftshift(np.fft.fft(profile))
    padded = np.zeros(n * times, dtype=np.complex128)
    padded[(n * times - n + 1) // 2 : (n * times - n + 1) // 2 + n] = spectrum
    return np.fft.ifft(np.fft.ifftshift(padded))


def highest_sidelobe(db: np.ndarray) -> float:
    """Highest level beyond the first null of a line that begins at its peak [dB]."""
    null = int(np.flatnonzero(np.diff(db) > 0)[0])
    return float(db[null:].max())


def test_layover_of_a_wedge(build_scene: Build) -> None:
    """A ramp steeper than the look angle: its slant ranges run backwards, between the analytic ends."""
    cell, altitude = 1.0, 3000.0
    radar = Radar(
        altitude_m=altitude, range_spacing_m=0.7, range_resolution_m=1.0, azimuth_spacing_m=1.0,
        azimuth_resolution_m=1.2,
    )  # fmt: skip
    slope, length = 2.0, 20.0

    def surface(east: np.ndarray, north: np.ndarray) -> np.ndarray:
        # up over `length`, then gently down so that nothing behind it is hidden
        top = slope * length
        return np.where(
            east < 0, 0.0, np.where(east < length, slope * east, np.maximum(top - 0.4 * (east - length), 0))
        )

    geometry = make_geometry(build_scene(surface, cells=(24, 320), cell_m=cell), radar)
    east = np.arange(-159.5, 160)
    track = altitude + float(surface(east, 0 * east).mean())
    slant = altitude / np.cos(np.radians(geometry.flat_incidence_deg))

    def row_of(ground_m: float) -> float:
        height = float(surface(np.array([ground_m]), np.zeros(1))[0])
        return float(np.interp(np.hypot(altitude + ground_m, track - height), slant, np.arange(slant.size)))

    rows = np.flatnonzero(geometry.layover[:, 12])
    along = radar.range_spacing_m * np.sqrt(2.0)
    assert abs(rows[0] - 0.5 - row_of(length - 1e-6)) * along < cell + along / 2
    assert abs(rows[-1] + 0.5 - row_of(-1e-6)) * along < cell + along / 2
