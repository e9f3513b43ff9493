"""Calibration of a law written as a formula: the same as of the built-in law with the same curve."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from calibration_samples import BOUNDS, TRUTH

from radcal.calibration.loop import calibrate
from radcal.config import case_from, stages
from radcal.laws import LAWS
from radcal.measurement.sources import make_measurement
from radcal.objectives import OBJECTIVES
from radcal.registration.registered import register
from radcal.simulators.builtin import BuiltinSimulator
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore
from radcal.targets.target_fit import make_targets

MANGIA = {
    "law": "formula",
    "formula": "X1 + X2*cos(phi) + X3*exp(-X4*phi**2)",
    "names": ["X1", "X2", "X3", "X4"],
    "units": ["dB", "dB", "dB", "1/rad2"],
}


@pytest.fixture
def calibrated(parts, tmp_path):
    """Function that calibrates the field of the parts, with keys of its law and of the case."""
    _, _, geometry, scene, _ = parts

    def of(law: dict[str, Any], **keys: Any) -> Any:
        field = {"calibrate": True, "bounds": BOUNDS, **law}
        case = case_from(
            {
                "scene": {"source": "slant_range", "labels": "-", "names": "-", "near_incidence_deg": 20,
                          "far_incidence_deg": 45},
                "materials": {"field": field, "lake": {"parameters": TRUTH["lake"]}},
                "measurement": {"synthetic": {"parameters": {"field": TRUTH["field"]}, "warp_px": 0}},
                "registration": {"method": "none"},
                "radar": {"nesz_db": -40},
                "design": {"size": 2},
                "optimiser": {"population": 20, "evaluations": 100},
                "uncertainty": {"walkers": 32, "steps": 100},
                **keys,
            }
        )  # fmt: skip
        simulator = BuiltinSimulator(geometry, case.radar, case.laws)
        runner = Runner(RunStore(tmp_path), simulator, geometry, scene.identity, stages.Simulation.of(case))
        measurement = make_measurement(stages.MeasurementStage.of(case), geometry, simulator, scene)
        start = simulator.run(case.start_parameters, 1)
        registered, stage = register(start, measurement, case.registration), stages.TargetStage.of(case)
        targets = make_targets(stage, geometry, registered, start, OBJECTIVES[case.objective].misfit)
        return (case, runner, targets, *calibrate(case, runner, targets))

    return of


@pytest.mark.slow
def test_the_same_density_gives_the_same_x(calibrated):
    keys = {"objective": "density", "stop": {"rms": 1e-5, "max_runs": 8}}
    (_, _, _, built_in, ended), (_, _, _, formula, end) = (calibrated(law, **keys) for law in ({}, MANGIA))
    assert (ended.reason, len(built_in.runs)) == (end.reason, len(formula.runs))
    assert [run.index for run in built_in.infill] == list(range(len(built_in.infill)))
    assert len(built_in.infill) > 1
    for one, other in zip(built_in.runs, formula.runs, strict=True):
        assert one.scores["field"].parameters == other.scores["field"].parameters
        assert one.scores["field"].dp == other.scores["field"].dp
        assert one.keys != other.keys


@pytest.mark.slow
def test_in_bins_the_law_is_found(calibrated):
    _, _, _, history, decision = calibrated(MANGIA, objective="classes", stop={"max_runs": 12})
    assert decision.converged
    seen = np.linspace(21.0, 44.0, 24)
    x = history.best("field").parameters
    error = LAWS["mangia"](np.radians(seen), x) - LAWS["mangia"](np.radians(seen), TRUTH["field"])
    assert np.abs(error).max() < 1.0


def test_a_changed_formula_or_order_of_names_is_another_run(parts, tmp_path):
    _, simulator, geometry, scene, _ = parts

    def key_data(formula: str, names: list[str]) -> Any:
        field = {"law": "formula", "formula": formula, "names": names, "calibrate": True, "bounds": [[-9, 9]] * 2}
        case = case_from(
            {
                "materials": {"field": field, "lake": {"parameters": TRUTH["lake"]}},
                "measurement": {"synthetic": {"parameters": {"field": [1, 2]}}},
            }
        )
        runner = Runner(RunStore(tmp_path), simulator, geometry, scene.identity, stages.Simulation.of(case))
        return runner.description({"field": [1.0, 2.0], "lake": TRUTH["lake"]}, 3)

    first = key_data("a + b*cos(phi)", ["a", "b"])
    assert first["materials"]["field"]["formula"] == "a + b * cos(phi)"
    assert first == key_data(" a+b * (cos(phi))", ["a", "b"])
    assert first != key_data("a - b*cos(phi)", ["a", "b"])
    assert first != key_data("a + b*cos(phi)", ["b", "a"])
    assert "formula" not in first["materials"]["lake"]
