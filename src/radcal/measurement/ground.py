"""Pixels of one material, each with its field and image block, for fits of a law and for checks on held-out pixels."""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import cached_property
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from radcal.config import Validation
from radcal.measurement.classes import class_of, incidence_edges
from radcal.measurement.correlation import Correlation, independent_pairs, without_trend
from radcal.measurement.patches import Cells, make_cells

__all__ = ["Blocks", "Ground"]


@dataclass(frozen=True)
class Blocks:
    """Blocks of an image, like the squares of a chessboard; each is used for the calibration or held out as a whole.

    Attributes
    ----------
    rows : int
        Image rows of a block.
    part_rows : int
        Image rows of a part of a block, whose mean is predicted; a divisor of ``rows``.
    columns : int, optional
        Image columns of a block; all of them if missing.
    """

    rows: int
    part_rows: int
    columns: int | None = None

    @classmethod
    def of(cls, validation: Validation | None, rows: int = 0) -> Blocks:
        """Blocks as configured; by default two parts of 10 rows or more per block, and at most 50 parts per image."""
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
        """Whether each part is used for the calibration: parts of blocks with even numbers, odd numbers, or all."""
        if keep in ("both", "fields"):
            return np.ones(part.shape, dtype=np.bool_)
        return np.asarray(part // self.parts % 2 == (0 if keep == "even" else 1))


@dataclass(frozen=True)
class Ground:
    """Pixels of one material to which a law is fitted, or with which it is compared.

    Attributes
    ----------
    values_db : ndarray, shape (pixels,)
        Measured backscatter [dB].
    incidence_deg : ndarray, shape (pixels,)
        Local incidence [deg].
    patch, block : ndarray of int, shape (pixels,)
        Field (connected area), and part of a block of the image (see :class:`Blocks`), of each pixel.
    pixels : ndarray of int64, shape (pixels,), optional
        Flat image indices, increasing.
    correlation : Correlation, optional
        Correlation of the material's pixels; without it they are independent.
    error_deg : ndarray, shape (pixels,), optional
        Standard error of the local incidence of each pixel [deg]; missing where one number holds for all.
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
        """Sampling variance of each cell's mean at its incidence [dB^2], which the spread by a law is no part of."""
        member = class_of(self.incidence_deg, incidence_edges(self.incidence_deg, "auto"))
        left = without_trend(self.values_db, self.incidence_deg, member)
        return self.cells.sampling_variance(left, self.independent)

    @cached_property
    def independent(self) -> float:
        """Number of independent pixels for each pixel, at most 1."""
        if self.correlation is None or self.pixels is None or not self.pixels.size:
            return 1.0
        return self.correlation.effective(self.pixels) / self.pixels.size

    def pairs(self, group: NDArray[np.int64], size: int) -> NDArray[np.float64]:
        """Mean correlation, its square and its cube over the pairs of pixels of two groups, shape (3, size, size)."""
        if self.correlation is None or self.pixels is None:
            return independent_pairs(group, size)
        return self.correlation.pairs(self.pixels, group, size)

    def part(self, mask: NDArray[np.bool_]) -> Ground:
        """Ground restricted to the pixels of a mask."""

        def of(values: NDArray[Any] | None) -> Any:
            return None if values is None else values[mask]

        found = {field.name: of(getattr(self, field.name)) for field in fields(self) if field.name != "correlation"}
        return Ground(**found, correlation=self.correlation)
