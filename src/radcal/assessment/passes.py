"""Uncertainty of a law over the incidence of each pass, from the first pass alone and from all passes."""

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

_STEP = 1e-4  # step of a numerical derivative, in widths of the bounds


@dataclass(frozen=True)
class PassLaw:
    """Uncertainty of a material's law over the incidence of one pass, and rms of its density in the pass.

    Attributes
    ----------
    low_deg, high_deg : float
        5 and 95 % quantile of the local incidence of the target's pixels [deg].
    rms : float
        Rms difference of the best run's density from the target's in this pass [1/dB].
    sd_first_db, sd_all_db : float
        Largest standard deviation of the law between ``low_deg`` and ``high_deg`` [dB], from the first pass alone and
        from all passes; NaN for a law without a curve and for normalised images.
    """

    low_deg: float
    high_deg: float
    rms: float
    sd_first_db: float
    sd_all_db: float


def law_sd_db(law: Law, bounds: ArrayLike, fit: LawFit, incidence_rad: NDArray[np.float64]) -> NDArray[np.float64]:
    """Standard deviation [dB] of a fitted law at angles [rad], shape (k,), from the Gauss-Newton covariance of X.

    The looks are integrated out: the covariance of X includes the uncertainty of the looks.
    """
    x = fit.parameters
    steps = np.diag(_STEP * np.diff(np.asarray(bounds, dtype=np.float64), axis=1)[:, 0])
    slopes = np.stack(
        [(law(incidence_rad, x + step) - law(incidence_rad, x - step)) / (2.0 * step.max()) for step in steps], axis=-1
    )
    covariance = fit.covariance[: x.size, : x.size]
    return np.asarray(np.sqrt(np.einsum("kd,de,ke->k", slopes, covariance, slopes)))


def pass_laws(case: stages.Archive, targets: Targets, history: History) -> list[Mapping[str, PassLaw]]:
    """Uncertainty of each material's law in its best run, for each pass that has enough pixels of the material."""
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
