"""Speed of the phase history, point targets and looks, and levels of a focused image against the fast image.

    python benchmarks/signals.py [--quick]

Times are CPU seconds of one thread. The plain sum is compiled, in double precision, over the same scatterers and
frequencies; it is taken at fewer pulses. The time of 56 km2 (X band, slant range of 11 km, 1 m resolution, facets of
1 m and of half a cell, all pulses in the main lobe of the beam) is by proportion. Levels are those of the default case
at one look: mean power of each material in the focused image over the expectation of the fast image, its standard
error (of as many independent pixels as the area of the response leaves), the autocorrelation of the amplitude on even
ground, and its equivalent number of looks. Without ``--quick`` the mean is over four draws. Point targets are six in
each case, from near to far and from start to end: largest error of place (cells of resolution), phase and amplitude,
and of width, highest and mean sidelobes against the response of the Taylor-weighted band; with the time-bandwidth
product, the processed band along the track squared times half of wavelength and range.
Looks are four of even ground on facets of the default case: largest correlation between two, and equivalent number of
looks of their mean. Tracks are those of drawn detections: 20 movers of 5 to 15 m/s on 2 x 2 km, 40 scans of 2 s,
standard error 15 m, probability of detection 0.9, 5 false alarms a scan. Completeness is the share of movers and scans
with a track within 45 m, spurious the mean number of tracks of a scan without a mover within 45 m.
"""

from __future__ import annotations

import argparse
import json
import os
import time
from dataclasses import replace
from typing import Any

os.environ["NUMBA_NUM_THREADS"] = "1"  # before numba is imported

import numpy as np
from scipy.ndimage import uniform_filter

from radcal.bands import WIDTH_FACTOR
from radcal.compiled import njit
from radcal.config import case_from
from radcal.gmti.tracks import tracked
from radcal.radar.projection import make_geometry
from radcal.scene.model import Scene
from radcal.scene.sources import make_scene
from radcal.signals.focus import backprojected, focused
from radcal.signals.history import RawSignal, echoes
from radcal.signals.platform import LIGHT_MPS, Collection, collection
from radcal.signals.scatterers import Scatterers, scatterers
from radcal.signals.wavenumber import omega_k
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.forward import Forward
from radcal.speckle.response import speckle_correlation, taylor_weights

SWATH_M, SLANT_M, LONG_M = 600.0, 11_000.0, 40.0
AREA_M2 = 56e6
MOVERS, SCANS, ERROR_M = 20, 40, 15.0


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
        lit = found.amplitude * one.pattern(away[:, 0] / slant) * (SLANT_M / slant) ** 2
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


POINTS: dict[str, tuple[float, dict[str, Any], dict[str, Any]]] = {
    "X band, 0.5 m": (0.5, {}, {}),
    "X band, 0.5 m, omega-k": (0.5, {}, {"focusing": "omega_k"}),
    "X band, 0.5 m, squint of 20 degrees": (0.5, {}, {"squint_deg": 20.0}),
    "X band, 0.5 m, squint of 20 degrees, omega-k": (0.5, {}, {"squint_deg": 20.0, "focusing": "omega_k"}),
    "X band, 0.3 m, spotlight": (0.3, {}, {"mode": "spotlight"}),
    "L band, 0.75 m, bent track": (0.75, {"band": "L", "altitude_m": 6400.0}, {"motion_m": 1.0}),
    "default, X band, 3.5 m": (3.5, {"range_resolution_m": 2.0, "range_spacing_m": 1.5}, {}),
    "default, X band, 3.5 m, omega-k": (
        3.5,
        {"range_resolution_m": 2.0, "range_spacing_m": 1.5},
        {"focusing": "omega_k"},
    ),
}
FINE = 40  # samples of a cut per resolution cell


def lobes(cut: Any) -> tuple[float, float, float, float]:
    """Offset of the peak and -3 dB width [samples], highest sidelobe and energy of the sidelobes [dB] of a cut."""
    power = np.abs(cut) ** 2
    m = int(power.argmax())
    a, b, c = power[m - 1 : m + 2]
    top = b + (a - c) ** 2 / (8.0 * (2.0 * b - a - c))
    offset = m + 0.5 * (a - c) / (a - 2.0 * b + c) - (len(cut) - 1) / 2
    beside = []
    for line in (power[m::-1], power[m:]):
        k = int(np.argmax(line < 0.5 * top))
        edge = k - (0.5 * top - line[k]) / (line[k - 1] - line[k])
        null = int(np.argmax((np.diff(line) > 0.0) & (line[:-1] < top / 50.0)))
        beside.append((edge, null))
    (left, before), (right, after) = beside
    side = np.concatenate([power[: m - before], power[m + after :]])
    main = power[m - before : m + after].sum()
    return offset, left + right, 10.0 * np.log10(side.max() / top), 10.0 * np.log10(side.sum() / main)


def ideal(cells: Any) -> Any:
    """Response of the Taylor-weighted band at distances in resolution cells."""
    frequency = (np.arange(4000) + 0.5) / 4000 - 0.5
    return np.cos(2.0 * np.pi * WIDTH_FACTOR * np.multiply.outer(cells, frequency)) @ taylor_weights(frequency)


