"""Base class of the models that contain several sections: export as plain data, and values derived from sections."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar

from pydantic import BeforeValidator, ConfigDict, Field, SerializerFunctionWrapHandler, WrapSerializer

from radcal.config.disclosure import Undisclosed
from radcal.laws import EXTERNAL, OF_PASS, Law
from radcal.sections.base import Section
from radcal.sections.materials import Material
from radcal.sections.measurement import MeasurementConfig, RegistrationConfig
from radcal.sections.ppi import Gmti, Ppi, Products
from radcal.sections.radar import Radar, Signals
from radcal.sections.scene import SceneConfig
from radcal.sections.search import Design, Infill, Optimiser, Stop, SurrogateConfig
from radcal.sections.simulator import SimulatorConfig
from radcal.sections.target import TargetConfig, Uncertainty, Validation

# The baseline predicts most of how a run depends on X, and its error is learnt where the search goes. A reference run
# with another law trains no surrogate: the first search then needs a design.
_DESIGN_SIZE_WITHOUT_REFERENCE = 2
_DESIGN_SIZE_WITHOUT_BASELINE = 8

_Item = TypeVar("_Item")


def _listed(value: object) -> object:
    return value if isinstance(value, list) else [value]


def _alone(items: list[Any], write: SerializerFunctionWrapHandler) -> Any:
    written = write(items)
    return written[0] if len(written) == 1 else written


# sections of all passes: in plain data a list, or of a single pass the section itself
_PerPass = Annotated[list[_Item], BeforeValidator(_listed), WrapSerializer(_alone)]

Radars = Annotated[_PerPass[Radar], Field(alias="radar")]
"""Acquisition of each pass."""
Measurements = Annotated[_PerPass[MeasurementConfig], Field(alias="measurement")]
"""Measured image of each pass."""


class Part(Section):
    """Some or all sections of the configuration: those of a stage (:mod:`radcal.config.stages`), or those of a case.

    A part has only the sections that its model declares. Every other section, and a property that is derived from it,
    is an AttributeError.
    """

    if TYPE_CHECKING:
        case: str
        seed: int
        scene: SceneConfig
        radars: list[Radar]
        signals: Signals
        simulator: SimulatorConfig
        materials: dict[str, Material]
        ppi: Ppi
        gmti: Gmti
        products: Products
        measurements: list[MeasurementConfig]
        colours: dict[str, str] | None
        registration: RegistrationConfig
        objective: str
        target: TargetConfig
        validation: Validation | None
        design: Design
        surrogate: SurrogateConfig
        optimiser: Optimiser
        infill: Infill
        uncertainty: Uncertainty
        stop: Stop

    model_config = ConfigDict(serialize_by_alias=True)  # plain data have the keys of a case file

    @classmethod
    def of(cls, case: Part) -> Self:
        """Model filled with its sections of a whole case, or of another model that contains them."""
        return cls.model_validate(
            {field.alias or name: getattr(case, name) for name, field in cls.model_fields.items()}
        )

    def sections(self, *names: str) -> dict[str, Any]:
        """Sections of the fields with the given names as plain data, for the ``params`` of a Snakemake rule."""
        sections = self.model_dump(mode="json", include=set(names))
        if sections.get("colours", {}) is None:  # a case without colours has the jobs it had before this key existed
            del sections["colours"]
        if sections.get("infill") == Infill().model_dump():
            del sections["infill"]
        if sections.get("stop", {}).get("max_hours", 0) is None:
            del sections["stop"]["max_hours"]
        simulator = sections.get("simulator", {})
        simulator.pop("strips", None)  # the geometry has the same bits in any number of strips
        if environment := simulator.get("environment"):
            simulator["environment"] = Undisclosed(environment)
        return sections

    @property
    def calibrated(self) -> list[str]:
        """Names of the materials to calibrate, in the order of the case file."""
        return [name for name, material in self.materials.items() if material.calibrate]

    @property
    def start_parameters(self) -> dict[str, list[float]]:
        """Law parameters of each material in the reference run, for the laws of :attr:`at_start`."""
        return {name: material.start_parameters for name, material in self.materials.items()}

    @property
    def start_with_another_law(self) -> list[str]:
        """Names of the calibrated materials whose law in the reference run differs from the calibrated law."""
        return [name for name, material in self.materials.items() if material.starts_with_another_law]

    @property
    def at_start(self) -> Self:
        """Copy of the model for the reference run, in which each material has the law with which it starts."""
        return self.model_copy(
            update={"materials": {name: material.at_start for name, material in self.materials.items()}}
        )

    @property
    def laws(self) -> dict[str, Law]:
        """Law of each material at the frequency and polarisation of the pass."""
        conditions = {key: getattr(self.radar, key) for key in OF_PASS}
        return {name: material.unbound_law.bound(**conditions) for name, material in self.materials.items()}

    @property
    def passes(self) -> list[Self]:
        """List of copies of the model, one for each pass: each copy contains the sections of its pass alone."""
        fields = [name for name in ("radars", "measurements") if hasattr(self, name)]
        count = range(len(self.radars))
        return [self.model_copy(update={name: [getattr(self, name)[k]] for name in fields}) for k in count]

    @property
    def radar(self) -> Radar:
        """Acquisition of a model of one pass; of several passes, that of the first, which defines the looks."""
        return self.radars[0]

    @property
    def measurement(self) -> MeasurementConfig:
        """Measured image of a model of one pass; of several passes, that of the first."""
        return self.measurements[0]

    @property
    def reference_materials(self) -> list[str]:
        """Names of the materials with fixed parameters from which radcal estimates the level of the measured image."""
        if self.target.reference_materials is not None:
            return list(self.target.reference_materials)
        return [name for name, material in self.materials.items() if not material.calibrate]

    @property
    def has_baseline(self) -> bool:
        """Whether all surrogates have a baseline: a prediction of the statistics from law, speckle and noise."""
        curves = all(material.law != EXTERNAL for material in self.materials.values() if material.calibrate)
        learnt = self.surrogate.baseline and self.surrogate.outputs == "centred"
        return curves and learnt and self.target.normalisation != "image"

    @property
    def design_size(self) -> int:
        """Number of runs of the design, also if the configured size is ``auto``."""
        if self.design.size != "auto":
            return self.design.size
        if self.has_baseline:
            return _DESIGN_SIZE_WITHOUT_REFERENCE if self.start_with_another_law else 0
        most = max(len(material.box) for material in self.materials.values() if material.calibrate)
        return max(_DESIGN_SIZE_WITHOUT_BASELINE, 2 * most)

    @property
    def design_parts(self) -> int:
        """Number of workflow jobs that simulate the design in one pass."""
        return -(-self.design_size // self.design.chunk)
