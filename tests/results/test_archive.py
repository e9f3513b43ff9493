"""The archive is what its types say, in the file and in the documents."""

import re
from pathlib import Path

import numpy as np

from radcal.results.archive import UNLISTED, Archive, Images, read_archive
from radcal.storage.dataclass_groups import table

# of any dataset: description, unit, and what HDF5 needs for dimension scales


def test_the_page_names_every_group_of_the_file():
    page = (Path(__file__).resolve().parents[2] / "docs" / "archive.md").read_text(encoding="utf-8")
    cells = (line.split("|")[1] for line in table(Archive, unlisted=UNLISTED).splitlines()[2:])
    groups = {cell.strip(" `").partition("/")[0] for cell in cells} - {""}
    assert groups - set(re.findall(r"`(\w+)(?:/[^`]*)?`", page)) == set()


def test_every_field_has_a_description():
    lines = table(Archive).splitlines()[2:]
    assert len(lines) > 120
    assert [line for line in lines if not line.split("|")[5].strip()] == []


def test_what_is_gathered_is_what_is_read(made):
    """Materials in their order, arrays with their types, None as None."""
    archive = made.archive
    assert list(archive.materials) == ["dyke", "stem beans"]
    assert list(archive.laws) == ["dyke", "stem beans", "unused"]
    assert archive.materials["stem beans"].hidden is None
    assert archive.image.radiometry["1"].materials == ("unused",)
    assert archive.measured_db.dtype == np.float32
    np.testing.assert_array_equal(archive.measured_db, made.registered.measurement.image_db)
    assert read_archive(made.path, images=False).images == Images()
    assert archive.names == made.geometry.names
