"""The product ``ppi`` of a forward run: checks before any work, an HDF5 file with the names of CfRadial, pictures."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.config.part import Part
from radcal.errors import ConfigError
from radcal.figures.drawing import TOLERANCE, new_canvas, styled, write_png
from radcal.findings import Finding
from radcal.laws import Law
from radcal.ppi.ground import BINS_DEG, Ground, Points, ground_of, points_of, site_of
from radcal.ppi.scan import Sweep, detected, one_turn
from radcal.radar.geometry import Geometry
from radcal.scene.crs import longitude_latitude
from radcal.scene.model import Scene
from radcal.sections.errors import nearest
from radcal.sections.ppi import Ppi
from radcal.signals.platform import carrier_hz
from radcal.simulators.forward import Forward
from radcal.storage.records import plain_hdf5

_ALL_DEG = (0.0, 90.0)
_LARGEST = 200_000_000  # largest number of pulses x gates: 5 GB of sums
_SCALE_DB = 50.0  # longest colour scale, from the brightest cells down
_LEAST_PERCENT = 5.0  # of a material's visible ground beyond the known incidence, as in the report


def check(case: Part, scene: Scene) -> None:
    """Raise an error if the band has no known frequency, or with a sentence for each contradiction with the scene."""
    carrier_hz(case.radar)
    if wrong := list(_contradictions(case, scene)):
        raise ConfigError("\nradcal: ".join(wrong))


def _contradictions(case: Part, scene: Scene) -> Iterator[str]:
    config = case.ppi
    if scene.elevation_m is None:
        yield f"scene.source is {case.scene.source}, whose scene has no heights, expected one with an elevation."
        return
    size = [cells * scene.cell_m for cells in scene.material.shape[::-1]]
    if config.site_m is not None and not all(0.0 <= x < s for x, s in zip(site_of(scene, config), size, strict=True)):
        yield f"ppi.site_m is {list(config.site_m)}, expected a place in the scene of {size[0]:g} x {size[1]:g} m."
    for name in config.land:
        if name not in case.materials:
            yield f"ppi.land.{name}: no such material{nearest(name, case.materials)}."
    if (size_px := config.turn * config.gates) > _LARGEST:
        yield (
            f"ppi.gate_m is {config.gate_m:g} and ppi.range_m {config.range_m:g}: a turn would have {size_px:,} pulses "
            f"and gates, expected at most {_LARGEST:,}."
        )


def extrapolated(ground: Ground, laws: Mapping[str, Law], geometry: Geometry) -> list[Finding]:
    """Findings on materials that the mast sees at incidences at which their laws are not known.

    A law is known at the angles that it was made for. One that was made for all angles is known where the pass of the
    case sees its material, between the 5 % and the 95 % quantile.

    Parameters
    ----------
    ground : Ground
        What the mast sees.
    laws : mapping
        Law of each material.
    geometry : Geometry
        Geometry of the pass.
    """
    found, middle = list[Finding](), 0.5 * (BINS_DEG[1:] + BINS_DEG[:-1])
    for name, law in laws.items():
        area, (low, high) = ground.seen[name], law.valid_deg
        pixels = geometry.pixels(name)
        if law.valid_deg == _ALL_DEG and pixels.size:
            low, high = np.quantile(geometry.incidence_deg.flat[pixels], [0.05, 0.95])
        if not (total := area.sum()):
            continue
        beyond = 100.0 * area[(middle < low) | (middle > high)].sum() / total
        if beyond >= _LEAST_PERCENT:
            median = middle[np.searchsorted(np.cumsum(area), 0.5 * total)]
            numbers = {"median_deg": median, "percent": beyond, "low_deg": float(low), "high_deg": float(high)}
            found.append(Finding("ppi_extrapolated", "warning", name, {**numbers, "law": law.name}))
    return found


def _detections(sweep: Sweep, points: Points, found: NDArray[np.bool_], config: Ppi) -> Finding:
    """Finding on false alarms without objects, and on the objects that are detected."""
    off = np.abs((sweep.azimuth_deg[:, None] - points.azimuth_deg + 180.0) % 360.0 - 180.0)
    # the ray that points nearest to an object, and its neighbours
    rays = np.arange(-1, 2)[:, None] + np.argmin(off, axis=0) if points.snr.size else np.zeros((3, 0), np.intp)
    hits = found[rays % len(found), points.gate].any(axis=0)
    numbers = {
        "asked": config.false_alarms,
        "alarms": float(detected(sweep.without_objects, config).mean()),
        "objects": float(points.snr.size),
        "detected": float(hits.sum()),
    }
    return Finding("ppi_detections", "note", "ppi", numbers)


def write(stem: Path, made: Forward) -> list[Path | Finding]:
    """Write the picture of one turn to an HDF5 file, and its B-scope and its map as PNG.

    Parameters
    ----------
    stem : path
        Path of the files without suffix.
    made : Forward
        Forward run of the pass.

    Returns
    -------
    list of path or Finding
        The files; which laws are extrapolated, and what the detector found.
    """
    case, scene, config = made.case, made.scene, made.case.ppi
    check(case, scene)
    laws = {name: law for name, law in case.laws.items() if name in scene.names}
    ground = ground_of(scene, config, case.radar, laws, case.start_parameters)
    points = points_of(scene, config, case.radar, laws, case.start_parameters)
    sweep = one_turn(ground, points, config, made.seed)
    found = detected(sweep.snr, config)
    ruled = {name: law for name, law in laws.items() if name not in config.land}
    paths = [stem.with_suffix(".h5"), stem.with_suffix(".png")]
    _write_sweep(paths[0], made, sweep, found)
    _write_pictures(paths[1], sweep, found, scene, site_of(scene, config))
    return [*paths, *extrapolated(ground, ruled, made.geometry), _detections(sweep, points, found, config)]


def _write_sweep(path: Path, made: Forward, sweep: Sweep, reported: NDArray[np.bool_]) -> None:
    """Write a turn with the names of CfRadial 2.0 (Dixon and Lee, 2016): root group, and one group for the sweep."""
    config, scene = made.case.ppi, made.scene
    assert scene.elevation_m is not None  # noqa: S101 - checked
    x, y = site_of(scene, config)
    longitude, latitude = longitude_latitude(scene, x, y) or (np.nan, np.nan)
    height = scene.elevation_m[int(y / scene.cell_m), int(x / scene.cell_m)] + config.mast_m
    began, tilt = "2000-01-01T00:00:00Z", config.tilt_deg
    seconds, of_ray = sweep.azimuth_deg / 360.0 * 60.0 / config.rotation_rpm, ("time",)
    snr = (10.0 * np.log10(sweep.snr)).astype(np.float32)
    # values, axes, unit and standard name
    variables: dict[str, tuple[Any, ...]] = {
        "volume_number": (0, ()), "latitude": (latitude, ()), "longitude": (longitude, ()), "altitude": (height, ()),
        "time_coverage_start": (began, ()), "time_coverage_end": (began, ()), "sweep": ([0], ("sweep",)),
        "sweep_group_name": (["sweep_0"], ("sweep",)), "sweep_fixed_angle": ([tilt], ("sweep",)),
        "sweep_0/sweep_number": (0, ()), "sweep_0/sweep_mode": ("azimuth_surveillance", ()),
        "sweep_0/follow_mode": ("none", ()), "sweep_0/prt_mode": ("fixed", ()), "sweep_0/sweep_fixed_angle": (tilt, ()),
        "sweep_0/frequency": ([carrier_hz(made.case.radar)], ("frequency",)),
        "sweep_0/time": (seconds, of_ray, f"seconds since {began}", "time"),
        "sweep_0/range": (sweep.range_m, ("range",), "meters", "projection_range_coordinate"),
        "sweep_0/azimuth": (sweep.azimuth_deg, of_ray, "degrees", "ray_azimuth_angle"),
        "sweep_0/elevation": (np.full_like(seconds, tilt), of_ray, "degrees", "ray_elevation_angle"),
        "sweep_0/SNR": (snr, ("time", "range"), "dB", "signal_to_noise_ratio"),
        "sweep_0/DETECTED": (reported.astype(np.int8), ("time", "range"), "1", "detection_by_cell_averaging"),
    }  # fmt: skip
    with plain_hdf5(path) as file:
        described = {f"ppi_{key}": value for key, value in config.model_dump(exclude={"land", "site_m"}).items()}
        file.attrs.update({
            "Conventions": "Cf/Radial", "version": "2.0", "title": f"PPI of the case {made.case.case}",
            "instrument_name": "radcal", "institution": "", "references": "", "history": f"run {made.key}",
            "source": "simulation by radcal", "platform_is_mobile": "false", "simulated": "true",
            "comment": "the date of time is invented", "polarisation": made.case.radar.polarisation, **described,
        })  # fmt: skip
        for name, (values, axes, *named) in variables.items():
            data = file.create_dataset(name, data=values, compression="gzip" if len(axes) > 1 else None)
            data.attrs.update(zip(("units", "standard_name"), named, strict=False))
            for k, axis in enumerate(axes):
                if name.rpartition("/")[2] == axis:
                    data.make_scale(axis)
                else:
                    data.dims[k].attach_scale(data.parent[axis])


def _write_pictures(
    path: Path, sweep: Sweep, reported: NDArray[np.bool_], scene: Scene, site_m: tuple[float, float]
) -> None:
    """Write B-scope and map of a turn as PNG; detections are dots."""
    db = 10.0 * np.log10(sweep.snr)
    high = float(np.quantile(db, 0.999))
    low = max(-3.0, high - _SCALE_DB)
    scale = {"vmin": low, "vmax": high, "cmap": "viridis", "rasterized": True}
    gate, ray = sweep.range_m[1] - sweep.range_m[0], 360.0 / sweep.azimuth_deg.size
    ranges_km = np.append(sweep.range_m - gate / 2.0, sweep.range_m[-1] + gate / 2.0) / 1e3
    bearings = np.append(sweep.azimuth_deg - ray / 2.0, sweep.azimuth_deg[-1] + ray / 2.0)
    ny, nx = scene.material.shape
    edge = np.array([[0.0, 0.0], [nx, 0.0], [nx, ny], [0.0, ny], [0.0, 0.0]]) * scene.cell_m / 1e3
    rays, gates = np.nonzero(reported)
    dots = {"marker": ".", "s": 3.0, "linewidths": 0.0, "color": TOLERANCE["color"]}
    with styled():
        canvas = new_canvas(11.5, 5.2)
        scope, plan = canvas.subplots(1, 2, gridspec_kw={"width_ratios": [1.0, 1.15]})
        scope.pcolormesh(bearings, ranges_km, db.T, **scale)
        scope.scatter(sweep.azimuth_deg[rays], sweep.range_m[gates] / 1e3, **dots)
        scope.set(xlabel="azimuth [deg]", ylabel="slant range [km]", title="B-scope", xlim=(0, 360))
        east, north = (np.outer(ranges_km, turn(np.radians(bearings))) for turn in (np.sin, np.cos))
        x0, y0 = (each / 1e3 for each in site_m)
        drawn = plan.pcolormesh(x0 + east, y0 + north, db.T, **scale)
        turned = np.radians(sweep.azimuth_deg[rays])
        at = sweep.range_m[gates] / 1e3
        plan.scatter(x0 + at * np.sin(turned), y0 + at * np.cos(turned), label="detection", **dots)
        plan.plot(*edge.T, color="white", linewidth=0.9, label="scene")
        plan.plot([x0], [y0], "+", color="white", label="mast")
        plan.set(xlabel="east [km]", ylabel="north [km]", title="PPI", aspect="equal")
        plan.legend(loc="lower left", labelcolor="black", frameon=True, facecolor="#B0B0B0", markerscale=3.0)
        for panel in (scope, plan):
            panel.grid(visible=False)
        canvas.colorbar(drawn, ax=plan, extend="both", fraction=0.046, pad=0.02).set_label("signal-to-noise ratio [dB]")
        write_png(path, canvas)
