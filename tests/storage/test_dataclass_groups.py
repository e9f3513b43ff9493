"""Layout of dataclasses in HDF5, read back and looked at with h5py alone."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import h5py
import numpy as np
import pytest
from numpy.typing import NDArray

from radcal.storage.dataclass_groups import put, same, table, take


@dataclass(frozen=True)
class Inner:
    level_db: float
    flags: NDArray[np.bool_]


@dataclass(frozen=True)
class Curve:
    values: NDArray[np.float64]
    law: str
    remark: str | None
    names: tuple[str, ...] = ()
    frequency_ghz: float | None = None


@dataclass(frozen=True)
class Outer:
    """Fields of all types.

    Attributes
    ----------
    image_db : ndarray
        Image of the pass [dB].
    arrays : mapping
        Anything.
    """

    count: int
    fixed: bool
    source: str
    mode: Literal["a", "b"]
    shape: tuple[int, int]
    names: tuple[str, ...]
    image_db: NDArray[np.float32]
    inner: Inner
    given: Inner | None
    curves: Mapping[str, Curve]
    parts: Mapping[str, Inner]
    reasons: Mapping[str, int]
    arrays: Mapping[str, NDArray[np.float64]]
    other: Inner | None = None
    maybe_db: float | None = None
    later: float = 2.5
    notes: tuple[str, ...] = field(default_factory=tuple)


PLAIN = {"count": 3, "fixed": True, "source": "a file, näher bezeichnet", "mode": "b"}


def example(**changed):
    values = {
        **PLAIN,
        "shape": (4, 7),
        "names": ("Wald", "Wasser"),
        "image_db": np.arange(1200, dtype=np.float32).reshape(30, 40),
        "inner": Inner(-3.5, np.array([True, False])),
        "given": None,
        "curves": {
            "z": Curve(np.array([1.0, -2.0]), "mangia", None),
            "a": Curve(np.empty(0), "external", "u?", ("u",), 1.3),
        },
        "parts": {"b": Inner(1.0, np.zeros(0, dtype=np.bool_)), "a": Inner(2.0, np.ones((2, 1), dtype=np.bool_))},
        "reasons": {"in shadow": 4, "near an edge": 0},
        "arrays": {"q": np.array([np.nan, np.inf])},
    }
    return Outer(**{**values, **changed})


def kept(value, path):
    with h5py.File(path, "w") as file:
        put(file, value)
    with h5py.File(path, "r") as file:
        return take(file, Outer)


def test_what_was_written_is_read(tmp_path):
    written = example(other=Inner(0.25, np.array([False])), maybe_db=-7.0, notes=("one", "two"))
    found = kept(written, tmp_path / "a.h5")
    assert same(found, written)
    assert list(found.curves) == ["z", "a"], "in the order in which they were written, not in that of the alphabet"


@pytest.mark.parametrize(("size", "compression"), [(255, None), (256, "gzip"), (249_999, "gzip"), (250_000, None)])
def test_arrays_of_a_kilobyte_to_a_megabyte_are_compressed(tmp_path, size, compression):
    kept(example(image_db=np.zeros((1, size), dtype=np.float32)), tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "r") as file:
        assert file["image_db"].compression == compression


def test_changes_of_a_large_array_stay_in_memory(tmp_path):
    image = np.random.default_rng(1).standard_normal((500, 501)).astype(np.float32)
    first = kept(example(image_db=image.copy()), tmp_path / "a.h5")
    first.image_db[3, 4] = 7.0
    with h5py.File(tmp_path / "a.h5", "r") as file:
        np.testing.assert_array_equal(take(file, Outer).image_db, image)


@pytest.mark.parametrize(
    ("one", "other", "alike"),
    [
        (np.nan, np.nan, True),
        (0.0, -0.0, False),
        ({"a": 1, "b": 2}, {"b": 2, "a": 1}, False),  # the order of a mapping is kept, too
        ({"a": 1}, {"a": 1, "b": 2}, False),
        ((1, 2), (1, 2, 3), False),
        (1, 1.0, False),
        (np.zeros(2), np.zeros(2, dtype=np.float32), False),
        (np.zeros((1, 2)), np.zeros((2, 1)), False),
        (np.array([np.nan]), np.array([np.nan]), True),
        (np.array(["a", None], dtype=object), np.array(["a", None], dtype=object), True),
    ],
)
def test_what_is_the_same(one, other, alike):
    assert same(one, other) is alike
    assert same(other, one) is alike


def test_a_field_with_a_default_may_be_missing_and_no_other(tmp_path):
    kept(example(), tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5", "r+") as file:
        del file.attrs["later"], file["notes"]
        assert take(file, Outer).later == 2.5
        assert take(file, Outer).notes == ()
        del file["inner"].attrs["level_db"]
        with pytest.raises(LookupError, match="/inner lacks level_db"):
            take(file, Outer)


def test_a_type_without_a_place_is_refused(tmp_path):
    @dataclass
    class Wrong:
        things: list[int]

    with h5py.File(tmp_path / "a.h5", "w") as file, pytest.raises(TypeError, match=r"things: a list\[int\] has no"):
        put(file, Wrong([1]))


@dataclass(frozen=True)
class Documented:
    """Levels of an image.

    Attributes
    ----------
    angle_deg : ndarray, shape (a,), dimension scale
        Angle [deg].
    low_db, high_db : ndarray, shape (m, a)
        Ends of each level [dB], as
        :meth:`radcal.somewhere.Other.ends` gives them.
    ratio : float
        Ratio of [dB] to [deg]; ``none`` if unknown.
    count : mapping
        Number of pixels by reason.
    words : tuple of str
        Warnings.
    curves : mapping of str to ndarray, shape (n,)
        A law each [dB].
    image : ndarray or None, shape (a,)
        Image.
    """

    angle_deg: NDArray[np.float64]
    low_db: NDArray[np.float64]
    high_db: NDArray[np.float64]
    ratio: float
    count: Mapping[str, int]
    words: tuple[str, ...]
    curves: Mapping[str, NDArray[np.float64]]
    parts: Mapping[str, Inner]
    image: NDArray[Any] | None = None


ENDS = "Ends of each level, as `ends` gives them"
LEVELS = np.arange(6.0).reshape(2, 3)
DOCUMENTED = Documented(
    np.array([20.0, 35.0, 60.0]), LEVELS, LEVELS + 1.0, 1.5, {"in shadow": 4}, ("one",), {"a": np.array([1.0])}, {},
    np.ones(3),
)  # fmt: skip


@pytest.fixture
def documented(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        put(file, DOCUMENTED)
    with h5py.File(tmp_path / "a.h5", "r") as file:
        yield file


def test_fields_that_are_not_wanted_are_not_read(documented):
    assert take(documented, Documented).image is not None
    assert take(documented, Documented, without=("image",)).image is None
    with pytest.raises(LookupError, match="lacks words"):
        take(documented, Documented, without=("words",))


def test_the_table_names_every_place_with_its_description():
    assert table(Documented).splitlines()[2:] == [
        "| `angle_deg` |  | float64 (a) | deg | Angle |",
        f"| `low_db` |  | float64 (m, a) | dB | {ENDS} |",
        f"| `high_db` |  | float64 (m, a) | dB | {ENDS} |",
        "| `/` | `ratio` | number |  | Ratio of [dB] to [deg]; `none` if unknown |",
        "| `count` | `<name>` | integer |  | Number of pixels by reason |",
        "| `words` |  | texts |  | Warnings |",
        "| `curves/<name>` |  | float64 (n) | dB | A law each |",
        "| `parts/<name>` |  | group |  |  |",
        "| `parts/<name>` | `level_db` | number |  |  |",
        "| `parts/<name>/flags` |  | bool |  |  |",
        "| `image` |  | numbers (a), or absent |  | Image |",
    ]
    kinds = {row.split("|")[3].strip() for row in table(Outer).splitlines()[2:]}
    assert kinds >= {"integer", "true or false", "text", "numbers", "texts", "float32", "group", "float64"}


def test_fields_are_described_in_the_file(documented):
    assert dict(documented["low_db"].attrs)["description"] == ENDS
    assert dict(documented["low_db"].attrs)["unit"] == "dB"
    assert dict(documented["count"].attrs) == {"in shadow": 4}
    assert documented["curves/a"].attrs["description"] == "A law each"
    assert documented["curves/a"].dims[0].label == "n"


def test_dimension_scales_lead_from_values_to_their_coordinate(documented):
    assert documented["angle_deg"].is_scale
    assert [one.label for one in documented["high_db"].dims] == ["m", "a"]
    assert len(documented["high_db"].dims[0]) == len(documented["curves/a"].dims[0]) == 0
    assert documented["high_db"].dims[1][0][()].tolist() == [20.0, 35.0, 60.0]
    assert not documented["curves/a"].is_scale
    assert same(take(documented, Documented), DOCUMENTED)
