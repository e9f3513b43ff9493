"""Radiometry of a measured image, as the fixed materials show it by the area of the ground in their pixels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Annotated

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.config import Uncertainty
from radcal.posterior.cells import WITHOUT_AREA, CellMeans
from radcal.posterior.effects import FIXED_FORMS, law_columns
from radcal.storage.dataclass_groups import About

Doubles = NDArray[np.float64]

_SNR_DB, _FEWEST = 10.0, 30  # of a fixed material that counts: level above the noise, number of cells
_MATERIALS = 2
_ROUNDS, _HUBER = 8, 2.0
_CELL_DB = 0.15
_MEDIAN = 0.6745  # of a half-normal distribution of scale 1
_WRONG = 0.1  # share of images whose radiometry is declared wrongly
_FOUND = 0.5  # chance of the other radiometry from which on it is found
_LEFT_OUT = 0.05  # chance below which a radiometry may lie outside of a 90 % band altogether


@dataclass(frozen=True)
class Radiometry:
    """Exponent on the area of the ground in a pixel, by which the image differs from the declared radiometry."""

    exponent: Annotated[float, About("exponent on the area of the ground; NaN if too few fixed materials show it")]
    error: Annotated[float, About("standard error of `exponent`")]
    term: Annotated[int, About("exponent of an image of the other radiometry: 1 if the declared one lacks the area")]
    chance: Annotated[float, About("probability of the other radiometry")]
    materials: Annotated[tuple[str, ...], About("fixed materials that show it")]

    @property
    def found(self) -> int:
        """Area term that the image has beside its declared radiometry: -1, 0 or 1."""
        return self.term if self.chance >= _FOUND else 0

    @property
    def checked(self) -> bool:
        """Whether the fixed materials show which of the two radiometries the image has."""
        return len(self.materials) >= _MATERIALS and not _LEFT_OUT < self.chance < _FOUND


def chances_of(passes: Sequence[Radiometry]) -> dict[tuple[int, ...], float]:
    """Probability of each combination of area terms of the passes that are not left out as improbable."""
    options = [
        {one.found: 1.0} if one.checked or one.found else {0: 1.0 - one.chance, one.term: one.chance} for one in passes
    ]
    found = {
        terms: float(np.prod([option[term] for option, term in zip(options, terms, strict=True)]))
        for terms in product(*options)
    }
    least = _LEFT_OUT * max(found.values())
    kept = {terms: chance for terms, chance in found.items() if chance > least}
    return {terms: chance / sum(kept.values()) for terms, chance in kept.items()}


def area_exponent(cells: Mapping[str, tuple[CellMeans, Doubles]], config: Uncertainty) -> tuple[float, float]:
    """Exponent on the area of the ground, and its standard error, from cells and law [dB] of fixed materials.

    Each field has its own level, and each law errors of its slope and form with their priors, that of the form at the
    median of its scale. Outlying cells have less weight.

    References
    ----------
    Huber, "Robust estimation of a location parameter", Annals of Mathematical Statistics 35 (1964).
    """
    parts = [one for one, _ in cells.values()]
    above = np.concatenate([one.above_db(law) for one, law in cells.values()])
    signal = np.concatenate([1.0 - one.share for one in parts])
    area = signal * np.concatenate([one.area_db for one in parts])
    own = scipy.linalg.block_diag(*(law_columns(one.incidence_deg)[:, 1:] for one in parts)) * signal[:, None]
    of = np.repeat(np.arange(len(parts)), [one.size for one in parts])
    fields, member = np.unique([of, np.concatenate([one.patch for one in parts])], axis=1, return_inverse=True)
    columns = np.column_stack([area, own, np.equal(member.ravel()[:, None], np.arange(fields.shape[1]))])
    slope, form = config.fixed_slope * config.fixed_law_db, _MEDIAN * config.form_db
    prior = np.zeros(columns.shape[1])
    prior[1 : 1 + own.shape[1]] = np.tile(np.maximum([slope, *[form] * FIXED_FORMS], 1e-3) ** -2.0, len(parts))
    weight = 1.0 / (np.concatenate([one.variance for one in parts]) + _CELL_DB**2)
    robust = np.ones_like(weight)
    for _ in range(_ROUNDS):
        used = weight * robust
        inverse = np.linalg.pinv((columns * used[:, None]).T @ columns + np.diag(prior))
        found = inverse @ (columns.T @ (used * above))
        left = np.abs(above - columns @ found) * np.sqrt(weight)
        robust = np.minimum(1.0, _HUBER / np.maximum(left, 1e-12))
    excess = max(1.0, float(np.minimum(left, 3.0) @ np.minimum(left, 3.0)) / max(above.size - columns.shape[1], 1))
    return float(found[0]), float(np.sqrt(inverse[0, 0] * excess))


def radiometry_of(cells: Mapping[str, tuple[CellMeans, Doubles]], declared: str, config: Uncertainty) -> Radiometry:
    """Radiometry of one pass, from cells and law [dB] of its fixed materials, and the radiometry that is declared.

    A material counts if its simulated level is 10 dB above the noise and it has 30 cells. The other radiometry adds the
    area of the ground to the declared one, or takes it out. Its probability follows from the exponent, which is normal
    about that of either radiometry; before the image is seen, it is 0.1. With fewer than two materials, it is 0: these
    cannot tell it.

    References
    ----------
    Gelman et al., "Bayesian Data Analysis", 3rd edition (2013), section 7.4: probabilities of discrete models.
    """
    counted = {
        name: (one, law)
        for name, (one, law) in cells.items()
        if one.size >= _FEWEST and np.median(one.share) < 10.0 ** (-_SNR_DB / 10.0)
    }
    term = 1 if declared in WITHOUT_AREA else -1  # an area term that the declared radiometry lacks, or has too much
    if not counted:
        return Radiometry(float("nan"), float("inf"), term, 0.0, ())
    exponent, error = area_exponent(counted, config)
    log_odds = scipy.special.logit(_WRONG) + (term * exponent - 0.5) / (error**2 + config.area**2)
    chance = float(scipy.special.expit(log_odds)) if len(counted) >= _MATERIALS else 0.0
    return Radiometry(exponent, error, term, chance, tuple(counted))
