"""Raw numbers after a header, in either byte order."""

from types import SimpleNamespace

import numpy as np
import pytest

from radcal.errors import SimulatorError
from radcal.programs.command import read_raw
from radcal.reading.images import ImageFile

VALUES = np.array([[1.5, -2.25, 3e7], [4.0, 5.0, -6e-3]])


def read(path, **output):
    config = SimpleNamespace(**{"dtype": "float32", "byte_order": None, "header_bytes": None} | output)
    return read_raw(ImageFile(path, config, "simulator.output", "file", SimulatorError), config, (2, 3))


@pytest.mark.parametrize(("order", "sign"), [(None, "<"), ("little", "<"), ("big", ">")])
@pytest.mark.parametrize("header", [None, 7])
def test_numbers_after_a_header(tmp_path, order, sign, header):
    path = tmp_path / "image.raw"
    path.write_bytes(b"\1" * (header or 0) + VALUES.astype(f"{sign}f4").tobytes())
    np.testing.assert_array_equal(read(path, byte_order=order, header_bytes=header), VALUES.astype("f4"))


def test_a_file_of_another_size_is_refused(tmp_path):
    path = tmp_path / "image.raw"
    path.write_bytes(bytes(5 + 6 * 8))
    said = r"53 bytes, expected 29 for 2 x 3 numbers of float32 after a header of 5"
    with pytest.raises(SimulatorError, match=said):
        read(path, header_bytes=5)
