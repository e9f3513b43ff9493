"""Archive of every run and iteration, ``calibration.h5``, and the same as a table, ``runs.csv``.

Layout of the archive (schema 2); backscatter in dB, angles in degrees:

========================================  =====================================================
``/`` attributes                          ``case``, ``config`` (JSON), ``objective``, ``reason``, ``converged``,
                                          ``tolerance``, ``max_runs``, ``measurement``, ``notes``, ``looks``,
                                          ``measured_looks`` (homogeneous areas),
                                          ``simulator`` (JSON: its identity), ``sentences``, ``law_notes``,
                                          ``versions`` (JSON), ``final_runs``
``runs/kind, index, key, seconds``        one entry per run: reference, reused, design, infill
``materials/<m>`` attributes              ``law``, ``parameter_names``, ``parameter_units``,
                                          ``reason``, ``sentence``, ``eligible``, ``at_boundary``,
                                          ``rms_sampling``, ``effective`` (independent pixels),
                                          ``left_out`` (JSON: visible pixels by reason), ``looks``
                                          (among neighbours), ``textured``, ``fresh`` (another seed gives other pixels),
                                          ``fit_ks, fit_ks_p, fit_ad, fit_ad_p`` (pixels against
                                          their density), ``best`` (index into ``runs``)
``materials/<m>/parameters, dp, rms``     per run: X (n, d), (xi, omega, alpha) (n, 3), rms (n,)
``materials/<m>/bounds, start``           search box (d, 2), starting X (d,); where ``start`` is of another law,
                                          ``parameters`` of the reference run are NaN
``materials/<m>/hidden``                  truth of a synthetic measurement (d,), where there is one
``materials/<m>/target_dp,``              (3,); standard errors of mean [dB], sd [dB], skewness (3,),
``  target_cp_error, target_cp_interval`` and their 95 % intervals (3, 2)
``materials/<m>/pixels``                  flat image index of the target's pixels (p,)
``materials/<m>/incidence_deg``           their local incidence (p,)
``materials/<m>/measured_db, start_db,``  the same pixels at their levels, in the measurement, the reference run,
``  calibrated_db, fresh_db``             the calibrated run, and with fresh random numbers (p,)
``materials/<m>/final_dp, fresh_dp``      densities of the two final runs (3,)
``materials/<m>/predicted_rms, floor_rms, mode``  per infill run, NaN where not computed
``materials/<m>/cost, run_looks``         per run, where incidence-angle bins are compared: half the sum of
                                          squared residuals, and the effective looks that suit it (n,)
``materials/<m>/check`` attributes        ``looks`` (effective), ``looks_nominal``, ``identified`` (0, 1; -1 without a
                                          curve), ``constant_db``, ``between_db``, ``within_db``,
                                          ``incidence_error_deg``, ``sentences``; of held-out blocks ``rmse_law_db``,
                                          ``rmse_law_patch_db``, ``rmse_constant_db``, ``rmse_best_db``,
                                          ``rmse_start_db``, ``ks_law``, ``ks_constant``, ``ks_start``,
                                          ``tail_law_db``, ``tail_constant_db``, ``tail_start_db``,
                                          ``coverage_90``, ``n_blocks``
``materials/<m>/check/class_deg,``        each bin's mean incidence [deg], the level that its pixels ask of the law
``  class_db, class_error_db``            there [dB] and its standard error (n,)
``materials/<m>/check/block, mean_db,``   held-out blocks: number, mean measured, predicted by law and fields, by the
``  predicted_db, law_db, sd_db``         law alone, standard deviation of the prediction [dB] (b,)
``images/measured_db, reference_db,``     whole images (rows: slant range, columns: azimuth);
``  calibrated_db, material,``            the calibrated one has fresh random numbers
``  incidence_deg``
``scene/material, elevation_m``           materials and elevation [m] of the scene, row 0 in the south, every
                                          ``step``-th cell (attribute; ``cell_m`` [m] is that of the scene)
``scene/objects``                         middle [m] of objects, east and north of the south-west corner, evenly spaced
                                          ones where there are many (attribute ``count`` is of all); only if any
``laws/<m>``                              parameters of every material's law in the final runs; the law's
                                          name is an attribute of ``laws``
``laws/<m>``, ``materials/<m>/start``     what evaluating their law takes: ``law``, ``polarisation``, and
``  parameters`` attributes               ``frequency_ghz`` and ``angles_deg`` where there are any; ``names`` and
                                          ``units`` of an external law, which has no curve
``registration`` attributes               ``method``, ``applied``, ``verdict``
``registration/displacement_px,``         where in the measured image each pixel lies (2, rows, columns),
``  uncertainty_px, unregistered_db,``    its standard error, the image before, and the true
``  misregistration_px``                  displacement of a synthetic one; where it was applied
``levels`` attributes                     ``normalisation``, ``offset_db``, ``offset_error_db``, ``scale``,
                                          ``sentence``, ``doubtful``, ``unit`` of densities and pixels
``names``                                 material id k is ``names[k - 1]``
========================================  =====================================================
"""

