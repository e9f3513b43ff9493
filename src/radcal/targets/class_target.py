"""Target of a material in incidence-angle bins: statistics of measured pixels, variance between and within fields."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from radcal.ground.bins import Classes, class_cumulants, winsorised
from radcal.ground.patches import Spread


@dataclass(frozen=True)
class ClassTarget:
    """Target of one material by incidence-angle bin.

    Attributes
    ----------
    classes : Classes
        Incidence-angle bins with the measured statistics of the target's pixels, prepared for a comparison with K draws
        of speckle (:meth:`radcal.ground.bins.Classes.compared`).
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
