"""Files that a case names."""

from pathlib import Path

import pytest
from config_samples import flat, mapped, measured
from safe_product import write_product

from radcal.config import Case, case_from, expand_path, input_files
from radcal.config.inputs import check_reuse, executable_path, missing_inputs
from radcal.errors import ConfigError


def test_paths_expand_variables_and_home(tmp_path, monkeypatch):
    (tmp_path / "a b.tif").write_text("")
    monkeypatch.setenv("RADCAL_TEST", str(tmp_path))
    monkeypatch.setenv("HOME", str(tmp_path))
    assert expand_path("${RADCAL_TEST}/a b.tif", "key") == tmp_path / "a b.tif"
    assert expand_path("~/a b.tif", "key") == tmp_path / "a b.tif"
    with pytest.raises(ConfigError, match=r"^key: the file .*/b\.tif does not exist\.$"):
        expand_path("${RADCAL_TEST}/b.tif", "key")
    with pytest.raises(ConfigError, match="is not a file"):
        expand_path(str(tmp_path), "key")  # a folder
    monkeypatch.delenv("RADCAL_TEST")
    with pytest.raises(ConfigError, match=r"^key is '\$\{RADCAL_TEST\}/x' but .* RADCAL_TEST is not set: type export"):
        expand_path("${RADCAL_TEST}/x", "key")


def test_names_that_no_file_has_end_in_a_sentence():
    with pytest.raises(
        ConfigError, match=r"^scene\.labels: the file a{197}\.\.\. cannot be read \(File name too long\)\.$"
    ):
        expand_path("a" * 5000, "scene.labels")
    with pytest.raises(
        ConfigError, match=r"^scene\.labels: the file a\\nb\\x00\.tif does not exist in /.*, the current folder\.$"
    ):
        expand_path("a\nb\0.tif", "scene.labels")


def test_variables_are_expanded_when_the_file_is_read_not_before(monkeypatch):
    monkeypatch.delenv("RADCAL_TEST", raising=False)
    case = case_from(measured(path="${RADCAL_TEST}/a.tif"))
    assert case.measurement.path == "${RADCAL_TEST}/a.tif"
    with pytest.raises(ConfigError, match=r"measurement\.path .* RADCAL_TEST"):
        input_files(case)


def test_input_files_are_those_that_the_case_reads(tmp_path):
    assert input_files(Case()) == {}
    paths = {name: tmp_path / name for name in ("labels.tif", "names.json", "image.tif")}
    for path in paths.values():
        path.write_text("")
    labels, names, image = (str(path) for path in paths.values())
    case = case_from(flat(labels=labels, names=names) | measured(path=image))
    assert input_files(case) == {
        "scene.labels": paths["labels.tif"],
        "scene.names": paths["names.json"],
        "measurement.path": paths["image.tif"],
    }
    files = {"elevation": image, "materials": labels, "names": names}
    assert input_files(case_from(mapped(**files))) == {f"scene.{key}": Path(path) for key, path in files.items()}


def test_what_a_raster_is_read_together_with_is_an_input_too(tmp_path):
    paths = {name: tmp_path / name for name in ("own/a.vrt", "own/a.prj", "other/tile.tif", "names.json")}
    for path in paths.values():
        path.parent.mkdir(exist_ok=True)
        path.write_text("")
    source = '<SourceFilename relativeToVRT="1">../other/tile.tif</SourceFilename>'
    paths["own/a.vrt"].write_text(
        f"<VRTDataset><VRTRasterBand><SimpleSource>{source}</SimpleSource></VRTRasterBand></VRTDataset>"
    )
    keys = {"labels": str(paths["own/a.vrt"]), "names": str(paths["names.json"])}
    case = case_from(flat(**keys, vrt_folders=[str(tmp_path / "other")]) | measured(path=str(paths["names.json"])))
    assert input_files(case) == {
        "scene.labels": paths["own/a.vrt"],
        "scene.labels.0": paths["own/a.prj"],
        "scene.labels.1": paths["other/tile.tif"],
        "scene.names": paths["names.json"],
        "measurement.path": paths["names.json"],
    }
    with pytest.raises(ConfigError, match=r"^scene\.labels: .*a\.vrt cannot be read as a raster \(a\.vrt names"):
        input_files(case_from(flat(**keys) | measured(path=str(paths["names.json"]))))
    with pytest.raises(ConfigError, match=r"scene\.vrt_folders\.0: the file .*gone does not exist"):
        input_files(case_from(flat(**keys, vrt_folders=[str(tmp_path / "gone")]) | measured(path=str(tmp_path / "x"))))


def test_an_earlier_case_without_runs_is_refused(tmp_path):
    case = case_from({"design": {"reuse": "first"}})
    with pytest.raises(ConfigError, match=r"'first', .* expected a case that has runs, of which there are none\.$"):
        check_reuse(case, tmp_path)
    for name, record in (("first", ".partial-a.h5"), ("second", "a.h5")):
        (tmp_path / name / "runs").mkdir(parents=True)
        (tmp_path / name / "runs" / record).touch()
    with pytest.raises(ConfigError, match=r"which has no runs in .*/first/runs, expected one of second\.$"):
        check_reuse(case, tmp_path)
    (tmp_path / "first" / "runs" / "b.h5").touch()
    check_reuse(case, tmp_path)
    check_reuse(case_from({}), tmp_path / "nowhere")


def test_files_of_one_polarisation_of_a_product_are_inputs(tmp_path):
    safe = write_product(tmp_path)
    radar = {"polarisation": "VV", "band": "C"}
    case = case_from({"measurement": {"source": "file", "path": str(safe)}, "radar": radar})
    files = input_files(case)
    assert files["measurement.path"] == safe / "manifest.safe"
    assert sorted(files) == ["measurement.path", *(f"measurement.path.{k}" for k in range(4))]
    assert all("-vv-" in files[f"measurement.path.{k}"].name for k in range(4))
    other = case_from({"measurement": {"source": "file", "path": str(safe)}, "radar": {**radar, "polarisation": "HH"}})
    ((_, problem),) = missing_inputs(other, {})
    assert str(problem) == (
        f"measurement.path: {safe} cannot be read as a Sentinel-1 product (it has VV, radar.polarisation is HH)."
    )


def test_images_of_further_passes_are_inputs_by_their_number(tmp_path):
    images = [tmp_path / "a.npy", tmp_path / "b.npy"]
    for path in images:
        path.touch()
    each = [measured(path=str(path))["measurement"] for path in images]
    case = case_from({"radar": [{"depression_deg": 45}, {"depression_deg": 50}], "measurement": each})
    assert input_files(case) == {"measurement.1.path": images[0], "measurement.2.path": images[1]}


def test_a_program_is_looked_for_on_the_path_that_it_gets(tmp_path):
    program = tmp_path / "sh"
    program.write_text("#!/bin/sh\n")
    program.chmod(0o755)
    assert executable_path("sh", "simulator.command", {"PATH": str(tmp_path)}) == program
    assert executable_path("sh", "simulator.command", {}) != program
    with pytest.raises(ConfigError, match="no program 'ls' on the PATH"):
        executable_path("ls", "simulator.command", {"PATH": str(tmp_path)})
