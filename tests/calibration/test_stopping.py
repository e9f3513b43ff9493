from __future__ import annotations

from dataclasses import replace

import pytest

from radcal.calibration.history import History, Proposal, Run
from radcal.calibration.stopping import decide
from radcal.config import Stop


def run(kind, index, rms, mode="exploit", floor=None, promised=None):
    names = list(rms)
    return Run(
        kind=kind,
        index=index,
        key=f"{kind}{index}",
        seconds=0.0,
        parameters={name: [float(index)] for name in names},
        dp={name: [0.0, 1.0, 0.0] for name in names},
        rms=rms,
        proposals={name: Proposal([float(index)], mode, promised or rms[name], floor) for name in names}
        if kind == "infill"
        else {},
    )


def history(infill, design=(0.5, 0.4), floors=None):
    floors = floors or [None] * len(infill)
    return History(
        [
            run("reference", 0, {"dyke": 0.6}),
            *(run("design", k, {"dyke": rms}) for k, rms in enumerate(design)),
            *(run("infill", k, {"dyke": rms}, floor=f) for k, (rms, f) in enumerate(zip(infill, floors, strict=True))),
        ]
    )


def reason(h, **stop):
    return decide(h, ["dyke"], Stop(**{"rms": 1e-3, "max_runs": 50, "stagnation_runs": 5, **stop})).reason


def test_goes_on_until_within_the_tolerance():
    assert reason(history([0.1, 0.01])) is None
    assert reason(history([0.1, 0.01, 9e-4])) == "rms"
    assert reason(history([], design=(0.5, 1e-4))) == "rms"
    assert decide(history([9e-4]), ["dyke"], Stop(rms=1e-3)).converged


def test_the_maximum_counts_design_and_infill():
    assert reason(history([0.1, 0.1]), max_runs=4) == "max_runs"
    assert reason(history([0.1, 0.1]), max_runs=5) is None
    # an iteration beyond the maximum does not count, even where it is within the tolerance
    assert reason(history([0.1, 0.1, 1e-4]), max_runs=4) == "max_runs"


def test_stagnation_counts_runs_without_a_better_point():
    assert reason(history([0.3, 0.31, 0.32]), stagnation_runs=2) == "stagnation"
    assert reason(history([0.3, 0.31, 0.29]), stagnation_runs=2) is None
    assert reason(history([0.3, 0.31, 0.32]), stagnation_runs=3) is None


def test_unreachable_needs_a_floor_near_the_best():
    assert reason(history([0.1, 0.1], floors=[None, 0.095])) == "unreachable"
    assert reason(history([0.1, 0.1], floors=[None, 0.05])) is None


def test_a_floor_counts_only_where_the_surrogate_kept_its_promise():
    runs = history([0.1]).runs
    kept = run("infill", 1, {"dyke": 0.1}, floor=0.095, promised=0.095)
    broken = run("infill", 1, {"dyke": 0.1}, floor=0.095, promised=0.05)
    explored = run("infill", 1, {"dyke": 0.1}, mode="explore", floor=0.095)
    assert [reason(History([*runs, last])) for last in (kept, broken, explored)] == ["unreachable", None, None]


def test_the_sentence_says_why():
    verdict = decide(history([0.1, 0.1], floors=[None, 0.095]), ["dyke"], Stop(rms=1e-3)).materials["dyke"]
    for word in ("dyke", "0.1", "0.001", "0.095", "out of reach"):
        assert word in verdict.sentence


@pytest.mark.parametrize("patience", [1, 2, 5])
def test_an_ended_material_that_repeats_its_best_does_not_stagnate(patience):
    runs = [
        run("reference", 0, {"a": 0.6, "b": 0.6}),
        run("design", 0, {"a": 1e-4, "b": 0.5}),
        *(
            Run("infill", k, str(k), 0.0, {}, {}, {"a": 1e-4, "b": 0.4 - 0.01 * k},
                {"a": Proposal([0.0], "ended"), "b": Proposal([0.0], "exploit", 0.0)})
            for k in range(4)
        ),
    ]  # fmt: skip
    decision = decide(History(runs), ["a", "b"], Stop(rms=1e-3, stagnation_runs=patience))
    assert decision.materials["a"].reason == "rms"
    assert decision.materials["b"].reason is None
    assert not decision.ended


