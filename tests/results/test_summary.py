"""The numbers of summary.json against numbers by hand."""

import json
from dataclasses import replace

import numpy as np
import pytest
from archives import changed_findings, changed_material, changed_target, configured
from scipy.special import ndtr

from radcal.findings import Finding
from radcal.results.summary import numbered_jobs, sentences, summarise, wall_seconds
from radcal.words import sentence


def test_counts_add_up(made):
    summary = summarise(made.archive)
    wanted = {"reference": 1, "design": 4, "infill": 2, "final": 1, "total": 8, "search": 6}
    assert summary["runs"] == {**wanted, "registration": 0, "reused": 0}
    assert summary["iterations"] == 2
    assert (summary["converged"], summary["stop_reason"]) == (False, "unreachable")
    assert summary["wall_seconds"] == {}


def test_materials(made):
    materials = summarise(made.archive, {"design": 3.0})["materials"]
    dyke, beans = materials["dyke"], materials["stem beans"]
    best = made.history.runs[6]
    assert dyke["parameters"] == dict(zip(("X1", "X2", "X3", "X4"), best.scores["dyke"].parameters, strict=True))
    assert dyke["bounds"] == [[0.0, 50.0]] * 4
    assert dyke["rms"] == best.scores["dyke"].rms
    assert dyke["mse"] == pytest.approx(dyke["rms"] ** 2)
    assert dyke["rms_start"] == made.history.runs[0].scores["dyke"].rms
    assert list(dyke["target"].values()) == made.targets["dyke"].dp.tolist()
    assert dyke["calibrated"]["xi"] == pytest.approx(dyke["target"]["xi"] + 1e-6, abs=1e-12)
    assert dyke["rms_sampling"] == 0.004
    # four runs of the design and two of infill: the reference is not counted
    assert dyke["runs_to_tolerance"] == 6
    assert (dyke["stop_reason"], beans["stop_reason"]) == ("rms", "unreachable")
    assert beans["runs_to_tolerance"] is None
    assert beans["parameters"]["X1"] == 50.0
    assert "hidden" in dyke
    assert "hidden" not in beans
    assert "law_difference_db" not in beans
    first = (
        "sigma0 of 2 materials: 2 are determined at some angles (dyke, stem beans). Unchecked: radiometry. The "
        "search is not finished."
    )
    summary = summarise(made.archive)
    assert summary["verdict"] == first
    assert summary["fits"] is dyke["fits"] is True
    # the made-up bands do not hold the made-up laws
    assert [said.split(": ")[:2] for said in summary["warnings"]] == [["warning", "dyke"], ["warning", "stem beans"]]
    said = [first, dyke["verdict"], beans["verdict"], *summary["warnings"], dyke["sentence"], beans["sentence"]]
    assert sentences(made.archive) == said
    assert (dyke["looks"], dyke["looks_nominal"]) == (4.0, 4.0)


def test_findings_are_data_and_sentences(made):
    numbers = {"error_db": 2.0, "p05_db": 1.4, "p95_db": float("nan")}
    one = Finding("fixed_law", "warning", "unused", numbers, "materials.unused.parameters")
    archive = changed_findings(made.archive, one)
    summary = summarise(archive)
    (found,) = summary["findings"]
    assert {key: found[key] for key in ("code", "severity", "about", "do")} == {
        "code": "fixed_law", "severity": "warning", "about": "unused", "do": "materials.unused.parameters",
    }  # fmt: skip
    assert found["numbers"] == {"error_db": 2.0, "p05_db": 1.4, "p95_db": None}
    assert found["text"].startswith("unused: the image minus its fixed law is +2.00 dB")
    assert summary["next"] == ["check materials.unused.parameters"]
    assert sentences(archive)[0].endswith("check materials.unused.parameters. The search is not finished.")


def test_what_the_fixed_laws_say_is_listed(made):
    found = summarise(made.archive)["fixed_laws"]
    assert found["levels_db"] == [[-0.31, 0.12, 0.43]]
    assert found["errors_db"] == {"unused": [-0.52, 0.07, 0.61]}
    assert found["radiometry"] == [
        {"exponent": 0.14, "error": 0.08, "term": 1, "chance": 0.0, "materials": ["unused"], "found": 0}
    ]


