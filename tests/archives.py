"""Archives for tests, with results that differ from those of a calibration."""

import json
from dataclasses import replace

import numpy as np

from radcal.calibration.stopping import Decision
from radcal.findings import Finding
from radcal.posterior.effects import Shared
from radcal.posterior.radiometry import Radiometry
from radcal.posterior.result import Curve, FormError, Image, Posterior

RADIOMETRY = Finding(
    "radiometry", "refusal", "pass 1",
    {"exponent": 0.93, "error": 0.1, "declared": "sigma0_local", "other": "sigma0_ref"},
    "radar.radiometry: sigma0_ref",
)  # fmt: skip


def determined(name="dyke", **numbers):
    """Finding that sigma0 of a material is determined."""
    known = {"half_width_db": 1.5, "from_deg": 22.25, "to_deg": 39.5, "field_half_width_db": 0.9, "systematic_db": 0.4}
    return Finding("determined", "note", name, {**known, **numbers})


def changed_material(archive, name, **changes):
    """Copy of an archive with changed results of one material."""
    return replace(archive, materials={**archive.materials, name: replace(archive.materials[name], **changes)})


def changed_target(archive, name, **changes):
    """Copy of an archive with a changed target of one material in the first pass."""
    material = archive.materials[name]
    return changed_material(archive, name, targets={**material.targets, "1": replace(material.target, **changes)})


def changed_measurement(archive, image_db):
    """Copy of an archive with another measured image of the first pass."""
    measurement = replace(archive.registered.measurement, image_db=image_db)
    first = replace(archive.passes["1"], registered=replace(archive.registered, measurement=measurement))
    return replace(archive, passes={**archive.passes, "1": first})


def configured(archive, **sections):
    """Copy of an archive with other sections of the configuration."""
    return replace(archive, config=json.dumps({**json.loads(archive.config), **sections}))


def ended(archive, reason, **materials):
    """Copy of an archive whose search has ended for another reason, with the reasons of some materials."""
    verdicts = archive.decision.materials
    changed = {name: replace(verdicts[name], reason=materials.get(name, verdicts[name].reason)) for name in verdicts}
    return replace(archive, decision=Decision(changed, reason))


def changed_findings(archive, *findings):
    """Copy of an archive with other findings."""
    return replace(archive, findings=findings)


def image(**changes):
    """What one fixed material, ``unused``, says of an image, with changes to its fields."""
    keys = {
        "shared": {
            "0": Shared(1.0, np.array([0.12, 0.03, 0.2, -0.1, 0.3]), np.diag([0.05, 0.01, 0.6, 0.7, 0.8]), (-0.7, 0.3))
        },
        "levels_db": np.array([[-0.31, 0.12, 0.43]]),
        "laws_db": {"unused": np.array([-0.52, 0.07, 0.61])},
        "apart_db": {"unused": np.array([-0.24, 0.19, 0.33])},
        "radiometry": {"1": Radiometry(0.14, 0.08, 1, 0.0, ("unused",))},
        "sampled": True,
        **changes,
    }
    return Image(**keys)


def posterior(**changes):
    """Posterior of a law with four parameters, determined between two angles, with changes to its fields."""
    angle, four = np.arange(86.0), np.array([1.0, 2.0, 3.0, 4.0])
    curve = Curve(
        incidence_deg=angle, systematic_db=np.full(86, 0.4),
        median_db=-4.0 - 0.2 * angle, p05_db=-5.0 - 0.21 * angle, p95_db=-3.2 - 0.18 * angle,
        field_median_db=-4.1 - 0.2 * angle, field_p05_db=-4.6 - 0.205 * angle, field_p95_db=-3.7 - 0.19 * angle,
    )  # fmt: skip
    keys = {
        "sampled": True, "ess": 812.0, "r_hat": 1.01, "steps": 1500, "cells": 210, "fields": 7, "looks": 3.0,
        "parameters_p05": four, "parameters_p50": four + 0.7, "parameters_p95": four + 1.9,
        "between_db": np.array([0.21, 0.3, 0.39]),
        "within_db": np.array([0.1, 0.15, 0.2]),
        "seen_deg": np.array([[21.0, 44.0]]), "parameters_model": four + 0.8, "curve": curve,
        "known_between_deg": (22.25, 39.5), "known_half_width_db": 1.5,
        "form": FormError(np.array([0.06, 0.25, 0.7]), noticed=False, refuted=False, noticed_db=1.4),
        **changes,
    }  # fmt: skip
    return Posterior(**keys)


def without_curve(**changes):
    """Posterior of a law of which only parameters are known."""
    unknown = dict.fromkeys(("curve", "known_between_deg", "known_half_width_db", "form", "parameters_model"))
    return posterior(**{**unknown, **changes})