def test_the_worst_reason_names_the_loop():
    runs = [
        run("reference", 0, {"a": 0.6, "b": 0.6}),
        run("design", 0, {"a": 1e-4, "b": 0.5}),
        run("infill", 0, {"a": 1e-4, "b": 0.5}, floor=0.49),
    ]
    decision = decide(History(runs), ["a", "b"], Stop(rms=1e-3))
    assert decision.reason == "unreachable"
    assert not decision.converged


def of_law(cost, predicted, left=1.0, moved=1.0):
    """Infill scored in classes: cost, what was promised, and what its own correction would still take."""
    runs = [replace(run("design", 0, {"dyke": 0.5}), cumulants={"dyke": [[0.0, 1.0, 0.0]]}, cost={"dyke": 50.0})]
    for k, (found, promise) in enumerate(zip(cost, predicted, strict=True)):
        runs.append(
            replace(
                run("infill", k, {"dyke": 0.1}),
                proposals={"dyke": Proposal([float(k)], "exploit", predicted_cost=promise)},
                cumulants={"dyke": [[0.0, 1.0, 0.0]]},
                cost={"dyke": found},
                left={"dyke": left},
                moved_db={"dyke": moved},
            )
        )
    return History(runs)


def test_a_law_settles_when_its_last_run_would_hardly_change_it():
    assert reason(of_law([5.0], [4.0])) is None
    assert reason(of_law([5.0], [4.0], left=0.04)) == "settled"
    assert reason(of_law([5.0], [4.0], moved=0.04), law_db=0.05) == "settled"
    # not in a run that is worse than the best
    assert reason(of_law([5.0, 6.0], [4.0, 4.5], left=0.04)) == "settled"
    assert decide(of_law([5.0], [4.0], left=0.04), ["dyke"], Stop()).converged


def test_a_law_settles_when_all_runs_promise_no_better_and_are_right():
    # the correction of one run alone sees more to gain than there is
    assert reason(of_law([5.0, 4.98], [4.0, 4.97])) == "settled"
    assert reason(of_law([5.0, 4.80], [4.0, 4.97])) is None, "better than promised: go on"
    assert reason(of_law([5.0, 4.98], [4.0, 4.50])) is None, "the promise was not kept"


def outside(infill, sampling=0.3, **stop):
    """A history whose reference run says the sampling error."""
    runs = history(infill).runs
    runs = [replace(runs[0], rms_sampling={"dyke": sampling}), *runs[1:]]
    return decide(History(runs), ["dyke"], Stop(**{"at_sampling_error": True, **stop})).materials["dyke"]


def test_another_program_ends_where_the_image_tells_no_more():
    below = [0.099, *[0.2] * 5]
    verdict = outside(below)
    assert verdict.reason == "stagnation"
    assert "no better for 5 runs and below a third of the sampling error 0.3" in verdict.sentence
    assert outside(below[:-1]).reason is None, "four runs without a better one"
    assert outside([0.101, *[0.2] * 5]).reason is None, "above a third"
    assert outside([0.099, 0.2, 0.2, 0.098, 0.2, 0.2]).reason is None, "a better one in between"
    assert outside(below, at_sampling_error=False).reason is None
    assert outside(below, sampling=0.0).reason is None, "where it was not recorded"


def test_all_whole_numbers_simulated_is_out_of_reach():
    runs = history([0.2]).runs
    last = run("infill", 1, {"dyke": 0.2}, mode="exhausted", floor=0.2)
    verdict = decide(History([*runs, last]), ["dyke"], Stop()).materials["dyke"]
    assert verdict.reason == "unreachable"
    assert "every combination of whole parameters" in verdict.sentence
