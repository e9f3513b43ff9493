"""Runs of an earlier case that are taken over, and those that are not."""

import pytest

from radcal.calibration.reuse import reuse_runs
from radcal.config.stages import STAGES
from radcal.errors import ConfigError
from radcal.seeds import draw_seeds
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore

START = [10.0, 14.0, 21.0, 3.0]
INSIDE, AT_ENDS, OUTSIDE = [11.0, 12.5, 20.0, 4.0], [8.0, 15.0, 19.0, 5.0], [11.0, 15.5, 20.0, 4.0]
NARROW = [[8, 12], [12, 15], [19, 22], [2, 5]]


@pytest.fixture
def made(build_case, scene, geometry, tmp_path):
    """Function that makes a case of two draws of speckle, and its runner on a store of a given name."""

    def make(store, bounds, **keys):
        dyke = {"calibrate": True, "bounds": bounds, "start": START}
        case = build_case(
            materials={"dyke": dyke, "grass": {"parameters": [10.0, 14.0, 6.0, 4.0]}},
            simulator={"kind": "builtin", "draws": 2},
            **keys,
        )
        simulator = BuiltinSimulator(geometry, case.radar, case.laws)
        stage = STAGES["reference_run"].of(case)
        return stage, Runner(RunStore(tmp_path / store), simulator, geometry, scene.identity, stage)

    return make


def run_all(case, runner, *points):
    """Hashes of the draws of some runs, by the parameters of the dyke."""
    return {
        tuple(x): [runner.run({**case.start_parameters, "dyke": list(x)}, seed).key for seed in draw_seeds(case)]
        for x in points
    }


def test_runs_inside_of_the_bounds_are_taken_with_their_draws(made, tmp_path):
    """Ends of the bounds belong to them; the reference run is copied, and counts for itself."""
    keys = run_all(*made("earlier", [[0, 50]] * 4), START, INSIDE, AT_ENDS, OUTSIDE)
    case, runner = made("mine", NARROW)
    taken = {tuple(run.parameters["dyke"]): run for run in reuse_runs(case, runner, tmp_path / "earlier")}
    assert set(taken) == {tuple(INSIDE), tuple(AT_ENDS)}
    assert taken[tuple(INSIDE)].key == keys[tuple(INSIDE)][0]
    assert all(run.draws == (keys[x][1],) for x, run in taken.items())
    assert all(run.parameters["grass"] == [10.0, 14.0, 6.0, 4.0] for run in taken.values())
    copied = {path.stem for path in (tmp_path / "mine").glob("*.h5")}
    assert copied == {*keys[tuple(START)], *keys[tuple(INSIDE)], *keys[tuple(AT_ENDS)]}


def test_a_run_without_a_draw_is_left_out(made, tmp_path):
    """Its statistics would scatter more than those of the others. The reference run makes a draw that it lacks."""
    keys = run_all(*made("earlier", [[0, 50]] * 4), START, INSIDE, AT_ENDS)
    for x in (START, AT_ENDS):
        (tmp_path / "earlier" / f"{keys[tuple(x)][1]}.h5").unlink()  # killed between its draws
    (taken,) = reuse_runs(*made("mine", NARROW), tmp_path / "earlier")
    assert taken.key == keys[tuple(INSIDE)][0]
    assert {path.stem for path in (tmp_path / "mine").glob("*.h5")} == {*keys[tuple(INSIDE)], keys[tuple(START)][0]}
    (tmp_path / "earlier" / f"{keys[tuple(INSIDE)][1]}.h5").unlink()
    with pytest.raises(ConfigError, match=r"fewer than the 2 speckle draws of this case \(simulator.draws\)"):
        reuse_runs(*made("other", NARROW), tmp_path / "earlier")


def test_damaged_runs_of_the_earlier_case_are_left_out_and_stay_where_they_are(made, tmp_path):
    keys = run_all(*made("earlier", [[0, 50]] * 4), START, INSIDE, AT_ENDS)
    for damaged in keys[tuple(AT_ENDS)]:
        path = tmp_path / "earlier" / f"{damaged}.h5"
        path.write_bytes(path.read_bytes()[:-9] + b"not so long")
    before = {path: path.read_bytes() for path in (tmp_path / "earlier").iterdir()}
    (taken,) = reuse_runs(*made("mine", NARROW), tmp_path / "earlier")
    assert [taken.key, *taken.draws] == keys[tuple(INSIDE)]
    assert {path: path.read_bytes() for path in (tmp_path / "earlier").iterdir()} == before


def test_runs_of_another_seed_or_outside_of_the_bounds_alone_are_refused(made, tmp_path):
    earlier, runner = made("earlier", [[0, 50]] * 4)
    run_all(earlier, runner, INSIDE)
    other, theirs = made("mine", NARROW, seed=7)
    with pytest.raises(ConfigError, match=r"design.reuse: none of the 2 runs .* noise_seed"):
        reuse_runs(other, theirs, tmp_path / "earlier")
    run_all(*made("far", [[0, 50]] * 4), OUTSIDE)
    with pytest.raises(ConfigError, match=r"none of the 1 runs .* materials.dyke is outside its bounds"):
        reuse_runs(*made("mine", NARROW), tmp_path / "far")


def test_the_target_without_an_earlier_case_says_what_is_missing(made):
    with pytest.raises(ConfigError, match=r"^design\.reuse is missing, expected the name of the earlier case"):
        reuse_runs(*made("mine", NARROW), None)
