"""Laws of composite materials as mixtures of the fixed laws of their base materials.

References
----------
OGC 15-113r6, section 2.5.2.2: a substrate is a mixture of base materials, whose weights are shares of its surface.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from radcal.cdb.mapping import CdbMapping
from radcal.cdb.materials import weights
from radcal.cdb.mosaic import Log
from radcal.errors import SceneError
from radcal.reading.cdb import cdb_files

_MOISTURE = "BM_MOISTURE"  # state of a surface, and no surface itself
_KNOTS_DEG = [float(angle) for angle in range(0, 91, 3)]


def mixture(parts: Mapping[str, float], mapping: CdbMapping) -> dict[str, Any]:
    """Tabulated law of a surface of several base materials: the mean of their sigma0 in linear power, by weight.

    Parameters
    ----------
    parts : mapping of str to float
        Weight of each base material.
    mapping : CdbMapping
        Laws of the base materials.

    Returns
    -------
    dict
        Keys of a material with fixed parameters: sigma0 [dB] at every third degree of incidence.
    """
    curves = [mapping.bases[name].unbound_law(np.radians(_KNOTS_DEG), mapping.bases[name].parameters) for name in parts]
    power = np.average(10.0 ** (np.array(curves) / 10.0), axis=0, weights=list(parts.values()))
    level = [round(float(x), 3) for x in 10.0 * np.log10(power)]
    return {"law": "tabulated", "angles_deg": _KNOTS_DEG, "parameters": level}


def mixed_laws(
    root: Path, bounds: tuple[float, float, float, float], mapping: CdbMapping
) -> tuple[dict[str, dict[str, Any]], list[str]]:
    """Laws of the materials whose composite material has base materials with laws only, and a sentence on each.

    The weights are those of the primary substrate. BM_MOISTURE is left out, and the other weights are scaled to a sum
    of 1.

    Parameters
    ----------
    root : path
        Folder of the database.
    bounds : (float, float, float, float)
        West, south, east and north bounds [deg].
    mapping : CdbMapping
        Materials of the composite materials, and laws of the base materials.

    Raises
    ------
    ConfigError
        A law of a base material depends on frequency or polarisation.
    SceneError
        Two composite materials of one material are mixed differently.
    """
    laws, seen, said = dict[str, dict[str, Any]](), dict[str, Any](), []
    for name, found in weights(cdb_files(root, bounds, (6,)), Log(root)):
        material, total = mapping.composites.get(name), sum(found.values()) - found.get(_MOISTURE, 0.0)
        parts = {base: weight / total for base, weight in found.items() if base != _MOISTURE and weight > 0 < total}
        if material is None or seen.get(material) == parts:
            continue
        if material in seen:
            raise SceneError(f"scene.root: {root} mixes {name} of {material!r} in two ways: {seen[material]}, {parts}.")
        seen[material] = parts
        what = " + ".join(f"{share:.3g} {base}" for base, share in parts.items())
        if lacking := ", ".join(base for base in parts if base not in mapping.bases):
            said.append(f"{name}: {what}: no mixture, without a law of {lacking} in bases")
        elif parts:
            laws[material] = mixture(parts, mapping)
            said.append(f"{name}: {what}" + f"; {_MOISTURE} is left out" * (_MOISTURE in found))
    return laws, said
