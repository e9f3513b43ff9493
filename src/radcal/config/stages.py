"""Sections of the configuration that each stage reads: one frozen model a rule of the workflow.

A rule takes its ``params`` from the fields (:meth:`Stage.params`), its script makes the model of them again, and
functions of the library have it as the type of their argument: mypy refuses a section that the model does not name,
and a job runs again when one that it names has changed (``docs/reruns.md``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

from radcal.config.case import Case
from radcal.config.design import Design
from radcal.config.limits import Seed
from radcal.config.materials import Material
from radcal.config.measurement import MeasurementConfig
from radcal.config.optimiser import Optimiser
from radcal.config.part import Part
from radcal.config.radar import Radar
from radcal.config.registration import RegistrationConfig
from radcal.config.scene import SceneConfig
from radcal.config.sections import CaseName, Objective
from radcal.config.simulator import SimulatorConfig
from radcal.config.stop import Stop
from radcal.config.surrogate import SurrogateConfig
from radcal.config.target import TargetConfig
from radcal.config.validation import Validation

__all__ = [
    "STAGES",
    "Archive",
    "DesignChunk",
    "DesignSize",
    "FinalRuns",
    "Geometry",
    "Measurement",
    "Propose",
    "ReferenceRun",
    "Registration",
    "Reuse",
    "Scene",
    "Scores",
    "Simulation",
    "Simulator",
    "Stage",
    "StopSettings",
    "Target",
    "Train",
    "Verify",
]


class Stage(Part):
    """What a stage reads."""

    @classmethod
    def of(cls, case: Case) -> Self:
        """The stage's sections of a whole case."""
        return cls.model_validate({name: getattr(case, name) for name in cls.model_fields})

    @classmethod
    def params(cls, case: Case) -> dict[str, Any]:
        """The same as plain data, of which a script makes the model again by ``model_validate``."""
        return case.sections(*cls.model_fields)


class Scene(Stage):
    """Scene and names of its materials."""

    scene: SceneConfig
    materials: dict[str, Material]


class Geometry(Stage):
    """Pass."""

    radar: Radar


class Simulator(Stage):
    """Simulator, and what it is told of materials and pass."""

    radar: Radar
    simulator: SimulatorConfig
    materials: dict[str, Material]


class Measurement(Simulator):
    """Measured image, and what it is checked for."""

    measurement: MeasurementConfig
    target: TargetConfig


class Scores(Stage):
    """Laws that runs are scored for; what is minimised comes with the targets' file."""

    seed: Seed
    radar: Radar
    materials: dict[str, Material]


class Simulation(Simulator, Scores):
    """What determines the numbers of a run."""


class Reuse(Simulation):
    """Runs of an earlier case."""


class ReferenceRun(Simulation):
    """Reference run."""


class Registration(Stage):
    """Registration, and materials that the reference run's record holds."""

    materials: dict[str, Material]
    registration: RegistrationConfig


class Target(Simulation):
    """Pixels, levels and incidence-angle bins."""

    objective: Objective
    target: TargetConfig
    validation: Validation | None


class DesignSize(Stage):
    """Number of runs and chunks of the design."""

    objective: Objective
    design: Design


class DesignChunk(Simulation, DesignSize):
    """Runs of the design."""


class Train(Stage):
    """Surrogates, and whether the simulator is deterministic."""

    simulator: SimulatorConfig
    materials: dict[str, Material]
    surrogate: SurrogateConfig


class Propose(Scores):
    """Search for the next parameters."""

    optimiser: Optimiser


class Verify(Simulation):
    """Run of the proposals, and its score."""


class StopSettings(Stage):
    """Stop criteria."""

    stop: Stop


class FinalRuns(Simulation):
    """Runs of the calibrated laws together."""


class Archive(Stage):
    """Nearly everything; the stop criteria come as a file."""

    # in the order of the whole case, which the archive records
    case: CaseName
    seed: Seed
    scene: SceneConfig
    radar: Radar
    simulator: SimulatorConfig
    materials: dict[str, Material]
    measurement: MeasurementConfig
    registration: RegistrationConfig
    objective: Objective
    target: TargetConfig
    validation: Validation | None
    design: Design
    surrogate: SurrogateConfig
    optimiser: Optimiser


STAGES: Mapping[str, type[Stage]] = {
    "scene": Scene,
    "geometry": Geometry,
    "simulator": Simulator,
    "measurement": Measurement,
    "reuse": Reuse,
    "reference_run": ReferenceRun,
    "registration": Registration,
    "target": Target,
    "design_chunk": DesignChunk,
    "scores": Scores,
    "train": Train,
    "propose": Propose,
    "verify": Verify,
    "stop_settings": StopSettings,
    "final_runs": FinalRuns,
    "archive": Archive,
}
"""Model by rule."""
