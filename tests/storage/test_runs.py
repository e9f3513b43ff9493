import errno
import fcntl
import hashlib
import json
from dataclasses import replace

import h5py
import numpy as np
import pytest
from runner_samples import Counting, X
from sealed import changed

from radcal.errors import SimulatorError, StoreError
from radcal.laws import LAWS
from radcal.simulators.runner import Runner
from radcal.storage.files import digest
from radcal.storage.runs import Record, RunStore


@pytest.fixture
def simulator(geometry):
    return Counting(geometry.shape)


@pytest.fixture
def store(tmp_path):
    return RunStore(tmp_path / "runs")


@pytest.fixture
def runner(store, simulator, geometry, case):
    return Runner(store, simulator, geometry, "scene", case)


def files(store):
    return sorted(path.name for path in store.folder.glob("[!.]*")) if store.folder.exists() else []


def test_a_run_with_the_pixels_of_another_geometry_is_made_again(runner, store, simulator, geometry, case):
    """A later version may see a little more or less of the ground: pixels in an order of their own."""
    material = geometry.material.copy()
    material[tuple(np.argwhere(material == 1)[3])] = 0
    other = replace(geometry, material=material)
    key = Runner(store, simulator, other, "scene", case).run(X, 7).key
    image = simulator.run(X, 7)
    calls = simulator.calls
    for _ in range(2):
        found = runner.run(X, 7)
        assert found.key == key
        assert found.seconds >= 0
        assert found.pixels_db["dyke"].dtype == np.float32
        np.testing.assert_array_equal(found.pixels_db["dyke"], image.ravel()[geometry.pixels("dyke")])
    assert simulator.calls == calls + 1


def test_key_changes_with_all_that_changes_the_numbers(store, geometry, build_case, monkeypatch):
    monkeypatch.setitem(LAWS.builtin, "other", LAWS["mangia"])

    def key(x=X, seed=7, scene="scene", version=1, **sections):
        runner = Runner(store, Counting(geometry.shape, version), geometry, scene, build_case(**sections))
        return digest(runner.description(x, seed))

    def table(angles_deg, **radar):
        law = {"calibrate": True, "law": "tabulated", "angles_deg": angles_deg, "bounds": [[-30, 0]] * 2}
        x = {"dyke": [-9.0, -12.0], "grass": X["grass"]}
        return key(x, materials={"dyke": law, "grass": grass}, radar={"altitude_m": 1000.0, **radar},
                   measurement={"synthetic": {"parameters": {"dyke": [-9, -12]}}})  # fmt: skip

    grass = {"parameters": X["grass"]}
    changes = ({"altitude_m": 1001.0}, {"looks": 3}, {"nesz_db": -21.0}, {"look_side": "left"}, {"band": "C"})
    keys = [
        key(), key(seed=8), key(scene="other scene"), key(version=2),
        key({**X, "dyke": [6.1, 14.2, 21.5, 3.3 + 1e-15]}), key({**X, "grass": [10.0, 14.0, 6.0, 4.5]}),
        key({"dyke": X["grass"], "grass": X["dyke"]}),
        *(key(radar={"altitude_m": 1000.0, **change}) for change in changes),
        key(materials={"dyke": {"calibrate": True, "law": "other"}, "grass": grass}),
        table([20, 40]), table([20, 41]), table([20, 40], frequency_ghz=9.6), table([20, 40], frequency_ghz=9.65),
    ]  # fmt: skip
    assert len(set(keys)) == len(keys) == 17


def test_key_of_a_run_is_that_of_earlier_versions(store, geometry, case):
    # finished runs are found under this name in every results folder there is
    description = Runner(store, Counting(geometry.shape), geometry, "scene", case).description(X, 7)
    assert digest(description) == "785489fb591a27106056"
    assert "frequency_ghz" not in description["pass"]


def test_values_of_the_environment_are_in_the_key_and_not_in_the_record(store, geometry, case):
    class Secretive(Counting):
        @property
        def identity(self):
            return {"kind": "command", "environment": {"KEY": "s3cr3t", "EMPTY": ""}}

    runner = Runner(store, Secretive(geometry.shape), geometry, "scene", case)
    record = runner.run(X, 7)
    # the key that such runs always had
    assert record.key == digest(runner.description(X, 7)) == "982df8fa1fdab920ecb2"
    assert b"s3cr3t" not in store.path(record.key).read_bytes()
    described = store.description(record.key)["simulator"]
    assert described["environment_sha256"]["KEY"] == hashlib.sha256(b"s3cr3t").hexdigest()
    assert "environment" not in described
    # records of before hold the values: found as they are, and told of without them
    with changed(store.path(record.key)) as file:
        file.attrs["description"] = json.dumps(runner.description(X, 7))
    assert store.get(record.key, ["dyke"]) is not None
    assert "s3cr3t" not in json.dumps(store.description(record.key))


