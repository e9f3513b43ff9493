"""Results folders that earlier versions of radcal wrote, continued by this one."""

import shutil
import tarfile
from pathlib import Path

import pytest

MOVED = "the files of pass 1 lie in passes/1 now; those of an earlier version of radcal are removed and made again."
SIMULATED = "measured image: synthetic, seed 1"


@pytest.mark.parametrize(
    ("version", "killed", "made_again"),
    [
        ("0.1.0", False, {"calibration", "field", "image", "registered"}),
        ("69e11348", False, {"calibration", "field"}),
        ("69e11348", True, set()),
    ],
)
def test_results_of_an_earlier_version_are_continued_without_a_repeated_run(project, version, killed, made_again):
    """The tiny case of each version, with 48 x 40 pixels, 4 runs of the design, and no report, exports and logs.

    Before 0.1.0 the files of the first pass lay beside ``passes``: the measured image is simulated again, no run is.
    Jobs of the search are made again, too. Their least squares have found lower minima since 29 November 2026, so that
    the two infill runs and the final one have other X than those of these versions.
    """
    with tarfile.open(Path(__file__).with_name(f"results_{version}.tar.xz")) as archive:
        archive.extractall(project.folder, filter="data")
    records, contents, summary = project.records(), project.contents(), project.summary()
    assert len(records) == summary["runs"]["total"]
    if killed:  # in the first iteration
        for name in ("iterations/0/verified.json", "final.json", "calibration.h5", "summary.json"):
            (project.out() / name).unlink()
        for path in [*project.out().glob("iterations/[1-9]*"), project.out() / "posterior"]:
            shutil.rmtree(path)
    printed = project.ended("--configfile", "tiny.yaml")
    assert printed.count(MOVED) == printed.count(SIMULATED) == (version != "0.1.0")
    # layouts that have changed since: made again from the runs
    assert {path.stem for path in project.out().rglob("*.earlier")} == made_again
    now = project.records()
    assert {name: now[name] for name in records} == records
    assert contents.items() <= project.contents().items()
    assert len(now) - len(records) == summary["runs"]["infill"] + summary["runs"]["final"] == 3
    found, before = project.summary(), summary["materials"]["field"]
    assert found["runs"] == summary["runs"]
    field = found["materials"]["field"]
    assert field["target"] == before["target"]
    assert field["rms"] < before["rms"]
    for key, within in (("parameters", 0.02), ("calibrated", 0.01), ("rms_fresh", 0.01)):
        assert field[key] == pytest.approx(before[key], rel=within)
    assert "Nothing to be done" in project.run("--configfile", "tiny.yaml").stdout
