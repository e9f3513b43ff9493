"""Cells of one pass: mean measured and simulated power of each material in small areas of similar incidence.

A cell is the part of one field in a square of 24 x 24 pixels and in 3 degrees of local incidence. Means of power, and
not of dB values, are compared, because texture lowers the mean of dB values.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.config import Radar
from radcal.laws import Law
from radcal.radar.radiometry import noise_floor_db, of_sigma0, with_noise_db

if TYPE_CHECKING:
    from radcal.ground.correlation import Correlation
    from radcal.radar.geometry import Geometry

Doubles = NDArray[np.float64]

DB = 10.0 / np.log(10.0)
STEP_DEG = 3.0
"""Width of the intervals of incidence into which cells are divided [deg]."""
_BLOCK_PX = 24
_FEWEST = 8  # pixels in a cell
_LEAST_SIN = 0.02
WITHOUT_AREA = ("sigma0_local", "gamma0_rtc")
"""Radiometries without an area term."""
_LEAK_DB = 0.4


@dataclass(frozen=True)
class Simulated:
    """Simulated image of one pass, with the parameters of every material's law.

    Attributes
    ----------
    image_db : ndarray, shape (rows, columns)
        Image [dB].
    parameters : mapping
        X of every material.
    """

    image_db: NDArray[np.float32]
    parameters: Mapping[str, Sequence[float]]


@dataclass(frozen=True)
class CellMeans:
    """Cells of one material in one pass.

    Attributes
    ----------
    patch : ndarray of int64, shape (n,)
        Number of each cell's field.
    incidence_deg : ndarray, shape (n,)
        Mean local incidence [deg].
    measured_db : ndarray, shape (n,)
        Measured mean power, less the expected bias of its logarithm [dB].
    beside_db : ndarray, shape (n,)
        Simulated mean power, less its bias, minus law and noise at the mean incidence [dB]: area of the ground, point
        spread, and power of neighbouring ground.
    area_db : ndarray, shape (n,)
        Area of the ground in a pixel, relative to level ground [dB].
    noise_db : ndarray, shape (n,)
        Mean noise floor [dB].
    share : ndarray, shape (n,)
        Share of noise in the expected power of the simulated image, from 0 to 1.
    variance : ndarray, shape (n,)
        Variance of ``measured_db - beside_db`` by the speckle of measured and simulated pixels [dB^2].
    pixels : ndarray of int64, shape (n,)
        Number of pixels.
    fold : ndarray of int64, shape (n,)
        Part of the ground in which each cell lies, if parts are held out; else 0.
    looks : float
        Effective looks of the measured pixels inside of the cells.
    """

    patch: NDArray[np.int64]
    incidence_deg: Doubles
    measured_db: Doubles
    beside_db: Doubles
    area_db: Doubles
    noise_db: Doubles
    share: Doubles
    variance: Doubles
    pixels: NDArray[np.int64]
    fold: NDArray[np.int64]
    looks: float

    @classmethod
    def none(cls) -> CellMeans:
        """No cells."""
        whole, real = np.empty(0, dtype=np.int64), np.empty(0)
        return cls(whole, real, real, real, real, real, real, real, whole, whole, 1.0)

    @property
    def size(self) -> int:
        """Number of cells."""
        return self.patch.size

    def part(self, mask: NDArray[np.bool_]) -> CellMeans:
        """Cells of a mask."""
        each: dict[str, Any] = {key: value[mask] for key, value in vars(self).items() if key != "looks"}
        return CellMeans(**each, looks=self.looks)

    def without_leaks(self, has_area: bool) -> CellMeans:
        """Cells without those into which other ground leaks, whose simulated mean is 0.4 dB or more from the law's.

        ``has_area`` tells whether the simulated radiometry has an area term.
        """
        left = self.beside_db - (1.0 - self.share) * self.area_db * has_area
        return self.part(np.abs(left - np.median(left)) < _LEAK_DB) if self.size else self

    def above_db(self, law_db: Doubles) -> Doubles:
        """Measured minus simulated mean of each cell [dB], if the law has the levels ``law_db`` [dB] there."""
        return self.measured_db - self.beside_db - with_noise_db(law_db, self.noise_db)


def area_db(geometry: Geometry, radar: Radar) -> Doubles:
    """Area of the visible ground in each pixel, relative to level ground [dB], shape (pixels,).

    In radiometries with an area term, the weights of a pixel's facets sum to this area. In the others, the area is that
    of ground that is tilted along range only.

    References
    ----------
    Ulander, "Radiometric slope correction of synthetic-aperture radar images", IEEE TGRS 34 (1996).
    """
    columns = geometry.shape[1]
    flat = np.repeat(geometry.flat_incidence_deg, columns)
    if radar.radiometry in WITHOUT_AREA:
        local = np.sin(np.radians(geometry.incidence_deg.ravel().astype(np.float64)))
        return np.asarray(10.0 * np.log10(np.sin(np.radians(flat)) / np.maximum(local, _LEAST_SIN)))
    with np.errstate(divide="ignore"):
        return np.asarray(10.0 * np.log10(weights_of_facets(geometry) / of_sigma0(radar.radiometry, flat)))


def weights_of_facets(geometry: Geometry) -> Doubles:
    """Sum of the weights of all facets in each pixel, the power of a pixel whose sigma0 is 1, shape (pixels,)."""
    of_facets = np.concatenate([[0.0], np.cumsum(geometry.facet_weight, dtype=np.float64)])
    return np.diff(of_facets[geometry.facet_start[geometry.cell_start]])


def cell_keys(pixels: NDArray[np.int64], patch: NDArray[np.int64], angle_deg: Doubles, width: int) -> NDArray[np.int64]:
    """Field, square and interval of incidence of each pixel of an image of ``width`` columns, shape (4, p)."""
    row, column = np.divmod(pixels, width)
    return np.stack([patch, row // _BLOCK_PX, column // _BLOCK_PX, (angle_deg // STEP_DEG).astype(np.int64)])


def cell_means(
    pixels: NDArray[np.int64],
    patch: NDArray[np.int64],
    image_db: NDArray[np.float32],
    simulated: Sequence[Simulated],
    name: str,
    law: Law,
    geometry: Geometry,
    radar: Radar,
    correlation: Correlation,
    area: Doubles,
    noisy: bool = True,
    fold: NDArray[np.int64] | None = None,
) -> CellMeans:
    """Cells of a material in a pass.

    Parameters
    ----------
    pixels : ndarray of int64, shape (p,)
        Flat indices of the usable pixels, increasing.
    patch : ndarray of int64, shape (p,)
        Field of each pixel.
    image_db : ndarray, shape (rows, columns)
        Measured image on the simulated image's pixels [dB].
    simulated : sequence of Simulated
        Simulated images of the pass; their means are averaged, each relative to its own law.
    name, law
        Material, and its law; a law without a curve counts as 0 dB.
    geometry, radar
        Pass.
    correlation : Correlation
        Correlation of the material's measured pixels.
    area : ndarray, shape (pixels of the image,)
        Result of :func:`area_db`.
    noisy : bool
        Whether the simulated images contain the noise of section ``radar``.
    fold : ndarray of int64, shape (p,), optional
        Part of the ground, 0 or 1, in which each pixel lies; a cell lies in one part.

    Returns
    -------
    CellMeans

    References
    ----------
    Nicolas, "Introduction aux statistiques de deuxieme espece", Traitement du Signal 19 (2002): mean of the logarithm
    of gamma variables, psi(L) - ln L. Oliver and Quegan, "Understanding Synthetic Aperture Radar Images" (2004).
    """
    width = geometry.shape[1]
    angle = geometry.incidence_deg.ravel()[pixels].astype(np.float64)
    fold = np.zeros(pixels.size, dtype=np.int64) if fold is None else fold
    inside, member, of_cell = members(cell_keys(pixels, 2 * patch + fold, angle, width))
    pixels, angle, n = pixels[inside], angle[inside], of_cell.size
    count = np.bincount(member, minlength=n)

    def mean(values: Doubles) -> Doubles:
        return np.asarray(np.bincount(member, values, n) / count)

    independent = correlation.effective_of(pixels, member)

    def level(image: NDArray[np.float32]) -> tuple[Doubles, Doubles, float]:
        return _level(10.0 ** (image.ravel()[pixels].astype(np.float64) / 10.0), member, count, independent)

    incidence = mean(angle)
    noise = np.full(n, -np.inf)
    if noisy:
        rows = noise_floor_db(radar, geometry.flat_incidence_deg)[pixels // width]
        noise = DB * np.log(mean(10.0 ** (rows / 10.0)))
    measured, variance, looks = level(image_db)
    area = mean(area[pixels])
    on_ground = area * (law.has_curve and radar.radiometry not in WITHOUT_AREA)
    beside, of_draws, shares = [], [], []
    for one in simulated:
        db, own, _ = level(one.image_db)
        of_law = np.asarray(law(np.radians(incidence), one.parameters[name])) if law.has_curve else np.zeros(n)
        beside.append(db - with_noise_db(of_law, noise))
        of_draws.append(own)
        # of the expected power: a share of the drawn one would be large where its speckle is weak
        expected = with_noise_db(of_law + on_ground, noise) if law.has_curve else db
        shares.append(np.minimum(10.0 ** ((noise - expected) / 10.0), 1.0))
    return CellMeans(
        patch=of_cell // 2,
        fold=of_cell % 2,
        incidence_deg=incidence,
        measured_db=measured,
        beside_db=np.mean(beside, axis=0),
        area_db=area,
        noise_db=noise,
        share=np.mean(shares, axis=0),
        variance=variance + np.mean(of_draws, axis=0) / len(simulated),
        pixels=count.astype(np.int64),
        looks=looks,
    )


def members(keys: NDArray[np.int64]) -> tuple[NDArray[np.bool_], NDArray[np.int64], NDArray[np.int64]]:
    """Whether each pixel is in a cell of 8 or more, the cell of each of those that are, and the field of each cell."""
    found, member, count = np.unique(keys, axis=1, return_inverse=True, return_counts=True)
    kept = count >= _FEWEST
    inside = kept[member.ravel()]
    return inside, (np.cumsum(kept) - 1)[member.ravel()[inside]], found[0][kept]


def _level(
    power: Doubles, member: NDArray[np.int64], count: NDArray[np.int64], independent: Doubles
) -> tuple[Doubles, Doubles, float]:
    """Mean power of each cell without bias [dB], its variance [dB^2], and effective looks of the pixels."""
    middle = np.bincount(member, power, count.size) / count
    away = power / middle[member] - 1.0
    # correlated pixels scatter less about their own mean than independent ones
    freedom = float(np.sum(count - count / independent))
    looks = 1.0 / max(float(away @ away) / max(freedom, 1.0), 1e-6)
    total = independent * looks
    return (
        DB * (np.log(middle) - scipy.special.digamma(total) + np.log(total)),
        DB**2 * scipy.special.polygamma(1, total),
        looks,
    )
