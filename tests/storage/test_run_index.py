"""Indexes of runs."""

import numpy as np
import pytest

from radcal.errors import StoreError
from radcal.storage.records import read_json, write_json
from radcal.storage.runs import IndexedRun, Record, RunStore, indexed, read_index, write_index

X = {"dyke": [0.1 + 0.2, 1e-300], "road": [3.0]}


def test_an_index_holds_keys_and_parameters_and_what_repeats_differ(tmp_path):
    runs = [IndexedRun("b" * 20, X), IndexedRun("a" * 20, X, 0.0), IndexedRun("c" * 20, {"dyke": [1.5]}, 0.25)]
    write_index(tmp_path / "index.json", runs)
    assert read_index(tmp_path / "index.json") == runs
    # byte for byte the file of plain data, without the difference where there is none
    plain = [
        {"key": "b" * 20, "parameters": X},
        {"key": "a" * 20, "parameters": X, "difference_db": 0.0},
        {"key": "c" * 20, "parameters": {"dyke": [1.5]}, "difference_db": 0.25},
    ]
    assert read_json(tmp_path / "index.json") == plain
    write_json(tmp_path / "plain.json", plain)
    assert (tmp_path / "index.json").read_bytes() == (tmp_path / "plain.json").read_bytes()


def test_listed_runs_come_in_order_and_one_that_is_gone_is_named(tmp_path):
    store, file = RunStore(tmp_path / "runs"), tmp_path / "index.json"
    write_index(file, [IndexedRun("def", X), IndexedRun("abc", {"dyke": [2.0, 5.0]})])
    with pytest.raises(StoreError, match=r"def\.h5: missing, damaged or without dyke, though .*index\.json lists it"):
        list(indexed([file], store.folder, ["dyke"]))
    for key, level in (("abc", 4.0), ("def", 7.0)):
        store.put(Record(key, {"dyke": np.full(3, level, np.float32)}, None, 0.2), {})
    found = list(indexed([file, file], store.folder, ["dyke"]))
    assert [(record.key, x["dyke"]) for record, x in found] == [("def", X["dyke"]), ("abc", [2.0, 5.0])] * 2
    assert found[0][0].pixels_db["dyke"].tolist() == [7.0] * 3
    with pytest.raises(StoreError, match=r"damaged or without dyke, the whole image, though .*; delete "):
        list(indexed([file], store.folder, ["dyke"], image=True))


@pytest.mark.parametrize(
    "held",
    [
        *(7, {"key": "a"}, ["a"], [{"key": 7, "parameters": X}], [{"key": "a", "parameters": {"dyke": [None]}}]),
        *([{"key": "../scores", "parameters": X}], [{"key": "a", "parameters": X, "draws": ["/tmp/a"]}]),
    ],
)
def test_other_contents_under_a_right_checksum_are_one_sentence(tmp_path, held):
    write_json(tmp_path / "index.json", held)
    with pytest.raises(StoreError, match=r"index\.json: holds other contents than radcal writes"):
        read_index(tmp_path / "index.json")