from __future__ import annotations

import csv
import json
import platform
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from radcal.calibration.class_search import ClassSearch, class_searches
from radcal.calibration.history import History
from radcal.calibration.law_check import LawCheck, check_laws, texture_note
from radcal.calibration.noise import noise_sentence
from radcal.calibration.steps import not_fresh, repeatability
from radcal.calibration.stopping import decide
from radcal.config import Stop, stages
from radcal.errors import StoreError
from radcal.measurement.registration import Registered
from radcal.measurement.target import Targets
from radcal.radar.geometry import Geometry
from radcal.report.law_notes import law_notes
from radcal.report.law_records import put_law
from radcal.scene.model import Scene
from radcal.storage.disclosure import disclosed
from radcal.storage.files import atomic
from radcal.storage.records import read_hdf5, write_hdf5
from radcal.storage.runs import Record, RunStore

__all__ = ["write_archive", "write_table"]

_REGISTRATION = ("unregistered_db", "displacement_px", "uncertainty_px")
_LARGEST_SCENE = 1200  # cells per side
_MOST_OBJECTS = 20_000  # more dots than a picture tells apart
_PACKAGES = ("radcal", "numpy", "scipy", "smt", "platypus-opt", "h5py", "snakemake")


def write_archive(
    path: str | Path,
    *,
    case: stages.Archive,
    stop: Stop,
    history: History,
    scene: Scene,
    geometry: Geometry,
    registered: Registered,
    targets: Targets,
    runs: str | Path,
    final: Sequence[Record],
) -> None:
    """Write ``calibration.h5``, atomically.

    Parameters
    ----------
    path : path
        The file.
    case, stop : stages.Archive, Stop
        Configuration.
    history : History
        Reference, design and verified proposals.
    scene, geometry, registered, targets
        What the runs are compared with.
    runs : path
        Folder of the run store.
    final : sequence of two Record
        The calibrated laws with common and with fresh random numbers.

    Raises
    ------
    StoreError
        The reference run's record is gone.
    """
    measurement = registered.measurement
    decision = decide(history, list(targets), stop)
    store = RunStore(runs)
    reference = store.get(history.runs[0].key, list(targets), image=True)
    if reference is None:
        raise StoreError(
            f"{store.path(history.runs[0].key)}: the reference run is missing or without its image; delete "
            f"{Path(runs).parent / 'reference.json'} and type the same command again to make it again."
        )
    repeated = [sentence] if (sentence := repeatability(case.simulator, history.repeat_db)) else []
    if case.surrogate.outputs == "centred":
        known = {name: history.noise_variance(name) for name in targets}
        repeated += [noise_sentence(name, variance) for name, variance in known.items() if variance is not None]
    fresh = final[1]
    before = {run.key for run in history.runs}
    searches = class_searches(case, targets)
    checks = check_laws(case, targets, history)
    looks = {name: checks[name].looks for name in searches}
    repeated += [note] if (note := texture_note(checks)) else []
    repeated += [note] if (note := not_fresh(case.simulator, final)) else []
    calibrated_db, fresh_db = (_textured(final[k].pixels_db, searches, looks, fresh=k == 1) for k in range(2))
    start_db = _textured(reference.pixels_db, searches, history.runs[0].looks)
    final_scores = {"final": targets.score(calibrated_db), "fresh": targets.score(fresh_db)}
    with write_hdf5(path, "calibration") as file:
        file.attrs["case"] = case.case
        file.attrs["config"] = json.dumps(
            disclosed({**case.sections(*case.__dict__), "stop": stop.model_dump(mode="json")})
        )
        file.attrs["objective"] = case.objective
        file.attrs["reason"] = decision.reason or "running"
        file.attrs["converged"] = decision.converged
        file.attrs["tolerance"] = stop.rms
        file.attrs["max_runs"] = stop.max_runs
        file.attrs["looks"] = case.radar.looks
        file.attrs["measured_looks"] = targets.looks
        file.attrs["measurement"] = measurement.source
        file.attrs["notes"] = [*measurement.notes, *repeated]
        file.attrs["simulator"] = json.dumps(store.description(reference.key).get("simulator", {}))
        file.attrs["sentences"] = [decision.materials[name].sentence for name in targets]
        file.attrs["versions"] = json.dumps(_versions())
        file.attrs["final_runs"] = len({record.key for record in final} - before)
        group = file.create_group("registration")
        for key in ("method", "applied", "verdict"):
            group.attrs[key] = getattr(registered, key)
        if registered.applied:
            fields: dict[str, Any] = {key: getattr(registered, key) for key in _REGISTRATION}
            fields["misregistration_px"] = measurement.misregistration_px
            for key, values in fields.items():
                if values is not None:
                    group.create_dataset(key, data=values, compression="gzip", compression_opts=1)
        _put_scene(file.create_group("scene"), scene)
        laws = file.create_group("laws", track_order=True)
        best = {name: history.best(name).parameters[name] for name in targets}
        final_parameters = {
            name: best.get(name, material.start_parameters) for name, material in case.materials.items()
        }
        for name, material in case.materials.items():
            laws.attrs[name] = material.law
            laws[name] = final_parameters[name]
            put_law(laws[name], material, case.radar)
        file.attrs["law_notes"] = law_notes(case, geometry, final_parameters)
        group = file.create_group("levels")
        for key in ("normalisation", "offset_db", "offset_error_db", "scale", "sentence", "doubtful", "unit"):
            group.attrs[key] = getattr(targets.levels, key)
        # pictures compare whole images in dB, at the level that was taken as theirs
        level = 0.0 if targets.levels.normalisation == "none" else targets.levels.offset_db
        file["names"] = list(geometry.names)
        for key in ("kind", "index", "key", "seconds"):
            file[f"runs/{key}"] = [getattr(run, key) for run in history.runs]
        images: dict[str, Any] = {
            "measured_db": measurement.image_db - np.float32(level),
            "reference_db": reference.image_db,
            "calibrated_db": _picture(fresh, fresh_db, geometry, searches),
            "material": geometry.material,
            "incidence_deg": geometry.incidence_deg,
        }
        for name, image in images.items():
            if image is not None:
                file.create_dataset(f"images/{name}", data=image, compression="gzip", compression_opts=1)
        materials = file.create_group("materials", track_order=True)  # in the order of the configuration
        for name, target in targets.items():
            group = materials.create_group(name)
            material = case.materials[name]
            group.attrs["law"] = material.law
            group.attrs["parameter_names"] = material.parameter_names
            group.attrs["parameter_units"] = material.parameter_units
            group.attrs["reason"] = decision.materials[name].reason or "running"
            group.attrs["sentence"] = decision.materials[name].sentence
            group.attrs["eligible"] = target.eligible
            group.attrs["at_boundary"] = target.at_boundary
            group.attrs["rms_sampling"] = target.rms_sampling
            group.attrs["effective"] = target.effective
            group.attrs["looks"] = target.looks
            group.attrs["textured"] = targets.textured(name)
            group.attrs["fresh"] = not np.array_equal(final[0].pixels_db[name], fresh.pixels_db[name])
            group.attrs["left_out"] = json.dumps(target.left_out)
            for key in ("ks", "ks_p", "ad", "ad_p"):
                group.attrs[f"fit_{key}"] = getattr(target.goodness, key)
            group.attrs["best"] = history.runs.index(history.best(name))
            unknown = [np.nan] * len(material.parameter_names)
            group["parameters"] = [unknown if name in run.other_law else run.parameters[name] for run in history.runs]
            put_law(group["parameters"], material, case.radar)
            group["dp"] = [run.dp[name] for run in history.runs]
            group["rms"] = [run.rms[name] for run in history.runs]
            group["bounds"] = material.box
            group["start"] = material.start_parameters
            put_law(group["start"], material.at_start, case.radar)
            if name in measurement.hidden:
                group["hidden"] = measurement.hidden[name]
            group["target_dp"] = target.dp
            group["target_cp_error"] = target.cp_error
            group["target_cp_interval"] = target.cp_interval
            group["pixels"] = target.pixels
            group["incidence_deg"] = target.incidence_deg
            group["measured_db"] = target.values_db
            for key, pixels_db in (("start", start_db), ("calibrated", calibrated_db), ("fresh", fresh_db)):
                mapping = targets.levels.simulated(pixels_db)
                group[f"{key}_db"] = targets.levels.apply(pixels_db[name][target.order], mapping)
            if name in searches:
                group["cost"] = [run.cost.get(name, np.nan) for run in history.runs]
                group["run_looks"] = [run.looks.get(name, np.nan) for run in history.runs]
            _put_check(group.create_group("check"), checks[name])
            for key, scores in final_scores.items():
                group[f"{key}_dp"] = scores[name][0]
            proposals = [run.proposals[name] for run in history.infill]
            for key in ("predicted_rms", "floor_rms"):
                group[key] = np.array([getattr(p, key) for p in proposals], dtype=np.float64)
            group["mode"] = np.array([p.mode for p in proposals], dtype=h5py.string_dtype())


