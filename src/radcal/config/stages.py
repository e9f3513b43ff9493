"""Models of the configuration sections that each workflow rule reads: one model for each rule.

The ``params`` of a rule are the fields of its model (:meth:`Stage.params`). The rule's script restores the model from
``params`` and passes it to library functions, whose type annotations name the model. mypy therefore rejects access to
a section that the model lacks. A job runs again when a section of its model has changed (``docs/reruns.md``).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Self

from radcal.config.case import Case
from radcal.config.part import Measurements, Part, Radars
from radcal.sections.base import CaseName
from radcal.sections.limits import Seed
from radcal.sections.materials import Material
from radcal.sections.measurement import RegistrationConfig
from radcal.sections.objectives import Objective
from radcal.sections.scene import SceneConfig
from radcal.sections.search import Design, Optimiser, Stop, SurrogateConfig
from radcal.sections.simulator import SimulatorConfig
from radcal.sections.target import TargetConfig
from radcal.sections.uncertainty import Uncertainty, Validation

__all__ = [
    "STAGES",
    "ArchiveStage",
    "DesignChunk",
    "Export",
    "FinalRuns",
    "ForwardStage",
    "GeometryStage",
    "LawsOfImage",
    "MeasurementStage",
    "PosteriorStage",
    "Propose",
    "ReferenceRun",
    "Registration",
    "RegistrationRun",
    "Reuse",
    "SceneStage",
    "Scores",
    "Simulation",
    "SimulatorStage",
    "Stage",
    "StopSettings",
    "TargetStage",
    "Train",
    "Verify",
]


class Stage(Part):
    """Base class of the models; the fields of a model are the configuration sections that one rule reads."""

    @classmethod
    def of(cls, case: Case) -> Self:
        """Model of this stage, filled with the sections of a whole case that the stage reads."""
        return cls.model_validate(
            {field.alias or name: getattr(case, name) for name, field in cls.model_fields.items()}
        )

    @classmethod
    def params(cls, case: Case) -> dict[str, Any]:
        """Sections of a whole case that the stage of this model reads, as plain data for ``model_validate``."""
        return case.sections(*cls.model_fields)


class SceneStage(Stage):
    """Sections that rule ``scene`` reads: the scene, and the materials for their names."""

    scene: SceneConfig
    materials: dict[str, Material]


class GeometryStage(Stage):
    """Section that rule ``geometry`` reads: the pass."""

    radars: Radars


class SimulatorStage(Stage):
    """Sections that rule ``simulator`` reads: simulator settings, materials and pass."""

    radars: Radars
    simulator: SimulatorConfig
    materials: dict[str, Material]


class MeasurementStage(SimulatorStage):
    """Sections that rule ``measurement`` reads to simulate or read the measured image, and to check the image."""

    measurements: Measurements
    target: TargetConfig


class Laws(Stage):
    """Sections that define the laws of the runs: seed, pass and materials."""

    seed: Seed
    radars: Radars
    materials: dict[str, Material]


class Scores(Laws):
    """Sections that rule ``scores`` reads to score the runs: the laws in all passes, and the objective."""

    objective: Objective


class Simulation(SimulatorStage, Laws):
    """Sections that determine the pixel values of a run."""


class Reuse(Simulation):
    """Sections that rule ``reuse`` reads to find reusable runs of an earlier case."""


class ReferenceRun(Simulation):
    """Sections that rule ``reference_run`` reads."""


class Registration(Stage):
    """Sections that rule ``registration`` reads: its settings, the pass, and the materials of a run's record."""

    radars: Radars
    materials: dict[str, Material]
    registration: RegistrationConfig


class RegistrationRun(Simulation):
    """Sections that rule ``registration_run`` reads."""


class TargetStage(Simulation, Scores):
    """Sections that rule ``target`` reads to derive the targets of the materials."""

    target: TargetConfig
    validation: Validation | None


class LawsOfImage(TargetStage):
    """Sections that rule ``laws_of_image`` reads to fit laws for the registration run."""


class DesignChunk(Simulation):
    """Sections that rule ``design_chunk`` reads; a separate parameter of the rule gives the number of runs."""

    design: Design


class Train(Scores):
    """Sections that rule ``train`` reads; section ``simulator`` shows whether runs are deterministic."""

    simulator: SimulatorConfig
    surrogate: SurrogateConfig


class Propose(Scores):
    """Sections that rule ``propose`` reads to search for the next parameters X."""

    optimiser: Optimiser


class Verify(Simulation, Train):
    """Sections that rule ``verify`` reads to run and score proposals, and to predict a possible further improvement."""


class PosteriorStage(Simulation, Train):
    """Sections that rule ``posterior`` reads, also for an image of many looks of the built-in simulator."""

    target: TargetConfig
    validation: Validation | None
    uncertainty: Uncertainty


class StopSettings(Stage):
    """Section that rule ``stop_settings`` reads: the stop criteria."""

    stop: Stop


class FinalRuns(Simulation):
    """Sections that rule ``final_runs`` reads to run the calibrated laws of all materials together."""


class ForwardStage(FinalRuns):
    """Sections that a forward run reads: scene, passes, simulator and materials."""

    case: CaseName
    scene: SceneConfig


class Export(FinalRuns):
    """Sections that rule ``export`` reads to write the calibrated materials and images with their texture."""


class ArchiveStage(Stage):
    """Sections that rule ``archive`` reads: all but ``replace`` and ``stop``; the stop criteria come from a file."""

    # in the same order as in class Case, because the archive records the sections in this order
    case: CaseName
    seed: Seed
    scene: SceneConfig
    radars: Radars
    simulator: SimulatorConfig
    materials: dict[str, Material]
    measurements: Measurements
    colours: dict[str, str] | None = None
    registration: RegistrationConfig
    objective: Objective
    target: TargetConfig
    validation: Validation | None
    design: Design
    surrogate: SurrogateConfig
    optimiser: Optimiser
    uncertainty: Uncertainty


STAGES: Mapping[str, type[Stage]] = {
    "scene": SceneStage,
    "geometry": GeometryStage,
    "simulator": SimulatorStage,
    "measurement": MeasurementStage,
    "reuse": Reuse,
    "reference_run": ReferenceRun,
    "registration": Registration,
    "laws_of_image": LawsOfImage,
    "registration_run": RegistrationRun,
    "target": TargetStage,
    "design_chunk": DesignChunk,
    "scores": Scores,
    "train": Train,
    "propose": Propose,
    "verify": Verify,
    "stop_settings": StopSettings,
    "final_runs": FinalRuns,
    "posterior": PosteriorStage,
    "archive": ArchiveStage,
    "export": Export,
}
"""Model of each rule, by the name of the rule."""
