"""Incidences at which materials are seen, which limit what is known of their laws."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.findings import Finding
from radcal.radar.geometry import Geometry

# Range of incidence below which a material's level can be determined, but not its law. Over one degree, the level of
# the steepest natural surface changes by about 1 dB (calm water, 27 dB between 20 and 44 degrees), that of land by 0.1
# to 0.5 dB. Fields of one material differ as much, so that the slope of the law cannot be separated from differences
# between fields (Ulaby and Dobson, "Handbook of Radar Scattering Statistics for Terrain", 1989: levels over incidence,
# with their spread, by material).
LEAST_SPAN_DEG = 1.0
_MOST_NAMED = 8  # objects that a finding names by their number
_NORMAL_SPAN = 3.2897  # standard deviations between the 5 % and 95 % quantiles of a normal distribution


def incidence_span_deg(incidence_deg: ArrayLike, error_deg: float = 0.0) -> float:
    """Width of the range of incidence angles at which a material is seen.

    Parameters
    ----------
    incidence_deg : array_like, shape (pixels,)
        Local incidence angle of each pixel, as computed from the scene [deg].
    error_deg : float
        Standard error of the computed local incidence angle [deg], for example from heights rounded to whole metres.

    Returns
    -------
    float
        Width between the 5 % and 95 % quantiles [deg], without the part due to the error. The squared width of the
        error is subtracted from the squared width of the angles, because squared widths of independent distributions
        add.

    References
    ----------
    Carroll, Ruppert, Stefanski and Crainiceanu, "Measurement Error in Nonlinear Models", 2nd edition (2006), chapter 1:
    the variance of the mapped values is that of the true ones plus that of the error.
    """
    low, high = np.percentile(np.asarray(incidence_deg, dtype=np.float64), [5.0, 95.0])
    return float(np.sqrt(max(0.0, (high - low) ** 2 - (_NORMAL_SPAN * error_deg) ** 2)))


def seen_at_one_incidence(incidence_deg: ArrayLike, error_deg: float = 0.0) -> bool:
    """Whether a material is seen at a single incidence angle, so that its level can be determined, but not its law.

    Parameters
    ----------
    incidence_deg, error_deg
        Arguments of :func:`incidence_span_deg`.

    Returns
    -------
    bool
        Whether the range of incidence angles is narrower than 1 degree. Over 1 degree, the laws of natural surfaces
        change by 0.1 to 1 dB, which is no more than the differences between fields of one material.

    References
    ----------
    Ulaby and Dobson, "Handbook of Radar Scattering Statistics for Terrain" (1989): levels over incidence, with their
    spread, by material.
    """
    return incidence_span_deg(incidence_deg, error_deg) < LEAST_SPAN_DEG


@dataclass(frozen=True)
class Bounces:
    """Double bounces on a material in a pass, and where the pass shows the material.

    Attributes
    ----------
    low_deg, high_deg : float
        Incidence of the material's pixels, 5 % and 95 % quantile [deg]; infinite and reversed without pixels.
    number, alpha_deg : ndarray, shape (n,)
        Index of the object, and incidence at which its double bounce uses the material's law [deg].
    """

    low_deg: float
    high_deg: float
    number: NDArray[np.float64]
    alpha_deg: NDArray[np.float64]


def bounces_on(geometry: Geometry, names: Iterable[str]) -> dict[str, Bounces]:
    """Double bounces of a pass on each of some materials."""
    number, material, alpha_deg = geometry.bounces
    found = {}
    for name in names:
        own, pixels = material == geometry.names.index(name) + 1, geometry.pixels(name)
        ends = np.quantile(geometry.incidence_deg.ravel()[pixels], [0.05, 0.95]) if pixels.size else (np.inf, -np.inf)
        found[name] = Bounces(float(ends[0]), float(ends[1]), number[own], alpha_deg[own])
    return found


def bounces_outside(passes: Sequence[Mapping[str, Bounces]]) -> list[Finding]:
    """Notes on walls whose double bounce uses a calibrated law at incidences that no pass shows of the material.

    Parameters
    ----------
    passes : sequence of mapping of str to Bounces
        Double bounces on the calibrated materials in each pass.

    Returns
    -------
    list of Finding
        A note for each material with such walls; the material's incidences are those between the least and the largest
        of all passes.
    """
    found = []
    for name in passes[0] if passes else ():
        every = [one[name] for one in passes]
        low, high = min(one.low_deg for one in every), max(one.high_deg for one in every)
        number, alpha_deg = (np.concatenate([getattr(one, key) for one in every]) for key in ("number", "alpha_deg"))
        walls = np.unique(number[(alpha_deg < low) | (alpha_deg > high)]).astype(int) + 1
        if walls.size and low < high:
            listed = ", ".join(map(str, walls[:_MOST_NAMED])) + (", ..." if walls.size > _MOST_NAMED else "")
            numbers: dict[str, float | str] = {"walls": int(walls.size), "of": int(np.unique(number).size)}
            numbers |= {"low_deg": low, "high_deg": high, "objects": listed}
            found.append(Finding("bounces_outside", "note", name, numbers))
    return found