def _textured(
    pixels_db: Mapping[str, NDArray[np.float32]],
    searches: Mapping[str, ClassSearch],
    looks: Mapping[str, float],
    fresh: bool = False,
) -> dict[str, NDArray[np.float32]]:
    """A run's pixels with the texture of each material whose looks are known."""
    known = {name: searches[name].textured(pixels_db[name], looks[name], fresh) for name in searches if name in looks}
    return {**pixels_db, **known}


def _picture(
    record: Record,
    pixels_db: Mapping[str, NDArray[np.float32]],
    geometry: Geometry,
    searches: Mapping[str, ClassSearch],
) -> NDArray[np.float32] | None:
    """A run's whole image with the same."""
    if record.image_db is None or not searches:
        return record.image_db
    image = record.image_db.copy()
    for name in searches:
        image.ravel()[geometry.pixels(name)] = pixels_db[name]
    return image


def _put_check(group: h5py.Group, check: LawCheck) -> None:
    """Write what is known of the law."""
    group.attrs["identified"] = -1 if check.identified is None else int(check.identified)
    group.attrs["sentences"] = np.array(check.sentences, dtype=h5py.string_dtype())
    for key in ("looks", "looks_nominal", "constant_db", "between_db", "within_db", "incidence_error_deg"):
        group.attrs[key] = getattr(check, key)
    for key in ("class_deg", "class_db", "class_error_db"):
        group[key] = getattr(check, key)
    if check.held is not None:
        for key, value in asdict(check.held).items():
            if isinstance(value, np.ndarray):
                group[key] = value
            else:
                group.attrs[key] = value


