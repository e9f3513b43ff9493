"""Model of a whole case: all sections, and checks that compare keys of different sections."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Self

from pydantic import Field, field_validator, model_validator

from radcal.bands import WIDTH_FACTOR, same_label
from radcal.config.fitting_defaults import fitting_defaults, with_starting_laws
from radcal.config.part import Measurements, Part, Radars
from radcal.laws import DEFAULT_LAW, EXTERNAL, laws_known
from radcal.sections.base import PASSES, CaseName
from radcal.sections.errors import Mistake, Wrong, key_in_list, mistakes_of, nearest
from radcal.sections.limits import Seed
from radcal.sections.materials import Material, OtherLaw, check_parameters, default_materials
from radcal.sections.measurement import (
    FileMeasurement,
    MeasurementConfig,
    RegistrationConfig,
    Synthetic,
    SyntheticMeasurement,
)
from radcal.sections.objectives import DEFAULT, OBJECTIVES, Objective, names
from radcal.sections.ppi import Gmti, Ppi, Products
from radcal.sections.radar import Radar, Signals
from radcal.sections.scene import BuiltinScene, SceneConfig
from radcal.sections.search import Design, Infill, Optimiser, Stop, SurrogateConfig
from radcal.sections.simulator import BuiltinSimulation, SimulatorConfig
from radcal.sections.target import TargetConfig, Uncertainty, Validation
from radcal.tables.sensors import sensors


def _synthetic_measurement() -> list[MeasurementConfig]:
    return [SyntheticMeasurement()]


class Case(Part):
    """Configuration of one calibration.

    In a case file, ``radar`` and ``measurement`` may be lists of equal length, with one item for each pass.
    """

    case: CaseName = Field("dyke", description="name of the case and of its folder below results/")
    replace: bool = Field(False, description="whether finished results of another scene or pass may be replaced")
    seed: Seed = Field(1, description="seed of all random draws without a key seed of their own")
    # a default_factory, because a section that is created here would make every job build its validator
    scene: SceneConfig = Field(default_factory=BuiltinScene, description="source of elevation, materials and objects")
    radars: Radars = Field(
        default_factory=lambda: [Radar()], description="the acquisition: track, sensor and image grid"
    )
    signals: Signals = Field(default_factory=Signals)
    simulator: SimulatorConfig = Field(
        default_factory=BuiltinSimulation, description="radcal's own simulator or any other program"
    )
    materials: dict[str, Material] = Field(
        default_factory=default_materials,
        min_length=1,
        description="surface materials by name, each with its backscatter law",
    )
    # a default_factory, so that jobs of a calibration do not build its validator
    ppi: Ppi = Field(default_factory=Ppi)
    gmti: Gmti = Field(default_factory=Gmti)
    products: Products = Field(default_factory=Products)
    measurements: Measurements = Field(
        default_factory=_synthetic_measurement, description="the measured image in a file, or a synthetic one"
    )
    colours: dict[str, str] | None = Field(None, description="colours of the materials in figures")
    registration: RegistrationConfig = Field(default_factory=RegistrationConfig)
    objective: Objective = Field(
        DEFAULT,
        description="what is compared: incidence-angle bins (classes, likelihood; docs/right_law.md) or the histogram "
        "(density)",
    )
    target: TargetConfig = Field(default_factory=TargetConfig)
    validation: Validation | None = Field(None, description="ground that the calibration leaves out, to check the laws")
    design: Design = Field(default_factory=Design)
    surrogate: SurrogateConfig = Field(default_factory=SurrogateConfig)
    optimiser: Optimiser = Field(default_factory=Optimiser)
    infill: Infill = Field(default_factory=Infill)
    uncertainty: Uncertainty = Field(default_factory=Uncertainty)
    stop: Stop = Field(default_factory=Stop)

    @model_validator(mode="before")
    @classmethod
    def _starting_laws(cls, data: object) -> object:
        return with_starting_laws(data) if isinstance(data, dict) else data

    @model_validator(mode="after")
    def _fitting_defaults(self) -> Self:
        self.__dict__.update(fitting_defaults(self))  # the model is frozen once it is made
        return self

    @field_validator("materials")
    @classmethod
    def _material_names(cls, value: dict[str, Material]) -> dict[str, Material]:
        for name in value:
            if not re.fullmatch(r"[A-Za-z0-9]([A-Za-z0-9_ -]*[A-Za-z0-9_-])?", name):
                raise ValueError(f"name {name!r} is not made of letters, digits, blanks, _ and -")
            if len(name) > 60:
                raise ValueError(f"name {name!r} has {len(name)} letters, expected at most 60: it names a file")
            if again := re.search(r"(.+)\1{19}$", name):  # Snakemake refuses such a value of a wildcard
                raise ValueError(f"name {name!r} ends with 20 times {again[1]!r}, expected at most 19 times")
        return value

    @property
    def registers_twice(self) -> bool:
        """Whether the image is registered again, onto a run of the laws that the first registration gives."""
        return self.registration.rounds == 2 and self.registration.method != "none" and self.has_baseline

    @model_validator(mode="after")
    def _of_equal_lengths(self) -> Self:
        if not len(self.radars) == len(self.measurements) > 0:
            lengths = f"radar of {len(self.radars)} and measurement of {len(self.measurements)}"
            wrong = f": found {lengths}, expected lists of equal length, with one item for each pass"
            raise Wrong("measurement", wrong)
        return self

    def contradictions(self) -> list[Mistake]:
        """Contradictions between settings of different sections, in the order of the sections."""
        return mistakes_of(self._contradictions())

    def _contradictions(self) -> Iterator[Wrong]:
        """Sentences on contradictions between settings of different sections, in the order of the sections."""
        if not self.calibrated:
            yield Wrong("materials", ": none is marked calibrate: true, expected at least one")
            return
        for name in self.target.reference_materials or []:
            if name not in self.materials:
                yield Wrong("target.reference_materials", f": no material {name!r}{nearest(name, self.materials)}")
            elif self.materials[name].calibrate:
                yield Wrong(
                    "target.reference_materials", f": {name!r} is calibrated, expected a material with fixed parameters"
                )
        if self.target.normalisation == "offset" and not self.reference_materials:
            yield Wrong(
                "target.normalisation",
                " is offset, expected at least one material with fixed parameters (calibrate: false) to give the "
                "level, found none",
            )
        headings = [one.radar.heading_deg for one in self.passes]
        if len(set(headings)) > 1:
            yield Wrong(
                "radar.*.heading_deg",
                f" are {', '.join(f'{heading:g}' for heading in headings)}, expected the same heading in all passes, "
                "which share the scene's grid: make a case of its own for each heading, and compare them with "
                "radcal apply or radcal compare (docs/passes.md)",
            )
        for number, one in enumerate(self.passes, start=1):
            for found in one._in_pass():
                section, _, rest = found.key.partition(".")
                own = f"{key_in_list(section, number - 1)}.{rest}" if section in PASSES else found.key
                yield Wrong(own, str(found).removeprefix(found.key))
        yield from self._of_objective()
        if self.design.reuse is not None and len(self.radars) > 1:
            yield Wrong(
                "design.reuse",
                f" is {self.design.reuse!r} in a case of {len(self.radars)} passes, expected one pass: a pass that is "
                "added to a case reuses the case's own runs without it",
            )
        if self.design.reuse == self.case:
            yield Wrong("design.reuse", f" is {self.case!r}, this case itself, expected an earlier one")
        yield from self._in_whole_box()
        if self.design_size == 0 and self.start_with_another_law and self.design.reuse is None:
            yield Wrong(
                "design.size",
                f" is 0 and materials.{self.start_with_another_law[0]}.start is of another law, so that no "
                "run would train the surrogate, expected design.size of at least 1",
            )
        if self.stop.max_runs < self.design_size:
            yield Wrong(
                "stop.max_runs", f" is {self.stop.max_runs}, expected at least design.size ({self.design_size})"
            )

    def _in_pass(self) -> Iterator[Wrong]:
        """Sentences on settings of one pass that contradict the laws or the measured image of this pass."""
        measurement = self.measurement
        if isinstance(measurement, SyntheticMeasurement):
            yield from self._in_hidden(measurement.synthetic)
            yield from self._in_truth(measurement.synthetic)
            yield from self._in_mismatch(measurement.synthetic)
        yield from self._in_sampling()
        yield from self._in_focused()
        yield from self._in_track()
        yield from self.laws_without_pass()
        if isinstance(measurement, FileMeasurement):
            yield from self._in_image(measurement)

    def _in_sampling(self) -> Iterator[Wrong]:
        """Sentences on resolutions too fine for the built-in simulator to sample at the given pixel spacing."""
        if not self.simulator.own:
            return
        for way in ("range", "azimuth"):
            resolution, spacing = (getattr(self.radar, f"{way}_{what}_m") for what in ("resolution", "spacing"))
            finest = WIDTH_FACTOR * spacing
            if resolution < finest * (1 - 1e-9):
                yield Wrong(
                    f"radar.{way}_resolution_m",
                    f" is {resolution:g}, expected at least {finest:.2f} at radar."
                    f"{way}_spacing_m of {spacing:g} (the image must be sampled above its bandwidth), or a spacing of "
                    f"at most {resolution / WIDTH_FACTOR:.3g}",
                )

    def _in_focused(self) -> Iterator[Wrong]:
        """Sentences on settings that runs focused from raw signals do not have."""
        if not self.simulator.focused:
            return
        why = "with simulator.product: focused"
        if not self.scene.has_heights:
            yield Wrong("scene.source", f" is {self.scene.source}, expected a scene with elevation {why}")
        if self.radar.looks % 1:
            yield Wrong("radar.looks", f" is {self.radar.looks:g}, expected a whole number {why}")
        if self.simulator.strips > 1:
            strips = f" is {self.simulator.strips}, expected 1 {why}, for which the whole scene is seen at once"
            yield Wrong("simulator.strips", strips)
        if self.signals.squint_deg:
            squint = f" is {self.signals.squint_deg:g}, expected 0 {why}, whose runs look at zero Doppler"
            yield Wrong("signals.squint_deg", squint)

    def _in_hidden(self, synthetic: Synthetic) -> Iterator[Wrong]:
        """Sentences on keys of unknown materials, and on hidden parameters that do not fit their law."""
        # default hidden parameters belong to the default case; without hidden parameters a material keeps its start
        hidden = synthetic.parameters if synthetic.is_written else {}
        sections: dict[str, Iterable[str]] = {
            "parameters": hidden,
            "laws": synthetic.laws,
            "fields_db": synthetic.fields_db,
        }
        for section, names_of in sections.items():
            for name in names_of:
                if name not in self.materials:
                    key = f"measurement.synthetic.{section}.{name}"
                    yield Wrong(key, f": no such material{nearest(name, self.materials)}")
        for name, x in hidden.items():
            if (material := self.materials.get(name)) is not None:
                key = f"measurement.synthetic.parameters.{name}"
                try:
                    check_parameters(key, x, material.unbound_law)
                    material.check_whole(key, x)
                except Wrong as error:
                    yield error

    def _in_whole_box(self) -> Iterator[Wrong]:
        """Sentence on bounds with fewer combinations of integer parameters than design and reference run need."""
        materials = [self.materials[name] for name in self.calibrated]
        if not all(all(material.integers) for material in materials):
            return
        points = math.prod(int(high - low) + 1 for material in materials for low, high in material.box)
        if self.design_size >= points:
            yield Wrong(
                "design.size",
                f" is {self.design_size}, expected less than {points}, the number of combinations of whole "
                "parameters inside the bounds, of which the reference run takes one",
            )

    def _of_objective(self) -> Iterator[Wrong]:
        """Sentences on settings that the objective does not use, and on settings that contradict the objective."""
        traits, target = OBJECTIVES[self.objective], self.target
        if not traits.bins and target.incidence_classes not in (1, "auto"):
            yield Wrong(
                "target.incidence_classes",
                f" is {target.incidence_classes}, which objective: {self.objective} does not "
                f"use, expected objective: {' or '.join(names(bins=True))}",
            )
        in_db = {"validation": "configured"} if self.validation is not None else {}
        in_db |= {"objective": self.objective} if traits.bins else {}
        for key, found in in_db.items() if target.normalisation == "image" else ():
            wrong = f" is {found} and target.normalisation is image, whose values are not in dB, expected "
            yield Wrong(key, wrong + "normalisation none or offset")
        if traits.bins and (self.surrogate.outputs, self.surrogate.training) != ("centred", "posterior"):
            yield Wrong(
                "surrogate.outputs",
                f" is {self.surrogate.outputs} and surrogate.training {self.surrogate.training}, "
                f"which objective: {self.objective} does not use, expected centred and posterior",
            )
        if traits.curve or self.validation is not None:
            key, found = ("objective", self.objective) if traits.curve else ("validation", "configured")
            for name in self.calibrated:
                if self.materials[name].law == EXTERNAL:
                    yield Wrong(
                        key,
                        f" is {found} and materials.{name}.law is {EXTERNAL}, whose curve only the simulator knows, "
                        f"expected objective: {' or '.join(names(curve=False))}, without validation",
                    )

    def _in_truth(self, synthetic: Synthetic) -> Iterator[Wrong]:
        """Sentences on calibrated laws for which the synthetic measurement has no hidden parameters."""
        for name, material in self.materials.items():
            by_default = name in synthetic.parameters and not synthetic.is_written
            if name in synthetic.laws or (name in synthetic.parameters and material.law == DEFAULT_LAW):
                continue
            if by_default or (name not in synthetic.parameters and material.starts_with_another_law):
                yield Wrong(
                    f"measurement.synthetic.parameters.{name}",
                    f" is missing, expected hidden parameters of law {material.law!r} of materials.{name}: "
                    + (f"the default is for law {DEFAULT_LAW!r}" if by_default else "its start is of another law"),
                )

    def _in_mismatch(self, synthetic: Synthetic) -> Iterator[Wrong]:
        """Sentences on mismatches of a synthetic measurement that scene, pass, laws or simulator do not support."""
        key = "measurement.synthetic"
        for name, hidden in synthetic.laws.items():
            if synthetic.is_written and name in synthetic.parameters:
                yield Wrong(f"{key}.laws.{name}", f" and {key}.parameters.{name} are both given, expected one of them")
            yield from self._without_pass(f"{key}.laws.{name}", hidden)
        if synthetic.disturbed and not self.simulator.own:
            yield Wrong(
                f"{key}.{synthetic.disturbed[0]}",
                f" is for the built-in simulator, which images the changed scene; "
                f"simulator.kind: {self.simulator.kind} receives the scene of the runs alone",
            )
        if synthetic.relief_m > 0 and not self.scene.has_heights:
            yield Wrong(
                f"{key}.relief_m", f" is {synthetic.relief_m:g}, expected 0: a slant-range scene has no heights"
            )

    def _in_track(self) -> Iterator[Wrong]:
        """Sentences on a heading of the track that the scene does not allow, or on a missing heading."""
        radar, scene = self.radar, self.scene
        if not scene.on_map:
            if radar.heading_deg:
                yield Wrong(
                    "radar.heading_deg",
                    f" is {radar.heading_deg:g}, expected none with scene.source: {scene.source}, "
                    "whose grid has no place on the map",
                )
            return
        if radar.heading_deg and scene.on_ground is not None and scene.on_ground.path is not None:
            yield Wrong(
                "radar.heading_deg",
                f" is {radar.heading_deg:g} and scene.objects.path is given, whose positions are not "
                "turned with the scene's grid, expected scene.objects.generate or a track to the north",
            )
        if radar.sensor is not None and sensors()[radar.sensor].orbit and "heading_deg" not in radar.model_fields_set:
            yield Wrong(
                "radar.heading_deg",
                f" is missing: the track of sensor {radar.sensor} does not head north (docs/sensors.md)",
            )

    def laws_without_pass(self) -> Iterator[Wrong]:
        """Sentences on laws that the simulator cannot evaluate, or that are not for the pass."""
        for name, material in self.materials.items():
            if material.law == EXTERNAL and self.simulator.own:
                yield Wrong(
                    f"materials.{name}.law",
                    f" is {EXTERNAL}, which only simulator.kind: command can simulate, "
                    f"expected one of {', '.join(laws_known(external=False))}",
                )
            if material.starts_with_another_law and self.simulator.only_parameters:
                yield Wrong(
                    f"materials.{name}.start",
                    f" is of law {material.at_start.law!r}, which simulator.kind: command does "
                    f"not receive: expected a list of {len(material.parameter_names)} numbers for law "
                    f"{material.law!r}",
                )
            for key, seen in ((name, material), (f"{name}.start", material.at_start)):
                yield from self._without_pass(f"materials.{key}", seen)

    def _without_pass(self, key: str, material: Material | OtherLaw) -> Iterator[Wrong]:
        """Sentences on a law, at its key, that has no numbers for the frequency or the polarisation of the pass."""
        law, radar = material.unbound_law, self.radar
        if "frequency_ghz" in law.needs and radar.frequency_ghz is None:
            yield Wrong("radar.frequency_ghz", f" is missing: law {material.law!r} of {key} depends on it")
        if radar.polarisation not in law.polarisations:
            known = " or ".join(law.polarisations)
            yield Wrong(
                "radar.polarisation", f" is {radar.polarisation}, expected {known} for law {material.law!r} of {key}"
            )

    def _in_image(self, measurement: FileMeasurement) -> Iterator[Wrong]:
        """Sentences on a file that is no image, or on an image whose keys contradict those of section ``radar``."""
        for key in ("elevation", "materials", "labels"):
            of_scene = getattr(self.scene, key, None)
            if of_scene and measurement.band in (None, 1) and Path(of_scene) == Path(measurement.path):
                yield Wrong(
                    "measurement.path",
                    f" and scene.{key} are the same file {of_scene}, expected the measured image in measurement.path",
                )
        for key, other, why in (
            ("radiometry", "radiometry", "since the simulated image is made in it"),
            ("polarisation", "polarisation", "since polarisations are never mixed"),
            ("carrier_band", "band", "since bands are never mixed"),
        ):
            image, own = getattr(measurement, key), getattr(self.radar, other)
            if image is not None and not same_label(image, own):
                yield Wrong(
                    f"measurement.{key}",
                    f" is {image}, radar.{other} is {own}: set radar.{other} to the measurement's, {why}",
                )
