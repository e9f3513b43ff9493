"""What files say of themselves."""

import numpy as np
from raster_files import write_raster

from radcal.newcase.file_facts import code_counts


def test_codes_are_those_of_the_file_as_it_is(tmp_path):
    path, cover = tmp_path / "cover.tif", np.full((6, 7), 3, np.uint8)
    for code, expected in ((9, {3: 35, 9: 7}), (4, {3: 35, 4: 7})):
        cover[0] = code
        write_raster(path, cover)
        assert code_counts(path) == expected