def test_key_does_not_change_with_how_runs_are_used(store, geometry, build_case):
    simulator = Counting(geometry.shape)
    grass = {"parameters": X["grass"]}
    changes = [
        {},
        {"case": "other", "seed": 99},
        {"target": {"pixels": 60, "margin_px": 3}},
        {"stop": {"rms": 1e-3, "max_runs": 30, "stagnation_runs": 5}},
        {"optimiser": {"population": 20, "objective": "rms"}},
        {"surrogate": {"outputs": "direct"}},
        {
            "objective": "classes",
            "simulator": {"draws": 1},
            "target": {"incidence_classes": 3, "looks": "nominal", "priors": False, "incidence_error_deg": 0.5},
            "validation": {"rows": 20, "means": 10, "keep": "odd"},
        },
        {"design": {"sampler": "monte_carlo", "size": 3}},
        {"measurement": {"source": "synthetic", "synthetic": {"seed": 8, "offset_db": 2.0}}},
        {"materials": {"dyke": {"calibrate": True, "bounds": [[0, 60]] * 4, "start": [1, 1, 1, 1]}, "grass": grass}},
        {"materials": {"grass": grass, "dyke": {"calibrate": True}}},
    ]
    tuples = {name: tuple(np.float64(v) for v in x) for name, x in reversed(X.items())}
    keys = {
        Runner(RunStore(store.folder), simulator, geometry, "scene", build_case(**change)).run(x, 7).key
        for change in changes
        for x in (X, tuples)
    }
    assert len(keys) == 1
    assert simulator.calls == 1


