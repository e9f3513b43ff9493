"""Sections of the configuration as plain data, and what follows from them, for a whole case and for a stage's part."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Protocol, Self, TypeVar

from radcal.config.design import Design
from radcal.config.materials import Material
from radcal.config.radar import Radar
from radcal.config.sections import Objective, Section
from radcal.config.target import TargetConfig
from radcal.radar.laws import Law, law_for
from radcal.storage.disclosure import Undisclosed

__all__ = ["Part"]

_DESIGN_SIZE: Mapping[Objective, int] = {"classes": 2, "likelihood": 2, "density": 16}  # bins know the law without runs


class _Materials(Protocol):
    @property
    def materials(self) -> dict[str, Material]: ...

    def model_copy(self, *, update: Mapping[str, Any] | None = None) -> Self: ...


class _Pass(_Materials, Protocol):
    @property
    def radar(self) -> Radar: ...


class _Levels(_Materials, Protocol):
    @property
    def target(self) -> TargetConfig: ...


class _Design(Protocol):
    @property
    def objective(self) -> Objective: ...

    @property
    def design(self) -> Design: ...


_OfMaterials = TypeVar("_OfMaterials", bound=_Materials)


class Part(Section):
    """Some sections of the configuration, or all of them.

    Each property says in the type of ``self`` which sections it follows from, so that mypy refuses it where
    they are missing.
    """

    def sections(self, *names: str) -> dict[str, Any]:
        """Return the named sections as plain data, for a rule's ``params``."""
        sections = self.model_dump(mode="json", include=set(names))
        if environment := sections.get("simulator", {}).get("environment"):
            sections["simulator"]["environment"] = Undisclosed(environment)
        return sections

    @property
    def calibrated(self: _Materials) -> list[str]:
        """Names of the materials to calibrate, in the order of the file."""
        return [name for name, material in self.materials.items() if material.calibrate]

    @property
    def start_with_another_law(self: _Materials) -> list[str]:
        """Names of the calibrated materials whose reference run is made with another law."""
        return [name for name, material in self.materials.items() if material.starts_with_another_law]

    @property
    def at_start(self: _OfMaterials) -> _OfMaterials:
        """The same as the reference run sees it: materials have the law of their start."""
        return self.model_copy(
            update={"materials": {name: material.at_start for name, material in self.materials.items()}}
        )

    @property
    def laws(self: _Pass) -> dict[str, Law]:
        """Every material's law for this pass, ready to be evaluated unless it is external."""
        return {
            name: law_for(
                material.law,
                frequency_ghz=self.radar.frequency_ghz,
                polarisation=self.radar.polarisation,
                angles_deg=material.angles_deg,
                names=material.names,
                units=material.units,
            )
            for name, material in self.materials.items()
        }

    @property
    def reference_materials(self: _Levels) -> list[str]:
        """Names of the fixed materials from which the measured image's level is estimated."""
        if self.target.reference_materials is not None:
            return list(self.target.reference_materials)
        return [name for name, material in self.materials.items() if not material.calibrate]

    @property
    def design_size(self: _Design) -> int:
        """Number of runs of the design."""
        return _DESIGN_SIZE[self.objective] if self.design.size == "auto" else self.design.size
