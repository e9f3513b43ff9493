"""Typed configuration of a case; only this package interprets the configuration.

A case is one YAML file. Each section has a model in a module of its own. Missing keys take the default values of the
models. In the default case, every key has its default value; ``python -m radcal.config`` prints this case as
``config/config.yaml``. An unknown key is an error. No model can be changed after its creation.
"""

from radcal.config.case import Case
from radcal.config.design import Design
from radcal.config.inputs import (
    check_reuse,
    executable_path,
    expand_path,
    files_below,
    input_files,
    missing_inputs,
    vrt_folders,
)
from radcal.config.loading import case_from, load, load_forward, load_measured
from radcal.config.materials import Material, Start
from radcal.config.measurement import (
    FileMeasurement,
    HiddenLaw,
    MeasurementConfig,
    Synthetic,
    SyntheticMeasurement,
    starts_as_truth,
)
from radcal.config.mistakes import Loaded, load_with_problems
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
from radcal.config.uncertainty import Uncertainty
from radcal.config.undecided import FILL_IN
from radcal.config.validation import Validation
from radcal.config.writing import default_case, default_yaml

__all__ = [
    "FILL_IN",
    "BuiltinScene",
    "BuiltinSimulation",
    "Case",
    "CommandSimulation",
    "Design",
    "FileMeasurement",
    "HiddenLaw",
    "InputFile",
    "Loaded",
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
