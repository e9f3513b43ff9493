"""What is said of a case at the terminal."""

import json
import os

import pytest
from commands import typed

from radcal.config.stages import OUTPUTS
from radcal.errors import StoreError
from radcal.products.showing import results_folder, show
from radcal.results.summary import summarise
from radcal.storage.lock import CaseLock
from radcal.storage.records import write_json

PATHS = [path.format(p=1, k=0, j=0, chunk=0, s=1, material="dyke") for path in OUTPUTS]


@pytest.fixture
def folder(made, tmp_path, monkeypatch):
    """Folder ``results/small`` of a finished case, in the working folder."""
    monkeypatch.chdir(tmp_path)
    folder = tmp_path / "results" / "small"
    for path in PATHS:
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).touch()
    write_json(folder / "summary.json", summarise(made.archive), flat=True)
    return folder


def test_a_finished_case(folder, made):
    (folder / "passes/1/geometry.h5").unlink()  # to save space
    lines = show(folder)
    assert lines[0] == summarise(made.archive)["verdict"]
    # the verdict begins with the name
    verdict = summarise(made.archive)["materials"]["dyke"]["verdict"]
    assert verdict.startswith("dyke")
    assert lines[1].startswith(f"{verdict} mangia with X1 ")
    assert (
        lines[2] == "dyke: parameters_model, the law nearest to the median of the band: X1 1.8, X2 2.8, X3 3.8, X4 4.8."
    )
    counts = "simulator runs of the search: 6 (4 design, 2 infill), besides 1 reference, 1 final"
    assert lines[5:7] == summarise(made.archive)["warnings"]
    assert lines[7] == f"{counts}; end: target seems out of reach inside the bounds."
    assert lines[8:] == [
        f"report: {folder / 'report.html'}",
        f"exports: {folder / 'export'}",
        f"summary: {folder / 'summary.json'}",
        f"table of runs: {folder / 'runs.csv'}",
    ]


def test_registration_runs_are_counted_apart_and_a_summary_without_runs_is_one_sentence(folder):
    file = folder / "summary.json"
    data = json.loads(file.read_text())
    file.write_text(json.dumps(data | {"runs": data["runs"] | {"reference": 3, "registration": 2}}))
    assert "besides 1 reference, 2 registration, 1 final; end" in show(folder)[7]
    del data["runs"]
    file.write_text(json.dumps(data))
    with pytest.raises(StoreError, match=r"summary\.json: holds other contents .* \(LookupError: lacks runs\)"):
        show(folder)


def test_an_unfinished_case_says_what_is_missing(folder):
    for name in ("final.json", "calibration.h5", "export", "export.json", "report.json", "report.html", "summary.json"):
        (folder / name).unlink()
    for name in ("runs/aa.h5", "runs/bb.h5", "runs/.partial-x-cc.h5", "iterations/0/verified.json"):
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).touch()
    lines = show(folder)
    missing = "final runs, archive of all runs and exports, figures, report and summary"
    assert lines[0] == f"small: not finished; missing: {missing}."
    assert lines[1] == f"records of runs: 2 in {folder / 'runs'}; iterations verified: 1."
    again = "type the command that began the case again (radcal run with its YAML file): finished runs are kept."
    assert lines[-1] == f"To continue, {again}"
    (folder / "logs").mkdir()
    (folder / "logs/failure.txt").write_text("registration: a.tif has nothing in common.\n")
    failed = show(folder)
    assert failed[-2] == "the last command failed: registration: a.tif has nothing in common."
    assert failed[-1] == f"Once the cause is removed, {again}"


def test_a_command_at_work_is_told_with_where_it_stands(folder):
    (folder / "summary.json").unlink()
    assert not any("running" in line for line in show(folder))
    lock = CaseLock(folder)
    lock.acquire()
    (folder / "logs").mkdir(exist_ok=True)
    (folder / "logs/reference.progress").write_text("reference run: 3.0 s")
    lines = show(folder)
    assert lines[-2].startswith(f"running now: process {os.getpid()}, for ")
    assert lines[-1] == "last progress: reference run: 3.0 s"
    assert not any("To continue" in line for line in lines)
    lock.release()
    assert "To continue" in show(folder)[-1]


def test_a_case_is_found_by_name_folder_or_file(folder, tmp_path):
    (tmp_path / "mine.yaml").write_text("case: small\n")
    (tmp_path / "small").mkdir()  # a folder of this name is not meant
    for case in ("small", "results/small", str(folder), "mine.yaml"):
        assert results_folder(case).resolve() == folder
    with pytest.raises(StoreError, match=r"gone: there is no folder results/gone, expected the name of a case"):
        results_folder("gone")
    one = typed("show", "mine.yaml").stdout
    assert one.splitlines()[7] == show(folder)[7]
    assert typed("show", "gone", "small", "mine.yaml", code=1).stdout.strip() == f"{one}\n{one}".strip()
    empty = typed("show", "small", "--results", tmp_path, code=1)
    assert empty.stderr == f"radcal: {tmp_path / 'small'}: holds no results, expected the results folder of a case.\n"
    (tmp_path / "small/logs").mkdir()
    elsewhere = typed("show", "small", "--results", tmp_path)
    assert elsewhere.stdout.startswith("small: not finished; missing: scene,")
    assert "File name too long" in typed("show", "a" * 300, code=1).stderr
    failed = typed("show", "gone", code=1)
    assert failed.stdout == ""
    assert failed.stderr.startswith("radcal: gone: there is no folder")
