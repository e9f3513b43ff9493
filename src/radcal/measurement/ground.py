"""The pixels of one material that a law is fitted to, or compared with, and the areas that they lie in."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from radcal.measurement.patches import Cells, make_cells

__all__ = ["Ground"]


@dataclass(frozen=True)
class Ground:
    """The pixels of one material that a law is fitted to, or compared with.

    Attributes
    ----------
    values_db : ndarray, shape (pixels,)
        Measured backscatter [dB].
    incidence_deg : ndarray, shape (pixels,)
        Local incidence [deg].
    patch, block : ndarray of int, shape (pixels,)
        Connected area and block of the image that each lies in.
    independent : float
        Independent pixels for each pixel, at most 1.
    """

    values_db: NDArray[np.float64]
    incidence_deg: NDArray[np.float64]
    patch: NDArray[np.int64]
    block: NDArray[np.int64]
    independent: float = 1.0

    @cached_property
    def cells(self) -> Cells:
        """Parts of patches in blocks."""
        return make_cells(self.patch, self.block)

    @cached_property
    def sampling(self) -> NDArray[np.float64]:
        """Sampling variance of each cell's mean [dB^2]."""
        return self.cells.sampling_variance(self.values_db, self.independent)

    def part(self, mask: NDArray[np.bool_]) -> Ground:
        """Only these pixels."""
        return Ground(
            self.values_db[mask], self.incidence_deg[mask], self.patch[mask], self.block[mask], self.independent
        )
