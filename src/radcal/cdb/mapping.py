"""File in which users say what the names and codes of a database are in the scene."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

from pydantic import Field, ValidationError

from radcal.config.yaml_file import read_case_file
from radcal.errors import SceneError
from radcal.sections.base import Section
from radcal.sections.errors import first_of, mistakes
from radcal.sections.limits import Decibels

__all__ = ["CdbMapping", "FeatureClass", "read_mapping"]

_MOST_MATERIALS = 126  # ids are stored in one byte, with a bit for mixtures


class FeatureClass(Section):
    """Objects of one feature code."""

    kind: str = Field("", description="name of the kind of object")
    rcs_db_per_m2: Decibels = Field(description="mean cross-section per square metre of the footprint [dB]")


class CdbMapping(Section):
    """What composite materials and feature codes of a database are in the scene.

    Attributes
    ----------
    composites : dict of str to str
        Material of each composite material, by their names.
    features : dict of str to FeatureClass
        Class of objects of each feature code; points of other codes are no objects.
    surfaces : dict of str to str
        Material of the lines and areas of each feature code, such as roads and waters; a later one lies above.
    materials : dict
        Materials for ``materials_from`` of a case, which alone reads them.
    """

    composites: Annotated[dict[str, str], Field(min_length=1)]
    features: dict[str, FeatureClass] = Field(default_factory=dict)
    surfaces: dict[str, str] = Field(default_factory=dict)
    materials: dict[str, Any] = Field(default_factory=dict)

    @property
    def names(self) -> dict[int, str]:
        """Name of each material id, from 1, in the order of the file."""
        return dict(enumerate(dict.fromkeys([*self.composites.values(), *self.surfaces.values()]), start=1))


def read_mapping(path: Path) -> CdbMapping:
    """Read the file of ``scene.materials``.

    Raises
    ------
    ConfigError
        The file is not YAML.
    SceneError
        A key or value is wrong, or the file names too many materials.
    """
    try:
        mapping = CdbMapping.model_validate(read_case_file(path))
    except ValidationError as error:
        texts = [one.text for one in mistakes(error, CdbMapping)]
        raise SceneError(f"scene.materials: {path}: {first_of(texts)}") from None
    if len(mapping.names) > _MOST_MATERIALS:
        raise SceneError(
            f"scene.materials: {path} names {len(mapping.names)} materials, expected at most {_MOST_MATERIALS}."
        )
    return mapping
