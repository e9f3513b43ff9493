"""Files of a results folder that are not what was written, each small enough to be made here."""

from pathlib import Path

import numpy as np
import pytest
from sealed import flip

from radcal.session.salvage import salvage
from radcal.storage.records import provenance, write_hdf5, write_json, write_listing
from radcal.storage.runs import Record, RunStore

PATTERNS = (
    *("scene.h5", "passes/{p}/reference.json", "scores.json", "design/{chunk}.json", "iterations/{k}/proposal.json"),
    *("figures", "runs.csv", "table.json", "report.json"),
)
KEYS = [f"{digit}" * 20 for digit in "abcdef"]
INDEXES = ("passes/1/reference.json", "design/0.json", "design/1.json")


@pytest.fixture
def out(tmp_path, monkeypatch):
    """A results folder of six runs, listed by three indexes."""
    monkeypatch.setattr("radcal.session.salvage.OUTPUTS", PATTERNS)
    folder = tmp_path / "tiny"
    store = RunStore(folder / "runs")
    with provenance("tiny"):
        for k, key in enumerate(KEYS):
            store.put(Record(key, {"field": np.arange(3.0 + k, dtype=np.float32)}, None, 0.5), {"noise_seed": k})
        with write_hdf5(folder / "scene.h5", "scene") as file:
            file["x"] = 1.5
        entries = [{"key": key, "parameters": {"field": [1.0]}} for key in KEYS]
        for name, some in (("passes/1/reference", entries[:1]), ("design/0", entries[1:3]), ("design/1", entries[3:])):
            write_json(folder / f"{name}.json", some)
        write_json(folder / "iterations/0/proposal.json", {"field": {"parameters": [1.0]}})
    (folder / "figures").mkdir()
    for name in ("runs.csv", "report.html", "figures/law.png", "figures/law.pdf"):
        (folder / name).write_text(f"what {name} holds\n")
    with provenance("tiny"):
        write_listing(folder / "table.json", [folder / "runs.csv"])
        write_listing(
            folder / "report.json", [folder / n for n in ("report.html", "figures/law.png", "figures/law.pdf")]
        )
    return folder


def names(folder):
    return {
        path.relative_to(folder).as_posix() for path in folder.rglob("*") if path.is_file() and path.name != ".claims"
    }


def test_sound_files_and_those_that_no_rule_makes_stay(out):
    (out / "notes.json").write_text("{}")
    (out / "mine.h5").write_text("nothing")
    before = names(out)
    assert salvage(out, "tiny") == []
    assert names(out) == before


@pytest.mark.parametrize("name", ["scene.h5", "iterations/0/proposal.json", "design/1.json", "report.json"])
def test_damaged_files_are_set_aside(out, name):
    flip(out / name, np.random.default_rng(3))
    (sentence,) = salvage(out, "tiny")
    assert sentence.startswith(f"{out / name}: is damaged")
    assert "it is made again where needed" in sentence
    assert not (out / name).exists()
    assert (out / name).with_suffix(".damaged").is_file()


def test_files_at_the_place_of_an_earlier_version_are_removed(out):
    earlier = {
        *("geometry.h5", "measurement.h5", "reference.json", "registration_run.json", "target.h5", "simulator.json"),
        *("first/registered.h5", "registered.h5", "passes/2/design/0.json", "passes/2/external/failed-1/log"),
        *("logs/first_registration.log", "logs/passes/2/design/0.log", "benchmarks/passes/2/design_0.tsv"),
    }
    stay = {"passes/1/target.h5", "passes/2/geometry.h5", "logs/passes/1/target.log", "logs/scene.log"}
    for name in {*earlier, *stay, "benchmarks/scene.tsv"}:
        (out / name).parent.mkdir(parents=True, exist_ok=True)
        (out / name).touch()
    before = names(out)
    (sentence,) = salvage(out, "tiny")
    assert sentence.startswith(f"{out}: the files of pass 1 lie in passes/1 now; those of an earlier ")
    assert names(out) == before - earlier
    assert {path.name for path in (out / "passes/2").iterdir()} == {"geometry.h5"}
    assert salvage(out, "tiny") == []


def test_a_lost_run_takes_its_index_with_it(out):
    (out / f"runs/{KEYS[2]}.h5").unlink()
    (sentence,) = salvage(out, "tiny")
    assert sentence == (
        f"{out}/runs: runs listed in design/0.json are not there ({KEYS[2]}); they alone are made again where needed."
    )
    assert names(out) & {*INDEXES} == {*INDEXES[::2]}


