"""Radiometries that the measured images of the passes can have, and what fixed materials show of them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from radcal.posterior.cells import WITHOUT_AREA, CellMeans

_SNR_DB, _FEWEST = 10.0, 30  # of a fixed material that counts: level above the noise, number of cells
_MATERIALS = 2
_WRONG = 0.1  # share of images whose radiometry is declared wrongly
_LEFT_OUT = 0.05  # chance below which a radiometry may lie outside of a 90 % band altogether


@dataclass(frozen=True)
class Radiometry:
    """Exponent on the area of the ground in a pixel, by which the image differs from the declared radiometry.

    Attributes
    ----------
    exponent : float
        Exponent on the area of the ground; NaN if no fixed material shows it.
    error : float
        Standard error of ``exponent``.
    term : int
        Exponent of an image of the other radiometry: 1 if the declared one lacks the area.
    chance : float
        Probability of the other radiometry.
    materials : tuple of str
        Fixed materials that show it.
    """

    exponent: float
    error: float
    term: int
    chance: float
    materials: tuple[str, ...]

    @property
    def found(self) -> int:
        """Area term that the image has beside its declared radiometry: -1, 0 or 1."""
        return self.term if self.chance >= 1.0 - _LEFT_OUT else 0

    @property
    def checked(self) -> bool:
        """Whether the fixed materials show which of the two radiometries the image has."""
        return len(self.materials) >= _MATERIALS and not _LEFT_OUT < self.chance < 1.0 - _LEFT_OUT


def other_term(declared: str) -> int:
    """Exponent on the area of the ground that the other radiometry has beside the declared one: 1 or -1."""
    return 1 if declared in WITHOUT_AREA else -1


def shown_by(cells: Mapping[str, CellMeans]) -> tuple[str, ...]:
    """Fixed materials that show the radiometry of a pass: 10 dB above the noise, with 30 cells or more."""
    least = 10.0 ** (-_SNR_DB / 10.0)
    return tuple(name for name, one in cells.items() if one.size >= _FEWEST and np.median(one.share) < least)


def before_the_image(declared: Sequence[str], shown: Sequence[Sequence[str]]) -> dict[tuple[int, ...], float]:
    """Probability of each combination of area terms of the passes, before the values of the images are seen.

    The other radiometry of a pass has a probability of 0.1. With fewer than two materials that show it, it has none:
    these cannot tell it.
    """
    options = [
        {0: 1.0 - _WRONG, other_term(one): _WRONG} if len(names) >= _MATERIALS else {0: 1.0}
        for one, names in zip(declared, shown, strict=True)
    ]
    return {
        terms: float(np.prod([option[term] for option, term in zip(options, terms, strict=True)]))
        for terms in product(*options)
    }


def likely(chances: Mapping[tuple[int, ...], float]) -> dict[tuple[int, ...], float]:
    """Combinations of area terms that are not twenty times less probable than another, the likeliest first."""
    kept = {terms: chance for terms, chance in chances.items() if chance > _LEFT_OUT * max(chances.values())}
    return {terms: kept[terms] / sum(kept.values()) for terms in sorted(kept, key=lambda terms: -kept[terms])}
