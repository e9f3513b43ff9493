"""The product ``gmti`` of a forward run: detections of moving targets, as GeoJSON and on the map."""

from __future__ import annotations

import importlib.util
import json
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config.part import Part
from radcal.figures.drawing import HIDDEN, new_canvas, styled
from radcal.findings import Finding
from radcal.gmti.adaptive import Complex, Interval, covariance, dpca, kelly, kelly_threshold, least_velocity_mps
from radcal.gmti.channels import Dwell, Movers, dwells, interval_of, movers_of
from radcal.gmti.stanag import Seen, write_stanag
from radcal.gmti.tracks import Track, tracked
from radcal.processes import one_thread
from radcal.scene.model import Scene
from radcal.signals.platform import LIGHT_MPS, Collection, collection, pattern
from radcal.simulators.forward import Forward
from radcal.storage.files import atomic

Array = NDArray[np.floating[Any]]

_COUNTED = 8  # one gate in so many counts the false alarms without movers
_GUARD = 2  # gates on either side of a detection that report nothing else
_DIRECTIONS, _FINER = 5, 9  # directions across the beam; points of the finer grid around a detection
_SHOWN_S = 10.0  # least way of the movers on the map
_ON_TRACK_M = 30.0  # from a mover to its track
_NEAR_M, _NEAR_MPS = 5.0, 2.0  # differences in slant range and radial velocity to the mover that was detected


@dataclass(frozen=True)
class Report:
    """Detection of a moving target.

    Attributes
    ----------
    east_m, north_m, height_m : float
        Place to the east and to the north of the corner of the scene's grid, and elevation of the ground there [m].
    range_m, velocity_mps : float
        Slant range, and radial velocity, positive towards the radar.
    eta : float
        Kelly's statistic, 0 to 1.
    dwell, scan : int
        Numbers of the dwell and of the scan.
    """

    east_m: float
    north_m: float
    height_m: float
    range_m: float
    velocity_mps: float
    eta: float
    dwell: int
    scan: int


def check(case: Part, scene: Scene) -> None:
    """Raise the errors of collection and processing interval, before anything is simulated."""
    interval_of(case, collection(case, scene))


