"""Typed configuration of a case; only this package interprets the configuration.

A case is one YAML file. Each section has a model in a module of its own. Missing keys take the default values of the
models. In the default case, every key has its default value; ``python -m radcal.config`` prints this case as
``config/config.yaml``. An unknown key is an error. No model can be changed after its creation.
"""

from radcal.config.case import Case
from radcal.config.inputs import expand_path, input_files
from radcal.config.loading import case_from, load, load_forward, load_with_problems
from radcal.sections.materials import Material
from radcal.sections.measurement import FileMeasurement, RegistrationConfig, SyntheticMeasurement
from radcal.sections.radar import Radar
from radcal.sections.scene import RasterScene, SlantRangeScene
from radcal.sections.search import Optimiser, Stop, SurrogateConfig
from radcal.sections.simulator import CommandSimulation
from radcal.sections.target import TargetConfig, Uncertainty, Validation

__all__ = [
    "Case",
    "CommandSimulation",
    "FileMeasurement",
    "Material",
    "Optimiser",
    "Radar",
    "RasterScene",
    "RegistrationConfig",
    "SlantRangeScene",
    "Stop",
    "SurrogateConfig",
    "SyntheticMeasurement",
    "TargetConfig",
    "Uncertainty",
    "Validation",
    "case_from",
    "expand_path",
    "input_files",
    "load",
    "load_forward",
    "load_with_problems",
]
