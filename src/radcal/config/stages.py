"""Sections of the configuration that each stage reads: one frozen model for each rule of the workflow.

The ``params`` of a rule are the fields of its model (:meth:`Stage.params`). The rule's script restores the model from
them and passes it to functions of the library, whose arguments have the model as their type. Therefore mypy rejects
access to a section that the model lacks, and a job runs again when a section of its model has changed
(``docs/reruns.md``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

from radcal.config.case import Case
from radcal.config.design import Design
from radcal.config.limits import Seed
from radcal.config.materials import Material
from radcal.config.measurement import MeasurementConfig
from radcal.config.objectives import Objective
from radcal.config.optimiser import Optimiser
from radcal.config.part import Part
from radcal.config.radar import Radar
from radcal.config.registration import RegistrationConfig
from radcal.config.scene import SceneConfig
from radcal.config.sections import CaseName
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
    """Sections of the configuration that a stage reads."""

    @classmethod
    def of(cls, case: Case) -> Self:
        """Model with the stage's sections of a whole case."""
        return cls.model_validate({name: getattr(case, name) for name in cls.model_fields})

    @classmethod
    def params(cls, case: Case) -> dict[str, Any]:
        """Stage's sections of a whole case as plain data, from which ``model_validate`` restores the model."""
        return case.sections(*cls.model_fields)


class Scene(Stage):
    """Sections for the scene and the names of its materials."""

    scene: SceneConfig
    materials: dict[str, Material]


class Geometry(Stage):
    """Section for the geometry: the pass."""

    radar: Radar


class Simulator(Stage):
    """Sections for the simulator: its settings, and the materials and the pass that it receives."""

    radar: Radar
    simulator: SimulatorConfig
    materials: dict[str, Material]


class Measurement(Simulator):
    """Sections for the measured image, which is checked against pass, materials and target."""

    measurement: MeasurementConfig
    target: TargetConfig


class Laws(Stage):
    """Sections for the laws of the runs, with their pass."""

    seed: Seed
    radar: Radar
    materials: dict[str, Material]


class Scores(Laws):
    """Sections for the scores of the runs: laws, in all passes, and objective."""

    objective: Objective
    further_radar: list[Radar] | None = None


class Simulation(Simulator, Laws):
    """Sections that determine the numbers of a run."""


class Reuse(Simulation):
    """Sections for the reuse of an earlier case's runs."""


class ReferenceRun(Simulation):
    """Sections for the reference run."""


class Registration(Stage):
    """Sections for the registration, with the materials that the record of the reference run must hold."""

    materials: dict[str, Material]
    registration: RegistrationConfig


class Target(Simulation, Scores):
    """Sections for the targets: pixels, levels and incidence-angle bins."""

    target: TargetConfig
    validation: Validation | None


class DesignSize(Stage):
    """Sections for the number of runs of the design."""

    materials: dict[str, Material]
    target: TargetConfig
    design: Design
    surrogate: SurrogateConfig


class DesignChunk(Simulation):
    """Sections for the runs of the design; their number is a parameter of its own."""

    design: Design


class Train(Scores):
    """Sections for the training of surrogates; section ``simulator`` tells whether runs are deterministic."""

    simulator: SimulatorConfig
    surrogate: SurrogateConfig


class Propose(Scores):
    """Sections for the search for the next parameters."""

    optimiser: Optimiser


class Verify(Simulation, Train):
    """Sections for the run of the proposals, its score, and what the surrogate of all runs still promises."""


class StopSettings(Stage):
    """Section for the stop criteria."""

    stop: Stop


class FinalRuns(Simulation):
    """Sections for the final runs, with the calibrated laws of all materials together."""

    further_radar: list[Radar] | None = None


class Archive(Stage):
    """Sections for the archive: all but ``replace`` and ``stop``; the stop criteria come from a file."""

    # in the order of the whole case, in which the archive records them
    case: CaseName
    seed: Seed
    scene: SceneConfig
    radar: Radar
    simulator: SimulatorConfig
    materials: dict[str, Material]
    measurement: MeasurementConfig
    further_radar: list[Radar] | None = None
    further_measurement: list[MeasurementConfig] | None = None
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
"""Model of each rule, by the rule's name."""
