"""What each stage reads of a case: the same for its rule, its script and the functions it calls."""

import re
from pathlib import Path

import pytest
import yaml
from config_samples import FIXED, X, dyke, flat, measured, synthetic
from pydantic import ValidationError

from radcal.config import Case, case_from
from radcal.config.part import Part
from radcal.config.stages import OUTPUTS, SCHEMAS, STAGES
from radcal.storage.records import kind_of

WORKFLOW = Path(__file__).resolve().parents[2] / "workflow"


@pytest.mark.parametrize("rule", [name for name, stage in STAGES.items() if stage.reads])
def test_a_job_has_the_sections_of_its_stage_and_no_others(rule):
    row, case = STAGES[rule], case_from(flat() | measured() | {"materials": FIXED, "seed": 7, "infill": {"batch": 2}})
    stage, params = row.model, row.params(case)
    assert yaml.safe_load(yaml.safe_dump(params)) == params  # plain data
    # a job's params are compared as they are printed, in the order of the whole case
    whole = {name: field.alias or name for name, field in Case.model_fields.items() if name != "colours"}  # has none
    assert list(params) == [key for name, key in whole.items() if name in stage.model_fields]
    job = stage.model_validate(params)
    assert job == row.of(case)
    for name, key in whole.items():
        if key in params:
            assert getattr(job, name) == getattr(case, name)
        else:
            with pytest.raises(AttributeError):
                getattr(job, name)
            with pytest.raises(ValidationError, match=key):
                stage.model_validate({**params, key: case.sections(name)[key]})


@pytest.mark.parametrize("rule", STAGES)
def test_a_rule_takes_all_from_the_row_of_its_name(rule):
    pages = "".join(path.read_text(encoding="utf-8") for path in (WORKFLOW / "rules").glob("*.smk"))
    (body,) = re.findall(rf"(?ms)^(?:(?:rule|checkpoint) {rule}:|use rule \w+ as {rule} with:)\n(.*?)(?=^\S|\Z)", pages)
    named = re.findall(r"\b(?:outputs|words|of_pass|resources)\(\s*\"(\w+)|STAGES\[\"(\w+)", body)
    assert {"".join(names) for names in named} == {rule}
    assert body.count("outputs(") == body.count("words(") == 1
    sections = "params(" in body or "of_pass(" in body or rule == "first_registration"
    assert sections == bool(STAGES[rule].reads)
    for path in STAGES[rule].outputs.values():
        assert path.endswith((".json", ".csv", ".html")) or "." not in path or kind_of(path) in SCHEMAS


def test_every_rule_but_the_milestones_is_a_stage():
    pages = "".join(path.read_text(encoding="utf-8") for path in (WORKFLOW / "rules").glob("*.smk"))
    rules = re.findall(r"(?m)^(?:rule|checkpoint|use rule \w+ as) (\w+)(?::| with:)$", pages)
    assert sorted(rules) == sorted(STAGES)


def test_the_flow_in_the_documents_is_that_of_the_table():
    page = (WORKFLOW.parent / "docs/architecture.md").read_text(encoding="utf-8").split("## The rooms")[0]
    rows = re.findall(r"^\| [^|]* \| (`[^|]*) \| [^|]* \| (`[^|]*) \|$", page, flags=re.MULTILINE)
    rules, outputs = ([name for row in rows for name in re.findall("`(.*?)/?`", row[k])] for k in (0, 1))
    assert rules == list(STAGES)
    assert sorted(outputs) == sorted(path.replace("{", "<").replace("}", ">") for path in OUTPUTS)


def test_the_archive_records_all_that_jobs_depend_on():
    case = case_from(dyke() | synthetic(parameters={"dyke": X}))
    archive = STAGES["archive"].of(case)
    assert repr(archive.sections(*archive.__dict__)) == repr(case.sections(*STAGES["archive"].reads))


def test_what_follows_from_sections_is_that_of_the_case():
    start = {"law": "constant_gamma", "parameters": [-9.0]}
    materials = {"dyke": {"calibrate": True, "start": start}, "road": {"parameters": X}}
    rest = {"objective": "density", "design": {"size": 21}}
    case = case_from({"materials": materials, **synthetic(parameters={"dyke": X}), **rest})
    scores = STAGES["scores"].model.model_validate(STAGES["scores"].params(case))
    assert (scores.calibrated, scores.start_with_another_law) == (["dyke"], ["dyke"])
    assert (scores.laws["dyke"].names, scores.at_start.laws["dyke"].names) == (("X1", "X2", "X3", "X4"), ("gamma",))
    assert isinstance(scores.at_start, Part)
    assert STAGES["target"].of(case).reference_materials == case.reference_materials == ["road"]
    assert STAGES["design_chunk"].of(case).design_size == case.design_size == 21