def test_warnings_on_the_image_follow_the_verdicts(made):
    told = [Finding("heading_missing", "warning", about) for about in ("a key", "another")]
    archive = replace(made.archive, notes=(Finding("repeats", "note", "simulator"), *told, told[0]))
    summary = summarise(archive)
    assert summary["warnings"][:2] == [*map(sentence, told)]
    assert sentences(archive)[3:5] == [*map(sentence, told)]


def test_distances_of_two_normals(made):
    shift = 0.5
    dyke = made.archive.materials["dyke"]
    dp, moved = dyke.dp.copy(), np.array([shift, 1.0, 0.0])
    dp[dyke.best] = moved
    target = np.array([0.0, 1.0, 0.0])
    archive = changed_material(changed_target(made.archive, "dyke", dp=target), "dyke", dp=dp)
    dyke = summarise(archive)["materials"]["dyke"]
    assert dyke["ks"] == pytest.approx(2.0 * ndtr(shift / 2.0) - 1.0, rel=1e-5)
    assert dyke["hellinger"] == pytest.approx(np.sqrt(1.0 - np.exp(-(shift**2) / 8.0)), rel=1e-6)


def test_the_registration_run_counts_as_a_reference_run(made):
    before, runs = summarise(made.archive)["runs"], made.archive.runs
    kinds = runs.kind.astype("<U12")
    kinds[np.flatnonzero(kinds == "design")[0]] = "registration"
    found = summarise(replace(made.archive, runs=replace(runs, kind=kinds)))["runs"]
    assert (found["reference"], found["design"]) == (before["reference"] + 1, before["design"] - 1)
    assert (found["total"], found["registration"]) == (before["total"], 1)


def test_displacements_and_their_error_are_lengths(build_archive, tmp_path):
    """1.5 pixels in both directions, of which half a pixel is wrong."""
    found = summarise(build_archive(tmp_path, moved=True).archive)["registration"]
    assert found["rms_px"] == pytest.approx(1.5 * np.sqrt(2.0))
    assert found["error_px"] == pytest.approx(0.5 * np.sqrt(2.0))
    assert found["uncertainty_px"] == pytest.approx(0.2)


def test_numbers_are_finite_or_null(made):
    archive = changed_target(made.archive, "dyke", rms_sampling=float("nan"))
    rms = archive.materials["stem beans"].rms.copy()
    rms[0] = np.inf
    archive = changed_material(archive, "stem beans", rms=rms)
    summary = summarise(archive, {"design": float("nan")})
    assert summary["materials"]["dyke"]["rms_sampling"] is None
    assert summary["materials"]["stem beans"]["rms_start"] is None
    assert summary["wall_seconds"] == {"design": None}
    assert json.loads(json.dumps(summary, allow_nan=False)) == summary


def test_wall_seconds_by_stage(tmp_path):
    header = "s\th:m:s\tmax_rss\n"
    files = {"geometry": ["1.25"], "design_0": ["2.0"], "design_12": ["0.5", "0.25"], "final_runs": ["3.0"]}
    for name, rows in files.items():
        (tmp_path / f"{name}.tsv").write_text(header + "".join(f"{s}\t0:00:01\t10\n" for s in rows))
    (tmp_path / "notes.txt").write_text("no benchmark")
    assert wall_seconds(tmp_path) == {"geometry": 1.25, "design": 2.75, "final_runs": 3.0}
    assert wall_seconds(tmp_path / "nowhere") == {}
    # design_12 is left over from a larger design
    assert wall_seconds(tmp_path, {"design": 12, "verify": 0}) == {"geometry": 1.25, "design": 2.0, "final_runs": 3.0}
    assert wall_seconds(tmp_path, {"design": 13})["design"] == 2.75


def test_numbered_jobs_are_those_of_the_archive(made):
    """Four runs of the design in chunks of four, and of three; two iterations."""
    for chunk, chunks in ((4, 1), (3, 2), (1, 4)):
        archive = configured(made.archive, design={"size": 4, "chunk": chunk})
        assert numbered_jobs(archive) == {"design": chunks, "train": 2, "propose": 2, "verify": 2}
