"""Radiometry of a measured image, as the fixed materials show it by the area of the ground in their pixels."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from radcal.assessment.cells import WITHOUT_AREA, CellMeans, with_noise_db
from radcal.config import Uncertainty
from radcal.storage.dataclass_groups import About

__all__ = ["Radiometry", "area_exponent", "radiometry_of"]

Doubles = NDArray[np.float64]

_SNR_DB, _FEWEST = 10.0, 30  # of a fixed material that counts: level above the noise, number of cells
_MATERIALS = 2
_ROUNDS, _HUBER = 8, 2.0
_CELL_DB = 0.15
_SCATTER = 2.0  # times the stated standard error: scatter found among images of known radiometry
_UNCERTAIN = 0.25
_LEAST, _ERRORS = 0.6, 2.5  # exponent that shows another radiometry: smallest, and in standard errors


@dataclass(frozen=True)
class Radiometry:
    """Exponent on the area of the ground in a pixel, by which the image differs from the declared radiometry."""

    exponent: Annotated[float, About("exponent on the area of the ground; NaN if too few fixed materials show it")]
    error: Annotated[float, About("standard error of `exponent`")]
    found: Annotated[int, About("area term that the image has beside its declared radiometry: -1, 0 or 1")]
    materials: Annotated[tuple[str, ...], About("fixed materials that show it")]

    @property
    def checked(self) -> bool:
        """Whether the fixed materials can tell the radiometry, or do."""
        return len(self.materials) >= _MATERIALS and (self.error <= _UNCERTAIN or self.found != 0)


def area_exponent(cells: Mapping[str, tuple[CellMeans, Doubles]], config: Uncertainty) -> tuple[float, float]:
    """Exponent on the area of the ground, and its standard error, from cells and law [dB] of fixed materials.

    Each field has its own level, and each law a slope error with a prior. Outlying cells have less weight. The part of
    the standard error that is not due to the slopes is doubled: among images of known radiometry, the exponents
    scattered twice as much as it says.

    References
    ----------
    Huber, "Robust estimation of a location parameter", Annals of Mathematical Statistics 35 (1964).
    """
    names = list(cells)
    parts = [one for one, _ in cells.values()]
    above = np.concatenate([
        one.measured_db - one.beside_db - with_noise_db(law, one.noise_db) for one, law in cells.values()
    ])  # fmt: skip
    signal = np.concatenate([1.0 - one.share for one in parts])
    area = signal * np.concatenate([one.area_db for one in parts])
    of = np.repeat(np.arange(len(names)), [one.size for one in parts])
    away = np.concatenate([one.incidence_deg - one.incidence_deg.mean() for one in parts]) / 10.0
    slope = np.equal(of[:, None], np.arange(len(names))) * (signal * away)[:, None]
    pairs = np.stack([of, np.concatenate([one.patch for one in parts])])
    fields, member = np.unique(pairs, axis=1, return_inverse=True)
    columns = np.column_stack([area, slope, np.equal(member.ravel()[:, None], np.arange(fields.shape[1]))])
    prior = np.zeros(columns.shape[1])
    prior[1 : 1 + len(names)] = 1.0 / max(config.fixed_slope * config.fixed_law_db, 1e-3) ** 2
    weight = 1.0 / (np.concatenate([one.variance for one in parts]) + _CELL_DB**2)
    robust = np.ones_like(weight)
    for _ in range(_ROUNDS):
        used = weight * robust
        inverse = np.linalg.pinv((columns * used[:, None]).T @ columns + np.diag(prior))
        found = inverse @ (columns.T @ (used * above))
        left = np.abs(above - columns @ found) * np.sqrt(weight)
        robust = np.minimum(1.0, _HUBER / np.maximum(left, 1e-12))
    excess = max(1.0, float(np.minimum(left, 3.0) @ np.minimum(left, 3.0)) / max(above.size - columns.shape[1], 1))
    known = np.delete(np.arange(columns.shape[1]), np.arange(1, 1 + len(names)))
    alone = np.linalg.pinv((columns[:, known] * used[:, None]).T @ columns[:, known])[0, 0]
    return float(found[0]), float(np.sqrt((inverse[0, 0] + (_SCATTER**2 - 1.0) * alone) * excess))


def radiometry_of(cells: Mapping[str, tuple[CellMeans, Doubles]], declared: str, config: Uncertainty) -> Radiometry:
    """Radiometry of one pass, from cells and law [dB] of its fixed materials, and the radiometry that is declared.

    A material counts if its simulated level is 10 dB above the noise and it has 30 cells. Another radiometry is found
    if the exponent has the sign that it permits, and exceeds 0.6 and 2.5 standard errors.
    """
    counted = {
        name: (one, law)
        for name, (one, law) in cells.items()
        if one.size >= _FEWEST and np.median(one.share) < 10.0 ** (-_SNR_DB / 10.0)
    }
    if not counted:
        return Radiometry(float("nan"), float("inf"), 0, ())
    exponent, error = area_exponent(counted, config)
    sign = 1 if declared in WITHOUT_AREA else -1  # an area term that the declared radiometry lacks, or has too much
    found = len(counted) >= _MATERIALS and sign * exponent >= max(_LEAST, _ERRORS * error)
    return Radiometry(exponent, error, sign * found, tuple(counted))
