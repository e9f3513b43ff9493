from dataclasses import replace

import pytest
from calibration_samples import make_run

from radcal.calibration.stopping import decide, runs_left
from radcal.config import Stop
from radcal.findings import Finding
from radcal.objectives.history import History, Proposal

X = [1.0, 2.0]  # d = 2: no floor before the fourth run of design and infill


def run(kind, index, rms, mode="exploit", floor=None, promised=None):
    proposals = {
        name: Proposal(X, mode, cost=value if promised is None else promised, floor=floor)
        for name, value in rms.items()
    }
    return make_run(kind, index, rms, proposals if kind == "infill" else None, x=X)


def history(infill, design=(0.5, 0.4), floors=None):
    floors = floors or [None] * len(infill)
    return History(
        [
            run("reference", 0, {"dyke": 0.6}),
            *(run("design", k, {"dyke": rms}) for k, rms in enumerate(design)),
            *(run("infill", k, {"dyke": rms}, floor=f) for k, (rms, f) in enumerate(zip(infill, floors, strict=True))),
        ]
    )


def judged(h, objective="density", **stop):
    return decide(h, ["dyke"], Stop(**{"rms": 1e-3, "max_runs": 50, "stagnation_runs": 5, **stop}), objective)


def reason(h, objective="density", **stop):
    return judged(h, objective, **stop).reason


def test_goes_on_until_within_the_tolerance():
    assert reason(history([0.1, 0.01])) is None
    assert reason(history([0.1, 0.01, 9e-4])) == "rms"
    assert reason(history([], design=(0.5, 1e-4))) == "rms"
    assert judged(history([9e-4])).converged
    # the tolerance itself is within
    assert reason(history([1e-3])) == reason(history([], design=(0.5, 1e-3))) == "rms"


def test_the_reference_run_alone_may_be_within_the_tolerance():
    """There may be no design."""
    within = History([run("reference", 0, {"dyke": 9e-4})])
    assert reason(within) == "rms"
    assert judged(within).materials["dyke"].finding.code == "rms_before_infill"
    assert reason(History([run("reference", 0, {"dyke": 2e-3})])) is None


@pytest.mark.parametrize("objective", ["density", "classes"])
def test_the_maximum_counts_design_and_infill(objective):
    ended = judged(history([0.1, 0.1]), objective, max_runs=4)
    assert (ended.reason, ended.converged) == ("max_runs", False)
    assert ended.materials["dyke"].finding.code == "search_out_of_runs"
    assert reason(history([0.1, 0.1]), objective, max_runs=5) is None


@pytest.mark.parametrize(("objective", "step"), [("density", 0.01), ("classes", 0.035)])
def test_stagnation_counts_runs_without_a_better_point(objective, step):
    """For bins a better one by 0.03, a quarter of the law's standard error."""
    assert reason(history([0.3, 0.31, 0.32]), objective, stagnation_runs=2) == "stagnation"
    assert reason(history([0.3, 0.31, 0.3 - step]), objective, stagnation_runs=2) is None
    assert reason(history([0.3, 0.31, 0.32]), objective, stagnation_runs=3) is None
    assert reason(history([0.3, 0.31, 0.275]), "classes", stagnation_runs=2) == "stagnation"
    assert reason(history([0.3, 0.3, 0.3]), objective, stagnation_runs=2) == "stagnation", "equal is no better"


def test_an_iteration_of_several_runs_is_judged_by_its_best():
    def of(*iterations):
        return History(
            [*history([]).runs, *(run("infill", k, {"dyke": r}) for k, rms in enumerate(iterations) for r in rms)]
        )

    for rms in ((9e-4, 0.2), (0.2, 9e-4)):
        found = judged(of((0.1, 0.1), rms))
        assert (found.reason, found.materials["dyke"].finding.numbers["runs"]) == ("rms", 6)
        assert reason(of((0.1, 0.1), rms, (0.5, 0.5)), max_runs=6) == "rms"
    assert reason(of((0.3, 0.31), (0.32, 0.29)), stagnation_runs=2) is None
    assert reason(of((0.3, 0.31), (0.32, 0.31)), stagnation_runs=2) == "stagnation"
    # a maximum amid an iteration, which was lowered after its runs had been made
    for rms in ((9e-4, 0.2), (0.2, 9e-4)):
        assert reason(of((0.1, 0.1), rms), max_runs=5) == "rms"
    out = judged(of((0.1, 0.1), (0.2, 0.05)), max_runs=5).materials["dyke"]
    assert (out.reason, out.finding.numbers["runs"], out.finding.numbers["rms"]) == ("max_runs", 6, 0.05)


def test_runs_made_together_with_the_best_are_no_failures_after_it():
    """The first of ten runs is the best: only the next iteration, without a better one, is idle."""
    together = [*history([]).runs, *(run("infill", 0, {"dyke": rms}) for rms in (0.01, *[0.2] * 9))]
    assert reason(History(together), stagnation_runs=5) is None
    idle = [run("infill", 1, {"dyke": 0.02})] * 5
    assert reason(History([*together, *idle[:4]]), stagnation_runs=5) is None
    found = judged(History([*together, *idle]), stagnation_runs=5)
    assert (found.reason, found.materials["dyke"].finding.numbers["idle"]) == ("stagnation", 5)


