"""Second registration of the measured image, onto a run of the laws that fit the image as first registered."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from radcal.config import RegistrationConfig
from radcal.registration.registered import Registered, register

__all__ = ["register_again"]


def register_again(image_db: NDArray[np.float32], first: Registered, config: RegistrationConfig) -> Registered:
    """Register the measured image onto another simulated image, and choose the registration that agrees better.

    A registration compares patterns of brightness. The reference run has the starting laws. If a starting law differs
    much from the real law, other slopes are bright in the reference run than in the measured image, and the
    displacement has an error that its standard error does not contain. A run of the laws found with the first
    registration usually has a pattern that is nearer to that of the measured image (``docs/registration.md``).

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Simulated image of the laws found with the first registration [dB].
    first : Registered
        Measured image, registered onto the reference run.
    config : RegistrationConfig
        Method and limits of the registration.

    Returns
    -------
    Registered
        Registration with the higher mean local correlation of the measured image with its simulated image. The
        sentence ``verdict`` names the choice. Findings are those of the first registration.
    """
    again = register(image_db, replace(first.measurement, image_db=first.unregistered_db), config, same_area=True)
    before, after = (float(np.mean(one.correlation)) for one in (first, again))
    numbers = f"mean local correlation {after:.3f}, with the reference run {before:.3f}"
    if after < before:
        kept = f"The image agrees less with a run of the laws found with it ({numbers}), and this registration is kept."
        return replace(first, verdict=f"{first.verdict} {kept}")
    onto = f"This is the second registration, onto a run of the laws found with the first one ({numbers})."
    return replace(again, verdict=f"{again.verdict} {onto}", findings=first.findings)
