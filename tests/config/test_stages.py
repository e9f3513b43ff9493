"""What each stage reads of a case: the same for its rule, its script and the functions it calls."""

from __future__ import annotations

import ast
import re
from pathlib import Path

import pytest
import yaml
from config_samples import FIXED, X, dyke, flat, measured, synthetic
from pydantic import ValidationError

from radcal.config import Case, case_from, stages
from radcal.config.stages import STAGES

WORKFLOW = Path(__file__).resolve().parents[2] / "workflow"


@pytest.mark.parametrize("rule", STAGES)
def test_a_job_has_the_sections_of_its_stage_and_no_others(rule: str) -> None:
    stage, case = STAGES[rule], case_from(flat() | measured() | {"materials": FIXED, "seed": 7})
    params = stage.params(case)
    assert yaml.safe_load(yaml.safe_dump(params)) == params  # plain data
    # a job's params are compared as they are printed, in the order of the whole case
    whole = {name: field.alias or name for name, field in Case.model_fields.items() if name != "colours"}  # has none
    assert list(params) == [key for name, key in whole.items() if name in stage.model_fields]
    job = stage.model_validate(params)
    assert job == stage.of(case)
    for name, key in whole.items():
        if key in params:
            assert getattr(job, name) == getattr(case, name)
        else:
            with pytest.raises(AttributeError):
                getattr(job, name)
            with pytest.raises(ValidationError, match=key):
                stage.model_validate({**params, key: case.sections(name)[key]})


@pytest.mark.parametrize("rule", STAGES)
def test_rule_and_script_have_the_stage_of_their_name(rule: str) -> None:
    pages = "".join(path.read_text(encoding="utf-8") for path in (WORKFLOW / "rules").glob("*.smk"))
    (body,) = re.findall(rf"(?ms)^(?:rule|checkpoint) {rule}:\n(.*?)(?=^\S|\Z)", pages)
    of_stage = rf'(lambda wildcards: )?STAGES\["{rule}"\]\.params\(|of_pass\("{rule}"\),'
    assert re.search(rf"\bcase=({of_stage})", body)
    (script,) = re.findall(r'"\.\./scripts/(\w+\.py)"', body)
    nodes = ast.walk(ast.parse((WORKFLOW / "scripts" / script).read_text(encoding="utf-8")))
    calls = [ast.unparse(node) for node in nodes if isinstance(node, ast.Call)]
    made = [text for text in calls if text.endswith(".model_validate(snakemake.params.case)")]
    assert made == [f"stages.{STAGES[rule].__name__}.model_validate(snakemake.params.case)"]


def test_no_other_rule_takes_a_case() -> None:
    pages = "".join(path.read_text(encoding="utf-8") for path in (WORKFLOW / "rules").glob("*.smk"))
    assert len(re.findall(r"\bcase=", pages)) == len(STAGES)


def test_the_archive_records_all_that_jobs_depend_on() -> None:
    assert list(stages.ArchiveStage.model_fields) == [
        name for name in Case.model_fields if name not in ("replace", "stop")
    ]
    case = case_from(dyke() | synthetic(parameters={"dyke": X}))
    archive = stages.ArchiveStage.of(case)
    assert repr(archive.sections(*archive.__dict__)) == repr(case.sections(*stages.ArchiveStage.model_fields))


def test_what_follows_from_sections_is_that_of_the_case() -> None:
    start = {"law": "constant_gamma", "parameters": [-9.0]}
    case = case_from(
        {
            "materials": {"dyke": {"calibrate": True, "start": start}, "road": {"parameters": X}},
            **synthetic(parameters={"dyke": X}),
            "objective": "density",
            "design": {"size": 21},
        }
    )
    scores = stages.Scores.model_validate(stages.Scores.params(case))
    assert (scores.calibrated, scores.start_with_another_law) == (["dyke"], ["dyke"])
    assert (scores.laws["dyke"].names, scores.at_start.laws["dyke"].names) == (("X1", "X2", "X3", "X4"), ("gamma",))
    assert isinstance(scores.at_start, stages.Scores)
    assert stages.TargetStage.of(case).reference_materials == case.reference_materials == ["road"]
    assert stages.DesignChunk.of(case).design_size == case.design_size == 21
