"""Stop settings never touch finished runs; tightening them continues, loosening them goes back."""


def test_stop_settings_in_turn(finished):
    def history(**stop):
        before = finished.records()
        finished.write(stop=stop)
        finished.ended("--configfile", "tiny.yaml")
        after = finished.records()
        assert {name: after[name] for name in before} == before, "a finished run was touched"
        return finished.summary(), len(after) - len(before)

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
