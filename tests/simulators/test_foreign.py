"""A simulator and a law of another distribution, which radcal finds by their entry points."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from importlib.metadata import EntryPoint
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import pytest

from radcal import plugins
from radcal.config import Case, case_from
from radcal.config.part import Part
from radcal.config.stages import STAGES
from radcal.errors import ConfigError
from radcal.laws import Law
from radcal.radar.geometry import Geometry
from radcal.sections.simulator import PythonSimulation
from radcal.simulators.runner import Runner
from radcal.simulators.sources import make_simulator
from radcal.storage.files import digest
from radcal.storage.runs import RunStore


class LevelSimulation(PythonSimulation):
    """Section ``simulator`` with a key of its own."""

    kind: Literal["level"] = "level"
    gain_db: float = 0.0


class LevelSimulator:
    """Image of each material's sigma0 at its mean incidence, without speckle."""

    section = LevelSimulation

    def __init__(self, laws: Mapping[str, Law], geometry: Geometry, gain_db: float) -> None:
        self.laws, self.geometry, self.gain_db = laws, geometry, gain_db

    @classmethod
    def of(cls, case: Part, geometry: Geometry, geometry_path: str | Path) -> LevelSimulator:
        settings: Any = case.simulator
        return cls(case.laws, geometry, settings.gain_db)

    @property
    def identity(self) -> Mapping[str, Any]:
        return {"kind": "level", "gain_db": self.gain_db}

    def run(self, parameters: Mapping[str, Sequence[float]], noise_seed: int) -> np.ndarray:
        image = np.full(self.geometry.shape, -99.0, dtype=np.float32)
        for name in self.geometry.names:
            pixels = self.geometry.pixels(name)
            phi = np.radians(self.geometry.incidence_deg.ravel()[pixels]).mean()
            image.ravel()[pixels] = float(self.laws[name](phi, parameters[name])) + self.gain_db
        return image


def damp(phi_rad: Any, parameters: Any, *, permittivity: float) -> Any:
    return parameters[0] + 0.0 * phi_rad + permittivity


DAMP = Law(damp, ("level",), ("dB",), needs=("permittivity",))


@pytest.fixture
def installed(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """Distribution of the simulator and the law; its version can be changed."""
    distribution = SimpleNamespace(name="levels", version="1.0")
    found = {"radcal.simulators": "LevelSimulator", "radcal.laws": "DAMP"}

    def entries(group: str) -> tuple[EntryPoint, ...]:
        name = {"radcal.simulators": "level", "radcal.laws": "damp"}.get(group)
        made: Any = EntryPoint(str(name), f"{__name__}:{found.get(group)}", group)
        return (made._for(distribution),) if name else ()

    monkeypatch.setattr(plugins, "_entry_points", entries)
    return distribution


def loaded(permittivity: float = 5.0) -> Case:
    law = {"law": "damp", "conditions": {"permittivity": permittivity}}
    dyke = {**law, "calibrate": True, "bounds": [[-30, -10]], "start": [-20]}
    return case_from(
        {
            "simulator": {"kind": "level", "gain_db": 2.0},
            "materials": {"dyke": dyke, "grass": {"law": "constant_gamma", "parameters": [-10]}},
            "measurement": {"synthetic": {"parameters": {"dyke": [-15]}}},
        }
    )


def test_a_run_by_a_foreign_simulator_and_law(installed: SimpleNamespace, geometry: Geometry, tmp_path: Path) -> None:
    def runner(case: Case) -> Runner:
        stage = STAGES["reference_run"].model.model_validate(STAGES["reference_run"].params(case))  # as in a job
        return Runner(RunStore(tmp_path), make_simulator(stage, geometry, tmp_path), geometry, "scene", stage)

    case = loaded()
    x = case.start_parameters
    image = runner(case).run(x, 1, image=True).image_db
    assert image is not None
    np.testing.assert_allclose(image.ravel()[geometry.pixels("dyke")], -20.0 + 5.0 + 2.0, atol=1e-5)
    described = runner(case).description(x, 1)
    origin = {"distribution": "levels", "version": "1.0"}
    assert described["simulator"] == {"kind": "level", "gain_db": 2.0, **origin}
    assert described["materials"]["dyke"] == {
        "law": "damp", "conditions": {"permittivity": 5.0}, "parameters": [-20.0], **origin
    }  # fmt: skip
    assert described["materials"]["grass"] == {"law": "constant_gamma", "parameters": [-10.0]}
    keys = {digest(described), digest(runner(loaded(permittivity=6.0)).description(x, 1))}
    installed.version = "1.1"  # a new version does not take the runs of an earlier one
    keys.add(digest(runner(case).description(x, 1)))
    assert len(keys) == 3
    with pytest.raises(ConfigError, match=r"complex is not one of simulator\.kind: level"):
        runner(case).require("complex")


@pytest.mark.usefixtures("installed")
def test_wrong_keys_of_foreign_variants_are_sentences() -> None:
    for simulator, words in (
        ({"kind": "level", "gain": 1}, r"simulator\.gain"),
        ({"kind": "level", "gain_db": "x"}, r"simulator\.gain_db is 'x', expected a number"),
        ({"kind": "levels"}, r"simulator\.kind is 'levels'"),
    ):
        with pytest.raises(ConfigError, match=words):
            case_from({"simulator": simulator})
