"""Calibration of a law written as a formula: the same as of the built-in law with the same curve."""

from calibration_samples import TRUTH

from radcal.config import case_from
from radcal.config.stages import STAGES
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore


def test_a_changed_formula_or_order_of_names_is_another_run(parts, tmp_path):
    _, simulator, geometry, scene, _ = parts

    def key_data(formula, names):
        field = {"law": "formula", "formula": formula, "names": names, "calibrate": True, "bounds": [[-9, 9]] * 2}
        case = case_from(
            {
                "materials": {"field": field, "lake": {"parameters": TRUTH["lake"]}},
                "measurement": {"synthetic": {"parameters": {"field": [1, 2]}}},
            }
        )
        runner = Runner(RunStore(tmp_path), simulator, geometry, scene.identity, STAGES["reference_run"].of(case))
        return runner.description({"field": [1.0, 2.0], "lake": TRUTH["lake"]}, 3)

    first = key_data("a + b*cos(phi)", ["a", "b"])
    assert first["materials"]["field"]["formula"] == "a + b * cos(phi)"
    assert first == key_data(" a+b * (cos(phi))", ["a", "b"])
    assert first != key_data("a - b*cos(phi)", ["a", "b"])
    assert first != key_data("a + b*cos(phi)", ["b", "a"])
    assert "formula" not in first["materials"]["lake"]
