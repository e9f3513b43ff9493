"""File in which users say what the names and codes of a database are in the scene."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from radcal.sections.materials import OtherLaw
from radcal.vectors.mapping import FeatureMapping


class CdbMapping(FeatureMapping):
    """What composite materials and features of a database are in the scene.

    Attributes
    ----------
    composites : dict of str to str
        Material of each composite material, by their names.
    bases : dict of str to OtherLaw
        Law and parameters of base materials, for mixtures (``python -m radcal.cdb``).
    """

    attribute: str = "FACC"
    composites: Annotated[dict[str, str], Field(min_length=1)]
    bases: dict[str, OtherLaw] = Field(default_factory=dict)

    @property
    def grounds(self) -> list[str]:
        """Materials of the composite materials."""
        return list(self.composites.values())
