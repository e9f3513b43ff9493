"""Features of a database, with the attributes of their classes.

References
----------
OGC 15-113r6, sections 5.7.1 (instances, and classes by CNAM; sizes BBW along x, BBL along y, BBH; AO1 from true north
clockwise to the y axis) and tables 5-24 to 5-30 (component selectors).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from radcal.cdb.mosaic import Log
from radcal.errors import RadcalError
from radcal.reading.cdb import CdbFile
from radcal.reading.vectors import VectorLayer, read_layers
from radcal.vectors.mapping import text_of

if TYPE_CHECKING:
    import pandas as pd


_DATASETS = (100, 101, 201, 204)
_POINTS, _LINES, _AREAS = 1, 3, 5  # selectors T of the features; that of their classes is one more
_EMPTY_SHP, _EMPTY_DBF = 100, 33  # sizes of files without a record [bytes]
_NUMBERS = ["AO1", "AHGT", "SCALX", "SCALY", "SCALZ", "BBH", "BBL", "BBW", "HGT", "WGP"]


def read_features(files: Sequence[CdbFile], attributes: Sequence[str], log: Log) -> pd.DataFrame:
    """Features of all levels, in degrees; files that cannot be read are left out with a finding.

    Parameters
    ----------
    files : sequence of CdbFile
        Files of the tiles.
    attributes : sequence of str
        Attributes of instance or class that are read besides the feature code FACC.
    log : Log
        Findings, to which this function adds.

    Returns
    -------
    pandas.DataFrame
        Features as :func:`radcal.vectors.features.placed` takes them.
    """
    import pandas as pd
    import shapely

    classes = {
        one: one.path.with_name(one.path.name.replace(f"_T{one.second:03d}_", f"_T{one.second + 1:03d}_")[:-4] + ".dbf")
        for one in files
        if one.dataset in _DATASETS and one.second in (_POINTS, _LINES, _AREAS) and one.path.suffix == ".shp"
        and one.path.stat().st_size != _EMPTY_SHP
    }  # fmt: skip
    tables = [path for path in classes.values() if path.is_file() and path.stat().st_size > _EMPTY_DBF]
    paths = [*(one.path for one in classes), *tables]
    read = dict(zip(paths, read_layers(paths, log.refused), strict=True))
    for result in read.values():
        if isinstance(result, RadcalError):
            log.left_out_by(result)
    names = list(dict.fromkeys(["FACC", *attributes]))
    nothing = VectorLayer("", None, np.zeros(0, dtype=object), {})
    found = [_joined(nothing, None, names)]
    for one, path in classes.items():
        layer, table = read[one.path], read.get(path)
        if isinstance(layer, RadcalError):
            continue
        joined = _joined(layer, None if isinstance(table, RadcalError) else table, names)
        single = shapely.get_type_id(joined["shape"]) == shapely.GeometryType.POINT
        fits = single if one.second == _POINTS else shapely.get_dimensions(joined["shape"]) > 0
        kept = joined[(joined["FACC"] != "").to_numpy() & fits]
        if lost := len(joined) - len(kept):
            log.left_out(one.path, f"{lost} of its features, which have no class or no geometry of their kind")
        if len(kept):
            found.append(kept)
    return pd.concat(found[1:] or found, ignore_index=True)


def _joined(layer: VectorLayer, table: VectorLayer | None, names: list[str]) -> pd.DataFrame:
    """Features with the attributes of their class, by the class name CNAM; those of the instance count first."""
    import pandas as pd
    import shapely

    own, of_class = (
        pd.DataFrame({} if one is None else {name.upper(): values for name, values in one.columns.items()})
        for one in (layer, table)
    )
    if "CNAM" in own and "CNAM" in of_class:
        of_class = of_class.drop_duplicates("CNAM").set_index("CNAM").reindex(own["CNAM"]).set_axis(own.index)
        own = own.combine_first(of_class)
    own = own.reindex(index=range(len(layer.geometries)), columns=list(dict.fromkeys([*_NUMBERS, *names])))
    of = own[_NUMBERS].apply(pd.to_numeric, errors="coerce").astype(np.float64)
    scale = {name: of[f"SCAL{name}"].where(of[f"SCAL{name}"] > 0, 1.0) for name in "XYZ"}
    shapes = shapely.from_wkb(layer.geometries, on_invalid="ignore")
    joined: pd.DataFrame = own[names].map(text_of)
    return joined.assign(
        shape=shapes,
        length_m=of["BBL"] * scale["Y"],
        width_m=of["BBW"] * scale["X"],
        height_m=of["BBH"].where(of["BBH"] > 0, of["HGT"]) * scale["Z"],
        heading_deg=of["AO1"],
        base_m=shapely.get_z(shapes),
        absolute=of["AHGT"],
        line_m=of["WGP"],
    )
