"""Method of registration: what each one offers."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import NDArray


class Method(Protocol):
    """Function that finds the displacement between two images; checks and error of the registration are common."""

    def __call__(
        self,
        fixed: NDArray[np.float32],
        moving: NDArray[np.float32],
        start: NDArray[np.float64] | None,
        gefolki_px: NDArray[np.float64],
        /,
    ) -> NDArray[np.float64]:
        """Displacement of each pixel to its place in the moving image [pixels].

        Parameters
        ----------
        fixed, moving : ndarray of float32, shape (rows, columns)
            Rank transforms of the simulated and the measured image.
        start : ndarray, shape (2,), or None
            Shift of the whole image along rows and columns, if ``registration.global_shift`` asks for it [pixels].
        gefolki_px : ndarray, shape (2, rows, columns)
            Displacement that GeFolki has found from ``start`` [pixels]; the error of the registration is its error and
            the distance from it.

        Returns
        -------
        ndarray, shape (2, rows, columns)
            Displacement along rows and columns [pixels].
        """
        ...