def test_the_budget_of_time_ends_the_search_before_it_is_exceeded():
    """Every run takes half a second."""
    stop = Stop(max_hours=3.0 / 3600.0, max_runs=9)
    assert [runs_left(history([0.1] * k), stop) for k in (0, 1, 4)] == [4, 3, 0]
    assert runs_left(history([0.1] * 2), Stop(max_runs=5)) == 1
    # before any run of the search, each is expected to need the time of the reference run
    assert runs_left(history([], design=()), stop) == 6
    found = judged(history([0.1] * 4), max_hours=3.0 / 3600.0)
    assert (found.reason, found.converged) == ("max_hours", False)
    numbers = {"rms": 0.1, "tolerance": 1e-3, "hours": 3.0 / 3600.0}
    assert found.materials["dyke"].finding == Finding("search_out_of_time", "note", "dyke", numbers)
    assert reason(history([0.1] * 3), max_hours=3.0 / 3600.0) is None
    assert reason(history([0.1] * 4 + [9e-4]), max_hours=3.0 / 3600.0) == "max_hours", "the last one does not count"
    assert reason(history([0.1] * 4), max_hours=3.0 / 3600.0, max_runs=6) == "max_runs"
    # what is left of a law
    found = judged(of_law([50.0]), "classes", max_runs=2).materials["dyke"].finding
    assert found.numbers == {"runs": 2, "moved_db": 1.0}


def test_unreachable_needs_a_floor_near_the_best():
    assert reason(history([0.1, 0.1], floors=[None, 0.095])) == "unreachable"
    assert reason(history([0.1, 0.1], floors=[None, 0.085])) is None
    assert not judged(history([0.1, 0.1], floors=[None, 0.095])).converged


def test_a_floor_counts_only_from_d_and_2_runs_on():
    """Of design and infill; the reference run is not counted."""
    assert reason(history([0.1], floors=[0.095])) is None
    assert reason(history([0.1], design=(0.5, 0.4, 0.3), floors=[0.095])) == "unreachable"
    assert reason(history([0.1] * 3, design=(), floors=[0.095] * 3)) is None
    assert reason(history([0.1] * 4, design=(), floors=[0.095] * 4)) == "unreachable"


def test_a_floor_counts_only_where_the_surrogate_kept_its_promise():
    runs = history([0.1]).runs
    kept, broken = (run("infill", 1, {"dyke": 0.1}, floor=0.095, promised=promised) for promised in (0.086, 0.08))
    low = run("infill", 1, {"dyke": 0.1}, floor=0.095, promised=0.13)
    explored = run("infill", 1, {"dyke": 0.1}, mode="explore", floor=0.095)
    found = [reason(History([*runs, last])) for last in (kept, broken, low, explored)]
    assert found == ["unreachable", None, None, None]


def test_the_finding_says_why():
    numbers = {"rms": 0.1, "tolerance": 1e-3}
    found = judged(history([0.1, 0.1], floors=[None, 0.095])).materials["dyke"].finding
    assert found == Finding("rms_unreachable", "note", "dyke", {**numbers, "runs": 4, "floor": 0.095})
    assert judged(history([0.1])).materials["dyke"].finding.numbers == numbers
    found = judged(history([0.6]), stagnation_runs=1).materials["dyke"].finding
    assert found.numbers["idle"] == 1


@pytest.mark.parametrize("patience", [1, 2, 5])
def test_an_ended_material_that_repeats_its_best_does_not_stagnate(patience):
    runs = [run("reference", 0, {"a": 0.6, "b": 0.6}), run("design", 0, {"a": 1e-4, "b": 0.5})]
    for k in range(4):
        infill = run("infill", k, {"a": 1e-4, "b": 0.4 - 0.01 * k})
        runs.append(replace(infill, proposals={**infill.proposals, "a": Proposal(X, "ended")}))
    decision = decide(History(runs), ["a", "b"], Stop(rms=1e-3, stagnation_runs=patience), "density")
    assert decision.materials["a"].reason == "rms"
    assert decision.materials["b"].reason is None
    assert not decision.ended


def test_the_worst_reason_names_the_loop():
    first = [run("reference", 0, {"a": 0.6, "b": 0.6}), *(run("design", k, {"a": 1e-4, "b": 0.5}) for k in range(3))]
    runs = [*first, run("infill", 0, {"a": 1e-4, "b": 0.5}, floor=0.49)]
    decision = decide(History(runs), ["a", "b"], Stop(rms=1e-3), "density")
    assert decision.reason == "unreachable"
    assert not decision.converged
    assert {name: verdict.reason for name, verdict in decision.materials.items()} == {"a": "rms", "b": "unreachable"}
    # one that goes on keeps all going
    decision = decide(History([*runs[:-1], run("infill", 0, {"a": 1e-4, "b": 0.5})]), ["a", "b"], Stop(), "density")
    assert (decision.reason, decision.ended) == (None, False)


