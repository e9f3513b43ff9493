"""Raster material of a database: composite materials of the finest level, joined by their names.

The index of a composite material holds for its tile alone. A tile has n layers of indices and n - 1 layers of their
shares; the last layer has the rest, and all layers have equal shares if there is no layer of shares. A cell takes the
composite material with the largest share.

References
----------
OGC 15-113r6, sections 2.5.2.2 (tables of composite materials) and 5.6.3 (raster material).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from radcal.cdb.mosaic import Lattice, Log, band
from radcal.errors import SceneError
from radcal.findings import Finding
from radcal.reading.cdb import BASE_MATERIALS, CdbFile
from radcal.reading.intake import read_xml
from radcal.sections.materials import OtherLaw
from radcal.vectors.mapping import FeatureMapping

NO_TILE = 255  # id of cells without a raster of materials
_CLEAR = 0.8  # share of a composite material above which a cell is not mixed
MOST_BARE = 0.01  # largest share of cells without a material, beyond which there is a warning, or an error for names
_COMPOSITES = "//*[local-name()='Composite_Material']"
_DEFAULT = "BM_LAND-MOOR"
_UNKNOWN = "(index without a name)"


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


def composites(
    files: Sequence[CdbFile], to: Lattice, log: Log
) -> tuple[NDArray[np.int32], list[str], NDArray[np.bool_], NDArray[np.int8]]:
    """Composite materials of the elements of a lattice.

    Returns
    -------
    ndarray of int32
        Number of the composite material of each element in the list of names; -1 without a tile.
    list of str
        Names; the first stands for indices that are not in their table.
    ndarray of bool
        Whether the largest share is below 0.8.
    ndarray of int8
        Level of each element.
    """
    names = {_UNKNOWN: 0}
    found = np.full((to.rows, to.columns), -1, dtype=np.int32)
    mixed = np.zeros(found.shape, dtype=np.bool_)
    levels = np.full(found.shape, -99, dtype=np.int8)
    tables = {(one.level, one.box): one.path for one in files if _is_table(one)}
    base = _base_materials(log)
    layers: dict[tuple[int, tuple[float, ...]], dict[tuple[int, int], CdbFile]] = {}
    for one in sorted(files, key=lambda one: one.level):
        if one.dataset == 5 and one.path.suffix == ".tif" and one.first in (1, 2):
            layers.setdefault((one.level, one.box), {})[one.first, one.second] = one
    for key, of_tile in layers.items():
        tile = next(iter(of_tile.values()))
        if key not in tables:
            log.left_out(tile.path, "it has no table of composite materials (dataset 006)")
            continue
        if (table := _table(tables[key], base, log)) is None:
            continue
        numbers = np.zeros(256, dtype=np.int32)
        numbers[list(table)] = [names.setdefault(name, len(names)) for name in table.values()]
        if (read := _largest(of_tile, numbers, log)) is None:
            continue
        at, elements = to.within(tile)
        found[at], mixed[at], levels[at] = read[0][elements], read[1][elements] < _CLEAR, tile.level
    return found, list(names), mixed, levels


def _largest(
    layers: dict[tuple[int, int], CdbFile], numbers: NDArray[np.int32], log: Log
) -> tuple[NDArray[np.int32], NDArray[np.float64]] | None:
    """Composite material with the largest share of each element of a tile, and this share; None if it is left out.

    ``numbers`` has the number of the composite material of each index.
    """
    seconds, shares = (sorted(second for first, second in layers if first == kind) for kind in (1, 2))
    if seconds != list(range(1, len(seconds) + 1)) or not seconds:
        log.left_out(next(iter(layers.values())).path, f"its layers of indices are {seconds}, expected 1, 2, and so on")
        return None
    indices = [band(layers[1, k], log) for k in seconds]
    if any(one is None for one in indices):
        return None
    index = np.stack([one[0] for one in indices if one is not None])
    if index.dtype != np.uint8:
        log.left_out(layers[1, 1].path, f"it holds {index.dtype}, expected uint8")
        return None
    number = numbers[index]
    share = np.full(number.shape, 1.0 / len(number))
    given = [band(layers[2, k], log) for k in shares]
    if given and shares == seconds[:-1] and all(one is not None for one in given):
        for k, one in enumerate(one[0] for one in given if one is not None):
            # integers are scaled to their largest value (requirement 105)
            largest = np.iinfo(one.dtype).max if one.dtype.kind in "ui" else 1.0
            share[k] = np.nan_to_num(one.astype(np.float64)) / largest
        share[-1] = np.clip(1.0 - share[:-1].sum(axis=0), 0.0, 1.0)
    elif given:
        log.left_out(layers[1, 1].path, "a layer of shares is missing or damaged: equal shares are taken")
    # one composite material may stand in several layers
    total = np.stack([np.where(number == one, share, 0.0).sum(axis=0) for one in number])
    best = np.argmax(total, axis=0)[None]
    return np.take_along_axis(number, best, 0)[0], np.take_along_axis(total, best, 0)[0]


def _base_materials(log: Log) -> set[str]:
    """Names of base materials that the database defines; empty if its list is missing or damaged."""
    path = log.root / BASE_MATERIALS
    root = log.read(path, "XML", lambda: read_xml(path)) if path.is_file() else None
    return (
        set() if root is None else {text.strip() for text in root.xpath("//*[local-name()='Base_Material']/*/text()")}
    )


def _table(path: Path, base: set[str], log: Log) -> dict[int, str] | None:
    """Name of each index of a table of composite materials; None if the table is damaged."""
    if (root := log.read(path, "XML", lambda: read_xml(path))) is None:
        return None
    table = {}
    for one in root.xpath(_COMPOSITES):
        index, name = str(one.get("index")), _name(one)
        if not index.isdecimal() or int(index) > 255 or not name:
            log.left_out(path, f"it has a composite material {name!r} of index {index}, expected a name and 0 to 255")
            return None
        table[int(index)] = name
    unknown = {text.strip() for text in root.xpath("//*[local-name()='Material']/*[local-name()='Name']/text()")} - base
    if base and unknown:
        about = str(path.relative_to(log.root))
        log.append(Finding("cdb_base_materials", "warning", about, {"names": ", ".join(sorted(unknown))}))
    return table


def weights(files: Sequence[CdbFile], log: Log) -> Iterator[tuple[str, dict[str, float]]]:
    """Name of each composite material of each table, and the weights of the base materials of its primary substrate."""
    for file in filter(_is_table, files):
        root = log.read(file.path, "XML", partial(read_xml, file.path))
        for one in [] if root is None else root.xpath(_COMPOSITES):
            found: dict[str, float] = {}
            for part in one.xpath("*[local-name()='Primary_Substrate']/*[local-name()='Material']"):
                weight = part.xpath("number(*[local-name()='Weight'])")
                found[_name(part)] = found.get(_name(part), 0.0) + (weight if 0 < weight < np.inf else 0.0)
            yield _name(one), found


def _is_table(file: CdbFile) -> bool:
    return (file.dataset, file.first, file.second, file.path.suffix) == (6, 1, 1, ".xml")


def _name(element: Any) -> str:
    return str(element.xpath("string(*[local-name()='Name'])")).strip()


def material_ids(
    files: Sequence[CdbFile], to: Lattice, mapping: CdbMapping, log: Log
) -> tuple[NDArray[np.uint8], NDArray[np.bool_], NDArray[np.int8]]:
    """Material ids of the elements of a lattice, whether they are mixtures, and their levels.

    Returns
    -------
    ndarray of uint8
        Material id; 0 if the composite material has no material in the mapping, ``NO_TILE`` without a tile.
    ndarray of bool
        Whether no composite material has a clear share.
    ndarray of int8
        Level of each element.

    Raises
    ------
    SceneError
        More than 1 % of the elements are of unmapped composite materials.
    """
    number, names, mixed, levels = composites(files, to, log)
    if not (number >= 0).any():  # the default of section 5.6.3.2 of the standard
        number, names = np.ones_like(number), [_UNKNOWN, _DEFAULT]
        log.append(Finding("cdb_no_material", "warning", "scene.root", {"name": _DEFAULT}))
    total = int(np.count_nonzero(number >= 0))
    counts = np.bincount(number[number >= 0], minlength=len(names))
    ids = {name: k for k, name in mapping.names.items()}
    lacking = [name not in mapping.composites and counts[k] > 0 for k, name in enumerate(names)]
    if any(lacking):
        share = counts[lacking].sum() / total
        order = [k for k in np.argsort(-counts, kind="stable") if lacking[k]]
        listed = ", ".join(f"{names[k]} ({counts[k] / total:.2g})" for k in order)
        if share > MOST_BARE:
            raise SceneError(
                f"scene.materials: no material for {share:.1%} of the cells, expected for at most 1 %: {listed} of "
                f"{log.root}; add these names to composites."
            )
        log.append(Finding("cdb_unmapped", "warning", "scene.materials", {"names": listed}))
    if mixed.any():
        numbers = {"percent": 100.0 * np.count_nonzero(mixed) / total, "share": _CLEAR}
        log.append(Finding("cdb_mixed", "warning", "scene.root", numbers))
    of_number = np.array([ids.get(mapping.composites.get(name, ""), 0) for name in names] + [NO_TILE], dtype=np.uint8)
    return of_number[number], mixed, levels