def trained(echoes: Complex, training: int) -> Complex:
    """Sum of products of the echoes of the nearest gates around each gate, without its neighbours.

    Every second gate is used, because the echoes of neighbouring gates are correlated by the weights of the spectrum.

    Parameters
    ----------
    echoes : ndarray of complex128, shape (size, gates)
        Vectors in space and time.
    training : int
        Number of training gates; near the ends of the swath one more.

    Returns
    -------
    ndarray of complex128, shape (gates, size, size)
        Sums for :func:`.adaptive.kelly`.
    """
    out = np.empty((echoes.shape[1], len(echoes), len(echoes)), np.complex128)
    for half in (0, 1):
        part = echoes[:, half::2]
        gates, width = np.arange(part.shape[1]), training + 3
        sums = np.cumsum(np.einsum("ig,jg->gij", part, part.conj()), axis=0)
        sums = np.concatenate([np.zeros_like(sums[:1]), sums])
        low = np.clip(gates - width // 2, 0, gates.size - width)
        near, far = np.maximum(gates - 1, 0), np.minimum(gates + 2, gates.size)
        out[half::2] = sums[low + width] - sums[low] - sums[far] + sums[near]
    return out


def _statistic(echoes: Complex, sums: Complex, vectors: Complex) -> Array:
    """Kelly's statistic of each gate for each expected echo, shape (gates, m)."""
    return np.array([kelly(echoes[:, k : k + 1], sums[k], vectors)[0] for k in range(len(sums))])


def detections(
    dwell: Dwell, interval: Interval, case: Part, scene: Scene, one: Collection, least_mps: float = 0.0
) -> tuple[list[Report], float]:
    """Detections of one dwell, at most one in five neighbouring gates, and the share of false alarms.

    Parameters
    ----------
    dwell : Dwell
        Echoes.
    interval : Interval
        Pulses and channels.
    case, scene, one : Part, Scene, Collection
        Configuration, scene and collection.
    least_mps : float
        Radial velocity below which nothing is tested, because clutter hides it [m/s].

    Returns
    -------
    reports : list of Report
        Detections by range.
    alarms : float
        Share of the tests that exceed the threshold without movers.
    """
    half = 0.4 * one.wavelength_m / one.antenna_m  # of the beam
    fastest = 0.25 * one.wavelength_m * interval.prf_hz
    directions = np.linspace(-half, half, _DIRECTIONS)
    velocities = np.linspace(-fastest, fastest, 2 * interval.pulses, endpoint=False)
    tested = velocities[np.abs(velocities) >= least_mps]
    sine, speed = (np.ravel(each) for each in np.meshgrid(directions, tested))
    vectors, training = interval.steering(sine, speed), case.gmti.training
    least = kelly_threshold(case.gmti.false_alarms, interval.size, training)
    alone = _statistic(dwell.ground[:, ::_COUNTED], trained(dwell.ground, training)[::_COUNTED], vectors)
    echoes = dwell.ground + dwell.movers
    sums = trained(echoes, training)
    eta = _statistic(echoes, sums, vectors)
    best, reports = eta.max(axis=1), []
    away = np.linspace(-1.0, 1.0, _FINER)
    du, dv = (
        np.ravel(each) for each in np.meshgrid(away * half / (_DIRECTIONS // 2), away * 2 * fastest / velocities.size)
    )
    for gate in np.flatnonzero(best > least):
        if best[gate] < best[max(gate - _GUARD, 0) : gate + _GUARD + 1].max():
            continue
        coarse = int(eta[gate].argmax())
        u, v = sine[coarse] + du, speed[coarse] + dv
        finer = kelly(echoes[:, gate : gate + 1], sums[gate], interval.steering(u, v))[0]
        k = int(finer.argmax())
        place = _place(scene, case, one, dwell.antenna_m, dwell.range_m[gate], u[k])
        reports.append(
            Report(*place, float(dwell.range_m[gate]), float(v[k]), float(finer[k]), dwell.number, dwell.scan)
        )
    return reports, float((alone > least).mean())


def _place(
    scene: Scene, case: Part, one: Collection, antenna_m: Array, range_m: float, sine: float
) -> tuple[float, float, float]:
    """Place in the scene's grid of a slant range and direction, on the ground, and its elevation [m]."""
    assert scene.elevation_m is not None  # noqa: S101 - collection() has refused it
    (ny, nx), cell = scene.material.shape, scene.cell_m
    height, north = float(scene.elevation_m.mean()), float(antenna_m[0] + range_m * sine)
    east = 0.0
    for _ in range(5):  # the height at the place changes the place
        square = range_m**2 * (1.0 - sine**2) - (antenna_m[2] - height) ** 2
        east = float(_east_m(scene, case, one, np.sqrt(max(square, 0.0))))
        row, column = (int(np.clip(at / cell, 0, n - 1)) for at, n in ((north, ny), (east, nx)))
        height = float(scene.elevation_m[row, column])
    return east, north, height


def _east_m(scene: Scene, case: Part, one: Collection, ground_m: Any) -> Any:
    """Place east of the corner of the scene's grid, from that in ground range [m]."""
    away, half = ground_m - one.reference_m[0, 1], 0.5 * scene.material.shape[1] * scene.cell_m
    return half + _side(case) * away


def _side(case: Part) -> float:
    """Sign of the direction east in which the ground range grows."""
    return -1.0 if case.radar.look_side == "left" else 1.0


def _least_velocity(dwell: Dwell, interval: Interval, one: Collection) -> float:
    """Velocity of 5 dB of loss for the covariance of clutter of the mean power of a dwell's echoes [m/s]."""
    sine = np.linspace(-1.0, 1.0, 401) * interval.wavelength_m / one.antenna_m
    power = pattern(sine, one.antenna_m, interval.wavelength_m) ** 2
    ratio = max(float(np.mean(np.abs(dwell.ground) ** 2)) / dwell.noise_m2 - 1.0, 0.0)
    return least_velocity_mps(interval, covariance(interval, sine, ratio * power / power.sum()))


def write(stem: Path, made: Forward) -> list[Path | Finding]:
    """Simulate all dwells and detect movers; write the reports as GeoJSON and on the map.

    Parameters
    ----------
    stem : path
        Path of the files without suffix.
    made : Forward
        Forward run of the pass.

    Returns
    -------
    list of path or Finding
        The files, and what was found.
    """
    case, scene = made.case, made.scene
    one = collection(case, scene)
    interval, movers = interval_of(case, one), movers_of(case, scene, one)
    reports, alarms, slowest, found, off = list[Report](), list[float](), list[float](), set[int](), list[float]()
    seen = list[Seen]()
    left = list[float]()  # share of the ground's power that the differences of displaced phase centres leave
    for dwell in dwells(case, scene, one, movers, made.seed):
        slowest.append(_least_velocity(dwell, interval, one))
        power = [np.mean(np.abs(each) ** 2) for each in (dpca(dwell.ground, interval), dwell.ground)]
        left.append(float(power[0] / power[1]))
        with one_thread():
            some, share = detections(dwell, interval, case, scene, one, slowest[-1])
        reports += some
        places = np.array([(each.north_m, _ground_m(each, case, scene, one), each.height_m) for each in some])
        seen.append(Seen(dwell.scan, dwell.number, dwell.antenna_m, places, [each.velocity_mps for each in some]))
        alarms.append(share)
        now = movers.after((dwell.scan - 1) * case.gmti.revisit_s)
        slant, sine, velocity = now.seen(dwell.antenna_m)
        for each in some:
            near = np.abs(slant - each.range_m) < _NEAR_M
            near &= np.abs(velocity - each.velocity_mps) < _NEAR_MPS
            near &= np.abs(sine) < interval.wavelength_m / one.antenna_m
            for k in np.flatnonzero(near):
                found.add(int(k))
                off.append(each.north_m - now.place_m[k, 0])
    numbers = {
        "movers": float(len(movers.amplitude)),
        "found": float(len(found)),
        "reports": float(len(reports)),
        "along_m": float(np.sqrt(np.mean(np.square(off)))) if off else 0.0,
        "asked": case.gmti.false_alarms,
        "alarms": float(np.mean(alarms)),
        "least_mps": float(np.median(slowest)),
        "dpca_db": float(10.0 * np.log10(np.mean(left))),
    }
    paths = [stem.with_suffix(".geojson"), stem.with_suffix(".png")]
    features = [(asdict(each), [(each.east_m, each.north_m)]) for each in reports]
    _write_geojson(paths[0], "Point", features, made)
    followed, tracks = list[Path | Finding](), list[Track]()
    if case.gmti.scans > 1:
        followed, tracks = _tracks(stem.with_name(f"{stem.name}_tracks.geojson"), reports, movers, interval, made, one)
    shown_s = max(_SHOWN_S, case.gmti.revisit_s * (case.gmti.scans - 1))
    ends_m = [movers.after(seconds).place_m for seconds in (0.0, shown_s)]
    east = np.stack([_east_m(scene, case, one, place[:, 1]) for place in ends_m])
    north = np.stack([place[:, 0] for place in ends_m])
    _write_picture(paths[1], reports, tracks, scene, east, north, shown_s)
    stanag = write_stanag(stem.with_suffix(".4607"), made, one, seen, 0.4 * one.wavelength_m / one.antenna_m)
    return [*paths, *stanag, Finding("gmti_detections", "note", "gmti", numbers), *followed]


def _ground_m(report: Report, case: Part, scene: Scene, one: Collection) -> float:
    """Ground range of a detection, to whose east the same mirror image leads [m]."""
    half = 0.5 * scene.material.shape[1] * scene.cell_m
    return float(one.reference_m[0, 1] + _side(case) * (report.east_m - half))


def _tracks(
    path: Path, reports: Sequence[Report], movers: Movers, interval: Interval, made: Forward, one: Collection
) -> tuple[list[Path | Finding], list[Track]]:
    """Write the tracks through the detections of all scans as GeoJSON.

    The radial velocity gives that to the east, because the beam looks across the track. The standard errors of place
    and velocity are a quarter of gate, velocity resolution and beam.
    """
    if importlib.util.find_spec("stonesoup") is None:
        why = "the package stonesoup is missing: type pip install 'radcal[tracking]'."
        return [Finding("file_left_out", "note", "tracks", {"why": why})], []
    case, scene = made.case, made.scene
    gate, beam = LIGHT_MPS / (2.0 * one.samples * one.step_hz), 0.8 * one.range_m * one.wavelength_m / one.antenna_m
    slow = 0.5 * interval.wavelength_m * interval.prf_hz / interval.pulses
    plots = list[tuple[float, Array]]()
    for scan in range(case.gmti.scans):
        kept = list[Report]()
        for each in sorted((one for one in reports if one.scan == scan + 1), key=lambda one: -one.eta):
            if not any(
                abs(each.range_m - other.range_m) < (_GUARD + 1) * gate
                and abs(each.velocity_mps - other.velocity_mps) < slow
                and abs(each.north_m - other.north_m) < beam
                for other in kept
            ):  # neighbouring dwells see a mover, too
                kept.append(each)
        rows = [
            (r.east_m, -_side(case) * r.velocity_mps * r.range_m / _ground_m(r, case, scene, one), r.north_m)
            for r in kept
        ]
        plots.append((scan * case.gmti.revisit_s, np.array(rows).reshape(-1, 3)))
    steep = one.range_m / one.reference_m[0, 1]
    tracks = tracked(plots, [0.25 * steep * gate, 0.25 * steep * slow, 0.25 * beam])
    features = [
        (
            {"track": k, **{name: value.tolist() for name, value in vars(each).items()}},
            each.place_m.tolist(),
        )
        for k, each in enumerate(tracks, start=1)
    ]
    _write_geojson(path, "LineString", features, made)
    return [path, Finding("gmti_tracks", "note", "gmti", _followed(tracks, movers, plots, made, one))], tracks


def _followed(
    tracks: Sequence[Track], movers: Movers, plots: Sequence[tuple[float, Array]], made: Forward, one: Collection
) -> dict[str, float]:
    """Number of movers near a track in half of the scans or more, and of tracks near a mover in half of theirs."""
    met, right, squares = np.zeros((len(movers.amplitude), len(plots)), np.bool_), 0, list[float]()
    for track in tracks:
        near = 0
        for seconds, place in zip(track.seconds, track.place_m, strict=True):
            now = movers.after(seconds).place_m
            true = np.stack([_east_m(made.scene, made.case, one, now[:, 1]), now[:, 0]], axis=1)
            away = np.linalg.norm(true - place, axis=1)
            at = round(float(seconds) / made.case.gmti.revisit_s)
            met[:, at] |= away < _ON_TRACK_M
            near += bool((away < _ON_TRACK_M).any())
            squares += (away[away < _ON_TRACK_M] ** 2).tolist()
        right += 2 * near >= len(track.seconds)
    return {
        "movers": float(len(movers.amplitude)),
        "scans": float(len(plots)),
        "followed": float((2 * met.sum(axis=1) >= len(plots)).sum()),
        "tracks": float(len(tracks)),
        "right": float(right),
        "rms_m": float(np.sqrt(np.mean(squares))) if squares else 0.0,
    }


def _write_geojson(
    path: Path, kind: str, features: Sequence[tuple[dict[str, Any], Sequence[Sequence[float]]]], made: Forward
) -> None:
    """Write properties and places as GeoJSON (RFC 7946), in longitude and latitude if the scene is on the map."""
    scene, geometries = made.scene, list[Any]([None] * len(features))
    if scene.crs is not None and scene.transform is not None:
        from radcal.scene.crs import transformer

        (a, b, c, d, e, f), onto = scene.transform, transformer(scene.crs, "OGC:CRS84")
        for k, (_, places) in enumerate(features):
            column, row = np.array(places).T / scene.cell_m
            ends = onto.transform(a * column + b * row + c, d * column + e * row + f)
            line = np.stack(ends, axis=1).tolist()
            geometries[k] = {"type": kind, "coordinates": line[0] if kind == "Point" else line}
    written = [
        {"type": "Feature", "geometry": geometry, "properties": properties}
        for geometry, (properties, _) in zip(geometries, features, strict=True)
    ]
    with atomic(path) as partial:
        found = {"type": "FeatureCollection", "case": made.case.case, "run": made.key, "features": written}
        partial.write_text(json.dumps(found, indent=1), encoding="utf-8")


def _write_picture(
    path: Path,
    reports: Sequence[Report],
    tracks: Sequence[Track],
    scene: Scene,
    east_m: Array,
    north_m: Array,
    shown_s: float,
) -> None:
    """Write a map of detections and tracks over the materials, with the first and last places of the movers' paths."""
    ny, nx = scene.material.shape
    with styled():
        canvas = new_canvas(7.0, 6.4)
        plan = canvas.subplots()
        extent = (0.0, nx * scene.cell_m / 1e3, 0.0, ny * scene.cell_m / 1e3)
        plan.imshow(scene.material, cmap="Greys", alpha=0.35, origin="lower", extent=extent, interpolation="nearest")
        if east_m.size:
            plan.plot(east_m / 1e3, north_m / 1e3, color=HIDDEN["color"], linewidth=2.0)
            label = f"mover, and its way in {shown_s:.0f} s"
            plan.plot(east_m[0] / 1e3, north_m[0] / 1e3, "o", color=HIDDEN["color"], markersize=5, label=label)
        for k, track in enumerate(tracks):
            plan.plot(*track.place_m.T / 1e3, color="black", linewidth=1.2, zorder=3, label="_" * (k > 0) + "track")
        size, width = (10, 0.8) if tracks else (36, 1.6)
        shown = plan.scatter(
            [one.east_m / 1e3 for one in reports], [one.north_m / 1e3 for one in reports], marker="x", s=size,
            c=[one.velocity_mps for one in reports], cmap="coolwarm", linewidths=width, label="detection",
        )  # fmt: skip
        canvas.colorbar(shown, ax=plan, fraction=0.046, pad=0.02).set_label("velocity towards the radar [m/s]")
        plan.set(xlabel="east [km]", ylabel="north [km]", title="Moving targets", xlim=extent[:2], ylim=extent[2:])
        plan.grid(visible=False)
        canvas.legend(loc="outside lower center", ncols=3)
        with atomic(path) as partial:
            canvas.savefig(partial, format="png", dpi=150, metadata={"Software": None}, facecolor="white")
