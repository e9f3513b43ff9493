"""Registration by scikit-image's iterative Lucas-Kanade optical flow."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from radcal.registration.displacement import warp


def ilk_px(
    fixed: NDArray[np.float32],
    moving: NDArray[np.float32],
    start: NDArray[np.float64] | None,
    _gefolki_px: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Displacement [pixels] with windows of 65 pixels, as a :class:`.Method`."""
    from skimage.registration import optical_flow_ilk

    shift = np.zeros((2, *fixed.shape))
    if start is not None:
        shift += np.round(start)[:, None, None]
        moving = np.nan_to_num(warp(moving, shift))
    return np.asarray(shift + optical_flow_ilk(fixed, moving, radius=32))
