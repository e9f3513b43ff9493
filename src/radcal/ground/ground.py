"""Pixels of one material, each with its field and image block, for fits of a law and for checks on held-out pixels."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from radcal.config import Validation
from radcal.ground.bins import class_of, incidence_edges
from radcal.ground.correlation import Correlation, independent_pairs, without_trend
from radcal.ground.patches import Cells, make_cells


@dataclass(frozen=True)
class Blocks:
    """Blocks of an image, like the squares of a chessboard; a whole block is used for the calibration or held out.

    Attributes
    ----------
    rows : int
        Number of image rows in a block.
    part_rows : int
        Number of image rows in a part of a block, a divisor of ``rows``; predictions are made for the means of parts.
    columns : int, optional
        Number of image columns in a block; by default all columns of the image.
    """

    rows: int
    part_rows: int
    columns: int | None = None

    @classmethod
    def of(cls, validation: Validation | None, rows: int = 0) -> Blocks:
        """Blocks as configured; by default, a block has two parts of at least 10 rows, and an image up to 50 parts."""
        if validation is not None:
            return cls(validation.rows, validation.means, validation.columns)
        part = max(10, -(-rows // 50))
        return cls(2 * part, part)

    @property
    def parts(self) -> int:
        """Number of parts in a block."""
        return self.rows // self.part_rows

    def parts_of(self, pixels: NDArray[np.int64], width: int) -> NDArray[np.int64]:
        """Number of the block part that holds each pixel, from the pixels' flat indices and the width of the image.

        Parts are numbered block by block, and blocks row by row. Of two blocks that share a side, one has an even and
        the other an odd block number.
        """
        row, column = np.divmod(np.asarray(pixels, dtype=np.int64), width)
        step = width if self.columns is None else self.columns
        across = -(-width // step)
        block = row // self.rows * (across + 1 - across % 2) + column // step
        return np.asarray(block * self.parts + row % self.rows // self.part_rows)

    def kept(self, part: NDArray[np.int64], keep: Literal["even", "odd", "both", "fields"]) -> NDArray[np.bool_]:
        """Whether each part is used for the calibration: ``keep`` selects even blocks, odd blocks, or all blocks."""
        if keep in ("both", "fields"):
            return np.ones(part.shape, dtype=np.bool_)
        return np.asarray(part // self.parts % 2 == (0 if keep == "even" else 1))


@dataclass(frozen=True)
class Ground:
    """Pixels of one material to which a law is fitted, or with which a law is compared.

    Attributes
    ----------
    values_db : ndarray, shape (pixels,)
        Measured backscatter [dB].
    incidence_deg : ndarray, shape (pixels,)
        Local incidence [deg].
    patch, block : ndarray of int, shape (pixels,)
        Field (connected area), and part of a block of the image (see :class:`Blocks`), of each pixel.
    pixels : ndarray of int64, shape (pixels,), optional
        Flat indices of the pixels in the image, increasing.
    correlation : Correlation, optional
        Correlation of the material's pixels; by default the pixels are independent.
    error_deg : ndarray, shape (pixels,), optional
        Standard error of the local incidence angle of each pixel [deg]; missing if one number holds for all pixels.
    """

    values_db: NDArray[np.float64]
    incidence_deg: NDArray[np.float64]
    patch: NDArray[np.int64]
    block: NDArray[np.int64]
    pixels: NDArray[np.int64] | None = None
    correlation: Correlation | None = None
    error_deg: NDArray[np.float64] | None = None

    @cached_property
    def cells(self) -> Cells:
        """Cells of these pixels; a cell is the area of one field that lies in one part of a block."""
        return make_cells(self.patch, self.block)

    @cached_property
    def sampling(self) -> NDArray[np.float64]:
        """Sampling variance of each cell's mean [dB^2], without the variation of the level with the incidence angle."""
        member = class_of(self.incidence_deg, incidence_edges(self.incidence_deg, "auto"))
        left = without_trend(self.values_db, self.incidence_deg, member)
        return self.cells.sampling_variance(left, self.independent)

    @cached_property
    def independent(self) -> float:
        """Ratio of the effective sample size to the number of pixels, at most 1."""
        if self.correlation is None or self.pixels is None or not self.pixels.size:
            return 1.0
        return self.correlation.effective(self.pixels) / self.pixels.size

    def pairs(self, group: NDArray[np.int64], size: int) -> NDArray[np.float64]:
        """Means of the first three powers of the correlation of pixels from two groups, shape (3, size, size)."""
        if self.correlation is None or self.pixels is None:
            return independent_pairs(group, size)
        return self.correlation.pairs(self.pixels, group, size)

    def part(self, mask: NDArray[np.bool_]) -> Ground:
        """Ground restricted to the pixels of a mask."""

        def of(values: NDArray[Any] | None) -> Any:
            return None if values is None else values[mask]

        found = {field.name: of(getattr(self, field.name)) for field in fields(self) if field.name != "correlation"}
        return Ground(**found, correlation=self.correlation)
