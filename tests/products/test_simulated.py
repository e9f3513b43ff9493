"""Forward runs without a measurement."""

import json
from pathlib import Path
from typing import get_args

import h5py
import numpy as np
import pandas as pd
import pytest
import rasterio
import yaml
from commands import typed
from raster_files import write_raster

from radcal.cli.simulate import forward_case
from radcal.config import Radar, load_forward
from radcal.errors import ConfigError
from radcal.products import PRODUCTS, applied
from radcal.products.simulated import forward
from radcal.sections.ppi import Products
from radcal.seeds import noise_seed
from radcal.storage.runs import RunStore


@pytest.fixture
def case(tmp_path):
    """Case with two passes over a scene in slant range."""
    labels = np.ones((30, 40), dtype=np.uint8)
    labels[:, 25:] = 2
    write_raster(tmp_path / "labels.tif", labels)
    (tmp_path / "names.json").write_text(json.dumps({"1": "field", "2": "lake"}))
    path = tmp_path / "case.yaml"
    path.write_text(
        f"case: small\nscene: {{source: slant_range, labels: {tmp_path}/labels.tif, names: {tmp_path}/names.json, "
        "near_incidence_deg: 20, far_incidence_deg: 45}\n"
        "radar: [{polarisation: HH}, {polarisation: VV}]\n"
        "materials: {field: {parameters: [-20, 8, 6, 4]}, lake: {parameters: [-30, 5, 20, 9]}}\n"
    )
    return path


def simulate(case, *options, code=0):
    return typed("simulate", case, "--results", case.parent / "results", *options, code=code)


def write_materials(folder, **materials):
    path = folder / "other.yaml"
    path.write_text(yaml.safe_dump({"materials": materials}))
    return path


def test_a_run_that_is_stored_is_not_made_again(tmp_path, case):
    """Two passes with the random numbers of final runs; the second time both come from the store."""
    other = load_forward([case])
    first, second = (forward(other, tmp_path / "out", tmp_path / "runs")[1] for _ in range(2))
    assert [one.kept for one in first] == [False, False]
    assert [one.kept for one in second] == [True, True]
    store = RunStore(tmp_path / "runs")
    for one, again in zip(first, second, strict=True):
        assert one.key == again.key
        np.testing.assert_array_equal(one.image_db, again.image_db)
        assert store.description(one.key)["noise_seed"] == noise_seed(other, fresh=True)
    assert first[0].key != first[1].key
    assert first[0].image_db[:, :25].mean() > first[0].image_db[:, 25:].mean() + 3.0


def test_complex_looks_have_the_power_of_the_image_and_documented_attributes(tmp_path, case):
    """One of the two materials has texture, of which the looks share the power."""
    textured = ("--set", "materials.lake.looks=1.5")
    simulate(case, *textured, "--product", "complex")
    page = (Path(__file__).parents[2] / "docs/predictions.md").read_text(encoding="utf-8")
    told = page.partition("`complex.h5` holds")[2].partition("\n\n")[0]
    runs = RunStore(tmp_path / "results/small/runs")
    for number, polarisation in (("", "HH"), ("_pass2", "VV")):
        with h5py.File(tmp_path / f"results/small/simulated/complex{number}.h5") as file:
            for name in file.attrs:
                assert f"`{name}`" in told or name in Radar.model_fields
            for name in file["looks"].attrs:
                assert f"`{name}`" in told
            assert (file.attrs["product"], file.attrs["polarisation"]) == ("complex", polarisation)
            assert {"radiometry", "range_spacing_m", "azimuth_spacing_m"} <= set(file.attrs)
            assert "random" in file["looks"].attrs["phases"]
            looks, record = file["looks"][()], runs.get(file.attrs["run"], [], image=True)
        power = np.mean(np.abs(looks.astype(np.complex128)) ** 2, axis=0)
        np.testing.assert_allclose(10.0 * np.log10(power), record.image_db, atol=2e-5)


