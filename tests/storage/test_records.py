import hashlib
import json
import re
import resource
import shutil
import time
from pathlib import Path

import h5py
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from sealed import changed, flip, seal

from radcal.config.stages import SCHEMAS
from radcal.errors import DamagedError, StoreError
from radcal.storage.records import (
    inspect,
    plain_hdf5,
    provenance,
    read_hdf5,
    read_json,
    set_aside,
    write_hdf5,
    write_json,
)

X = np.arange(3000, dtype=np.float32)


@pytest.fixture(autouse=True)
def _in_a_job():
    with provenance("dyke"):
        yield


def left_in(folder):
    return sorted(path.name for path in folder.iterdir())


def write(path, kind="scene", values=X):
    with write_hdf5(path, kind) as file:
        file.create_dataset("x", data=values, compression="gzip")
        file.attrs["name"] = "a"
    return path


def test_three_lines_of_h5py_read_it_with_where_it_comes_from(tmp_path):
    config = {"seed": 3, "radar": {"looks": 4}}
    with provenance("dyke", config):
        write(tmp_path / "a.h5")
    with h5py.File(tmp_path / "a.h5") as file:
        np.testing.assert_array_equal(file["x"], X)
        attributes = dict(file.attrs)
        assert json.loads(file["config"].asstr()[()]) == config
    assert (attributes["kind"], attributes["schema"], attributes["case"]) == ("scene", 2, "dyke")
    assert attributes["created"].endswith("+00:00")
    assert json.loads(attributes["versions"])["numpy"] == np.__version__
    assert attributes["radcal"]


def write_plain(path, values):
    with plain_hdf5(path) as file:
        file["x"] = values


@pytest.mark.parametrize("most", [600, 100_000])
@pytest.mark.parametrize("write", [write, write_plain])
def test_a_file_that_does_not_fit_is_one_sentence(tmp_path, most, write):
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (most, limits[1]))
    try:
        with pytest.raises(StoreError, match=r"a\.h5: cannot be written \(File too large\)"):
            write(tmp_path / "a.h5", values=np.random.default_rng(1).random(10**6))
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert left_in(tmp_path) == []
    write(tmp_path / "a.h5", values=X)


def test_the_checksum_is_that_of_coreutils(tmp_path):
    import subprocess

    path = write(tmp_path / "a.h5")
    words = path.read_bytes()[:512].split(b"\n")[0].split()
    tail = subprocess.run(["tail", "-c", "+513", str(path)], capture_output=True, check=True).stdout
    found = subprocess.run(["sha256sum"], input=tail, capture_output=True, check=True).stdout.split()[0]
    assert words[2] == found
    assert int(words[4]) == len(tail)


@pytest.mark.slow
@settings(max_examples=60, deadline=None)
@given(st.data())
def test_no_single_bit_passes(tmp_path_factory, data):
    folder = tmp_path_factory.mktemp("bits")
    if data.draw(st.booleans()):
        path, kind = write(folder / "a.h5"), "scene"
    else:
        path, kind = folder / "a.json", None
        write_json(path, {"x": [1.5, 2.5], "y": "text"})
    content = bytearray(path.read_bytes())
    content[data.draw(st.integers(0, len(content) - 1))] ^= 1 << data.draw(st.integers(0, 7))
    path.write_bytes(content)
    with pytest.raises(DamagedError, match=r"a\.(h5|json): .* set aside as a\.damaged; type the same command"):
        inspect(path, kind)
    assert left_in(folder) == ["a.damaged"]
    assert (folder / "a.damaged").read_bytes() == bytes(content)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.booleans())
def test_no_cut_or_lengthened_file_passes(tmp_path_factory, at, longer):
    path = write(tmp_path_factory.mktemp("cuts") / "a.h5")
    content = path.read_bytes()
    at %= len(content)
    path.write_bytes(content + bytes(at + 1) if longer else content[:at])
    with pytest.raises(DamagedError, match="is damaged"), read_hdf5(path, "scene"):
        pytest.fail("it was opened")


def test_of_a_large_file_header_and_size_are_compared_first(tmp_path):
    path = write(tmp_path / "a.h5")
    content = bytearray(path.read_bytes())
    place = content.index(b"SNOD" if b"SNOD" in content else b"TREE") + 200
    content[place] ^= 1
    path.write_bytes(content)
    inspect(path, "scene", most_bytes=len(content) - 1)
    for other in (content[:-1], content + b"\0"):
        path.write_bytes(other)
        told = rf"is damaged \({len(other) - 512} bytes after the header, expected {len(content) - 512}\)"
        with pytest.raises(DamagedError, match=told):
            inspect(path, "scene", most_bytes=600)
    path.write_bytes(content)
    with pytest.raises(DamagedError, match="its contents differ from its checksum"):
        inspect(path, "scene", most_bytes=len(content))


