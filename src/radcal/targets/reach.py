"""Range of levels that a law can reach inside the bounds of X, against the measured level."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.config.part import Part
from radcal.errors import ConfigError
from radcal.laws import Law
from radcal.radar.radiometry import with_noise_db
from radcal.seeds import derived_rng
from radcal.speckle.texture import log_speckle_cumulants
from radcal.targets.target import Targets

Doubles = NDArray[np.float64]

_SAMPLE = 1024
_ANGLES = 24
_MARGIN_DB = 3.0  # few effective looks, and the area of slopes, can each lower the mean of dB values by up to 3 dB


def law_range_db(law: Law, bounds: ArrayLike, incidence_deg: Doubles) -> tuple[Doubles, Doubles]:
    """Lowest and highest level of a law at each angle, among X drawn from the bounds and corners of the bounds.

    Parameters
    ----------
    law : Law
        Backscatter law with a curve.
    bounds : array_like, shape (d, 2)
        Bounds of X.
    incidence_deg : ndarray, shape (n,)
        Local incidence [deg].

    Returns
    -------
    (ndarray, ndarray), each of shape (n,)
        Lowest and highest level [dB].
    """
    box = np.asarray(bounds, dtype=np.float64)
    unit = derived_rng(0, "reach").random((_SAMPLE, len(box)))
    x = box[:, 0] + np.concatenate([unit, np.round(unit)]) * np.ptp(box, axis=1)
    levels = np.asarray(law(np.radians(incidence_deg)[:, None], x.T)).reshape(incidence_deg.size, -1)
    return levels.min(axis=1), levels.max(axis=1)


def check_level(case: Part, name: str, incidence_deg: ArrayLike, values_db: ArrayLike, noise_db: float) -> None:
    """Refuse bounds of X inside which a law stays more than 3 dB away from the measured level.

    This level is the mean of the measured dB values, less the mean of the logarithm of speckle.

    Parameters
    ----------
    case : Part
        Configuration of the pass, with laws, bounds and looks.
    name : str
        Calibrated material, whose law has a curve.
    incidence_deg, values_db : array_like, shape (n,)
        Local incidence [deg] and measured values [dB] of pixels of the material.
    noise_db : float
        Noise [dB]: the image of a surface below the noise shows the noise, so that no law is too low for it.

    Raises
    ------
    ConfigError
        If no X inside the bounds gives the level to within 3 dB.
    """
    law, material = case.laws[name], case.materials[name]
    asked = float(np.asarray(values_db, dtype=np.float64).mean() - log_speckle_cumulants(float(case.radar.looks))[0])
    angle = np.quantile(np.asarray(incidence_deg, dtype=np.float64), (np.arange(_ANGLES) + 0.5) / _ANGLES)
    low, high = (float(level.mean()) for level in law_range_db(law, material.box, angle))
    if low > asked + _MARGIN_DB or with_noise_db(np.array(high), noise_db) < asked - _MARGIN_DB:
        raise ConfigError(
            f"materials.{name}.bounds: inside them the law {material.law!r} gives {low:.1f} to {high:.1f} dB at the "
            f"incidence seen, and the measured level is {asked:.1f} dB: expected bounds between which the law "
            f"reaches it to within {_MARGIN_DB:g} dB."
        )


def check_reach(case: Part, targets: Targets) -> None:
    """Check of :func:`check_level` for the targets of all calibrated materials in one pass, before the design is run.

    Values of normalised images are not in dB and are not checked.
    """
    for name, target in targets.items():
        if case.laws[name].has_curve and case.target.normalisation != "image":
            check_level(case, name, target.incidence_deg, target.values_db, target.noise_db)
