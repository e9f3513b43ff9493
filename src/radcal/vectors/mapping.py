"""File in which users say what the features of vector layers are in the scene."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field, ValidationError, model_validator

from radcal.config.yaml_file import read_case_file
from radcal.errors import SceneError
from radcal.sections.base import Section
from radcal.sections.errors import first_of, mistakes
from radcal.sections.limits import Decibels, Length
from radcal.sections.scene import Permittivity

if TYPE_CHECKING:
    import pandas as pd


_ANY = "*"  # in place of a value: every value that is not empty
_NONE = ("", "no")  # values of an attribute that stand for its absence
MOST_MATERIALS = 254  # ids are stored in one byte; 255 stands for no data
_NAME_ALONE = BeforeValidator(lambda value: {"material": value} if isinstance(value, str) else value)
M = TypeVar("M", bound="FeatureMapping")


class FeatureClass(Section):
    """Boxes that stand for points and footprints; the sizes are for features that have none themselves."""

    kind: str = Field("", description="what the objects are, for readers of the file")
    rcs_db_per_m2: Decibels | None = Field(None, description="mean cross-section per square metre of footprint [dB]")
    cross_section: str | None = Field(None, description="class of scene.cross_sections")
    roof: str | None = Field(None, min_length=1, description="material of the roof; walls scatter apart from it")
    wall_sigma0_db: Decibels | None = Field(None, description="sigma0 of the walls beside a roof [dB]")
    bounce: bool | None = Field(None, description="whether the double bounce is added; by default with a roof")
    length_m: Length | None = Field(None, description="side of the box of a point along its heading [m]")
    width_m: Length | None = Field(None, description="side of the box of a point across its heading [m]")
    height_m: Length | None = Field(None, description="height of the box [m]")

    @model_validator(mode="after")
    def _one_echo(self) -> Self:
        given = [self.rcs_db_per_m2, self.cross_section, self.roof]
        if given.count(None) != 2 or (self.roof is None) != (self.wall_sigma0_db is None):
            raise ValueError("has not one of rcs_db_per_m2, cross_section, and roof with wall_sigma0_db, expected one")
        return self


class Surface(Section):
    """Material of lines and areas; in a file, the name of the material alone may stand for it."""

    material: Annotated[str, Field(min_length=1)]
    width_m: Length | None = Field(None, description="width of lines without a width of their own [m]")


class FeatureMapping(Section):
    """What features are in the scene, by their attributes.

    The keys of ``surfaces`` and ``features`` are ``attribute=value``, with ``*`` for any value, or the value alone of
    the key ``attribute``. A feature that fits several keys belongs to the last of them.

    Attributes
    ----------
    attribute : str
        Attribute of the keys that are values alone.
    surfaces : dict of str to Surface
        Material of lines and areas, such as roads and waters; a later one lies above.
    features : dict of str to FeatureClass
        Class of objects of points and areas; features of no key are no objects.
    materials : dict
        Materials for ``materials_from`` of a case, which alone reads them.
    permittivity : Permittivity or None
        Permittivities for the double bounce; without them, walls reflect all power.
    """

    attribute: str = ""
    surfaces: dict[str, Annotated[Surface, _NAME_ALONE]] = Field(default_factory=dict)
    features: dict[str, FeatureClass] = Field(default_factory=dict)
    materials: dict[str, Any] = Field(default_factory=dict)
    permittivity: Permittivity | None = None

    @property
    def grounds(self) -> list[str]:
        """Materials below all surfaces."""
        return []

    @property
    def names(self) -> dict[int, str]:
        """Name of each material id, from 1, in the order of the file."""
        surfaces = (one.material for one in self.surfaces.values())
        return dict(enumerate(dict.fromkeys([*self.grounds, *surfaces]), start=1))

    @property
    def attributes(self) -> list[str]:
        """Attributes that the keys name."""
        return list(dict.fromkeys(self._rule(key)[0] for key in (*self.surfaces, *self.features)))

    def _rule(self, key: str) -> tuple[str, str]:
        """Attribute and value of a key."""
        attribute, equals, value = key.partition("=")
        return (attribute, value) if equals else (self.attribute, key)

    def fitting(self, features: pd.DataFrame, keys: Iterable[str]) -> NDArray[np.int64]:
        """Number of the last key that fits each feature, whose attributes are columns of texts; -1 without one."""
        found = np.full(len(features), -1)
        for number, (attribute, value) in enumerate(map(self._rule, keys)):
            texts = features[attribute]
            found[(~texts.isin(_NONE) if value == _ANY else texts == value).to_numpy()] = number
        return found


class VectorMapping(FeatureMapping):
    """Mapping of ``scene.names`` for the source ``vectors``.

    Attributes
    ----------
    layers : list of str
        Layers that are read; by default the only layer.
    background : str
        Material of cells below no surface; empty for none.
    width, height, storeys, heading : str
        Attributes with the width of a line and the height of an object [m], with its number of storeys, and with the
        bearing of a point's front from true north [deg]. The defaults are keys of OpenStreetMap.
    """

    layers: list[str] = Field(default_factory=list)
    background: str = ""
    width: str = "width"
    height: str = "height"
    storeys: str = "building:levels"
    heading: str = "direction"

    @property
    def grounds(self) -> list[str]:
        """Material of cells below no surface."""
        return [self.background] if self.background else []


def text_of(value: Any) -> str:
    """Text of an attribute's value; empty for a missing value.

    A whole number among missing values, which comes as a floating-point number, has no decimal point.
    """
    if value is None or value != value:
        return ""
    return f"{value:.15g}" if isinstance(value, float) else str(value).strip()


def read_mapping(path: Path, key: str, kind: type[M]) -> M:
    """Read a mapping from the file of a configuration key.

    Raises
    ------
    ConfigError
        The file is not YAML.
    SceneError
        A key or value is wrong, or the file names no material or too many.
    """
    try:
        mapping = kind.model_validate(read_case_file(path))
    except ValidationError as error:
        texts = [one.text for one in mistakes(error, kind)]
        raise SceneError(f"{key}: {path}: {first_of(texts)}") from None
    if not 1 <= len(mapping.names) <= MOST_MATERIALS:
        raise SceneError(f"{key}: {path} names {len(mapping.names)} materials, expected 1 to {MOST_MATERIALS}.")
    if "" in mapping.attributes:
        raise SceneError(f"{key}: {path} has keys without an attribute, expected the key attribute, or water=yes.")
    return mapping
