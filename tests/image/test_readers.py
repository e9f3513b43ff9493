"""Every format round-trips; every broken file ends in its sentence."""

import contextlib
import os
import pickle
import signal
import zipfile
import zlib

import h5py
import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from raster_files import read_image, write_raster
from scipy.io import savemat

from radcal.config import FileMeasurement
from radcal.errors import MeasurementError
from radcal.reading.images import Counts

POWER = np.random.default_rng(1).gamma(4, 0.025, (40, 30))
DB = 10.0 * np.log10(POWER)
PHASE = np.exp(2j * np.pi * np.random.default_rng(2).random((40, 30)))
SCALES = {"db": DB, "power": POWER, "amplitude": np.sqrt(POWER), "complex": np.sqrt(POWER) * PHASE}


def write_h5(path, values):
    with h5py.File(path, "w") as file:
        file["image/values"] = values


def write_mat73(path, values):
    """MATLAB 7.3: HDF5 with a user block, axes the other way round, complex numbers as pairs."""
    with h5py.File(path, "w", userblock_size=512) as file:
        if np.iscomplexobj(values):
            pairs = np.empty(values.T.shape, dtype=[("real", "f8"), ("imag", "f8")])
            pairs["real"], pairs["imag"] = values.T.real, values.T.imag
            file["image"] = pairs
        else:
            file["image"] = values.T
    header = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(124) + b"\x00\x02IM"
    with path.open("r+b") as handle:
        handle.write(header)


WRITERS = {
    "image.tif": write_raster,
    "image.npy": np.save,
    "image.npz": lambda path, values: np.savez(path, image=values),
    "image.mat": lambda path, values: savemat(path, {"image": values}),
    "new.mat": write_mat73,
    "image.h5": write_h5,
}


def read(path, scale="power", **keys):
    return read_image(path, FileMeasurement(path=str(path), scale=scale, radiometry="sigma0_ref", **keys)).image_db


@pytest.mark.parametrize("scale", SCALES)
@pytest.mark.parametrize("name", WRITERS)
def test_every_format_and_scale_gives_the_same_db(tmp_path, name, scale):
    WRITERS[name](tmp_path / name, SCALES[scale])
    found = read(tmp_path / name, scale)
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, DB, atol=1e-4)


def test_band_and_dataset_are_chosen_by_name(tmp_path):
    write_raster(tmp_path / "two.tif", np.stack([POWER, 2 * POWER]))
    np.savez(tmp_path / "two.npz", hh=POWER, hv=2 * POWER)
    np.testing.assert_allclose(read(tmp_path / "two.tif", band=2), DB + 10 * np.log10(2), atol=1e-4)
    np.testing.assert_allclose(read(tmp_path / "two.npz", dataset="hv"), DB + 10 * np.log10(2), atol=1e-4)
    for name, words in (("two.tif", "2 bands, expected one: .*measurement.band"), ("two.npz", "hh, hv: .*dataset")):
        with pytest.raises(MeasurementError, match=words):
            read(tmp_path / name)
    with pytest.raises(MeasurementError, match="measurement.band is 3, .* has 2"):
        read(tmp_path / "two.tif", band=3)
    with pytest.raises(MeasurementError, match="dataset is 'vv', .* holds hh, hv"):
        read(tmp_path / "two.npz", dataset="vv")
    with pytest.raises(MeasurementError, match=r"measurement\.dataset is 'hh', .*two\.tif is a raster"):
        read(tmp_path / "two.tif", dataset="hh")


@pytest.mark.parametrize(
    ("values", "scale", "words"),
    [
        (DB, "power", "which power cannot be: .*scale: db"),
        (DB, "amplitude", "which amplitude cannot be"),
        (POWER, "db", "looks like power"),
        (POWER, "complex", "float64, expected complex numbers"),
        (SCALES["complex"], "power", "complex128, expected real numbers"),
        (np.full((4, 5), np.nan), "power", "no finite number"),
        (np.zeros((0, 5)), "power", "no finite number"),
        (np.zeros((4, 5)), "power", "no power: 20 of its pixels are 0"),
        (np.full((4, 5), 0.1), "power", r"measurement.path: all 20 pixels of .*a.npy are -10 dB, expected an image"),
        (np.zeros((4, 5), dtype=complex), "complex", "no power: 20 of its pixels are 0"),
        (np.ones((2, 3, 4)), "power", r"shape \(2, 3, 4\), expected an image"),
    ],
)
def test_numbers_that_contradict_the_scale_are_told(tmp_path, values, scale, words):
    np.save(tmp_path / "a.npy", values)
    with pytest.raises(MeasurementError, match=words):
        read(tmp_path / "a.npy", scale)


