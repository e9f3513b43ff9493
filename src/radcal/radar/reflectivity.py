"""Expected power of each material in each pixel: backscatter laws evaluated on the facets of a geometry."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.compiled import threaded
from radcal.errors import ConfigError
from radcal.laws import Law
from radcal.radar.geometry import Geometry

_LEVELS = 65536  # steps of the incidence angle between 0 and 90 degrees
_GRAZING = _LEVELS * 85 // 90
_BRIGHTEST_DB = 380.0  # single precision ends at 385 dB


@dataclass(frozen=True)
class Reflectivity:
    """Expected power of each material in each pixel.

    A *cell* is the contribution of one material to one pixel.

    Attributes
    ----------
    shape : (int, int)
        Image size.
    start : ndarray of int32, shape (pixels + 1,)
        First cell of each pixel.
    material : ndarray of uint8, shape (cells,)
        Material id of each cell.
    power : ndarray of float32, shape (cells,)
        Expected power of each cell in the configured radiometry [linear], before thermal noise and impulse response.
    """

    shape: tuple[int, int]
    start: NDArray[np.int32]
    material: NDArray[np.uint8]
    power: NDArray[np.float32]

    @property
    def image(self) -> NDArray[np.float32]:
        """Expected power of each pixel, summed over its materials [linear], shape ``shape``."""
        total = np.concatenate([[0.0], np.cumsum(self.power, dtype=np.float64)])
        return np.asarray(total[self.start[1:]] - total[self.start[:-1]], dtype=np.float32).reshape(self.shape)


def uniform(power: NDArray[np.float32]) -> Reflectivity:
    """Reflectivity of an image of one material, made from the power of each pixel [linear], shape (rows, columns)."""
    n = power.size
    shape = (power.shape[0], power.shape[1])
    return Reflectivity(
        shape,
        np.arange(n + 1, dtype=np.int32),
        np.ones(n, dtype=np.uint8),
        np.require(power, np.float32, ["C", "W"]).ravel(),  # functions would be compiled again for read-only arrays
    )


def law_tables(
    names: tuple[str, ...], laws: Mapping[str, Law], parameters: Mapping[str, ArrayLike]
) -> NDArray[np.float32]:
    """Tables of sigma0 over the incidence angle, one for the law of each material.

    Parameters
    ----------
    names : tuple of str
        Materials; id k is ``names[k - 1]``.
    laws, parameters : mapping
        Backscatter law of each material, and the parameters of the law. A material without a law has a sigma0 of 0.

    Returns
    -------
    ndarray of float32, shape (materials + 2, 65536)
        sigma0 [linear power]; column i is an incidence angle of i / 65535 times 90 degrees. Row 0 stands for pixels
        without material. The last row is 1 and stands for objects, whose cross-section is contained in the weights of
        their facets.

    Raises
    ------
    ConfigError
        A material is so bright that its power exceeds single precision.
    """
    phi = np.linspace(0.0, np.pi / 2.0, _LEVELS)
    tables = np.zeros((len(names) + 2, _LEVELS), dtype=np.float32)
    tables[-1] = 1.0
    for k, name in enumerate(names, start=1):
        if name in laws:
            sigma0_db = laws[name](phi, parameters[name])
            # a few laws grow without limit towards 90 degrees, which no facet reaches
            brightest = int(np.argmax(sigma0_db[:_GRAZING]))
            if sigma0_db[brightest] > _BRIGHTEST_DB:
                each = zip(laws[name].names, np.asarray(parameters[name]), strict=True)
                raise ConfigError(
                    f"materials.{name}: {', '.join(f'{key} = {x:.6g}' for key, x in each)} give a sigma0 of "
                    f"{sigma0_db[brightest]:.4g} dB, expected at most {_BRIGHTEST_DB:g} dB, at an incidence of "
                    f"{np.degrees(phi[brightest]):.4g} degrees: {laws[name].formula}."
                )
            tables[k] = 10.0 ** (sigma0_db / 10.0)
    return tables


@threaded
def _colour(
    part: Any, material: Any, first: Any, incidence: Any, weight: Any, tables: Any, changed: Any, power: Any
) -> None:  # fmt: skip
    """Expected power of every cell of the materials with a changed law, written to ``power``."""
    for i in range(part[0], part[1]):
        k = material[i]
        if changed[k]:
            total = np.float32(0.0)
            for j in range(first[i], first[i + 1]):
                total += weight[j] * tables[k, incidence[j]]
            power[i] = total


def reflectivity(
    geometry: Geometry, tables: NDArray[np.float32], before: Reflectivity | None = None,
    changed: NDArray[np.bool_] | None = None,
) -> Reflectivity:  # fmt: skip
    """Expected power of each pixel and material, without speckle, thermal noise and impulse response.

    Parameters
    ----------
    geometry : Geometry
        Facets of the pass, with their weights in the configured radiometry.
    tables : ndarray, shape (materials + 2, 65536)
        Laws from :func:`law_tables`.
    before, changed : optional
        Reflectivity with earlier laws, and mask of the material ids whose law has changed since then, shape (materials
        + 2,). Only the cells of materials with a changed law are computed again, in place.

    Returns
    -------
    Reflectivity
        Reflectivity; the power of a cell is the sum of weight times sigma0(phi) over the facets of the cell.
    """
    power = np.zeros(geometry.cell_material.size, dtype=np.float32) if before is None else before.power
    _colour(
        power.size,
        geometry.cell_material,
        geometry.facet_start,
        geometry.facet_incidence,
        geometry.facet_weight,
        tables,
        np.ones(len(tables), dtype=np.bool_) if changed is None else changed,
        power,
    )
    return Reflectivity(geometry.shape, geometry.cell_start, geometry.cell_material, power)
