"""Misfit of the bins of several passes over the same fields: a field has the same effect in all passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy
from numpy.typing import NDArray

from radcal.ground.bins import Classes
from radcal.inference.misfit import BinMisfit

Doubles = NDArray[np.float64]


def together(misfits: Sequence[BinMisfit]) -> BinMisfit:
    """Misfit of the bins of all passes, one pass after the other.

    Fields with the same label are one field. The effect of a field on the level, its texture, and the shape of the
    texture are the same in all passes. Parts of fields (cells) lie at different places in each image. The effects of
    cells and the sampling errors are therefore independent in different passes.

    Parameters
    ----------
    misfits : sequence of BinMisfit
        Misfit of each pass; the standard deviations between and within fields are the same in all passes.

    Returns
    -------
    BinMisfit
        Misfit with the covariance of all passes; with one pass, the misfit of this pass. The misfit
        of several passes does not shift expected statistics.
    """
    first = misfits[0]
    if len(misfits) == 1:
        return first
    every = [one.classes for one in misfits]
    patches = np.unique(np.concatenate([one.patches for one in misfits]))
    columns = [np.searchsorted(patches, one.patches) for one in misfits]
    shares = np.zeros((sum(one.size for one in every), patches.size))
    ends = np.cumsum([0, *(one.size for one in every)])
    for one, own, start in zip(misfits, columns, ends[:-1], strict=True):
        shares[start : start + one.classes.size, own] = one.patch_share
    nodes = np.concatenate([one.nodes_deg for one in every])
    return replace(
        first,
        classes=Classes(
            edges_deg=np.concatenate([one.edges_deg for one in every]),
            member=np.concatenate([one.member + start for one, start in zip(every, ends[:-1], strict=True)]),
            count=np.concatenate([one.count for one in every]),
            pairs=np.stack([scipy.linalg.block_diag(*(one.pairs[k] for one in every)) for k in range(3)]),
            cumulants=np.concatenate([one.cumulants for one in every]),
            nodes_deg=nodes,
            speckle_db2=np.concatenate([one.speckle_db2 for one in every]),
        ),
        patch_share=shares,
        cell_share=scipy.linalg.block_diag(*(one.cell_share for one in misfits)),
        patch_of_cell=np.concatenate([own[one.patch_of_cell] for one, own in zip(misfits, columns, strict=True)]),
        true_deg=nodes,
        patches=patches,
    )


class SharedFields:
    """Residuals of several passes with shared fields, from the residuals of each pass alone.

    Parameters
    ----------
    misfits : sequence of BinMisfit
        Misfit of each pass; the standard deviations between and within fields are the same in all passes.

    Attributes
    ----------
    joined : BinMisfit
        Misfit of the bins of all passes (:func:`together`).
    """

    def __init__(self, misfits: Sequence[BinMisfit]) -> None:
        self._misfits, self.joined = misfits, together(misfits)

    def residuals(self, each: Sequence[Doubles]) -> Doubles:
        """Residuals of all passes, shape (..., 3 n), from the residuals of each pass k, shape (..., 3 n_k).

        The order is: all means, all log sds, all skewnesses. Differences that one effect of a field explains in all
        passes make the sum of squared residuals smaller. Differences between passes on one field make the sum larger.
        """
        if len(each) == 1:
            return each[0]
        differences = [one.differences(own) for one, own in zip(self._misfits, each, strict=True)]
        return self.joined.whitened(np.concatenate(differences, axis=-2))
