"""Stop settings never touch finished runs; tightening them continues, loosening them goes back."""

import pytest

from radcal.calibration.stopping import decide
from radcal.config import Stop
from radcal.objectives.history import read_runs


@pytest.fixture
def history(finished):
    """What stood before a change, as a callable that runs with new stop settings."""

    def run(**stop):
        before = finished.records()
        finished.write(stop=stop)
        done = finished.run("--configfile", "tiny.yaml")
        assert done.returncode == 0, done.stdout
        after = finished.records()
        assert {name: after[name] for name in before} == before, "a finished run was touched"
        return finished.summary(), len(after) - len(before)

    return run


def test_stop_settings_in_turn(history, finished):
    first = finished.summary()
    reached = first["materials"]["field"]["rms"]

    # tolerance down: the loop goes on from where it ended
    tighter, added = history(rms=0.99 * reached)
    assert tighter["iterations"] > first["iterations"]
    assert added >= tighter["iterations"] - first["iterations"]
    assert tighter["materials"]["field"]["rms"] <= 0.99 * reached

    # tolerance up again: the earlier answer, no new run
    looser, added = history(rms=1e-3)
    assert added == 0
    assert looser["iterations"] == first["iterations"]
    assert looser["materials"]["field"]["parameters"] == first["materials"]["field"]["parameters"]

    # maximum down: fewer iterations count
    fewer, added = history(rms=1e-9, max_runs=13)
    assert fewer["iterations"] == 1
    assert fewer["stop_reason"] == "max_runs"
    assert fewer["converged"] is False
    assert added <= 1  # the final check of another best point, where there is one
    assert fewer["runs"]["design"] + fewer["runs"]["infill"] == 13

    # what the rules walk by, over the runs as they stand: the maximum up, it goes on again
    made = tighter["iterations"]
    assert walk(finished, made, rms=1e-9, max_runs=13) == (1, "max_runs")
    assert walk(finished, made, rms=1e-9, max_runs=made + 12) == (made, "max_runs")
    assert walk(finished, made, rms=1e-9, max_runs=made + 12 + 1) == (made, None)
    assert walk(finished, made, rms=1e-3) == (first["iterations"], "rms")
    # stagnation ends no later with a patience of one than with more, which goes on
    stuck, reason = walk(finished, made, rms=1e-12, stagnation_runs=1)
    assert stuck <= made
    assert reason in ("stagnation", None)
    assert walk(finished, made, rms=1e-12, stagnation_runs=50) == (made, None)


def walk(project, made, **stop):
    """Iterations that count under these settings, and how they end: None where another is to be made."""
    files = [project.out() / "scores.json"]
    files += [project.out() / f"iterations/{k}/verified.json" for k in range(made)]
    for k in range(made + 1):
        decision = decide(read_runs(files[: k + 1]), ["field"], Stop(**stop), "density")
        if decision.ended:
            return k, decision.reason
    return made, None
