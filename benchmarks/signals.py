"""Speed of the phase history against a plain sum, and levels of a focused image against the fast image.

    python benchmarks/signals.py [--quick]

Times are CPU seconds of one thread. The plain sum is compiled, in double precision, over the same scatterers and
frequencies; it is taken at fewer pulses. The time of 56 km2 (X band, slant range of 11 km, 1 m resolution, facets of
1 m and of half a cell, all pulses in the main lobe of the beam) is by proportion. Levels are those of the default case
at one look: mean power of each material in the focused image over the expectation of the fast image, its standard
error (of as many independent pixels as the area of the response leaves), the autocorrelation of the amplitude on even
ground, and its equivalent number of looks. Without ``--quick`` the mean is over four draws.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from typing import Any

os.environ["NUMBA_NUM_THREADS"] = "1"  # before numba is imported

import numpy as np
from scipy.ndimage import uniform_filter

from radcal.bands import WIDTH_FACTOR
from radcal.compiled import njit
from radcal.config import case_from
from radcal.radar.projection import make_geometry
from radcal.scene.sources import make_scene
from radcal.signals.focus import focused
from radcal.signals.history import echoes
from radcal.signals.platform import LIGHT_MPS, Collection, collection, pattern
from radcal.signals.record import RawSignal
from radcal.signals.scatterers import Scatterers, scatterers
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.forward import Forward
from radcal.speckle.response import speckle_correlation

SWATH_M, SLANT_M, LONG_M = 600.0, 11_000.0, 40.0
AREA_M2 = 56e6


@njit()
def plain_sum(place: Any, amplitude: Any, track: Any, distance: Any, frequency: Any, out: Any) -> None:
    """Sum over scatterers at each frequency of one pulse; the amplitudes include the beam."""
    for i in range(len(place)):
        x, y, z = place[i, 0] - track[0], place[i, 1] - track[1], place[i, 2] - track[2]
        away = np.sqrt(x * x + y * y + z * z) - distance
        for k in range(frequency.size):
            phase = -4.0 * np.pi / LIGHT_MPS * frequency[k] * away
            out[k] += amplitude[i] * complex(np.cos(phase), np.sin(phase))


def strip(facets: int) -> tuple[Collection, Scatterers]:
    """Collection at 1 m resolution in X band, and scatterers that all of its pulses see."""
    carrier, band = 9.65e9, WIDTH_FACTOR
    bandwidth = 0.5 * LIGHT_MPS * WIDTH_FACTOR
    samples = int(4.0 * 0.6 * SWATH_M * bandwidth / LIGHT_MPS)
    height = SLANT_M * np.sqrt(0.5)
    along = 0.5 * LONG_M + np.arange(64) * 0.5
    track = np.stack([along, np.zeros(64), np.full(64, height)], axis=1)
    reference = np.stack([along, np.full(64, height), np.zeros(64)], axis=1)
    one = Collection(
        track, reference, 200.0, 100.0, carrier, bandwidth / samples, samples, 2.0 / band, band, 1, SLANT_M, 0.0
    )
    rng = np.random.default_rng(1)
    slant = SLANT_M + SWATH_M * (rng.random(facets) - 0.5)
    place = np.stack([rng.uniform(0.0, LONG_M, facets), np.sqrt(slant**2 - height**2), np.zeros(facets)], axis=1)
    amplitude = rng.standard_normal(facets) + 1j * rng.standard_normal(facets)
    return one, Scatterers.sorted(place, amplitude.astype(np.complex64))


def timed(call: Any) -> tuple[Any, float]:
    """Result and CPU seconds."""
    started = time.process_time()
    return call(), time.process_time() - started


def speed(facets: int) -> dict[str, float]:
    """Speed and error of the phase history."""
    seconds = []
    for n in (facets // 8, facets):
        one, found = strip(n)
        echoes(one, found, 0, 1)  # compiled
        signal, spent = timed(lambda one=one, found=found: echoes(one, found, 0, 64))
        seconds.append(spent)
    few = max(1, 4_000_000 // facets // 8)
    sums = np.zeros((few, one.samples), np.complex128)
    plain_sum(found.place_m[:1], np.ones(1, complex), one.track_m[0], 0.0, one.frequency_hz[:1], np.zeros(1, complex))
    plain_s = 0.0
    for p in range(few):
        away = found.place_m - one.track_m[p]
        slant = np.linalg.norm(away, axis=1)
        lit = found.amplitude * pattern(away[:, 0] / slant, one.antenna_m, one.wavelength_m) * (SLANT_M / slant) ** 2
        call = (found.place_m, lit, one.track_m[p], one.distance_m[p], one.frequency_hz, sums[p])
        plain_s += timed(lambda call=call: plain_sum(*call))[1]
    error = np.sqrt(np.mean(np.abs(signal[:few] - sums) ** 2) / np.mean(np.abs(sums) ** 2))
    rate = 64 * facets / seconds[1]
    seen = 2.0 * SLANT_M * one.wavelength_m / one.antenna_m * one.prf_hz / one.speed_mps
    return {
        "pairs_per_s": rate,
        "ratio": plain_s / few / (seconds[1] / 64),
        "relative_rms": float(error),
        "exponent": float(np.log(seconds[1] / seconds[0]) / np.log(8.0)),
        "core_minutes_56km2_1m": AREA_M2 * seen / rate / 60.0,
        "core_minutes_56km2_half_cell": AREA_M2 / (0.5 * 0.5 * np.sqrt(2.0)) * seen / rate / 60.0,
    }


def clutter(draws: int) -> dict[str, Any]:
    """Levels, autocorrelation and looks of the focused default case at one look."""
    case = case_from({"radar": {"looks": 1}})
    scene = make_scene(case.scene, None, case.radar.heading_deg)
    geometry = make_geometry(scene, case.radar)
    started = case.at_start
    simulator = BuiltinSimulator(geometry, case.radar, started.laws)
    expected = 10.0 ** (simulator.expected(started.start_parameters) / 10.0)
    one, looks = collection(started, scene), []
    for seed in range(draws):
        made = Forward(started, scene, geometry, expected, "", seed, False, lambda: iter(()))
        found = scatterers(started, scene, seed, one.facet_m)
        looks.append(focused(one, RawSignal(one, found, seed)[:], made)[0])
    power = np.mean(np.abs(looks) ** 2, axis=0)
    inner = np.zeros(power.shape, dtype=bool)
    inner[20:-20, 20:-20] = True
    cells = case.radar.range_resolution_m * case.radar.azimuth_resolution_m
    cells /= case.radar.range_spacing_m * case.radar.azimuth_spacing_m
    levels = {}
    for number, name in enumerate(geometry.names, start=1):
        pixels = inner & (geometry.material == number)
        ratio = power[pixels] / expected[pixels]
        standard = ratio.std() / np.sqrt(ratio.size / max(1.0, cells))
        levels[name] = [float(10.0 * np.log10(ratio.mean())), float(4.34 * standard / ratio.mean())]
    even = inner & (uniform_filter((geometry.material == geometry.names.index("grass") + 1).astype(float), 9) > 0.999)
    field = np.array(looks) / np.sqrt(expected)
    lags = {}
    for axis, spacing, resolution in (
        (1, case.radar.range_spacing_m, case.radar.range_resolution_m),
        (2, case.radar.azimuth_spacing_m, case.radar.azimuth_resolution_m),
    ):
        for lag in (1, 2, 3):
            pairs = (field * np.roll(field, lag, axis).conj())[:, even].mean() / (np.abs(field) ** 2)[:, even].mean()
            ideal = np.sqrt(speckle_correlation(np.array([lag * spacing / resolution])))[0]
            lags[f"{'range' if axis == 1 else 'azimuth'} {lag}"] = [float(abs(pairs)), float(ideal)]
    each = np.abs(field[:, even]) ** 2
    return {"levels_db": levels, "correlation": lags, "looks": float(each.mean() ** 2 / each.var())}


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    fast, found = speed(20_000 if quick else 200_000), clutter(1 if quick else 4)
    print(f"{fast['pairs_per_s']:.3g} pairs of pulse and facet a CPU second, {fast['ratio']:.0f} times a plain sum,")
    print(f"relative rms {fast['relative_rms']:.1e}, exponent {fast['exponent']:.2f}")
    print("material    focused over fast [dB]   standard error [dB]")
    for name, (level, standard) in found["levels_db"].items():
        print(f"{name:12s} {level:+20.3f} {standard:20.3f}")
    print(json.dumps({"speed": fast, **found}))


if __name__ == "__main__":
    main()
