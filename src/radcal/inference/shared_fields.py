"""Misfit of the bins of several passes over the same fields: a field has the same effect in all passes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import scipy

from radcal.ground.bins import Classes
from radcal.inference.misfit import BinMisfit


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
        Misfit with the covariance of all passes, which does not shift expected statistics. With it, differences that
        one effect of a field explains in all passes make the sum of squared residuals smaller; differences between
        passes on one field make the sum larger.
    """
    every = [one.classes for one in misfits]
    patches = np.unique(np.concatenate([one.patches for one in misfits]))
    columns = [np.searchsorted(patches, one.patches) for one in misfits]
    shares = np.zeros((sum(one.size for one in every), patches.size))
    ends = np.cumsum([0, *(one.size for one in every)])
    for one, own, start in zip(misfits, columns, ends[:-1], strict=True):
        shares[start : start + one.classes.size, own] = one.patch_share
    nodes = np.concatenate([one.nodes_deg for one in every])
    return replace(
        misfits[0],
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
