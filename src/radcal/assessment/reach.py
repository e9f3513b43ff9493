"""Check, before any run of the design, that a law can reach the measured level inside the bounds of X."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.calibration.bounded import sobol
from radcal.config import stages
from radcal.errors import ConfigError
from radcal.measurement.target import Targets
from radcal.radar.laws import Law
from radcal.radar.texture import log_speckle_cumulants

__all__ = ["check_reach", "law_range_db", "level_asked_db"]

_SCREENED = 256
_POLISHED = 2
_MARGIN_DB = 3.0  # few effective looks, and the area of slopes, can each lower the mean of dB values by up to 3 dB


def law_range_db(law: Law, bounds: ArrayLike, incidence_deg: ArrayLike) -> tuple[float, float]:
    """Smallest and largest mean level of a law over given angles, for X inside its bounds.

    Parameters
    ----------
    law : Law
        Backscatter law with a curve.
    bounds : array_like, shape (d, 2)
        Bounds of X.
    incidence_deg : array_like, shape (n,)
        Local incidence [deg].

    Returns
    -------
    (float, float)
        Smallest and largest mean level [dB].
    """
    from scipy.optimize import minimize

    box = np.asarray(bounds, dtype=np.float64)
    phi = np.radians(np.asarray(incidence_deg, dtype=np.float64))
    low, width = box[:, 0], box[:, 1] - box[:, 0]

    def level(unit: NDArray[np.float64], sign: float) -> float:
        return sign * float(np.mean(law(phi, low + unit * width)))

    sample = np.concatenate([sobol(len(box), _SCREENED, 0), np.full((1, len(box)), 0.5)])
    found = []
    for sign in (1.0, -1.0):
        order = np.argsort([level(unit, sign) for unit in sample])
        starts = sample[order[:_POLISHED]]
        ends = [minimize(level, unit, (sign,), "L-BFGS-B", bounds=[(0.0, 1.0)] * len(box)) for unit in starts]
        found.append(sign * min(float(end.fun) for end in ends))
    return found[0], found[1]


def level_asked_db(values_db: ArrayLike, looks: float) -> float:
    """Level [dB] that a law needs to give the mean of measured dB values: this mean minus the mean of log speckle."""
    return float(np.mean(np.asarray(values_db, dtype=np.float64)) - log_speckle_cumulants(looks)[0])


def check_reach(case: stages.Target, targets: Targets) -> None:
    """Refuse bounds of X inside which a law stays more than 3 dB away from the measured level.

    Parameters
    ----------
    case : stages.Target
        Configuration with laws, bounds and looks.
    targets : Targets
        Target of each calibrated material.

    Raises
    ------
    ConfigError
        If no X inside the bounds of a material gives its measured level to within 3 dB.
    """
    if case.target.normalisation == "image":
        return  # values of normalised images are not in dB
    for name, target in targets.items():
        law = case.laws[name]
        if not law.has_curve:
            continue
        incidence = np.quantile(np.asarray(target.incidence_deg, dtype=np.float64), (np.arange(24) + 0.5) / 24)
        low, high = law_range_db(law, case.materials[name].box, incidence)
        asked = level_asked_db(target.values_db, float(case.radar.looks))
        # the image of a surface below the noise shows the noise, so that no law is too low for it
        too_low = high < asked - _MARGIN_DB and target.noise_db < asked - _MARGIN_DB
        if low > asked + _MARGIN_DB or too_low:
            raise ConfigError(
                f"materials.{name}.bounds: inside them the law {case.materials[name].law!r} gives {low:.1f} to "
                f"{high:.1f} dB at the incidence seen, and the measured level is {asked:.1f} dB: expected bounds "
                f"between which the law reaches it to within {_MARGIN_DB:g} dB (found without any run of the design)."
            )