def test_a_few_impossible_levels_are_masked_and_counted_many_refused(tmp_path):
    path = tmp_path / "a.npy"
    values = np.tile(DB, (2, 1)).astype(np.float32)  # 2,400 pixels: two are 0.08 %
    values[3, 4], values[7, 8] = 1e38, -1e38
    np.save(path, values)
    found = read_image(path, FileMeasurement(path=str(path), scale="db", radiometry="sigma0_ref"))
    assert np.isnan(found.image_db[[3, 7], [4, 8]]).all()
    assert np.isfinite(found.image_db).sum() == values.size - 2
    assert found.counts == Counts(2400, 0, 0, 0, impossible=2)
    values[9, 9] = 201.0  # three are 0.13 %
    np.save(path, values)
    with pytest.raises(MeasurementError, match=r"1e\+38 dB and 3 of 2,400 values like it, expected within \+-200 dB"):
        read(path, "db")
    np.save(path, np.random.default_rng(5).normal(96, 47, (60, 50)))
    with pytest.raises(MeasurementError, match=r"most likely measurement\.scale is not db"):
        read(path, "db")


def npy_header(shape, dtype="<f8"):
    text = repr({"descr": dtype, "fortran_order": False, "shape": shape}).encode().ljust(117) + b"\n"
    return b"\x93NUMPY\x01\x00" + len(text).to_bytes(2, "little") + text


def huge(path, shape):
    """Few bytes that tell of a large array."""
    name = path.name
    if name.endswith("npy"):
        with path.open("wb") as file:
            file.write(npy_header(shape))
            file.truncate(200 + 8 * shape[0] * shape[1])  # a hole, which takes no room
    elif name.endswith("npz"):
        with zipfile.ZipFile(path, "w") as archive:
            archive.writestr("a.npy", npy_header(shape))
    elif name.endswith("mat"):
        savemat(path, {"a": np.zeros((2, 3))})
        content = path.read_bytes()
        size = np.array([2, 3], dtype="<i4").tobytes()
        assert content.count(size) == 1
        path.write_bytes(content.replace(size, np.array(shape, dtype="<i4").tobytes()))
    else:
        with h5py.File(path, "w") as file:
            file.create_dataset("a", shape, "f8", chunks=(1000, 1000), compression="gzip")


@pytest.mark.parametrize("name", ["a.npy", "a.npz", "a.mat", "a.h5"])
def test_sizes_are_compared_before_anything_is_read(tmp_path, name, monkeypatch):
    """With a memory that would not hold the array: what is read first ends otherwise."""
    monkeypatch.setattr("radcal.reading.intake._SPARE_BYTES", 200 << 20)
    huge(tmp_path / name, (40000, 30000))
    config = FileMeasurement(path=name, scale="power", radiometry="sigma0_ref")
    with pytest.raises(MeasurementError, match="has 40000 x 30000 pixels, the scene's image 40 x 30: crop or resample"):
        read_image(tmp_path / name, config, (40, 30))
    with pytest.raises(MeasurementError, match="has 40000 x 30000 pixels, expected at most"):
        read_image(tmp_path / name, config)