def cut(one: Collection, signal: Any, at: Any, axis: int, off: Any, way: str) -> Any:
    """Image along the track (axis 0) or in slant range (1) at distances from a place [m]."""
    height = one.track_m[:, 2].mean() - at[2]
    x, r = np.array([at[0]]), np.array([np.hypot(at[1], height)])
    x, r = (x + off, r) if axis == 0 else (x, r + off)
    if way == "omega_k":
        return omega_k(one, signal, x, r)[0].ravel()
    x, r = np.broadcast_arrays(x, r)
    return backprojected(one, signal, np.stack([x, np.sqrt(r**2 - height**2), np.full(x.size, at[2])], axis=1))[0]


def points() -> dict[str, dict[str, float]]:
    """Largest errors of six point targets in each case, each alone: neighbours would fill the sidelobes."""
    ground, found = np.ones((24, 24), np.uint8), {}
    scene = Scene("flat", ("dyke",), ground, np.zeros(ground.shape), 5.0)
    away = np.arange(-8 * FINE, 8 * FINE + 1) / FINE
    shape = lobes(ideal(away))
    names = ["azimuth_cells", "range_cells", "phase_deg", "amplitude_db"]
    lobe_names = [f"{what}_{axis}" for what in ("width_percent", "pslr_db", "islr_db") for axis in ("azimuth", "range")]
    for name, (cell, radar, signals) in POINTS.items():
        sizes = {f"{axis}_{what}_m": share * cell for axis in ("range", "azimuth")
                 for what, share in (("resolution", 1.0), ("spacing", 0.5))}  # fmt: skip
        one = collection(case_from({"radar": {"looks": 1, **sizes, **radar}, "signals": signals}).at_start, scene)
        one = replace(one, noise_m2=0.0)
        cells = [cell, radar.get("range_resolution_m", cell)]
        place = one.reference_m[0] + np.zeros((6, 3))
        place[:, 0], place[:, 2] = [5.0, 115.0, 60.0, 30.0, 80.0, 100.0], [0.0, 8.0, -5.0, 15.0, 3.0, -9.0]
        place[:, 1] += [-50.0, 50.0, 0.0, 30.0, -20.0, 10.0]
        errors, way = [], signals.get("focusing", "")
        for at, truth in zip(place, np.exp(1j * np.arange(6.0)).astype(np.complex64), strict=True):
            signal = RawSignal(one, Scatterers(at[None], truth[None]), 1)[:]
            peak = cut(one, signal, at, 0, np.zeros(1), way)[0] / truth
            both = [lobes(cut(one, signal, at, axis, away * cells[axis], way)) for axis in (0, 1)]
            errors.append([each[0] / FINE for each in both])
            errors[-1] += [np.degrees(np.angle(peak)), 20.0 * np.log10(abs(peak))]
            for k, scale in ((1, 100.0 / shape[1]), (2, 1.0), (3, 1.0)):
                errors[-1] += [(each[k] - shape[k]) * scale for each in both]
        # cuts along and across the track do not follow the sidelobes of a turned or squinted response
        told = names if signals.keys() & {"squint_deg", "mode"} else names + lobe_names
        found[name] = {"product": one.band**2 * one.wavelength_m * one.range_m / 2.0}
        found[name] |= dict(zip(told, map(float, np.abs(errors).max(axis=0)), strict=False))
    return found


def looks_of_even_ground(draws: int) -> dict[str, float]:
    """Largest correlation between two of four looks, and equivalent number of looks of their mean."""
    length, images = 400.0, []
    ground = np.ones((int(length / 5.0), 12), np.uint8)
    one = collection(case_from({}).at_start, Scene("flat", ("dyke",), ground, np.zeros(ground.shape), 5.0))
    height, middle = one.track_m[0, 2], one.range_m
    along, slant = np.arange(-60.0, length + 60.0, one.facet_m), middle + np.arange(-24.0, 24.0, 1.0)
    image = np.arange(15.0, length - 15.0, 2.5), middle + np.arange(-18.0, 18.0, 1.5)
    facets, pixels = (
        np.stack([x.ravel(), np.sqrt(r.ravel() ** 2 - height**2), np.zeros(x.size)], axis=1)
        for x, r in (np.meshgrid(along, slant, indexing="ij"), np.meshgrid(*image))
    )
    for seed in range(draws):
        drawn = np.random.default_rng(seed).standard_normal((2, len(facets)))
        signal = RawSignal(one, Scatterers(facets, (drawn[0] + 1j * drawn[1]).astype(np.complex64)), seed)[:]
        images.append(backprojected(one, signal, pixels))
    looks = np.concatenate(images, axis=1)
    power = np.abs(looks) ** 2
    correlation = np.abs(looks @ looks.conj().T) / power.mean() / looks.shape[1]
    mean = power.mean(axis=0)
    return {
        "correlation": float((correlation - np.diag(np.diag(correlation))).max()),
        "looks": float(mean.mean() ** 2 / mean.var()),
    }