def test_a_lost_speckle_draw_takes_its_index_with_it(out):
    with provenance("tiny"):
        write_json(out / INDEXES[0], [{"key": KEYS[0], "parameters": {}, "draws": ["0" * 20]}])
    (sentence,) = salvage(out, "tiny")
    assert f"runs listed in {INDEXES[0]} are not there ({'0' * 20})" in sentence
    assert names(out) & {*INDEXES} == {*INDEXES[1:]}


def test_all_runs_lost_are_one_sentence_with_their_number(out):
    for path in (out / "runs").iterdir():
        path.unlink()
    (out / "runs").rmdir()
    with provenance("tiny"):
        write_json(out / "scores.json", [{"key": key, "rms": {}} for key in KEYS])
    (sentence,) = salvage(out, "tiny")
    assert sentence == (
        f"{out}/runs: runs listed in passes/1/reference.json, scores.json, design/0.json and 1 more are not there "
        f"({', '.join(sorted(KEYS)[:3])} and 3 more); they alone are made again where needed."
    )
    assert not names(out) & {"scores.json", *INDEXES}


def test_a_folder_in_the_place_of_a_record_is_noticed(out):
    path = out / f"runs/{KEYS[4]}.h5"
    path.unlink()
    for done in (f"; set aside as {KEYS[4]}.damaged", ", and cannot be set aside (Directory not empty); remove it"):
        path.mkdir()
        (path / "mine.txt").touch()
        said, *_ = salvage(out, "tiny")
        assert said.startswith(f"{path}: is a folder or a device, expected a file{done}")
    assert (path / "mine.txt").exists()


def test_a_record_under_the_name_of_another_is_noticed(out):
    first, second = (out / f"runs/{key}.h5" for key in KEYS[1:3])
    second.write_bytes(first.read_bytes())
    sentences = salvage(out, "tiny")
    assert sentences[0].startswith(f"{second}: holds the run {KEYS[1]}, expected {KEYS[2]}; set aside as ")
    assert "runs listed in design/0.json are not there" in sentences[1]
    assert first.is_file()
    # a job that asks for it meets the same
    assert RunStore(out / "runs").get(KEYS[2], ["field"]) is None
    assert RunStore(out / "runs").get(KEYS[1], ["field"]) is not None


@pytest.mark.parametrize(
    ("name", "listing"),
    [("runs.csv", "table.json"), ("report.html", "report.json"), ("figures/law.png", "report.json")],
)
def test_changed_pages_are_set_aside_and_made_again(out, name, listing):
    (out / name).write_text("another\n")
    (sentence,) = salvage(out, "tiny")
    assert sentence.startswith(f"{out / name}: is damaged or was changed (it differs from its checksum); set aside as ")
    assert (out / f"{Path(name).name}.damaged").read_text() == "another\n"
    # without it the rule that makes both runs again
    assert not (out / listing).exists()


@pytest.mark.parametrize("name", ["../notes.txt", "{out}/../notes.txt", "linked/notes.txt", "", "..", "a\0b"])
def test_a_list_that_names_files_elsewhere_leaves_them_alone(out, name):
    (out.parent / "notes.txt").write_text("mine\n")
    (out / "linked").symlink_to(out.parent)
    name = name.format(out=out)
    with provenance("tiny"):
        write_json(out / "report.json", {"checksums": {"report.html": "0" * 64, name: "0" * 64}})
    (sentence,) = salvage(out, "tiny")
    assert sentence.startswith(f"{out / 'report.json'}: names {name!r}, expected a file below {out}; set aside as ")
    assert sorted(path.name for path in out.parent.iterdir()) == ["notes.txt", "tiny"]
    assert (out / "report.damaged").is_file()
    assert (out / "report.html").is_file()


def test_missing_pages_are_one_sentence(out):
    for name in ("report.html", "figures/law.png", "figures/law.pdf"):
        (out / name).unlink()
    (sentence,) = salvage(out, "tiny")
    assert sentence == f"missing, and made again: {out}/report.html, {out}/figures/law.png, {out}/figures/law.pdf."
    assert not (out / "report.json").exists()
    assert (out / "table.json").is_file()
