"""What each pass adds: how well the law is known over its incidence, from the first pass alone and from all."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.calibration.history import History
from radcal.calibration.law_fit import LawFit
from radcal.calibration.objectives import make_objectives
from radcal.config import stages
from radcal.measurement.target import Targets
from radcal.radar.laws import Law, seen_rad

__all__ = ["PassLaw", "law_sd_db", "pass_laws"]

_STEP = 1e-4  # of the width of the box


@dataclass(frozen=True)
class PassLaw:
    """Law of a material over the incidence of one pass.

    Attributes
    ----------
    low_deg, high_deg : float
        5 and 95 % quantile of the local incidence of the target's pixels [deg].
    rms : float
        Rms difference of the best run's density from the target's in this pass [1/dB].
    sd_first_db, sd_all_db : float
        Largest standard deviation of the law over these angles, by what the first pass says alone, and by what all
        passes say [dB]; NaN for a law without a curve and for normalised images.
    """

    low_deg: float
    high_deg: float
    rms: float
    sd_first_db: float
    sd_all_db: float


def law_sd_db(law: Law, bounds: ArrayLike, fit: LawFit, incidence_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviation of a fitted law at angles [rad], shape (k,), by the Gauss-Newton covariance of its X [dB].

    The looks are integrated out: what is not known of them is in the covariance of X.
    """
    x = fit.parameters
    steps = np.diag(_STEP * np.diff(np.asarray(bounds, dtype=np.float64), axis=1)[:, 0])
    slopes = np.stack(
        [(law(incidence_rad, x + step) - law(incidence_rad, x - step)) / (2.0 * step.max()) for step in steps], axis=-1
    )
    covariance = fit.covariance[: x.size, : x.size]
    return np.asarray(np.sqrt(np.einsum("kd,de,ke->k", slopes, covariance, slopes)))


def pass_laws(case: stages.Archive, targets: Targets, history: History) -> list[Mapping[str, PassLaw]]:
    """Law of the best run of each material over the incidence of each pass; without a material that a pass lacks."""
    objectives = make_objectives(case, targets)
    found: list[dict[str, PassLaw]] = [{} for _ in targets.passes]
    for name, objective in objectives.items():
        score = history.best(name).scores[name]
        first = objective.passes[0]
        assert first is not None  # noqa: S101
        fits = None
        if first.material.law.has_curve and first.material.decibels:
            fits = first.law(objective.in_pass(0, score)).fit, objective.law_in(0, score).fit
        for number, part in enumerate(objective.passes):
            if part is None:
                continue
            law, box, seen = part.material.law, part.material.box, seen_rad(part.material.target.incidence_deg)
            sd = [float("nan")] * 2 if fits is None else [float(law_sd_db(law, box, fit, seen).max()) for fit in fits]
            ends = np.degrees([seen[0], seen[-1]])
            found[number][name] = PassLaw(
                float(ends[0]), float(ends[1]), objective.in_pass(number, score).rms, sd[0], sd[1]
            )
    return list(found)
