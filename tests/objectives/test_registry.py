"""One contract for all objectives: a further one needs its class and its traits."""

import ast
import re
from importlib.metadata import EntryPoint
from pathlib import Path

import pytest
from calibration_samples import make_run

from radcal import plugins
from radcal.calibration.stopping import decide
from radcal.config import Stop, case_from
from radcal.objectives import make_objectives, objective_class
from radcal.objectives.density import Density
from radcal.objectives.history import History, Proposal
from radcal.sections.objectives import OBJECTIVES, Traits

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "radcal"
ROOMS = (SOURCE / "objectives", SOURCE / "sections" / "objectives.py")
# the same word for something else: a way of fitting a density, and its name in a module's list
OTHER = {("sections/target.py", "likelihood"), ("skewnormal/__init__.py", "density")}


def test_classes_have_their_traits():
    for name, traits in OBJECTIVES.items():
        assert (objective_class(name).misfit is not None) == traits.bins


def test_no_name_of_an_objective_stands_anywhere_else():
    found = set()
    for path in SOURCE.rglob("*.py"):
        text = path.read_text()
        if any(path.is_relative_to(room) for room in ROOMS) or not any(name in text for name in OBJECTIVES.builtin):
            continue
        texts = {node.value for node in ast.walk(ast.parse(text)) if isinstance(node, ast.Constant)}
        found |= {(path.relative_to(SOURCE).as_posix(), name) for name in texts & set(OBJECTIVES.builtin)}
    assert found - OTHER == set()
    assert found >= OTHER, "an exception that is none any more"


def test_rules_scripts_and_the_report_compare_no_objective():
    files = [ROOT / "Snakefile", *(ROOT / "workflow").rglob("*.smk"), *(ROOT / "workflow").rglob("*.py")]
    files += SOURCE.rglob("*.j2")
    assert len(files) > 20
    for path in files:
        for line in path.read_text().splitlines():
            assert not re.search(r"objective\w*[\"'\]]*\s*(==|!=|\bin\b)", line), (path.name, line)


class Tenth(Density):
    """One density that need only be met to ten times the tolerance."""

    @classmethod
    def ending(cls, progress, stop):
        return super().ending(progress, stop.model_copy(update={"rms": 10.0 * stop.rms}))


TENTH = Traits(f"{__name__}:Tenth", bins=False, compares="the densities")


def test_a_fourth_objective_is_one_class_and_one_entry(parts, monkeypatch):
    """From the configuration to the end of a search."""
    case, *_, targets = parts
    entry = EntryPoint("tenth", f"{__name__}:TENTH", "radcal.objectives")  # of another distribution
    monkeypatch.setattr(plugins, "_entry_points", lambda _: (entry,))
    found = make_objectives(case.model_copy(update={"objective": "tenth"}), [targets])
    assert {type(objective).__name__ for objective in found.values()} == {"Tenth"}
    for rms, reason in ((9e-3, "rms"), (11e-3, None)):
        infill = make_run("infill", 0, {"lake": rms}, {"lake": Proposal([0.0], "exploit")})
        history = History([make_run("reference", 0, {"lake": 0.5}), infill])
        assert decide(history, ["lake"], Stop(rms=1e-3), "tenth").reason == reason


def test_an_unknown_objective_is_named(parts):
    with pytest.raises(Exception, match=r"'tenth', expected 'classes', 'density' or 'likelihood'"):
        case_from({"objective": "tenth", "materials": {"a": {"calibrate": True}}})
