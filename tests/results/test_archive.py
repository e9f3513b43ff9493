"""The archive is what its types say, in the file and in the documents."""

import re
from pathlib import Path

import h5py
import numpy as np

from radcal.results.archive import UNLISTED, Archive, Images, read_archive
from radcal.storage.dataclass_groups import table

# of any dataset: description, unit, and what HDF5 needs for dimension scales
GENERAL = ("description", "unit", "CLASS", "NAME", "REFERENCE_LIST", "DIMENSION_LIST", "DIMENSION_LABELS")


def test_the_page_names_every_group_of_the_file():
    page = (Path(__file__).resolve().parents[2] / "docs" / "archive.md").read_text(encoding="utf-8")
    cells = (line.split("|")[1] for line in table(Archive, unlisted=UNLISTED).splitlines()[2:])
    groups = {cell.strip(" `").partition("/")[0] for cell in cells} - {""}
    assert groups - set(re.findall(r"`(\w+)(?:/[^`]*)?`", page)) == set()


def test_every_field_has_a_description():
    lines = table(Archive).splitlines()[2:]
    assert len(lines) > 120
    assert [line for line in lines if not line.split("|")[5].strip()] == []


def test_the_file_has_what_the_table_lists_and_no_more(made):
    listed = {
        tuple(cell.strip().strip("`") for cell in line.split("|")[1:3]) for line in table(Archive).splitlines()[2:]
    }
    found = set()
    groups = ["laws", "decision/materials", "materials", "passes"]
    groups += [f"image/{name}" for name in ("laws_db", "apart_db", "radiometry", "shared")]
    named = ("left_out", "/rms", "measurement/hidden")

    def look(path, item):
        # any name stands for all of them
        place = re.sub(rf"^({'|'.join(groups)})/[^/]+", r"\1/<name>", path)
        place = re.sub(r"(<name>/targets)/[^/]+", r"\1/<name>", place)
        if place not in groups:
            found.add((place, ""))
        keys = ["<name>" if place.endswith(named) else key for key in item.attrs if key not in GENERAL]
        found.update((place or "/", key) for key in keys)

    with h5py.File(made.path) as file:
        file.visititems(look)
        look("", file)
        assert file["materials/dyke/dp"].attrs["unit"] == "dB or IQR"
        assert file["materials/dyke/dp"].attrs["description"].startswith("xi, omega and alpha")
        target = file["materials/dyke/targets/1"]
        assert target["values_db"].dims[0][0] == target["pixels"]
        assert target["incidence_deg"].attrs["unit"] == "deg"
        assert [one.label for one in file["images/reference_db"].dims] == ["rows", "columns"]
        assert file["laws/dyke"].attrs["description"].startswith("X of every material")
    provenance = {("/", key) for key in ("kind", "schema", "content", "created", "radcal")}
    mappings = ("levels/valid", "rms", "registered/measurement/hidden")
    assert found - listed == provenance | {("", "")} | {
        (place, "")
        for place in (
            "materials/<name>/targets",
            "materials/<name>/targets/<name>/left_out",
            *(f"passes/<name>/{name}" for name in mappings),
        )
    }
    assert {("materials/<name>/posterior/curve/p05_db", ""), ("materials/<name>", "best")} <= found


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
