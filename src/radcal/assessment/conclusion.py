"""Findings of a calibration, and what a refusal withholds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.known import image_findings, law_findings, material_findings
from radcal.assessment.program_check import another_law
from radcal.assessment.registration_check import check_registration
from radcal.config.part import Part
from radcal.findings import Finding
from radcal.objectives import Comparison
from radcal.objectives.history import History
from radcal.posterior.result import Image, Posterior
from radcal.radar.geometry import Geometry
from radcal.registration.registered import Registered
from radcal.targets.target import Targets, level_only


def conclude(
    case: Part,
    history: History,
    targets: Sequence[Targets],
    objectives: Mapping[str, Comparison],
    geometry: Geometry,
    final_db: NDArray[np.float32],
    posteriors: Mapping[str, Posterior],
    image: Image,
    images: Sequence[Registered] = (),
    noted: Sequence[Finding] = (),
) -> list[Finding]:
    """Findings on the images in the order in which to act on them, then on each material.

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
        Geometry of the first pass, which holds the pixels of each material.
    final_db : ndarray, shape (rows, columns)
        Image of the final run with fresh random numbers in the first pass [dB].
    posteriors : mapping
        Posterior of each material's law.
    image : Image
        What the fixed materials say.
    images : sequence of Registered
        Registered measured image of each pass; the first is registered again onto the image of the calibrated laws.
    noted : sequence of Finding
        Findings on the geometry of all passes.
    """
    seen = targets[0]  # it shows all calibrated materials
    findings = [finding for one in images for finding in one.findings]
    findings += [*image_findings(case, image), *noted]
    refused = any(one.severity == "refusal" for one in findings)
    warned = {one.code: f"{one.code.replace('_', ' ')} of {one.about}" for one in findings if one.severity != "note"}
    laws = {name: (case.laws[name], np.asarray(history.best(name).parameters)) for name in seen}
    for name, found in laws.items():
        findings += material_findings(case, name, posteriors[name], targets, refused)
        looks = history.best(name).looks
        if looks < case.radar.looks:
            numbers = {"looks": looks, "looks_nominal": float(case.radar.looks)}
            findings.append(Finding("texture", "note", name, numbers))
        findings += law_findings(name, posteriors[name], *found, warned.values())
        if not case.simulator.own:
            law = case.materials[name].law
            findings += another_law(name, law, objectives[name], seen[name], history, geometry)
    shown = {name: law for name, law in laws.items() if not level_only(targets, name)}
    for one in images[:1]:
        findings += check_registration(shown, seen, geometry, one, final_db)
    return findings


def withheld(posterior: Posterior, findings: Sequence[Finding]) -> Posterior:
    """Posterior of a law that determines sigma0 at no angle if a finding is a refusal."""
    refused = any(one.severity == "refusal" for one in findings)
    return replace(posterior, known_between_deg=None, known_half_width_db=None) if refused else posterior
