"""Cross-sections of classes of objects, as tables that an external code computed."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import h5py
import numpy as np
from numpy.typing import NDArray

from radcal.bands import same_label
from radcal.config import expand_path
from radcal.errors import SceneError
from radcal.reading.intake import elsewhere, guarded
from radcal.sections.scene import DBSM_LIMITS

LARGEST_ROWS = 30_000_000
"""Largest number of rows of a table, and of objects."""

_LIMITS = {"aspect_deg": (-180.0, 360.0), "elevation_deg": (-90.0, 90.0), "rcs_dbsm": DBSM_LIMITS}
_KEYS = ["class", "band", "polarisation"]


@dataclass(frozen=True)
class CrossSection:
    """Cross-section of one class of objects in one band and polarisation, by direction to the radar.

    Attributes
    ----------
    name, band, polarisation : str
        Name of the class, name of the frequency band, and polarisation.
    aspect_deg : ndarray, shape (a,)
        Bearing of the radar minus the heading of the object, in ascending order [deg].
    elevation_deg : ndarray, shape (e,)
        Elevation angle of the radar above the object's horizon, in ascending order [deg].
    dbsm : ndarray, shape (a, e)
        Cross-section [dB relative to 1 m2].
    """

    name: str
    band: str
    polarisation: str
    aspect_deg: NDArray[np.float64]
    elevation_deg: NDArray[np.float64]
    dbsm: NDArray[np.float64]


def towards(
    tables: Sequence[CrossSection], aspect_deg: NDArray[np.float64], elevation_deg: NDArray[np.float64], band: str,
    polarisation: str,
) -> NDArray[np.float64]:  # fmt: skip
    """Cross-section of objects of one class [dBsm], linear in dB between the nodes of its table.

    Parameters
    ----------
    tables : sequence of CrossSection
        Tables of the class.
    aspect_deg, elevation_deg : ndarray, shape (n,)
        Directions to the radar [deg]; whole turns of the aspect do not count.
    band, polarisation : str
        Band and polarisation of the pass.

    Raises
    ------
    SceneError
        No table is of the band and polarisation, or a direction lies outside of the table.
    """
    from scipy.interpolate import RegularGridInterpolator

    key = f"cross-sections of class {tables[0].name!r}"
    own = [one for one in tables if same_label(one.band, band) and one.polarisation == polarisation]
    if not own:
        listed = ", ".join(f"{one.band} {one.polarisation}" for one in tables)
        raise SceneError(f"{key}: the pass is of {band} {polarisation}, expected one of {listed}.")
    table = own[0]
    first = table.aspect_deg[0]
    turned = first + (aspect_deg - first + 1e-9) % 360.0 - 1e-9  # rounding would move the first one by a turn
    nodes = {"an aspect": (table.aspect_deg, turned), "an elevation angle": (table.elevation_deg, elevation_deg)}
    for name, (at, wanted) in nodes.items():
        wrong = (wanted < at[0] - 1e-9) | (wanted > at[-1] + 1e-9)
        if wrong.any():
            found = wanted[np.argmax(wrong)]
            raise SceneError(f"{key}: an object has {name} of {found:.5g} degrees, expected {at[0]:g} to {at[-1]:g}.")
    within = [np.clip(wanted, at[0], at[-1]) for at, wanted in nodes.values()]
    grid = RegularGridInterpolator((table.aspect_deg, table.elevation_deg), table.dbsm)
    return np.asarray(grid(np.stack(within, axis=1)))


def cross_sections(name: str | None, key: str) -> dict[str, CrossSection]:
    """Tables of a CSV or HDF5 file with the columns class, band, polarisation, aspect_deg, elevation_deg, rcs_dbsm.

    Parameters
    ----------
    name : str or None
        File as configured, whose name ends with ``.csv``, ``.h5`` or ``.hdf5``. An HDF5 file has one dataset for each
        column. Without a file there are no tables.
    key : str
        Configuration key, for error messages.

    Returns
    -------
    dict of str to CrossSection
        One table for each class, band and polarisation, by a number.

    Raises
    ------
    ConfigError
        The file does not exist.
    SceneError
        The file cannot be read, a column is missing, a value is wrong, or the directions of a class are no full grid.
    """
    import pandas as pd

    if name is None:
        return {}
    path = expand_path(name, key)

    def wrong(text: str) -> SceneError:
        return SceneError(f"{key} ({path}) {text}")

    is_csv = path.suffix.lower() == ".csv"
    with guarded(path, wrong, "CSV" if is_csv else "HDF5"):
        if is_csv:
            table = pd.read_csv(path, skipinitialspace=True)
        else:
            with h5py.File(path, "r") as file:
                if (what := elsewhere(file)) is not None:
                    raise wrong(f"is not read: {what}.")
                table = pd.DataFrame(columns_of(file, "", wrong))
    if missing := [one for one in (*_KEYS, *_LIMITS) if one not in table]:
        raise wrong(f"has no column {missing[0]!r}, found {', '.join(map(str, table.columns))}.")
    numbers = table[list(_LIMITS)].apply(pd.to_numeric, errors="coerce").astype(np.float64)
    low, high = np.array(list(_LIMITS.values())).T
    for row, k in np.argwhere(~((numbers >= low) & (numbers <= high)).to_numpy())[:1]:
        column = list(_LIMITS)[k]
        raise wrong(f"row {row + 1}: {column} is {table[column].iloc[row]}, expected {low[k]:g} to {high[k]:g}.")
    table[list(_LIMITS)] = numbers
    table[_KEYS] = table[_KEYS].astype(str).apply(lambda column: column.str.strip())
    found = dict[str, CrossSection]()
    for keys, rows in table.groupby(_KEYS, sort=True):
        names = [str(one) for one in keys]
        grid = rows.pivot_table("rcs_dbsm", "aspect_deg", "elevation_deg")
        nodes = [axis.to_numpy(dtype=np.float64) for axis in (grid.index, grid.columns)]
        whole = len(rows) == grid.size and not grid.isna().to_numpy().any()
        if not whole or min(grid.shape) < 2 or np.ptp(nodes[0]) > 360.0:
            raise wrong(
                f"has {len(rows)} rows of {' '.join(names)} with {grid.shape[0]} aspects and {grid.shape[1]} elevation "
                "angles, expected one for each pair of them, at least two of each, and aspects within one turn."
            )
        found[str(len(found))] = CrossSection(names[0], names[1], names[2], nodes[0], nodes[1], grid.to_numpy())
    return found


def columns_of(group: h5py.Group, within: str, refused: Callable[[str], SceneError]) -> dict[str, Any]:
    """Columns of a table that is stored as one HDF5 dataset for each column: arrays of numbers or of text.

    Parameters
    ----------
    group : h5py.Group
        Group with the datasets, of equal length, and with nothing else.
    within : str
        Path of the group in the file, for error messages.
    refused : callable
        Function from the end of a sentence to the exception.
    """
    columns = dict[str, Any]()
    for name, data in group.items():
        text = isinstance(data, h5py.Dataset) and h5py.check_string_dtype(data.dtype) is not None
        if not isinstance(data, h5py.Dataset) or data.ndim != 1 or not (text or data.dtype.kind in "fiub"):
            raise refused(f"{within}{name} is not a list of one number or text for each object.")
        if data.size > LARGEST_ROWS:
            raise refused(f"{within}{name} has {data.size} entries, expected at most {LARGEST_ROWS}.")
        columns[name] = data.asstr()[()] if text else data[()]
    counts = {name: len(values) for name, values in columns.items()}
    for name, count in counts.items():
        if count != (first := next(iter(counts.values()))):
            raise refused(f"{within}{name} has {count} entries, {within}{next(iter(counts))} {first}.")
    return columns
