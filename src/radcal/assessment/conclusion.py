"""Conclusion of a calibration: decision on its end, findings, densities of the final runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.known import image_findings, law_findings, material_findings
from radcal.assessment.program_check import another_law
from radcal.assessment.registration_check import check_registration
from radcal.calibration.scoring import with_texture
from radcal.calibration.stopping import Decision, decide
from radcal.config.part import Part
from radcal.findings import Finding
from radcal.objectives import Comparison
from radcal.objectives.history import History
from radcal.posterior.result import Image, Posterior
from radcal.radar.geometry import Geometry
from radcal.registration.registered import Registered
from radcal.storage.run_index import record_of
from radcal.storage.runs import Record, RunStore
from radcal.targets.target import Targets, level_only

Pixels = Mapping[str, NDArray[np.float32]]


@dataclass(frozen=True)
class MaterialPixels:
    """Simulated pixels of one material's target in the reference run and the two final runs, textured.

    Attributes
    ----------
    start, calibrated, fresh : ndarray, shape (n,)
        Pixels of three runs, after normalisation of the level: the reference run, the final run with common random
        numbers, and the final run with fresh ones [dB; interquartile ranges for ``normalisation: image``].
    calibrated_dp, fresh_dp : ndarray, shape (3,)
        Skew-normal densities (xi, omega, alpha) of all visible pixels in the two final runs; xi and omega have the
        unit of the pixels.
    differ : bool
        Whether the pixels of the two final runs, of different seeds, differ.
    """

    start: NDArray[Any]
    calibrated: NDArray[Any]
    fresh: NDArray[Any]
    calibrated_dp: NDArray[np.float64]
    fresh_dp: NDArray[np.float64]
    differ: bool


@dataclass(frozen=True)
class Conclusion:
    """Results of a calibration: decision on its end, laws, pixels of the final runs, and findings.

    Attributes
    ----------
    decision : Decision
        Whether the search has ended, and why.
    materials : mapping
        Pixels and densities of each calibrated material.
    reference_db, calibrated_db : ndarray of float32, shape (rows, columns), or None
        Image of the reference run, and image of the final run with fresh random numbers [dB].
    simulator : mapping
        Identity of the simulator.
    posteriors : mapping
        Posterior of each law; after a refusal, sigma0 is determined at no angle.
    findings : list of Finding
        Findings on the images in the order in which to act on them, then on each material.
    """

    decision: Decision
    materials: Mapping[str, MaterialPixels]
    reference_db: NDArray[np.float32] | None
    calibrated_db: NDArray[np.float32] | None
    simulator: Mapping[str, Any]
    posteriors: Mapping[str, Posterior]
    findings: list[Finding]


def conclude(
    case: Part,
    history: History,
    targets: Sequence[Targets],
    objectives: Mapping[str, Comparison],
    geometry: Geometry,
    runs: str | Path,
    final: Sequence[Record],
    posteriors: Mapping[str, Posterior],
    image: Image,
    images: Sequence[Registered] = (),
    noted: Sequence[Finding] = (),
) -> Conclusion:
    """Conclude a calibration: decide if the search has ended, collect the findings, and score the final runs.

    Parameters
    ----------
    case : Part
        Configuration of the case.
    history : History
        Scored runs: reference run, design and verified proposals.
    targets : sequence of Targets
        Targets of the calibrated materials in each pass.
    objectives : mapping
        Objective of each calibrated material.
    geometry : Geometry
        Geometry of the pass, which holds the pixels of each material.
    runs : path
        Folder of the run store.
    final : sequence of two Record
        Final runs of the calibrated laws: with the common random numbers, and with fresh ones.
    posteriors : mapping
        Posterior of each material's law.
    image : Image
        What the fixed materials say.
    images : sequence of Registered
        Registered measured image of each pass; the first is registered again onto the image of the calibrated laws.
    noted : sequence of Finding
        Findings on the geometry of all passes.

    Raises
    ------
    StoreError
        If the record of the reference run is missing or holds no image.
    """
    store, key = RunStore(runs), history.runs[0].keys[0]
    seen = targets[0]  # it shows all calibrated materials
    index = Path(runs).parent / "passes/1/reference.json"
    reference = record_of(store, index, key, list(seen), image=True)
    first = {name: score.looks for name, score in history.runs[0].scores.items()}
    looks = {name: history.best(name).looks for name in seen}
    fresh_db = with_texture(final[1].pixels_db, objectives, looks, case.seed, fresh=True)
    each_db = [
        with_texture(reference.pixels_db, objectives, first, case.seed),
        with_texture(final[0].pixels_db, objectives, looks, case.seed),
        fresh_db,
    ]
    findings = [finding for one in images for finding in one.findings]
    findings += [*image_findings(case, image), *noted]
    refused = any(one.severity == "refusal" for one in findings)
    warned = {one.code: f"{one.code.replace('_', ' ')} of {one.about}" for one in findings if one.severity != "note"}
    laws = {name: (case.laws[name], np.asarray(history.best(name).parameters)) for name in seen}
    for name, found in laws.items():
        findings += material_findings(case, name, posteriors[name], targets, refused)
        if looks[name] < case.radar.looks:
            numbers = {"looks": looks[name], "looks_nominal": float(case.radar.looks)}
            findings.append(Finding("texture", "note", name, numbers))
        findings += law_findings(name, posteriors[name], *found, warned.values())
        if not case.simulator.own:
            law = case.materials[name].law
            findings += another_law(name, law, objectives[name], seen[name], history, geometry)
    calibrated_db = final[1].image_db
    if calibrated_db is not None:
        calibrated_db = calibrated_db.copy()
        for name in seen:
            calibrated_db.ravel()[geometry.pixels(name)] = fresh_db[name]
    shown = {name: law for name, law in laws.items() if not level_only(targets, name)}
    for one in images[:1]:
        findings += check_registration(shown, seen, geometry, one, final[1].image_db)
    levels = seen.levels
    mappings = [levels.simulated(pixels_db) for pixels_db in each_db]
    scores = [seen.score(pixels_db) for pixels_db in each_db[1:]]
    materials = {}
    for name, target in seen.items():
        start, calibrated, fresh = (
            levels.apply(pixels_db[name][target.order], mapping)
            for pixels_db, mapping in zip(each_db, mappings, strict=True)
        )
        calibrated_dp, fresh_dp = (score[name][0] for score in scores)
        differ = not np.array_equal(final[0].pixels_db[name], final[1].pixels_db[name])
        materials[name] = MaterialPixels(start, calibrated, fresh, calibrated_dp, fresh_dp, differ)
    return Conclusion(
        decision=decide(history, list(seen), case.stop, case.objective),
        materials=materials,
        reference_db=reference.image_db,
        calibrated_db=calibrated_db,
        simulator=store.description(key).get("simulator", {}),
        posteriors={
            name: replace(one, known_between_deg=None, known_half_width_db=None) if refused else one
            for name, one in posteriors.items()
        },
        findings=findings,
    )