def test_a_file_that_somebody_has_replaced_meanwhile_is_not_set_aside(tmp_path):
    path = write(tmp_path / "a.h5")
    number = path.stat().st_ino
    write(tmp_path / "b.h5", values=X + 1).replace(path)  # while the first one was inspected
    assert path.stat().st_ino != number
    set_aside(path, "is damaged", number)
    assert left_in(tmp_path) == ["a.h5"]
    inspect(path, "scene")
    set_aside(path, "is damaged", path.stat().st_ino)
    assert left_in(tmp_path) == ["a.damaged"]


def test_another_kind_version_or_case_is_named_and_set_aside(tmp_path):
    with provenance("dyke"):
        path = write(tmp_path / "a.h5", "scene")
    with provenance("dyke"), read_hdf5(path, "scene"):
        pass
    with read_hdf5(path, "scene"):  # a script of one's own
        pass
    copy = Path(shutil.copy(path, tmp_path / "b.h5"))
    with pytest.raises(DamagedError, match="kind 'scene', expected 'geometry'"), read_hdf5(copy, "geometry"):
        pass
    copy = Path(shutil.copy(path, tmp_path / "c.h5"))
    with provenance("paper"), pytest.raises(DamagedError, match="belongs to the case 'dyke', expected 'paper'"):
        inspect(copy, "scene")
    with changed(path) as file:
        file.attrs["schema"] = 99
    with pytest.raises(DamagedError, match="written with schema 99, this radcal reads 2"):
        inspect(path, "scene")
    with provenance("dyke"):
        write_json(tmp_path / "d.json", [1])
    with provenance("paper"), pytest.raises(DamagedError, match="belongs to the case 'dyke'"):
        read_json(tmp_path / "d.json")
    assert left_in(tmp_path) == ["a.damaged", "b.damaged", "c.damaged", "d.damaged"]


def test_a_file_of_an_earlier_schema_is_not_called_damaged(tmp_path):
    path = write(tmp_path / "a.h5", "scene")
    with changed(path) as file:
        file.attrs["schema"] = SCHEMAS["scene"] - 1
    said = f"is of an earlier version of radcal: it was written with schema 1, this radcal reads {SCHEMAS['scene']};"
    with pytest.raises(DamagedError, match=re.escape(said)) as caught:
        inspect(path, "scene")
    assert "damaged" not in str(caught.value)
    assert left_in(tmp_path) == ["a.earlier"]
    with changed(write(tmp_path / "b.h5", "scene")) as file:
        file.attrs["schema"] = SCHEMAS["scene"] - 1
    flip(tmp_path / "b.h5", np.random.default_rng(3))
    with pytest.raises(DamagedError, match="is damaged"):
        inspect(tmp_path / "b.h5", "scene")
    assert left_in(tmp_path) == ["a.earlier", "b.damaged"]


def test_outside_of_a_command_on_a_case_no_file_is_renamed(tmp_path):
    path = write(tmp_path / "a.h5", "scene")
    with changed(path) as file:
        file.attrs["schema"] = SCHEMAS["scene"] - 1
    (tmp_path / "b.json").write_text("{}")
    with provenance():
        with pytest.raises(DamagedError, match=r"a\.h5: is of an earlier version .*; nothing was changed; type"):
            inspect(path, "scene")
        with pytest.raises(DamagedError, match=r"b\.json: is damaged .*; nothing was changed; type the command of its"):
            read_json(tmp_path / "b.json")
    assert left_in(tmp_path) == ["a.h5", "b.json"]


def test_what_is_made_again_without_a_difference_stays_byte_for_byte(tmp_path):
    with provenance("dyke", {"seed": 1}):
        path = write(tmp_path / "a.h5")
    before, stamp = path.read_bytes(), path.stat().st_mtime_ns
    time.sleep(1.1)  # longer than the resolution of the time that it holds
    with provenance("dyke", {"seed": 2}):
        write(path)
    assert path.read_bytes() == before
    assert path.stat().st_mtime_ns > stamp
    with provenance("dyke", {"seed": 2}):
        write(path, values=X + 1)
    assert path.read_bytes() != before
    with read_hdf5(path, "scene") as file:
        assert json.loads(file["config"].asstr()[()]) == {"seed": 2}