def test_materials_of_a_file_replace_those_of_the_same_names(tmp_path, case):
    other = write_materials(tmp_path, field={"law": "constant_gamma", "parameters": [-8]})
    done = simulate(case, "--materials", other)
    assert done.stdout.startswith(
        f"{other} has the laws of field; the other materials keep the laws of {case}: lake.\n"
    )
    box = {"calibrate": True, "bounds": [[-40, 0], [0, 9], [0, 9], [0, 9]], "start": [-17, 1, 2, 3]}
    both = write_materials(tmp_path, field={"law": "constant_gamma", "parameters": [-8]}, lake=box)
    done = simulate(case, "--materials", both, "--replace")
    assert done.stdout.startswith("Simulated at the start, because of calibrate: true: lake.\n")


def test_an_image_of_another_run_is_replaced_only_on_demand(tmp_path, case):
    folder = tmp_path / "results/small/simulated"
    simulate(case)
    before = {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}
    assert folder / "simulated_pass2.tif" in before
    simulate(case)  # the same image
    darker = ("--set", "materials.field.parameters=[-25, 8, 6, 4]", "--set", "scene.far_incidence_deg=44")
    done = simulate(case, *darker, code=1)
    assert done.stderr.count("\n") == 1
    assert f"radcal: {folder}/simulated.tif: is the image of run " in done.stderr
    assert "give --replace to replace it, or --out with another folder." in done.stderr
    assert {path: path.read_bytes() for path in folder.rglob("*.tif")}.items() <= before.items()
    assert (folder / "passes/1/geometry.h5").read_bytes() == before[folder / "passes/1/geometry.h5"]
    simulate(case, *darker, "--out", tmp_path / "dark")
    (folder / "simulated.tif").unlink()  # of the second pass, too
    assert "simulated_pass2.tif: is the image of run " in simulate(case, *darker, code=1).stderr
    (folder / "simulated.tif").write_bytes(b"no raster")
    assert "simulated.tif: is no readable image of a run, and not of run " in simulate(case, code=1).stderr
    simulate(case, *darker, "--replace")
    assert (folder / "simulated.tif").read_bytes() == (tmp_path / "dark/simulated.tif").read_bytes()


def test_all_mistakes_of_a_file_of_materials_are_told_at_once(tmp_path, case):
    other = write_materials(
        tmp_path,
        field={"law": "constant_gama", "parameters": [-8]},
        lake={"law": "constant_gamma", "parameters": [-8, 2]},
        shore={"paramters": [1, 2, 3, 4]},
    )
    done = simulate(case, "--materials", other, code=1)
    assert [",".join(line.split(",")[:2]) for line in done.stderr.splitlines()] == [
        f"radcal: {other}, line 12: unknown key materials.shore.paramters (did you mean 'parameters'?).",
        f"radcal: {other}, line 2: materials.field: law is 'constant_gama'",
        f"radcal: {other}, line 8: materials.lake: parameters has 2 numbers",
    ]
    law = {"law": "constant_gamma", "parameters": [-8]}
    done = simulate(case, "--materials", write_materials(tmp_path, feld=law, lake=law, shore=law), code=1)
    assert done.stderr.splitlines() == [
        "radcal: materials.feld: not in the scene (did you mean 'field'?).",
        "radcal: materials.shore: not in the scene (known: field, lake).",
    ]
    open_ones = write_materials(tmp_path, field={**law, "parameters": ["FILL_IN"]}, lake={"parameters": "FILL_IN"})
    done = simulate(case, "--materials", open_ones, code=1)
    assert done.stderr.count(".parameters is FILL_IN, expected fixed parameters") == 2
    done = simulate(case, "--materials", tmp_path / "names.json", code=1)
    assert done.stderr.endswith(
        f"--materials: {tmp_path}/names.json has no section materials, expected one, as calibrated.yaml has it.\n"
    )