def test_chunks_and_filters_of_hdf5_are_looked_at(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        file.create_dataset("a", (40, 30), "f4", chunks=(20000, 20000), maxshape=(None, None), compression="gzip")
    with pytest.raises(MeasurementError, match=r"a\.h5 keeps 4,800 bytes in chunks of 1,600,000,000, expected none"):
        read(tmp_path / "a.h5")
    properties = h5py.h5p.create(h5py.h5p.DATASET_CREATE)
    properties.set_chunk((40, 30))
    for _ in range(2):  # a bomb in a bomb
        properties.set_deflate(9)
    with h5py.File(tmp_path / "b.h5", "w") as file:
        space = h5py.h5s.create_simple((40, 30))
        h5py.h5d.create(file.id, b"a", h5py.h5t.IEEE_F32LE, space, properties)
    with pytest.raises(MeasurementError, match=r"HDF5 filters \[1, 1\], expected those of the library itself"):
        read(tmp_path / "b.h5")
    with h5py.File(tmp_path / "c.h5", "w") as file:
        file.create_dataset("a", data=POWER, chunks=(40, 30), compression="gzip", shuffle=True, fletcher32=True)
    np.testing.assert_allclose(read(tmp_path / "c.h5"), DB, atol=1e-5)


@pytest.mark.slow
def test_what_inflates_beyond_its_size_ends_in_a_sentence(tmp_path, monkeypatch):
    """A deflate stream of 600 MB in a chunk of 4,800 bytes."""
    monkeypatch.setattr("radcal.reading.intake._SPARE_BYTES", 300 << 20)
    with h5py.File(tmp_path / "a.h5", "w") as file:
        data = file.create_dataset("a", (40, 30), "f4", chunks=(40, 30), compression="gzip")
        data.id.write_direct_chunk((0, 0), zlib.compress(bytes(600 << 20), 1))
    with pytest.raises(MeasurementError, match=r"a\.h5 cannot be read as HDF5"):
        read_image(tmp_path / "a.h5", FileMeasurement(path="a.h5", scale="power", radiometry="sigma0_ref"), (40, 30))


class Loaded:
    """Object that ends the test if it is unpickled."""

    def __reduce__(self):
        return pytest.fail, ("a pickle was loaded",)


@pytest.mark.parametrize("name", ["a.npy", "a.npz"])
@pytest.mark.parametrize(
    ("shape", "sentence"),
    [((1,), r"holds an array of shape \(1,\), expected an image"), ((2, 3), "holds object, expected real numbers")],
)
def test_pickled_objects_are_never_loaded(tmp_path, name, shape, sentence):
    WRITERS[name.replace("a.", "image.")](tmp_path / name, np.full(shape, Loaded(), dtype=object))
    with pytest.raises(MeasurementError, match=sentence):
        read(tmp_path / name)


def test_a_bare_pickle_is_no_array(tmp_path):
    content = pickle.dumps(Loaded())
    (tmp_path / "a.npy").write_bytes(content)
    with zipfile.ZipFile(tmp_path / "a.npz", "w") as archive:
        archive.writestr("a.npy", content)
    for name in ("a.npy", "a.npz"):
        with pytest.raises(MeasurementError, match=r"^measurement\.path: .* cannot be read as"):
            read(tmp_path / name)


@pytest.mark.parametrize("name", WRITERS)
def test_empty_and_wrong_files_end_in_a_sentence(tmp_path, name):
    for content in (b"", b"no image at all", bytes(range(256)) * 20):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(MeasurementError, match=r"^measurement\.path: .* (cannot be read as|holds)"):
            read(tmp_path / name)


@pytest.mark.parametrize("reader", ["whosmat", "loadmat"])
def test_a_file_that_crashes_its_reader_ends_in_a_sentence(tmp_path, monkeypatch, reader):
    """As scipy's reader does with some damaged files."""
    savemat(tmp_path / "a.mat", {"image": POWER})
    here = os.getpid()

    def crash(*_, **__):
        assert os.getpid() != here
        os.kill(os.getpid(), signal.SIGSEGV)

    monkeypatch.setattr(f"scipy.io.{reader}", crash)
    with pytest.raises(MeasurementError, match=r"a\.mat cannot be read as a MATLAB file .*damaged: reading it crashes"):
        read(tmp_path / "a.mat")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("files")
    for name, write in WRITERS.items():
        write(folder / name, POWER)
    return {name: (folder / name).read_bytes() for name in WRITERS}


@pytest.mark.slow
@pytest.mark.parametrize("name", WRITERS)
@given(data=st.data())
@settings(max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_damage_gives_an_image_or_a_sentence(tmp_path, files, name, data):
    content = bytearray(files[name])
    if data.draw(st.booleans()):
        content = content[: data.draw(st.integers(0, len(content) - 1))]
    for _ in range(data.draw(st.integers(0, 4))):
        if content:
            content[data.draw(st.integers(0, len(content) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    (tmp_path / name).write_bytes(bytes(content))
    # anything but a MeasurementError gets through and fails
    with contextlib.suppress(MeasurementError):
        assert read(tmp_path / name).ndim == 2