def clutter(draws: int) -> dict[str, Any]:
    """Levels, autocorrelation and looks of the focused default case at one look."""
    case = case_from({"radar": {"looks": 1}})
    scene = make_scene(case.scene, None, case.radar.heading_deg)
    geometry = make_geometry(scene, case.radar)
    started = case.at_start
    simulator = BuiltinSimulator(geometry, case.radar, started.laws)
    expected = 10.0 ** (simulator.expected(started.start_parameters) / 10.0)
    one, looks, others = collection(started, scene), [], []
    other = case_from({"radar": {"looks": 1}, "signals": {"focusing": "omega_k"}}).at_start
    for seed in range(draws):
        made = Forward(started, scene, geometry, expected, "", seed, False, lambda: iter(()))
        found = scatterers(started, scene, seed, one.facet_m)
        signal = RawSignal(one, found, seed)[:]
        looks.append(focused(one, signal, made)[0])
        others.append(focused(one, signal, replace(made, case=other))[0])
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
            ideal = np.sqrt(speckle_correlation(np.array([lag * spacing / resolution])))[0]
            lags[f"{'range' if axis == 1 else 'azimuth'} {lag}"] = [
                *(
                    _correlation(one / np.sqrt(expected), lag, axis, even)
                    for one in (np.array(looks), np.array(others))
                ),
                float(ideal),
            ]
    each = np.abs(field[:, even]) ** 2
    return {"levels_db": levels, "correlation": lags, "looks": float(each.mean() ** 2 / each.var())}


def _correlation(field: Any, lag: int, axis: int, even: Any) -> float:
    """Autocorrelation of a complex image at a lag along an axis, over some pixels."""
    pairs = (field * np.roll(field, lag, axis).conj())[:, even].mean()
    return float(abs(pairs / (np.abs(field) ** 2)[:, even].mean()))


def tracks(seeds: int) -> dict[str, float]:
    """Completeness and spurious tracks, and rms errors of the tracks' and detections' places [m]."""
    met, spurious, off, off_detected = list[float](), list[float](), list[float](), list[float]()
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        heading, speed = rng.uniform(0.0, 2.0 * np.pi, MOVERS), rng.uniform(5.0, 15.0, MOVERS)
        seconds = 2.0 * np.arange(SCANS)
        way = seconds[:, None, None] * (speed[:, None] * np.stack([np.sin(heading), np.cos(heading)], axis=1))
        true, scans = rng.uniform(0.0, 2000.0, (MOVERS, 2)) + way, []
        for k in range(SCANS):
            seen = true[k, rng.random(MOVERS) < 0.9]
            error = ERROR_M * rng.standard_normal(seen.shape)
            off_detected += (error**2).sum(axis=1).tolist()
            alarms = rng.uniform(0.0, 2000.0, (rng.poisson(5.0), 2))
            scans.append((float(seconds[k]), np.concatenate([seen + error, alarms])))
        near = np.zeros((SCANS, MOVERS), dtype=bool)
        wrong = np.zeros(SCANS)
        for track in tracked(scans, [ERROR_M, ERROR_M]):
            for k, place in zip((track.seconds / 2.0).astype(int), track.place_m, strict=True):
                away = np.linalg.norm(true[k] - place, axis=1)
                near[k] |= away < 3.0 * ERROR_M
                wrong[k] += away.min() >= 3.0 * ERROR_M
                off += [float(away.min() ** 2)] * bool(away.min() < 3.0 * ERROR_M)
        met.append(float(near.mean()))
        spurious.append(float(wrong.mean()))
    return {
        "completeness": float(np.mean(met)),
        "spurious": float(np.mean(spurious)),
        "rms_m": float(np.sqrt(np.mean(off))),
        "rms_detections_m": float(np.sqrt(np.mean(off_detected))),
    }


def main() -> None:
    """Measure and print."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--quick", action="store_true")
    quick = parser.parse_args().quick
    fast, found = speed(20_000 if quick else 200_000), clutter(1 if quick else 4)
    targets, even = points(), looks_of_even_ground(4 if quick else 12)
    print(f"{fast['pairs_per_s']:.3g} pairs of pulse and facet a CPU second, {fast['ratio']:.0f} times a plain sum,")
    print(f"relative rms {fast['relative_rms']:.1e}, exponent {fast['exponent']:.2f}")
    print("material    focused over fast [dB]   standard error [dB]")
    for name, (level, standard) in found["levels_db"].items():
        print(f"{name:12s} {level:+20.3f} {standard:20.3f}")
    print("point targets: largest errors")
    for name, errors in targets.items():
        print(name)
        print("   ", "  ".join(f"{key} {value:.4f}" for key, value in errors.items()))
    print(f"four looks: correlation {even['correlation']:.3f}, their mean has {even['looks']:.2f} looks")
    followed = tracks(2 if quick else 10)
    print("tracks: " + ", ".join(f"{key} {value:.3f}" for key, value in followed.items()))
    print(json.dumps({"speed": fast, **found, "points": targets, "four_looks": even, "tracks": followed}))


if __name__ == "__main__":
    main()
