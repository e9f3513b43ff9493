"""The product ``gmti`` of a forward run: detections and tracks of moving targets, as GeoJSON and on the map."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import asdict
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from radcal.config.part import Part
from radcal.errors import ConfigError
from radcal.figures.drawing import HIDDEN, new_canvas, styled, write_png
from radcal.findings import Finding
from radcal.gmti.adaptive import Array, Interval, dpca, kelly_threshold
from radcal.gmti.channels import Movers, dwells, interval_of, movers_of
from radcal.gmti.detection import GUARD, HALF_BEAM, Report, detections, least_velocity
from radcal.gmti.stanag import write_stanag
from radcal.gmti.tracks import Track, tracked
from radcal.processes import one_thread
from radcal.scene.crs import longitude_latitude
from radcal.scene.model import Scene
from radcal.sections.ppi import Gmti
from radcal.signals.platform import Collection, collection
from radcal.simulators.forward import Forward
from radcal.storage.files import atomic

_Line = tuple[Array, Array]  # times [s], and places to the east and to the north [m], of one or more scans

_SHOWN_S = 10.0  # least way of the movers on the map
_NEAR_M = 30.0  # from a mover to its detection or track


def check(case: Part, scene: Scene) -> None:
    """Raise the errors of collection and processing interval, and of routes that leave the scene, before any work."""
    interval_of(case, collection(case, scene))
    seconds, size = case.gmti.revisit_s * (case.gmti.scans - 1), np.array(scene.material.shape[::-1]) * scene.cell_m
    ends = movers_of(case, scene).after(seconds)[:, :2]
    if left := int(((ends < 0.0) | (ends > size)).any(axis=1).sum()):
        raise ConfigError(
            f"gmti.scans is {case.gmti.scans}: {left} of {len(ends)} movers leave the scene within {seconds:g} s, "
            "expected fewer scans or other routes."
        )


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
    case, scene, config = made.case, made.scene, made.case.gmti
    one = collection(case, scene)
    interval, movers = interval_of(case, one), movers_of(case, scene)
    reports, antennas = list[Report](), dict[int, Array]()
    # share of false alarms, least velocity, and share of the ground's power that displaced phase centres leave
    told = list[tuple[float, float, float]]()
    for dwell in dwells(case, scene, one, movers, made.seed):
        least = least_velocity(dwell, interval, one)
        left, whole = (float(np.mean(np.abs(each) ** 2)) for each in (dpca(dwell.ground, interval), dwell.ground))
        with one_thread():
            some, share = detections(dwell, interval, case, scene, one, least)
        reports += some
        antennas[dwell.number] = dwell.antenna_m
        told.append((share, least, left / whole))
    alarms, slowest, shares = np.array(told).T
    paths = [stem.with_suffix(".geojson"), stem.with_suffix(".png")]
    places = [np.array([each.east_m, each.north_m]) for each in reports]
    _write_geojson(paths[0], [*zip(map(asdict, reports), places, strict=True)], made)
    seen = [(np.array([(r.scan - 1) * config.revisit_s]), at[None]) for r, at in zip(reports, places, strict=True)]
    numbers = {
        **_agreement("reports", seen, movers, config),
        "asked": config.false_alarms,
        "alarms": float(np.mean(alarms)),
        "least_mps": float(np.median(slowest)),
        "dpca_db": float(10.0 * np.log10(np.mean(shares))),
    }
    found, tracks = list[Path | Finding]([Finding("gmti_detections", "note", "gmti", numbers)]), list[Track]()
    without = _missing("STANAG 4607", "stanag4607", "stanag")
    found += without or write_stanag(stem.with_suffix(".4607"), made, one, reports, antennas)
    missing = _missing("tracks", "stonesoup", "tracking") if config.scans > 1 else []
    if config.scans > 1 and not missing:
        tracks = _tracks(reports, interval, made, one)
        lines = [(each.seconds, each.place_m) for each in tracks]
        features = [
            ({"track": k, **{name: value.tolist() for name, value in vars(each).items()}}, each.place_m)
            for k, each in enumerate(tracks, start=1)
        ]
        paths.append(stem.with_name(f"{stem.name}_tracks.geojson"))
        _write_geojson(paths[-1], features, made)
        found.append(Finding("gmti_tracks", "note", "gmti", _agreement("tracks", lines, movers, config)))
    _write_picture(paths[1], reports, tracks, movers, made)
    return [*paths, *found, *missing]


def _missing(about: str, package: str, extra: str) -> list[Finding]:
    """Finding on a package that is not installed."""
    numbers = {"package": package, "extra": extra}
    return [] if find_spec(package) else [Finding("gmti_package", "note", about, numbers)]


def _tracks(reports: Sequence[Report], interval: Interval, made: Forward, one: Collection) -> list[Track]:
    """Tracks through the detections of all scans.

    The radial velocity gives that to the east, because the beam looks across the track. The standard errors of range
    and velocity are a quarter of gate and velocity resolution. That along the track is the one of monopulse, the beam
    divided by 1.6 sqrt(2 SNR), for a detection at the threshold (Barton and Ward, "Handbook of Radar Measurement",
    1969).
    """
    config = made.case.gmti
    gate, beam = one.gate_m, 2.0 * HALF_BEAM * one.range_m * one.null
    slow = 0.5 * interval.wavelength_m * interval.prf_hz / interval.pulses
    plots = list[tuple[float, Array]]()
    for scan in range(config.scans):
        kept = list[Report]()
        for each in sorted((one for one in reports if one.scan == scan + 1), key=lambda one: -one.eta):
            if not any(
                abs(each.range_m - other.range_m) < (GUARD + 1) * gate
                and abs(each.velocity_mps - other.velocity_mps) < slow
                and abs(each.north_m - other.north_m) < beam
                for other in kept
            ):  # neighbouring dwells see a mover, too
                kept.append(each)
        rows = [(r.east_m, -r.velocity_mps * r.range_m / (r.east_m - one.nadir_m), r.north_m) for r in kept]
        plots.append((scan * config.revisit_s, np.array(rows).reshape(-1, 3)))
    steep = one.range_m / one.reference_m[0, 1]
    eta = kelly_threshold(config.false_alarms, interval.size, config.training)
    snr = eta / (1.0 - eta) * (config.training - interval.size + 1)  # behind the adaptive filter
    return tracked(plots, [0.25 * steep * gate, 0.25 * steep * slow, beam / (1.6 * np.sqrt(2.0 * snr))])


def _agreement(what: str, lines: Sequence[_Line], movers: Movers, config: Gmti) -> dict[str, float]:
    """Number of movers near a line in half of the scans or more, and of lines near a mover in half of theirs.

    A line is a detection or a track. The rms error is that of the places near a mover.
    """
    met, right, squares = np.zeros((len(movers.amplitude), config.scans), np.bool_), 0, list[float]()
    for seconds, places in lines:
        near = 0
        for second, place in zip(seconds, places, strict=True):
            away = np.linalg.norm(movers.after(second)[:, :2] - place, axis=1)
            met[:, round(float(second) / config.revisit_s)] |= away < _NEAR_M
            near += bool((away < _NEAR_M).any())
            squares += [float(away.min() ** 2)] if (away < _NEAR_M).any() else []
        right += 2 * near >= len(seconds)
    return {
        "movers": float(len(movers.amplitude)),
        "scans": float(config.scans),
        f"movers_in_{what}": float((2 * met.sum(axis=1) >= config.scans).sum()),
        what: float(len(lines)),
        f"{what}_of_movers": float(right),
        f"{what}_rms_m": float(np.sqrt(np.mean(squares))) if squares else 0.0,
    }


def _write_geojson(path: Path, features: Sequence[tuple[dict[str, Any], Array]], made: Forward) -> None:
    """Write properties and places, one (2,) or several (n, 2), as GeoJSON (RFC 7946).

    Features have a geometry, in longitude and latitude, if the scene is on the map.
    """
    written = []
    for properties, place_m in features:
        geometry = None
        if (at := longitude_latitude(made.scene, *place_m.T)) is not None:
            kind = "Point" if place_m.ndim == 1 else "LineString"
            geometry = {"type": kind, "coordinates": np.stack(at, axis=-1).tolist()}
        written.append({"type": "Feature", "geometry": geometry, "properties": properties})
    with atomic(path) as partial:
        found = {"type": "FeatureCollection", "case": made.case.case, "run": made.key, "features": written}
        partial.write_text(json.dumps(found, indent=1), encoding="utf-8")


def _write_picture(
    path: Path, reports: Sequence[Report], tracks: Sequence[Track], movers: Movers, made: Forward
) -> None:
    """Write a map of detections and tracks over the materials, with the first and last places of the movers' paths."""
    scene, shown_s = made.scene, max(_SHOWN_S, made.case.gmti.revisit_s * (made.case.gmti.scans - 1))
    (ny, nx), ends_m = scene.material.shape, [movers.after(seconds) for seconds in (0.0, shown_s)]
    east_m, north_m, _ = np.moveaxis(np.array(ends_m), 2, 0)
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
        write_png(path, canvas)
