"""Check whether an external program computes the law of a material, from the runs of the program."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from radcal.findings import Finding
from radcal.inference.expected import LawForward
from radcal.objectives import Comparison
from radcal.objectives.history import History
from radcal.posterior.cells import weights_of_facets
from radcal.radar.geometry import Geometry
from radcal.radar.radiometry import with_noise_db
from radcal.targets.target import Target

# Differences that are left to effects which are not computed [dB]. With terrain, a pixel mixes ground of several
# incidences: the best runs of the built-in simulator, whose law is right, differ by up to 2.1 dB beyond what is known
# (the steep and dark dyke of config/dyke_published.yaml). Without terrain, they do not differ beyond it.
_LEFT_DB, _LEFT_ON_TERRAIN_DB = 1.0, 3.0
_ERRORS = 3.0  # sampling errors of a bin's mean in a run


def another_law(
    name: str, law: str, objective: Comparison, target: Target, history: History, geometry: Geometry
) -> Iterator[Finding]:
    """Warning if the program computes another law than the material's; none if the runs do not show it.

    Parameters
    ----------
    name, law : str
        Names of the material and of its law.
    objective : Comparison
        Objective of the material.
    target : Target
        Target of the material in the first pass.
    history : History
        Scored runs of the program.
    geometry : Geometry
        Geometry of the first pass.
    """
    if not objective.material.law.has_curve or not objective.material.decibels:
        return
    difference, beyond = beyond_law_db(name, objective, target, history, geometry)
    # only a scene in slant range has no places in a grid of the ground
    left_db = _LEFT_DB if np.isnan(geometry.ground).all() else _LEFT_ON_TERRAIN_DB
    if not np.all(beyond <= left_db):
        numbers: dict[str, float | str] = {"difference_db": float(np.abs(difference).max()), "law": law}
        yield Finding("another_law", "warning", name, numbers, f"materials.{name}.law")


def beyond_law_db(
    name: str, objective: Comparison, target: Target, history: History, geometry: Geometry
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Difference of the best run from the law at the same X in each bin of the first pass, and its unexplained part.

    A run differs from law and speckle by the area of the ground in a pixel, which the geometry contains, and by the
    power of noise and neighbouring materials. This power is about the same in all runs, so that it is at most the power
    of the darkest run.

    Returns
    -------
    (ndarray, ndarray), each of shape (n,)
        Mean of the best run minus the mean by law and speckle [dB]; distance of this difference from the interval which
        area, added power and three sampling errors explain [dB], negative inside the interval.
    """
    part = objective.passes[0]
    assert part is not None  # noqa: S101
    classes, material = part.classes, part.material
    each = [objective.in_pass(0, run.scores[name]) for run in history.runs if run.scores[name].own_law]
    best = objective.in_pass(0, history.best(name))
    means, sd = np.array([score.statistics for score in each])[:, :, 0], np.exp(np.array(best.statistics)[:, 1])
    expected = LawForward(material.law, classes.nodes_deg, material.looks)(np.array(best.parameters))[:, 0]
    difference = np.array(best.statistics)[:, 0] - expected
    area = 10.0 * np.log10(np.maximum(weights_of_facets(geometry)[target.pixels], 1e-9))
    by_area = np.bincount(classes.member, area, classes.size) / np.maximum(classes.count, 1)
    added = with_noise_db(expected, means.min(axis=0)) - expected
    low, high = np.minimum(by_area, 0.0), np.maximum(by_area, 0.0) + added
    error = _ERRORS * sd / np.sqrt(classes.effective)
    return difference, np.maximum(difference - high, low - difference) - error
