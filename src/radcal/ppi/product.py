"""The product ``ppi`` of a forward run: checks before any work, an HDF5 file with the names of CfRadial, pictures."""

from __future__ import annotations

import io
from collections.abc import Iterator, Mapping
from pathlib import Path

import h5py
import numpy as np

from radcal.config.part import Part
from radcal.errors import ConfigError
from radcal.findings import Finding
from radcal.laws import Law
from radcal.ppi.ground import BINS_DEG, Ground, Points, carrier_ghz, ground_of, points_of, site_of
from radcal.ppi.pictures import write_pictures
from radcal.ppi.scan import Sweep, detected, one_turn
from radcal.radar.geometry import Geometry
from radcal.scene.model import Scene
from radcal.sections.errors import nearest
from radcal.simulators.forward import Forward
from radcal.storage.files import atomic

_ALL_DEG = (0.0, 90.0)
_LARGEST = 200_000_000  # largest number of pulses x gates: 5 GB of sums
_LEAST_PERCENT = 5.0  # of a material's visible ground beyond the known incidence, as in the report


def check(case: Part, scene: Scene) -> None:
    """Raise an error with one sentence for each contradiction of section ``ppi`` with scene or pass."""
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
    if carrier_ghz(case.radar) is None:
        yield f"radar.frequency_ghz is missing: radar.band is {case.radar.band!r}, which has no known frequency."
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


def _detections(sweep: Sweep, points: Points, case: Part) -> Finding:
    """Finding on false alarms without objects, and on the objects that are detected."""
    config, found = case.ppi, detected(sweep.snr, case.ppi)
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
    frequency = carrier_ghz(case.radar)
    assert frequency is not None  # noqa: S101 - checked
    laws = {name: law for name, law in case.laws.items() if name in scene.names}
    ground = ground_of(scene, config, laws, case.start_parameters, frequency)
    points = points_of(scene, config, frequency, case.radar, laws, case.start_parameters)
    sweep = one_turn(ground, points, config, made.seed)
    ruled = {name: law for name, law in laws.items() if name not in config.land}
    paths = [stem.with_suffix(".h5"), stem.with_suffix(".png")]
    _write_sweep(paths[0], made, sweep, frequency)
    write_pictures(paths[1], sweep, detected(sweep.snr, config), scene, site_of(scene, config))
    return [*paths, *extrapolated(ground, ruled, made.geometry), _detections(sweep, points, case)]


def _place(scene: Scene, site: tuple[float, float]) -> tuple[float, float]:
    """Longitude and latitude of the mast [deg]; NaN for a scene without a place on the map."""
    if scene.crs is None or scene.transform is None:
        return np.nan, np.nan
    from radcal.scene.crs import transformer

    a, b, c, d, e, f = scene.transform
    column, row = (each / scene.cell_m for each in site)
    longitude, latitude = transformer(scene.crs, "EPSG:4326").transform(
        a * column + b * row + c, d * column + e * row + f
    )
    return float(longitude), float(latitude)


def _write_sweep(path: Path, made: Forward, sweep: Sweep, frequency_ghz: float) -> None:
    """Write a turn with the names of CfRadial 2.0 (Dixon and Lee, 2016): root group, and one group for the sweep."""
    config, scene, whole = made.case.ppi, made.scene, io.BytesIO()  # HDF5 cannot recover from a full disk
    assert scene.elevation_m is not None  # noqa: S101 - checked
    x, y = site_of(scene, config)
    longitude, latitude = _place(scene, (x, y))
    ground_m = scene.elevation_m[int(y / scene.cell_m), int(x / scene.cell_m)]
    turn_s = 60.0 / config.rotation_rpm
    rays = sweep.azimuth_deg.size
    with h5py.File(whole, "w") as file:
        described = {f"ppi_{key}": value for key, value in config.model_dump(exclude={"land", "site_m"}).items()}
        file.attrs.update({
            "Conventions": "Cf/Radial", "version": "2.0", "title": f"PPI of the case {made.case.case}",
            "instrument_name": "radcal", "institution": "", "references": "", "history": f"run {made.key}",
            "source": "simulation by radcal", "platform_is_mobile": "false", "simulated": "true",
            "comment": "the date of time is invented", "polarisation": made.case.radar.polarisation, **described,
        })  # fmt: skip
        root = {
            "volume_number": 0, "latitude": latitude, "longitude": longitude, "altitude": ground_m + config.mast_m,
            "time_coverage_start": "2000-01-01T00:00:00Z", "time_coverage_end": "2000-01-01T00:00:00Z",
            "sweep_group_name": ["sweep_0"], "sweep_fixed_angle": [config.tilt_deg],
        }  # fmt: skip
        for name, value in root.items():
            file[name] = value
        file["sweep"] = [0]
        file["sweep"].make_scale("sweep")
        for name in ("sweep_group_name", "sweep_fixed_angle"):
            file[name].dims[0].attach_scale(file["sweep"])
        group = file.create_group("sweep_0")
        scalars = {"sweep_number": 0, "sweep_mode": "azimuth_surveillance", "follow_mode": "none", "prt_mode": "fixed"}
        for name, value in {**scalars, "sweep_fixed_angle": config.tilt_deg}.items():
            group[name] = value
        time_s = sweep.azimuth_deg / 360.0 * turn_s
        axes = {
            "time": (time_s, "seconds since 2000-01-01T00:00:00Z", "time"),
            "range": (sweep.range_m, "meters", "projection_range_coordinate"),
        }
        for name, (values, unit, standard) in axes.items():
            group[name] = values
            group[name].make_scale(name)
            group[name].attrs.update({"units": unit, "standard_name": standard})
        group["frequency"] = [frequency_ghz * 1e9]
        group["frequency"].make_scale("frequency")
        snr = 10.0 * np.log10(sweep.snr)
        fields = {
            "azimuth": (sweep.azimuth_deg, "degrees", "ray_azimuth_angle"),
            "elevation": (np.full(rays, config.tilt_deg), "degrees", "ray_elevation_angle"),
            "SNR": (snr.astype(np.float32), "dB", "signal_to_noise_ratio"),
            "DETECTED": (detected(sweep.snr, config).astype(np.int8), "1", "detection_by_cell_averaging"),
        }
        for name, (values, unit, standard) in fields.items():
            data = group.create_dataset(name, data=values, **({"compression": "gzip"} if values.ndim > 1 else {}))
            data.attrs.update({"units": unit, "standard_name": standard})
            for axis, scale in zip(range(values.ndim), ("time", "range"), strict=False):
                data.dims[axis].attach_scale(group[scale])
    with atomic(path) as partial_path:
        partial_path.write_bytes(whole.getbuffer())
