"""Targets of all calibrated materials, the levels at which they are compared with runs, and their HDF5 file.

A target may be divided into incidence-angle bins, with statistics of measured pixels and variance between and within
fields.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from radcal import skewnormal
from radcal.ground.bins import Classes, class_cumulants, winsorised
from radcal.ground.correlation import Correlation
from radcal.ground.goodness import Goodness
from radcal.ground.ground import Ground
from radcal.ground.levels import Levels
from radcal.ground.one_incidence import seen_at_one_incidence
from radcal.ground.patches import Spread
from radcal.storage.records import Stored
from radcal.words import sentence

_TEXTURED = 0.7  # a textured material has fewer looks than this share of the looks of homogeneous areas


@dataclass(frozen=True)
class ClassTarget:
    """Target of one material by incidence-angle bin.

    Attributes
    ----------
    classes : Classes
        Incidence-angle bins with the measured statistics of the target's pixels, prepared for a comparison with K draws
        of speckle (:meth:`radcal.ground.ground.Classes.compared`).
    spread : Spread
        Between-field and within-field standard deviation, pooled over the materials [dB].
    free_looks : bool
        Whether the effective number of looks of the material is estimated together with the law.
    priors : bool
        Whether weak priors on the law's curve and on the number of looks enter the objective.
    incidence_error_deg : float
        Root mean square, over the pixels, of the standard error of the local incidence angle [deg].
    first : ndarray, shape (d,)
        X of the law that is fitted to the target without simulator runs, with a model of law and speckle; empty for a
        law without a curve.
    first_looks : float
        Effective number of looks of the fit that gives ``first``.
    error_deg : ndarray, shape (pixels,), or None
        Standard error of the local incidence angle of each pixel [deg], from the registration and the scene's slopes;
        None if one number holds for all pixels.
    """

    classes: Classes
    spread: Spread
    free_looks: bool
    priors: bool
    incidence_error_deg: float
    first: NDArray[np.float64]
    first_looks: float
    error_deg: NDArray[np.float64] | None = None

    def cumulants(self, values_db: NDArray[np.float64], pixels: NDArray[np.int64] | None = None) -> NDArray[np.float64]:
        """Cumulants of the target's pixels in a run, by incidence-angle bin.

        Parameters
        ----------
        values_db : ndarray, shape (pixels,)
            Values of the target's pixels in the run [dB]; far outliers are clipped, as in the measured pixels.
        pixels : ndarray of int, optional
            Indices, in ``values_db``, of the pixels to use; by default all pixels are used.

        Returns
        -------
        ndarray, shape (n, 3)
            Mean [dB], variance [dB^2] and third central moment [dB^3] in each of the n bins.
        """
        member = self.classes.member
        if pixels is not None:
            values_db, member = values_db[pixels], member[pixels]
        return class_cumulants(winsorised(values_db, member), member, self.classes.size)


@dataclass(frozen=True)
class Target:
    """Target density of one material.

    Attributes
    ----------
    pixels : ndarray of int64, shape (n,), dimension scale
        Flat indices, in the image, of the pixels drawn.
    order : ndarray of int64, shape (n,)
        Indices of the drawn pixels among the material's pixels in a run record.
    values_db : ndarray, shape (n,)
        Measured backscatter after level normalisation, in the unit of the levels (dB, or IQR for ``image``).
    incidence_deg : ndarray of float32, shape (n,)
        Local incidence angle [deg].
    dp : ndarray, shape (3,)
        Direct parameters xi [dB], omega [dB] and alpha of the fitted skew normal.
    eligible : int
        Number of pixels from which the target's pixels were drawn.
    at_boundary : bool
        Whether the fitted skewness has the largest absolute value that a skew normal can have.
    effective : float
        Effective sample size: number of independent pixels with the information of the correlated pixels.
    rms_sampling : float
        Density rms that sampling alone causes at the effective sample size [1/dB].
    cp_error : ndarray, shape (3,)
        Standard errors of mean [dB], standard deviation [dB] and skewness, at the effective sample size; NaN at the
        boundary.
    goodness : Goodness
        Goodness of fit of the density to the pixels.
    left_out : mapping
        Number of the material's visible pixels that are masked, by reason.
    looks : float
        Equivalent number of looks of the material, from neighbouring pixels; NaN if unknown.
    penalised : bool
        Whether the densities of the target and of every run are fitted by penalised likelihood.
    patch, block : ndarray of int, shape (n,)
        Connected area of the material (patch), and part of a block of the image, of each pixel.
    correlation : Correlation or None
        Correlation of the material's pixels; None for independent pixels.
    noise_db : float
        Mean noise-equivalent backscatter that the simulator adds at these pixels [dB]; -inf where no noise is known.
    classes : ClassTarget or None
        Statistics of the pixels by incidence-angle bin; None where the objective uses no bins.
    """

    pixels: NDArray[np.int64]
    order: NDArray[np.int64]
    values_db: NDArray[np.float64]
    incidence_deg: NDArray[np.float32]
    dp: NDArray[np.float64]
    eligible: int
    at_boundary: bool
    effective: float
    rms_sampling: float
    cp_error: NDArray[np.float64]
    goodness: Goodness
    left_out: Mapping[str, int] = field(default_factory=dict)
    looks: float = float("nan")
    penalised: bool = False
    patch: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    block: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    correlation: Correlation | None = None
    noise_db: float = float("-inf")
    classes: ClassTarget | None = None

    @property
    def ground(self) -> Ground:
        """Pixels of the target with their patches and blocks."""
        return Ground(
            values_db=np.asarray(self.values_db, dtype=np.float64),
            incidence_deg=np.asarray(self.incidence_deg, dtype=np.float64),
            patch=self.patch,
            block=self.block,
            pixels=self.pixels,
            correlation=self.correlation,
            error_deg=self.classes.error_deg if self.classes is not None else None,
        )

    @property
    def incidence_error_deg(self) -> float:
        """Standard error of the local incidence [deg]; 0 without incidence-angle bins."""
        return self.classes.incidence_error_deg if self.classes is not None else 0.0

    @property
    def level_only(self) -> bool:
        """Whether the material is seen at one incidence angle, so that its level can be determined, but not its law."""
        return seen_at_one_incidence(self.incidence_deg, self.incidence_error_deg)

    @property
    def cp(self) -> NDArray[np.float64]:
        """Centred parameters of the target density."""
        return skewnormal.centred(self.dp)

    def score(
        self, pixels_db: NDArray[np.float32], mapping: tuple[float, float] = (0.0, 1.0)
    ) -> tuple[NDArray[np.float64], float]:
        """Density fitted to the target's pixels in a run, and its rms difference from the target density.

        Parameters
        ----------
        pixels_db : ndarray
            Visible pixels of the material in the run [dB].
        mapping : (float, float)
            Shift [dB] subtracted from the run's values, and scale by which they are then divided.

        Returns
        -------
        dp : ndarray, shape (3,)
            Direct parameters of the run's density.
        rms : float
            Root-mean-square difference of the run's density from the target's [1/dB].
        """
        dp = skewnormal.fit(Levels.apply(pixels_db[self.order], mapping), self.penalised).dp
        return dp, skewnormal.density_rms(dp, self.dp)


@dataclass(frozen=True, eq=False)
class Targets(Mapping[str, Target], Stored, kind="target"):
    """Target of each calibrated material in one pass, with the level normalisation for the comparison with runs.

    Of several passes, the first shows all calibrated materials; the others may lack some.

    Attributes
    ----------
    materials : mapping
        Target by material.
    levels : Levels
        Level normalisation of both images; by default none.
    looks : float
        Equivalent number of looks of the measured image's homogeneous areas; NaN if unknown.
    """

    materials: Mapping[str, Target]
    levels: Levels = field(default_factory=Levels)
    looks: float = float("nan")

    def __getitem__(self, name: str) -> Target:
        return self.materials[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.materials)

    def __len__(self) -> int:
        return len(self.materials)

    def textured(self, name: str) -> bool:
        """Whether a material has far fewer looks than the image's homogeneous areas, and hence texture."""
        return self[name].looks < _TEXTURED * self.looks

    def score(self, pixels_db: Mapping[str, NDArray[np.float32]]) -> dict[str, tuple[NDArray[np.float64], float]]:
        """Direct parameters and density rms [1/dB] of every material, from the visible pixels of a run [dB]."""
        mapping = self.levels.simulated(pixels_db)
        return {name: target.score(pixels_db[name], mapping) for name, target in self.items()}

    def sentences(self) -> list[str]:
        """Lines for the terminal about levels and the target of each material."""
        levels = self.levels
        lines = [f"levels: {sentence(levels.finding)}"] if levels.normalisation != "none" or levels.references else []
        for name, target in self.items():
            mean, sd, skewness = target.cp
            size, unit = f"target of {name}: {len(target.pixels)} pixels", levels.unit
            classes = f", {target.classes.classes.size} incidence-angle bins" if target.classes is not None else ""
            moments = f"mean {mean:.2f} {unit}, standard deviation {sd:.2f} {unit}, skewness {skewness:.2f}"
            alone = "; seen at one incidence, from which no law can be determined" if target.level_only else ""
            lines.append(f"{size}, {moments}{classes}{alone}")
        return lines


def level_only(targets: Iterable[Targets], name: str) -> bool:
    """Whether a material is seen at one incidence angle only, in each pass that shows it."""
    return all(one[name].level_only for one in targets if name in one)