def _put_scene(group: h5py.Group, scene: Scene) -> None:
    """As much of the scene as pictures need."""
    step = -(-max(scene.material.shape) // _LARGEST_SCENE)
    group.attrs["step"] = step
    group.attrs["cell_m"] = scene.cell_m
    for name in ("material", "elevation_m"):
        if (values := getattr(scene, name)) is not None:
            values = values[::step, ::step].astype(np.uint8 if name == "material" else np.float32)
            group.create_dataset(name, data=values, compression="gzip", compression_opts=1)
    if scene.objects is not None and (count := len(scene.objects)):
        every = -(-count // _MOST_OBJECTS)
        places = np.stack([scene.objects.x_m, scene.objects.y_m], axis=1)[::every].astype(np.float32)
        group.create_dataset("objects", data=places, compression="gzip", compression_opts=1)
        group["objects"].attrs["count"] = count


def _versions() -> dict[str, str]:
    return {"python": platform.python_version(), **{name: version(name) for name in _PACKAGES}}


def write_table(path: str | Path, archive: str | Path) -> None:
    """Write ``runs.csv``: one line per run and material."""
    with read_hdf5(archive, "calibration") as file:
        names = list(file["materials"])
        headings = [list(file[f"materials/{name}"].attrs["parameter_names"]) for name in names]
        widest = max(headings, key=len)
        if any(heading != widest[: len(heading)] for heading in headings):  # materials of different laws
            widest = [f"X{k}" for k in range(1, len(widest) + 1)]
        runs = {key: file[f"runs/{key}"] for key in ("kind", "index", "key", "seconds")}
        with atomic(path) as partial, partial.open("w", newline="", encoding="utf-8") as handle:
            table = csv.writer(handle)
            table.writerow(
                ["run", "kind", "index", "key", "seconds", "material", *widest, "xi", "omega", "alpha", "rms"]
            )
            for n, kind in enumerate(runs["kind"].asstr()[()]):
                row = [n, kind, int(runs["index"][n]), runs["key"].asstr()[n], f"{runs['seconds'][n]:.3f}"]
                for name in names:
                    group = file[f"materials/{name}"]
                    x = ["" if np.isnan(v) else repr(float(v)) for v in group["parameters"][n]]
                    dp = [repr(float(v)) for v in group["dp"][n]]
                    table.writerow([*row, name, *x, *[""] * (len(widest) - len(x)), *dp, repr(float(group["rms"][n]))])
