"""Target of a law: statistics by incidence-angle bin, with between-field and within-field variance."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from radcal.measurement.classes import Classes, class_cumulants, winsorised
from radcal.measurement.patches import Spread

__all__ = ["ClassTarget"]


@dataclass(frozen=True)
class ClassTarget:
    """Target of one material by incidence-angle bin.

    Attributes
    ----------
    classes : Classes
        Measured, of the target's pixels; ``effective`` is what a difference from as many simulated ones stands
        for, half of the independent pixels.
    spread : Spread
        Among patches and their cells, pooled over the materials [dB].
    objective : {'classes', 'likelihood'}
        What is minimised.
    looks : float
        Of the simulated speckle, the sensor's.
    free_looks : bool
        Whether the material's own looks are searched.
    priors : bool
        Whether weak priors on curve and looks count.
    incidence_error_deg : float
        Standard error of the local incidence [deg].
    noise_db : float
        Mean noise-equivalent backscatter that the simulator adds at these pixels [dB]; -inf where it adds none
        that is known of.
    first : ndarray, shape (d,)
        X of the law found without a simulator, by law and speckle alone.
    first_looks : float
        Its effective looks.
    """

    classes: Classes
    spread: Spread
    objective: Literal["classes", "likelihood"]
    looks: float
    free_looks: bool
    priors: bool
    incidence_error_deg: float
    noise_db: float
    first: NDArray[np.float64]
    first_looks: float

    def cumulants(self, values_db: NDArray[np.float64]) -> NDArray[np.float64]:
        """Mean [dB], variance [dB^2] and third central moment [dB^3] of a run's classes, shape (n, 3).

        Parameters
        ----------
        values_db : ndarray, shape (pixels,)
            The target's pixels in a run [dB]; far outliers are limited as the measured ones are.
        """
        member = self.classes.member
        return class_cumulants(winsorised(values_db, member), member, self.classes.size)
