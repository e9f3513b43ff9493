"""Files of others: bounded, parsed without entities, and all that leads elsewhere found."""

import os
import resource
import sys

import h5py
import numpy as np
import pytest

from radcal.reading.intake import bounded_memory, elsewhere, parse_xml, unchanged


@pytest.mark.skipif(sys.platform != "linux", reason="the system has no /proc")
def test_memory_is_bounded_in_the_block_and_only_there():
    before = resource.getrlimit(resource.RLIMIT_AS)
    with bounded_memory(1000):
        np.ones(1 << 20)
        with pytest.raises(MemoryError):
            np.empty(3 << 27)  # 3 GB
    with bounded_memory(1 << 26):
        np.empty(3 << 27)
    assert resource.getrlimit(resource.RLIMIT_AS) == before


@pytest.mark.skipif(sys.platform != "linux", reason="the system has no /proc")
@pytest.mark.parametrize(("soft", "values", "tighter"), [(1 << 40, 1000, True), (1 << 40, 1 << 36, False)])
def test_a_limit_that_is_set_already_is_never_widened(monkeypatch, soft, values, tighter):
    limits = []
    monkeypatch.setattr(resource, "getrlimit", lambda _: (soft, 2 * soft))
    monkeypatch.setattr(resource, "setrlimit", lambda _, pair: limits.append(pair))
    with bounded_memory(values):
        assert (limits[0][0] < soft) is tighter
        assert limits[0][0] <= soft
        assert limits[0][1] == 2 * soft
    assert limits[1:] == [(soft, 2 * soft)]


def test_entities_and_document_types_are_refused(tmp_path):
    (tmp_path / "secret").write_text("secret")
    assert parse_xml(b"<a><b>1</b></a>").findtext("b") == "1"
    for text in (
        f'<!DOCTYPE a [<!ENTITY e SYSTEM "{tmp_path}/secret">]><a>&e;</a>',
        '<!DOCTYPE a [<!ENTITY e "x">]><a>&e;</a>',
        f'<!DOCTYPE a SYSTEM "{tmp_path}/secret"><a/>',
    ):
        for encoding in ("utf-8", "utf-16"):
            with pytest.raises(ValueError, match="declares a document type"):
                parse_xml(text.encode(encoding))
    with pytest.raises(ValueError, match="cannot be parsed"):
        parse_xml(b"<a>")


def test_a_file_that_changes_is_noticed(tmp_path):
    path = tmp_path / "a"
    path.write_text("one")
    with unchanged(path):
        path.read_text()
    for change in (lambda: path.write_text("three"), lambda: os.utime(path, ns=(1, 1))):
        with pytest.raises(ValueError, match="changed while it was read"), unchanged(path):
            change()


def test_what_of_an_hdf5_file_lies_elsewhere(tmp_path):
    (tmp_path / "raw").write_bytes(bytes(48))
    layout = h5py.VirtualLayout((2, 3), "f4")
    layout[...] = h5py.VirtualSource(str(tmp_path / "other.h5"), "x", (2, 3))
    kinds = {
        "link": (lambda group: group.__setitem__("x", h5py.ExternalLink("other.h5", "/")), "'g/x' is a link"),
        "storage": (
            lambda group: group.create_dataset("x", (2, 3), "f4", external=[(str(tmp_path / "raw"), 0, 24)]),
            "'g/x' keeps its numbers in another file",
        ),
        "virtual": (lambda group: group.create_virtual_dataset("x", layout), "'g/x' is a virtual dataset"),
    }
    for name, (make, words) in kinds.items():
        with h5py.File(tmp_path / f"{name}.h5", "w") as file:
            make(file.create_group("g"))
            assert (elsewhere(file) or "").startswith(words)
    with h5py.File(tmp_path / "own.h5", "w") as file:
        file["g/x"] = np.zeros(3)
        file["g/soft"] = h5py.SoftLink("/g/x")
        assert elsewhere(file) is None