def truncate(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def other_hash(path):
    with changed(path) as file:
        file.attrs["hash"] = "0" * 20


def no_pixels(path):
    with changed(path) as file:
        del file["pixels_db"]


def no_attributes(path):
    with changed(path) as file:
        del file.attrs["seconds"]


@pytest.mark.parametrize("damage", [truncate, other_hash, no_pixels, no_attributes], ids=lambda f: f.__name__)
def test_damaged_record_is_set_aside_and_made_again(runner, store, simulator, damage, caplog):
    first = runner.run(X, 7)
    path = store.path(first.key)
    damage(path)
    again = runner.run(X, 7)
    assert simulator.calls == 2
    np.testing.assert_array_equal(again.pixels_db["dyke"], first.pixels_db["dyke"])
    assert files(store) == [f"{first.key}.damaged", f"{first.key}.h5"]
    assert f"{first.key}.damaged" in caplog.text
    assert "made again" in caplog.text
    runner.run(X, 7)
    assert simulator.calls == 2


class Broken(Counting):
    def __init__(self, shape, image):
        super().__init__(shape)
        self.image = image

    def run(self, parameters, noise_seed):
        return self.image


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_pixels_that_are_not_finite_leave_no_record(store, geometry, case, bad):
    image = np.zeros(geometry.shape, dtype=np.float32)
    image.ravel()[geometry.pixels("dyke")[:3]] = bad
    n = geometry.pixels("dyke").size
    said = rf"run \w+: 3 of {n} pixels of 'dyke' .*dyke = \[6\.1, 14\.2, 21\.5, 3\.3\]"
    with pytest.raises(SimulatorError, match=said):
        Runner(store, Broken(geometry.shape, image), geometry, "scene", case).run(X, 7)
    assert files(store) == []


def test_nan_where_no_calibrated_material_is_seen_is_kept(store, geometry, case):
    image = np.full(geometry.shape, np.nan, dtype=np.float32)
    image.ravel()[geometry.pixels("dyke")] = 1.0
    record = Runner(store, Broken(geometry.shape, image), geometry, "scene", case).run(X, 7)
    assert (record.pixels_db["dyke"] == 1).all()


@pytest.mark.parametrize("shape", [(10, 10), (5,)])
def test_image_of_another_size_leaves_no_record(store, geometry, case, shape):
    rows, columns = geometry.shape
    with pytest.raises(SimulatorError, match=rf"the simulator's image has .* expected \({rows}, {columns}\)"):
        Runner(store, Broken(geometry.shape, np.zeros(shape)), geometry, "scene", case).run(X, 7)
    assert files(store) == []


def test_record_of_another_schema_is_refused_and_kept(runner, store, simulator):
    key = runner.run(X, 7).key
    with changed(store.path(key)) as file:
        file.attrs["schema"] = 99
    with pytest.raises(StoreError, match=rf"{key}\.h5: written with schema 99"):
        runner.run(X, 7)
    assert files(store) == [f"{key}.h5"]
    assert simulator.calls == 1


def test_record_that_cannot_be_reached_is_no_damaged_record(runner, store, simulator, monkeypatch):
    key = runner.run(X, 7).key

    def refuse(*_, **__):
        raise OSError(errno.EMFILE, "too many open files")

    monkeypatch.setattr(h5py, "File", refuse)
    with pytest.raises(StoreError, match=rf"{key}\.h5: cannot be read"):
        runner.run(X, 7)
    monkeypatch.undo()
    assert runner.run(X, 7).key == key
    assert simulator.calls == 1
    assert files(store) == [f"{key}.h5"]


def test_a_locked_record_can_be_read(runner, store, simulator):
    key = runner.run(X, 7).key
    with store.path(key).open("rb") as handle:
        fcntl.flock(handle, fcntl.LOCK_EX)
        assert runner.run(X, 7).key == key
    assert simulator.calls == 1


def test_a_record_keeps_what_an_earlier_one_held(store):
    store.put(Record("k", {"a": np.zeros(2, np.float32)}, np.ones((2, 2), np.float32), 0.1), {})
    store.put(Record("k", {"b": np.ones(2, np.float32)}, None, 0.1), {})
    record = store.get("k", ["a", "b"], image=True)
    np.testing.assert_array_equal(record.pixels_db["a"], [0, 0])
    np.testing.assert_array_equal(record.image_db, np.ones((2, 2)))
    # what is put last counts
    store.put(Record("k", {"a": np.array([3, 4], np.float32)}, np.full((2, 2), 5, np.float32), 0.1), {})
    latest = store.get("k", ["a", "b"], image=True)
    np.testing.assert_array_equal(latest.pixels_db["a"], [3, 4])
    np.testing.assert_array_equal(latest.image_db, np.full((2, 2), 5))
    assert store.get("k", ["a", "c"]) is None


def test_the_largest_difference_counts_in_either_direction():
    def record(**pixels):
        return Record("k", {name: np.array(values, np.float32) for name, values in pixels.items()}, None, 0.1)

    one = record(a=[1.0, 2.0], b=[5.0], c=[])
    assert one.largest_difference_db(record(a=[1.5, 2.0], b=[8.5], c=[])) == 3.5
    assert one.largest_difference_db(record(a=[1.0, -2.25], b=[5.0], c=[])) == 4.25
    assert record().largest_difference_db(record()) == 0.0


def outside(build_case, radar, **simulator):
    """A case of an external program."""
    law = {"calibrate": True, "law": "external", "names": ["a", "n"], "bounds": [[0, 50], [0, 50]]}
    return build_case(
        simulator={"kind": "command", "command": ["sh"], "output": {"file": "i.npy", "scale": "db"}, **simulator},
        materials={"dyke": law, "grass": {"law": "external"}},
        measurement={"synthetic": {"parameters": {"dyke": [9, 12]}}},
        radar={"altitude_m": 1000.0, **radar},
    )


OUTSIDE = {"dyke": [6.1, 14.0], "grass": []}


def test_what_a_program_is_not_told_is_no_part_of_its_runs(store, simulator, geometry, build_case):
    def run(radar, **options):
        return Runner(store, simulator, geometry, "scene", outside(build_case, radar, **options)).run(OUTSIDE, 7)

    first = run({"nesz_db": -20.0})
    for radar in ({"nesz_db": -60.0}, {"looks": 1}, {"range_resolution_m": 3.0, "azimuth_resolution_m": 9.0}):
        assert run(radar).key == first.key
    assert simulator.calls == 1
    # what the image's grid, its masks of materials or the program's input file may depend on
    told = {"input": {}}
    others = [run({"altitude_m": 1001.0}), run({"radiometry": "beta0"}), run({}, **told), run({"looks": 1}, **told)]
    assert len({first.key, *(record.key for record in others)}) == 5
    assert simulator.calls == 5
    # an input file without the pass tells nothing either
    assert run({"looks": 1}, input={"radar": False}).key == run({}, input={"radar": False}).key


def test_key_knows_which_parameters_are_whole(store, geometry, build_case):
    case = outside(build_case, {})
    whole = case.materials["dyke"].model_copy(update={"integer": ["n"]})
    other = case.model_copy(update={"materials": {**case.materials, "dyke": whole}})
    plain, counted = (
        Runner(store, Counting(geometry.shape), geometry, "scene", item).description(OUTSIDE, 7)
        for item in (case, other)
    )
    assert counted["materials"]["dyke"].pop("integer") == ["n"]
    assert counted == plain
