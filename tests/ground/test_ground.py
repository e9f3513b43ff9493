"""Blocks of an image that are calibrated on or held out."""

import numpy as np
import pytest

from radcal.ground.ground import Blocks


def picture(blocks, rows, columns):
    part = blocks.parts_of(np.arange(rows * columns), columns)
    return part.reshape(rows, columns), blocks.kept(part, "even").reshape(rows, columns)


def test_rows_alternate():
    part, kept = picture(Blocks(4, 2), 12, 3)
    assert (part == np.arange(6).repeat(2)[:, None]).all()
    assert kept[:, 0].tolist() == [True] * 4 + [False] * 4 + [True] * 4
    assert (Blocks(4, 2).kept(part, "odd") == ~kept).all()
    assert Blocks(4, 2).kept(part, "both").all()


@pytest.mark.parametrize("columns", [9, 12, 14], ids=["3 blocks", "4 blocks", "5 blocks, one of them cut"])
def test_blocks_of_columns_are_a_chessboard(columns):
    step = 3
    part, kept = picture(Blocks(4, 2, step), 12, columns)
    row, column = np.indices((12, columns))
    assert (kept == ((row // 4 + column // step) % 2 == 0)).all()
    # every part is two rows of one block
    for number in np.unique(part):
        inside = part == number
        assert inside.any(axis=1).sum() == 2
        assert inside.any(axis=0).sum() <= step
        assert len({(r // 4, c // step) for r, c in zip(*np.nonzero(inside), strict=True)}) == 1
    assert np.unique(part).size == 6 * -(-columns // step)