def of_law(cost, gain=1.0, moved=1.0, floor=None):
    """Infill scored in bins: cost, and what the surrogate of all runs still promises."""
    runs = [make_run("design", 0, {"dyke": 50.0}, x=X)]
    for k, found in enumerate(cost):
        proposals = {"dyke": Proposal(X, "exploit")}
        runs.append(
            make_run("infill", k, {"dyke": found}, proposals, x=X, gain=gain, moved_db=moved, floor=floor, rms=0.1)
        )
    return History(runs)


@pytest.mark.parametrize("objective", ["classes", "likelihood"])
def test_a_law_settles_when_all_runs_promise_no_better_or_hardly_another(objective):
    assert reason(of_law([5.0]), objective) is None
    assert reason(of_law([5.0], gain=0.04, moved=0.06), objective) is None
    assert reason(of_law([5.0], gain=0.02), objective) == "settled"
    assert reason(of_law([5.0], moved=0.04), objective) == "settled"
    assert reason(of_law([5.0], moved=0.06), objective, law_db=0.07) == "settled"
    # the limits themselves are within
    assert reason(of_law([5.0], moved=0.07), objective, law_db=0.07) == "settled"
    assert reason(of_law([5.0], gain=0.03), objective) == "settled"
    assert judged(of_law([5.0], gain=0.02), objective).converged
    # not in a run that is worse than the best
    assert reason(of_law([5.0, 6.0], gain=0.02), objective) == "settled"


def test_a_law_without_a_curve_settles_by_its_gain_alone():
    """Its search explores, so that there is a floor; 0.05 is its limit."""
    assert reason(of_law([5.0], gain=0.06, moved=None, floor=5.0), "classes") is None
    assert reason(of_law([5.0], gain=0.05, moved=None, floor=5.0), "classes") == "settled"
    found = judged(of_law([5.0], gain=0.04, moved=None, floor=5.0), "classes").materials["dyke"].finding
    assert found == Finding("no_better_x", "note", "dyke", {"runs": 2})


def test_a_law_does_not_settle_where_more_may_be_hidden():
    """Two standard errors in favour, more than 0.05 below the best: the search goes on exploring."""
    assert reason(of_law([5.0], gain=0.0, floor=4.9), "classes") is None
    assert reason(of_law([5.0], gain=0.0, floor=4.96), "classes") == "settled"


def test_the_finding_says_how_the_law_settled():
    gained, moved = (
        judged(of_law([5.0, 4.0], **last), "classes").materials["dyke"].finding
        for last in ({"gain": 0.01}, {"moved": 0.04})
    )
    assert gained == Finding("no_better_law", "note", "dyke", {"runs": 2})
    assert moved == Finding("law_settled", "note", "dyke", {"runs": 2, "moved_db": 0.04})


@pytest.mark.parametrize(("predicted", "infill", "settles"), [(2.0, 1, True), (1.6, 1, False), (1.6, 3, True)])
def test_a_surrogate_that_its_verification_refutes_settles_nothing_before_d_and_2_runs(predicted, infill, settles):
    """A verified cost of 5, more than three times the predicted one; d = 2, and one run is of the design."""
    first, *runs = of_law([5.0] * infill, gain=0.01).runs
    runs = [replace(one, proposals={"dyke": Proposal(X, "exploit", cost=predicted)}) for one in runs]
    assert (reason(History([first, *runs]), "classes") == "settled") == settles


def test_before_any_outlook_a_law_goes_on():
    """Costs are no rms: a small one ends nothing."""
    assert reason(of_law([1e-9], gain=None), "classes") is None
    assert reason(of_law([]), "classes") is None


def outside(infill, sampling=0.3, **stop):
    """A history whose reference run says the sampling error."""
    runs = history(infill).runs
    runs = [replace(runs[0], rms_sampling={"dyke": sampling}), *runs[1:]]
    return decide(History(runs), ["dyke"], Stop(**{"at_sampling_error": True, **stop}), "density").materials["dyke"]


def test_another_program_ends_where_the_image_tells_no_more():
    below = [0.099, *[0.2] * 5]
    verdict = outside(below)
    assert verdict.reason == "stagnation"
    assert verdict.finding.code == "rms_below_sampling_error"
    assert (verdict.finding.numbers["idle"], verdict.finding.numbers["sampling"]) == (5, 0.3)
    assert outside(below[:-1]).reason is None, "four runs without a better one"
    assert outside([0.101, *[0.2] * 5]).reason is None, "above a third"
    assert outside([0.099, 0.2, 0.2, 0.098, 0.2, 0.2]).reason is None, "a better one in between"
    assert outside(below, at_sampling_error=False).reason is None
    assert outside(below, sampling=0.0).reason is None, "where it was not recorded"


def test_all_whole_numbers_simulated_is_out_of_reach():
    runs = history([0.2]).runs
    last = run("infill", 1, {"dyke": 0.2}, mode="exhausted", floor=0.2)
    verdict = decide(History([*runs, last]), ["dyke"], Stop(), "density").materials["dyke"]
    assert verdict.reason == "unreachable"
    assert verdict.finding.code == "rms_exhausted"
