"""Levels of the incidence-angle bins that a calibrated law is compared with, and its looks."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from radcal.calibration.expected import law_cumulants
from radcal.calibration.grounds import GroundLaw
from radcal.calibration.history import History, Score
from radcal.calibration.misfit import true_angles
from radcal.calibration.objectives import Comparison
from radcal.config import stages
from radcal.measurement.target import Targets
from radcal.radar.texture import log_speckle_cumulants
from radcal.storage.dataclass_groups import About

__all__ = ["LawCheck", "check_laws", "texture_note"]

Doubles = NDArray[np.float64]


@dataclass(frozen=True)
class LawCheck:
    """Looks of a calibrated law, and levels of the incidence-angle bins of the first pass."""

    looks: Annotated[float, About("effective number of looks with which the best run fits the target")]
    looks_nominal: Annotated[float, About("number of looks of the simulated speckle")]
    incidence_error_deg: Annotated[float, About("standard error assumed for the local incidence", "deg")]
    class_deg: Annotated[Doubles, About("mean incidence of each incidence-angle bin", "deg", "c", scale=True)]
    class_db: Annotated[Doubles, About("sigma0 of the law that would match the measured pixels of the bin", "dB", "c")]
    class_error_db: Annotated[Doubles, About("standard error of `class_db`", "dB", "c")]


def check_laws(
    case: stages.Archive, targets: Targets, history: History, objectives: Mapping[str, Comparison]
) -> dict[str, LawCheck]:
    """Levels of the bins by the best run's law of every material."""
    found = {}
    for name, target in targets.items():
        score = history.best(name).scores[name]
        nominal, nothing = float(case.radar.looks), np.empty(0)
        curved = case.laws[name].has_curve and case.target.normalisation != "image"
        law = objectives[name].law_in(0, score) if curved else None
        centre, shown, error = nothing, nothing, nothing
        if law is not None and target.classes is not None:
            centre, shown, error = _levels_asked(law, objectives[name].in_pass(0, score), nominal)
        found[name] = LawCheck(
            looks=score.looks if law is None else law.fit.looks,
            looks_nominal=nominal,
            incidence_error_deg=float("nan") if law is None else law.method.incidence_error_deg,
            class_deg=centre,
            class_db=shown,
            class_error_db=error,
        )
    return found


def texture_note(checks: Mapping[str, LawCheck]) -> str:
    """Note that lists the materials whose simulated pixels are multiplied by texture; empty if there are none."""
    found = {name: check for name, check in checks.items() if check.looks < check.looks_nominal}
    if not found:
        return ""
    each = ", ".join(f"{name} {check.looks:.2f}" for name, check in found.items())
    nominal = next(iter(found.values())).looks_nominal
    return (
        f"The simulated speckle has {nominal:.3g} looks, and the search found fewer effective looks ({each}). Values "
        "above about 0.9 of the sensor's looks, the median of their prior, show no texture. For densities and images, "
        "these simulated pixels are multiplied by gamma texture that lowers their looks to those found."
    )


def _levels_asked(law: GroundLaw, score: Score, nominal: float) -> tuple[Doubles, ...]:
    """Mean incidence of each bin [deg], level of the law that gives the measured mean [dB], and standard error [dB]."""
    classes, method = law.classes, law.method
    speckle = log_speckle_cumulants(law.fit.looks)[0] - log_speckle_cumulants(nominal)[0]
    expected = np.asarray(score.statistics)[:, 0] + speckle
    nodes = true_angles(law.ground, classes, method, classes.nodes_deg)
    level, there = (law_cumulants(method.law, law.fit.parameters, at)[:, 0] for at in (classes.nodes_deg, nodes))
    # an error of the incidence changes the expected mean of a bin, and not the law
    shown = level + classes.cumulants[:, 0] - (expected + there - level)
    return classes.nodes_deg.mean(axis=1), shown, np.sqrt(classes.cumulants[:, 1] / classes.effective)
