"""One contract for all objectives: a further one needs its class and its traits."""

import ast
import re
from importlib.metadata import EntryPoint
from pathlib import Path

import numpy as np
import pytest
from calibration_samples import BOUNDS, TRUTH

from radcal import plugins
from radcal.calibration.loop import calibrate
from radcal.calibration.steps import progress_line
from radcal.config import case_from
from radcal.inference.expected import LawForward
from radcal.inference.moments import from_cumulants
from radcal.objectives import Objective, make_objectives, objective_class
from radcal.objectives.base import SearchState
from radcal.objectives.density import Density
from radcal.sections.objectives import OBJECTIVES, Traits
from radcal.simulators.runner import Runner
from radcal.storage.runs import RunStore
from radcal.targets.target import Targets

ROOT = Path(__file__).resolve().parents[2]
SOURCE = ROOT / "src" / "radcal"
ROOMS = (SOURCE / "objectives", SOURCE / "sections" / "objectives.py")
# the same word for something else: a way of fitting a density, and its name in a module's list
OTHER = {("sections/target.py", "likelihood"), ("skewnormal/__init__.py", "density")}


@pytest.fixture(scope="module")
def outside():
    """Files of the library that are no objective's own, and the nodes of their code."""
    files = (path for path in SOURCE.rglob("*.py") if not any(path == room or room in path.parents for room in ROOMS))
    return {path: list(ast.walk(ast.parse(path.read_text()))) for path in files}


def test_classes_have_their_traits():
    for name, traits in OBJECTIVES.items():
        assert (objective_class(name).misfit is not None) == traits.bins


def test_no_name_of_an_objective_stands_anywhere_else(outside):
    found = set()
    for path, nodes in outside.items():
        for node in nodes:
            if isinstance(node, ast.Constant) and node.value in OBJECTIVES.builtin:
                found.add((path.relative_to(SOURCE).as_posix(), node.value))
    assert found - OTHER == set()
    assert found >= OTHER, "an exception that is none any more"


def test_rules_scripts_and_the_report_compare_no_objective():
    files = [ROOT / "Snakefile", *(ROOT / "workflow").rglob("*.smk"), *(ROOT / "workflow").rglob("*.py")]
    files += SOURCE.rglob("*.j2")
    assert len(files) > 20
    for path in files:
        for line in path.read_text().splitlines():
            assert not re.search(r"objective\w*[\"'\]]*\s*(==|!=|\bin\b)", line), (path.name, line)


class Quartiles(Objective):
    """Median and interquartile range of all pixels; ends where the surrogate of all runs predicts nothing better."""

    looks_ahead = True
    explores = False
    tolerance = 1e-6

    def __init__(self, material):
        super().__init__(material)
        self._measured = self.statistics(material.target.values_db)
        nodes = np.quantile(material.target.incidence_deg, (np.arange(64) + 0.5) / 64)[None]
        expected = LawForward(material.law, nodes, material.looks, material.target.noise_db)
        self.baseline = lambda x: from_cumulants(expected(x))

    @property
    def scale(self):
        return np.array([[1.0, 0.1, 1.0]])

    def measured_bins(self):
        return Density(self.material).measured_bins()

    def statistics(self, values_db, pixels=None):
        values = values_db if pixels is None else values_db[pixels]
        low, median, high = np.quantile(np.asarray(values, dtype=np.float64), [0.25, 0.5, 0.75])
        return np.array([[median, np.log((high - low) / 1.349), (high + low - 2.0 * median) / (high - low)]])

    def residuals(self, points):
        return ((points.statistics - self._measured) / self.scale)[:, 0, :2]

    def worth(self, parameters, statistics):
        left = ((statistics - self._measured) / self.scale)[0, :2]
        return self.material.looks, 0.5 * float(left @ left)

    def promising(self, costs, best):
        return costs < 0.5 * best

    def leaves_open(self, floor, best):
        return floor < 0.9 * best

    @classmethod
    def ending(cls, progress, stop):
        if progress.score.gain > 0.01:
            return None
        return SearchState.of("settled", "no_better_x", progress.name, runs=progress.runs)

    @classmethod
    def progress_line(cls, history, materials, ended, stop):
        return f"quartiles of {len(ended)} of {len(materials)} materials agree best"


QUARTILES = Traits(f"{__name__}:Quartiles", bins=False, compares="the quartiles")


@pytest.mark.slow
def test_a_fourth_objective_is_one_class_and_one_entry(parts, monkeypatch, tmp_path):
    """From the configuration to the check of its laws, with whole runs of the simulator in between."""
    given, simulator, geometry, scene, both = parts
    targets = Targets({"lake": both["lake"]}, both.levels, both.looks)
    entry = EntryPoint("quartiles", f"{__name__}:QUARTILES", "radcal.objectives")  # of another distribution
    monkeypatch.setattr(plugins, "_entry_points", lambda _: (entry,))
    case = case_from(
        {
            "scene": given.scene.model_dump(),
            "radar": {"looks": 4, "nesz_db": -40},
            "objective": "quartiles",
            "materials": {name: {"calibrate": True, "bounds": BOUNDS} for name in TRUTH},
            "measurement": {"source": "synthetic", "synthetic": {"parameters": TRUTH}},
            "design": {"size": 1},
            "optimiser": {"population": 10, "evaluations": 40},
            "stop": {"max_runs": 15},
        }
    )
    runner = Runner(RunStore(tmp_path), simulator, geometry, scene.identity, case)
    history, decision = calibrate(case, runner, targets)
    assert decision.reason == "settled"
    assert decision.materials["lake"].finding.code == "no_better_x"
    for name, objective in make_objectives(case, targets).items():
        best, measured = history.best(name), objective._measured[0]
        np.testing.assert_allclose(best.statistics[0][0], measured[0], atol=0.3)
        np.testing.assert_allclose(best.statistics[0][1], measured[1], atol=0.05)
        assert best.cost < 0.02 * history.runs[0].scores[name].cost
    line = progress_line(history, list(targets), case.stop, "quartiles")
    assert line.endswith("quartiles of 1 of 1 materials agree best")


def test_an_unknown_objective_is_named(parts):
    with pytest.raises(Exception, match=r"'quartiles', expected 'classes', 'density' or 'likelihood'"):
        case_from({"objective": "quartiles", "materials": {"a": {"calibrate": True}}})
