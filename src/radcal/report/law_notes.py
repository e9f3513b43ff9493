"""Notes on laws used outside their valid incidence angles or parameters."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from radcal.config import stages
from radcal.radar.geometry import Geometry

__all__ = ["law_notes"]

_SHARE = 0.05  # share of a material's pixels outside the law's angles above which a note is made


def law_notes(case: stages.Archive, geometry: Geometry, parameters: Mapping[str, Sequence[float]]) -> list[str]:
    """Sentences about laws that are used outside their valid angles or the parameters of their data.

    Parameters
    ----------
    case : stages.Archive
        Laws by material.
    geometry : Geometry
        Geometry with the incidence of every material's visible pixels.
    parameters : mapping
        Parameters of each material's law in the final runs.

    Returns
    -------
    list of str
        One sentence for each material, calibrated or fixed, with more than 5 % of its pixels outside the law's valid
        angles, or with parameters outside the range of the law's data.
    """
    notes = []
    for name, law in case.laws.items():
        if name not in geometry.names or not law.has_curve:
            continue
        label = f"law {case.materials[name].law!r}"
        share = law.outside(geometry.incidence_deg.ravel()[geometry.pixels(name)])
        if share > _SHARE:
            low, high = law.valid_deg
            notes.append(
                f"{name}: {share:.0%} of its pixels are seen outside of the {low:g} to {high:g} deg that {label} was "
                "made for; there it is an extrapolation."
            )
        doubt = law.doubt(parameters[name]) if law.doubt is not None else None
        if doubt is not None:
            notes.append(f"{name}: {label} is an extrapolation: {doubt}.")
    return notes