def test_laws_of_a_land_cover_map_are_those_of_the_case(tmp_path):
    case = tmp_path / "map.yaml"
    scene = {"source": "raster", "elevation": "a.tif", "materials": "b.tif", "landcover": "nlcd", "vertical_datum": "x"}
    case.write_text(yaml.safe_dump({"scene": scene}))
    materials = {"moss": {}, "open_water": {"parameters": [-17], "law": "constant_gamma"}}
    found, remarks = forward_case(case, None, write_materials(tmp_path, **materials))
    assert (found.materials["moss"].parameters, remarks) == ([-20.0], [])
    with pytest.raises(
        ConfigError, match=r"other.yaml, line 2: materials.mos: a material that is not calibrated needs param"
    ):
        forward_case(case, None, write_materials(tmp_path, mos={}))


def test_members_have_files_and_quantiles(tmp_path, case, monkeypatch):
    """All have the speckle of the run itself, so that their images differ as their laws do."""

    def members_of(archive, other, count):
        assert (archive, count) == ("of results/small", 3)
        laws = ([-20.0 + 2.0 * k, 8.0, 6.0, 4.0] for k in range(count))
        field = other.materials["field"]
        each = ({**other.materials, "field": field.model_copy(update={"parameters": law})} for law in laws)
        return [other.model_copy(update={"materials": one}) for one in each]

    monkeypatch.setattr("radcal.results.archive.read_finished", lambda folder: f"of results/{folder.name}")
    monkeypatch.setattr("radcal.products.applied.members_of", members_of)
    export = tmp_path / "results/small/export"
    export.mkdir(parents=True)
    (export / "calibrated.yaml").write_text("materials: {field: {parameters: [-17, 8, 6, 4]}}\n")
    done = simulate(case, "--draws", "3", "--product", "complex", "--set", "radar=[{nesz_db: -90}, {nesz_db: -90}]")
    folder = tmp_path / "results/small/simulated"

    def image(name):
        with rasterio.open(folder / name) as raster:
            return raster.read(1)[:, :15]

    for number in ("", "_pass2"):
        low, run, high = (image(f"{name}{number}.tif") for name in ("simulated_p05", "simulated", "simulated_p95"))
        np.testing.assert_allclose(high - low, 3.6, atol=0.01)  # of -20, -18 and -16 dB
        np.testing.assert_allclose(run - low, 2.8, atol=0.01)
        assert [(folder / f"draws/{k}/complex{number}.h5").is_file() for k in (1, 2, 3)] == [True] * 3
    table = pd.read_csv(folder / "draws.csv")
    assert list(table) == ["pass", "member", "run", "field_db", "lake_db"]
    assert table[["pass", "member"]].to_numpy().tolist() == [[1, 1], [2, 1], [1, 2], [2, 2], [1, 3], [2, 3]]
    np.testing.assert_allclose(np.diff(table.field_db[table["pass"] == 2]), 2.0, atol=0.01)
    assert np.diff(table.lake_db[table["pass"] == 1]).max() < 0.6  # the brighter field reaches over the border
    assert "\n1     field_db" in done.stdout


def test_a_case_can_ask_for_each_product():
    assert sorted(get_args(get_args(Products.model_fields["make"].annotation)[0])) == sorted(PRODUCTS)


def test_products_are_made_with_the_laws_of_the_calibration(tmp_path, case, monkeypatch):
    """As of the command with calibrated.yaml, and again into the same folder."""
    law = {"law": "constant_gamma", "parameters": [-8.0]}
    found = {"field": law, "lake": {**law, "parameters": [-19.0]}}
    monkeypatch.setattr(applied, "calibrated_materials", lambda archive: found)
    monkeypatch.setattr(applied, "members_of", lambda archive, other, count: [other] * count)
    asked = load_forward([case], {"simulator": {}})
    asked = asked.model_copy(update={"products": Products(make=["intensity", "complex"], draws=2)})
    for _ in range(2):
        lines = applied.made_with(None, asked, tmp_path / "products", tmp_path / "runs")
    simulate(case, "--materials", write_materials(tmp_path, **found))
    made = (tmp_path / "products/intensity/simulated.tif").read_bytes()
    assert made == (tmp_path / "results/small/simulated/simulated.tif").read_bytes()
    assert (tmp_path / "products/complex/draws/2/complex_pass2.h5").is_file()
    assert sum("members of the posterior" in line for line in lines) == 2
