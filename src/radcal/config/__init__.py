"""Typed configuration of a case; only this package interprets the configuration.

A case is one YAML file. Each section has a model in a module of its own. Missing keys take the default values of the
models. In the default case, every key has its default value; ``python -m radcal.config`` prints this case as
``config/config.yaml``. An unknown key is an error. No model can be changed after its creation.
"""

from radcal.config.case import Case
from radcal.config.inputs import (
    check_reuse,
    executable_path,
    expand_path,
    files_below,
    input_files,
    missing_inputs,
    vrt_folders,
)
from radcal.config.loading import Loaded, case_from, load, load_forward, load_measured, load_with_problems
from radcal.config.writing import default_case, default_yaml
from radcal.sections.base import FILL_IN
from radcal.sections.errors import nearest
from radcal.sections.materials import Material
from radcal.sections.measurement import (
    FileMeasurement,
    RegistrationConfig,
    Synthetic,
    SyntheticMeasurement,
    starts_as_truth,
)
from radcal.sections.radar import Radar
from radcal.sections.scene import BuiltinScene, RasterScene, SceneConfig, SceneObjects, SlantRangeScene
from radcal.sections.search import Optimiser, Stop, SurrogateConfig
from radcal.sections.simulator import (
    BuiltinSimulation,
    CommandSimulation,
    InputFile,
    Output,
    RawType,
    SimulatorConfig,
)
from radcal.sections.target import TargetConfig
from radcal.sections.uncertainty import Uncertainty, Validation

__all__ = [
    "FILL_IN",
    "BuiltinScene",
    "BuiltinSimulation",
    "Case",
    "CommandSimulation",
    "FileMeasurement",
    "InputFile",
    "Loaded",
    "Material",
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
    "Stop",
    "SurrogateConfig",
    "Synthetic",
    "SyntheticMeasurement",
    "TargetConfig",
    "Uncertainty",
    "Validation",
    "case_from",
    "check_reuse",
    "default_case",
    "default_yaml",
    "executable_path",
    "expand_path",
    "files_below",
    "input_files",
    "load",
    "load_forward",
    "load_measured",
    "load_with_problems",
    "missing_inputs",
    "nearest",
    "starts_as_truth",
    "vrt_folders",
]
