"""Bins of several passes over the same fields: the effect of a field is one in all of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from radcal.calibration.misfit import BinMisfit
from radcal.measurement.classes import Classes

__all__ = ["SharedFields", "together"]

Doubles = NDArray[np.float64]


def together(misfits: Sequence[BinMisfit]) -> BinMisfit:
    """Misfit of the bins of all passes, one pass after the other.

    Fields of the same label are the same field: their effect on the level, the looks that their texture has and the
    shape of texture are common to all passes. Parts of fields (cells) lie elsewhere in each image, so that their
    effects belong to one pass; so does the sampling.

    Parameters
    ----------
    misfits : sequence of BinMisfit
        Of each pass, with the same standard deviations between and within fields.

    Returns
    -------
    BinMisfit
        For covariances and replicates; a single misfit itself. It has no angles, so that it expects nothing of a law.
    """
    first = misfits[0]
    if len(misfits) == 1:
        return first
    every = [one.classes for one in misfits]
    labels = [np.arange(one.patch_share.shape[1]) if one.patches is None else one.patches for one in misfits]
    patches = np.unique(np.concatenate(labels))
    columns = [np.searchsorted(patches, each) for each in labels]
    shares = np.zeros((sum(one.size for one in every), patches.size))
    ends = np.cumsum([0, *(one.size for one in every)])
    for one, own, start in zip(misfits, columns, ends[:-1], strict=True):
        shares[start : start + one.classes.size, own] = one.patch_share
    return BinMisfit(
        classes=Classes(
            edges_deg=np.concatenate([one.edges_deg for one in every]),
            member=np.concatenate([one.member + start for one, start in zip(every, ends[:-1], strict=True)]),
            count=np.concatenate([one.count for one in every]),
            pairs=np.stack([block_diag(*(one.pairs[k] for one in every)) for k in range(3)]),
            cumulants=np.concatenate([one.cumulants for one in every]),
            nodes_deg=np.concatenate([one.nodes_deg for one in every]),
            speckle_db2=np.concatenate([one.speckle_db2 for one in every]),
        ),
        patch_share=shares,
        cell_share=block_diag(*(one.cell_share for one in misfits)),
        patch_of_cell=np.concatenate([own[one.patch_of_cell] for one, own in zip(misfits, columns, strict=True)]),
        between_db=first.between_db,
        within_db=first.within_db,
        patches=patches,
    )


class SharedFields:
    """Residuals of several passes together, from those of each by itself.

    Parameters
    ----------
    misfits : sequence of BinMisfit
        Of each pass, with the same standard deviations between and within fields.

    Attributes
    ----------
    joined : BinMisfit
        Of all passes.
    """

    def __init__(self, misfits: Sequence[BinMisfit]) -> None:
        self._misfits, self.joined = misfits, together(misfits)

    def residuals(self, each: Sequence[Doubles]) -> Doubles:
        """Residuals of each pass, shapes (..., 3 n_k), to those of all, (..., 3 n): means, log sds, skewnesses.

        Their sum of squares is the smaller, the more of the differences an effect of the fields explains in all passes
        alike, and the larger where passes differ on the same field.
        """
        if len(each) == 1:
            return each[0]
        differences = [one.differences(own) for one, own in zip(self._misfits, each, strict=True)]
        return self.joined.whitened(np.concatenate(differences, axis=-2))