def test_a_damaged_file_is_no_reason_to_keep_it(tmp_path):
    path = write(tmp_path / "a.h5")
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    write(path)
    inspect(path, "scene")


def test_a_sealed_file_that_leads_elsewhere_is_set_aside(tmp_path):
    for name, make in {
        "link": lambda file: file.__setitem__("y", h5py.ExternalLink("other.h5", "/x")),
        "storage": lambda file: file.create_dataset("y", (4,), "u1", external=[("/etc/hostname", 0, 4)]),
    }.items():
        path = write(tmp_path / f"{name}.h5")
        with h5py.File(path, "r+") as file:
            make(file)
        seal(path)
        with pytest.raises(DamagedError, match=r"is not what radcal wrote \('y' .* another file\); set aside"):
            inspect(path, "scene")


def test_the_schemas_in_the_documents_are_those_of_the_code():
    page = (Path(__file__).parents[2] / "docs" / "records.md").read_text(encoding="utf-8")
    told = dict(re.findall(r"^\| `[^`]+` \| (\w+) (\d+) \|", page, flags=re.MULTILINE))
    assert {kind: int(number) for kind, number in told.items()} == dict(SCHEMAS)


def test_a_file_that_cannot_be_reached_is_not_damaged(tmp_path, monkeypatch):
    path = write(tmp_path / "a.h5")

    def refuse(*_, **__):
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "open", refuse)
    with pytest.raises(StoreError, match=r"a\.h5: cannot be read \(Permission denied\); nothing was changed"):
        inspect(path, "scene")
    monkeypatch.undo()
    inspect(path, "scene")
    with pytest.raises(StoreError, match="is missing; type the command of its case again"):
        inspect(tmp_path / "b.h5", "scene")


def test_a_folder_that_refuses_the_renaming_says_what_to_do(tmp_path, monkeypatch):
    path = write(tmp_path / "a.h5")
    path.write_bytes(b"")

    def refuse(*_):
        raise OSError(30, "Read-only file system")

    monkeypatch.setattr(Path, "replace", refuse)
    with pytest.raises(DamagedError, match=r"cannot be set aside \(Read-only file system\); remove it"):
        inspect(path, "scene")


def test_json_round_trip(tmp_path):
    data = {"a": [1, 2.5, None, True], "é": "ü", "data": 1, "sha256": 2}
    write_json(tmp_path / "a.json", data)
    assert read_json(tmp_path / "a.json") == data
    assert json.loads((tmp_path / "a.json").read_text())["data"] == data
    write_json(tmp_path / "b.json", [1, {"a": 2}])
    assert read_json(tmp_path / "b.json") == [1, {"a": 2}]
    write_json(tmp_path / "c.json", {"case": "x", "runs": 3}, flat=True)
    assert read_json(tmp_path / "c.json") == {"case": "x", "runs": 3}
    assert json.loads((tmp_path / "c.json").read_text())["runs"] == 3


def test_json_made_again_is_the_same_file(tmp_path):
    for name in ("a.json", "b.json"):
        with provenance("dyke", {"seed": len(name)}):
            write_json(tmp_path / name, [{"key": "k"}])
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


@pytest.mark.parametrize("value", [float("nan"), float("inf")])
def test_json_refuses_what_is_not_a_number(tmp_path, value):
    with pytest.raises(ValueError, match="not JSON compliant"):
        write_json(tmp_path / "a.json", {"a": value})
    assert left_in(tmp_path) == []


@pytest.mark.parametrize("content", [b"", b'{"a": 1', b"\xff\xfe\x00", b'{"a": 1}'])
def test_damaged_json_is_set_aside(tmp_path, content):
    (tmp_path / "a.json").write_bytes(content)
    with pytest.raises(DamagedError, match=r"a\.json: is damaged \(no checksum in its second line\)"):
        read_json(tmp_path / "a.json")
    assert left_in(tmp_path) == ["a.damaged"]
    with pytest.raises(StoreError, match=r"a\.json: is missing"):
        read_json(tmp_path / "a.json")


@pytest.mark.parametrize("rest", [' "data": nothing}', f' "data": {"[" * 100_000}{"]" * 100_000}' + "}"])
def test_a_right_checksum_of_no_json_is_one_sentence(tmp_path, rest):
    total = hashlib.sha256(rest.encode()).hexdigest()
    (tmp_path / "stop.json").write_text(f'{{\n "sha256": "{total}",\n{rest}')
    with pytest.raises(StoreError, match=r"stop\.json: holds other contents than radcal writes \((JSON|Recursion)"):
        read_json(tmp_path / "stop.json")
