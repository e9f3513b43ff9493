"""Typed configuration of a case; only this package interprets the configuration.

A case is one YAML file. Each section of the file has a pydantic model, defined in one module of this package. A key
that the file lacks takes the default value of the model; an unknown key is an error. The default values of all models
form the default case, which is the content of ``config/config.yaml``. No model can be changed after its creation.
"""

from radcal.config.case import Case
from radcal.config.design import Design
from radcal.config.inputs import check_reuse, executable_path, expand_path, files_below, input_files, vrt_folders
from radcal.config.loading import case_from, load
from radcal.config.materials import Material, Start
from radcal.config.measurement import FileMeasurement, MeasurementConfig, Synthetic, SyntheticMeasurement
from radcal.config.optimiser import Optimiser
from radcal.config.pydantic_errors import nearest
from radcal.config.radar import Radar
from radcal.config.registration import RegistrationConfig
from radcal.config.scene import BuiltinScene, RasterScene, SceneConfig, SceneObjects, SlantRangeScene
from radcal.config.simulator import (
    BuiltinSimulation,
    CommandSimulation,
    InputFile,
    Output,
    RawType,
    SimulatorConfig,
    Template,
)
from radcal.config.stop import Stop
from radcal.config.surrogate import SurrogateConfig
from radcal.config.target import TargetConfig
from radcal.config.validation import Validation
from radcal.config.writing import default_yaml

__all__ = [
    "BuiltinScene",
    "BuiltinSimulation",
    "Case",
    "CommandSimulation",
    "Design",
    "FileMeasurement",
    "InputFile",
    "Material",
    "MeasurementConfig",
    "Optimiser",
    "Output",
    "Radar",
    "RasterScene",
    "RawType",
    "RegistrationConfig",
    "SceneConfig",
    "SceneObjects",
    "SimulatorConfig",
    "SlantRangeScene",
    "Start",
    "Stop",
    "SurrogateConfig",
    "Synthetic",
    "SyntheticMeasurement",
    "TargetConfig",
    "Template",
    "Validation",
    "case_from",
    "check_reuse",
    "default_yaml",
    "executable_path",
    "expand_path",
    "files_below",
    "input_files",
    "load",
    "nearest",
    "vrt_folders",
]
