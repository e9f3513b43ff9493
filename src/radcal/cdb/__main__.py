"""Materials that are mixtures of base materials, in YAML, on standard output.

References
----------
OGC 15-113r6, section 2.5.2.2: a substrate is a mixture of base materials, whose weights are shares of its surface.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from radcal.cdb.materials import CdbMapping, weights
from radcal.cdb.mosaic import Log
from radcal.errors import RadcalError, SceneError
from radcal.reading.cdb import cdb_files
from radcal.vectors.mapping import read_mapping

_MOISTURE = "BM_MOISTURE"  # state of a surface, and no surface itself
_KNOTS_DEG = [float(angle) for angle in range(0, 91, 3)]


def _mixture(parts: Mapping[str, float], mapping: CdbMapping) -> dict[str, Any]:
    """Keys of a tabulated law: the mean of sigma0 of base materials in linear power, by weight."""
    curves = [mapping.bases[name].unbound_law(np.radians(_KNOTS_DEG), mapping.bases[name].parameters) for name in parts]
    power = np.average(10.0 ** (np.array(curves) / 10.0), axis=0, weights=list(parts.values()))
    level = [round(float(x), 3) for x in 10.0 * np.log10(power)]
    return {"law": "tabulated", "angles_deg": _KNOTS_DEG, "parameters": level}


def _mixed(root: Path, bounds: Sequence[float], mapping: CdbMapping) -> tuple[dict[str, Any], list[str]]:
    """Laws of the materials whose composite material has base materials with laws only, and a sentence on each.

    The weights are those of the primary substrate. BM_MOISTURE is left out, and the other weights are scaled to a sum
    of 1.

    Raises
    ------
    ConfigError
        A law of a base material depends on frequency or polarisation.
    SceneError
        Two composite materials of one material are mixed differently.
    """
    laws, seen, said = dict[str, Any](), dict[str, Any](), []
    west, south, east, north = bounds
    for name, found in weights(cdb_files(root, (west, south, east, north), (6,)), Log(root)):
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
            laws[material] = _mixture(parts, mapping)
            said.append(f"{name}: {what}" + f"; {_MOISTURE} is left out" * (_MOISTURE in found))
    return laws, said


parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
parser.add_argument("mapping", type=Path)
parser.add_argument("root", type=Path)
parser.add_argument("bounds", type=float, nargs=4, metavar=("west", "south", "east", "north"))
arguments = parser.parse_args()
try:
    mapping = read_mapping(arguments.mapping, "mapping", CdbMapping)
    laws, said = _mixed(arguments.root, arguments.bounds, mapping)
except RadcalError as error:
    sys.exit(f"radcal: {error}")
sys.stdout.writelines(f"# {line}\n" for line in said)
sys.stdout.write(yaml.safe_dump({"materials": laws}, sort_keys=False, default_flow_style=None, width=110))
