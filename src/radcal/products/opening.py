"""Results of a finished calibration for Python scripts: pandas tables, and images with their units."""

from __future__ import annotations

import importlib
import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from radcal.errors import StoreError
from radcal.products.geotiff import SLANT_RANGE
from radcal.storage.records import understood, unreachable

if TYPE_CHECKING:
    import pandas as pd
    import pystac
    import xarray


@dataclass(frozen=True)
class Results:
    """Results of a finished calibration; a file of the results folder is read when its content is used.

    Attributes
    ----------
    folder : Path
        ``results/<case>``.
    """

    folder: Path

    @cached_property
    def summary(self) -> dict[str, Any]:
        """Content of ``summary.json`` (``docs/records.md``)."""
        path = self.folder / "summary.json"
        try:
            with understood(path):
                data = json.loads(path.read_text(encoding="utf-8"))
                if lacking := {"verdict", "runs", "materials"} - data.keys():
                    raise LookupError(f"lacks {min(lacking)}")
                return {key: value for key, value in data.items() if key != "sha256"}
        except OSError as error:
            raise unreachable(path, error) from error

    @property
    def verdict(self) -> str:
        """Verdict on the laws of all materials, in a sentence."""
        return str(self.summary["verdict"])

    @cached_property
    def materials(self) -> pd.DataFrame:
        """Parameters of the calibrated materials, indexed by material and parameter (``docs/exports.md``)."""
        return self._table("export/parameters.csv", ["material", "parameter"])

    @cached_property
    def laws(self) -> pd.DataFrame:
        """Sigma0 [dB] with its 90 % band, indexed by material and local incidence [deg] (``docs/exports.md``)."""
        return self._table("export/laws.csv", ["material", "incidence_deg"])

    @cached_property
    def runs(self) -> pd.DataFrame:
        """Table of the reference run and of all runs of the search, indexed by run and material."""
        return self._table("runs.csv", ["run", "material"])

    @property
    def run_counts(self) -> dict[str, int]:
        """Number of simulator runs of each kind, and of the search (design and infill); keys: ``docs/records.md``."""
        return dict(self.summary["runs"])

    @property
    def images(self) -> list[str]:
        """Names of the exported images."""
        return sorted(path.stem for path in (self.folder / "export").glob("[!.]*.tif"))

    def array(self, name: str) -> NDArray[Any]:
        """Values of an exported image.

        Parameters
        ----------
        name : str
            One of :attr:`images`.

        Returns
        -------
        ndarray, shape (rows, columns)
            Pixels in the unit that :meth:`unit` gives. North is up on a map; in slant range, row 0 is nearest to the
            radar. Pixels of which nothing is known are NaN, or 0 in images of whole numbers.

        Raises
        ------
        StoreError
            No exported image has this name, or the file cannot be read.
        """
        return self._read(name)[0]

    def unit(self, name: str) -> str:
        """Unit of an exported image: dB, deg, or 1 for whole numbers; errors as for :meth:`array`."""
        return str(self._read(name)[1]["unit"])

    def image(self, name: str) -> Any:
        """Exported image with its coordinates and unit.

        Parameters
        ----------
        name : str
            One of :attr:`images`.

        Returns
        -------
        xarray.DataArray
            On a map, the dimensions y and x have the coordinates of the pixel centres, and the coordinate
            ``spatial_ref`` has the CRS and the affine transform as rioxarray and GDAL read them (``image.rio.crs``); in
            slant range, the dimensions are slant_range and azimuth, in pixels.

        Raises
        ------
        ImportError
            xarray is not installed; the message says how to install it.
        StoreError
            No exported image has this name, or the file cannot be read.
        """
        xarray = _library("xarray", f"image({name!r})", f", or call array({name!r}) for a numpy array")
        from pyproj import CRS

        values, attributes, (a, b, c, d, e, f) = self._read(name)
        rows, columns = (np.arange(n) + 0.5 for n in values.shape)
        attributes["units"] = attributes["unit"]
        if attributes["grid"] == SLANT_RANGE:
            coordinates = {"slant_range": rows - 0.5, "azimuth": columns - 0.5}
            return xarray.DataArray(values, coordinates, ("slant_range", "azimuth"), name, attributes)
        transform = " ".join(map(repr, (c, a, b, f, d, e)))  # in GDAL's order
        grid_mapping = {**CRS.from_user_input(attributes["crs"]).to_cf(), "GeoTransform": transform}
        places: dict[str, Any] = {"spatial_ref": ((), 0, grid_mapping)}
        if not (b or d):  # the axes of a turned grid have no coordinates of their own
            places |= {"y": e * rows + f, "x": a * columns + c}
        return xarray.DataArray(values, places, ("y", "x"), name, attributes)

    def to_stac(self) -> pystac.Item:
        """STAC item of the case, with its exports as assets (:func:`.stac.stac_item`).

        ``results.to_stac().save_object()`` writes it to ``item.json`` in the results folder.

        Raises
        ------
        ImportError
            pystac is not installed; the message says how to install it.
        DamagedError, StoreError
            A file is missing or cannot be read.
        """
        _library("pystac", "to_stac()", extra="stac")
        from radcal.products.stac import stac_item

        return stac_item(self.folder, self.summary, self.images)

    def to_arviz(self) -> xarray.DataTree:
        """Posterior, prior, sampler statistics and measured levels of all laws (:func:`.posterior_tree`).

        ``results.to_arviz().to_netcdf("posterior.nc", engine="h5netcdf")`` writes a file for ``arviz.from_netcdf``.

        Raises
        ------
        ImportError
            xarray is not installed; the message says how to install it.
        DamagedError, StoreError
            ``calibration.h5`` is missing or cannot be read, or it holds no draws of a posterior.
        """
        _library("xarray", "to_arviz()", extra="arviz")
        from radcal.products.posterior_tree import posterior_tree
        from radcal.results.archive import read_finished

        return posterior_tree(read_finished(self.folder))

    def _table(self, name: str, index: list[str]) -> pd.DataFrame:
        import pandas as pd

        try:
            with understood(self.folder / name):
                return pd.read_csv(self.folder / name).set_index(index)
        except OSError as error:
            raise unreachable(self.folder / name, error) from error

    def _read(self, name: str) -> tuple[NDArray[Any], dict[str, Any], tuple[float, ...]]:
        """Values of an exported image, its tags and CRS, and the six coefficients of its affine transform."""
        from rasterio.errors import RasterioError

        from radcal.reading.rasters import open_raster

        if name not in self.images:
            raise StoreError(f"{self.folder / 'export'}: no image {name!r}, expected one of {self.images}.")
        path = self.folder / "export" / f"{name}.tif"
        try:
            with understood(path), open_raster(path) as raster:
                tags = {key: value for key, value in raster.tags().items() if key.islower()}
                if not {"unit", "grid"} <= tags.keys():
                    raise LookupError("lacks the tags unit and grid")
                crs = {} if raster.crs is None else {"crs": raster.crs.to_string()}
                return raster.read(1), {**tags, **crs}, tuple(raster.transform)[:6]
        except (OSError, RasterioError) as error:
            raise StoreError(f"{path}: cannot be read ({error}).") from error


def _library(name: str, of: str, otherwise: str = "", extra: str | None = None) -> Any:
    """Library that a call needs; if it is not installed, the error says how to install it."""
    try:
        return importlib.import_module(name)
    except ImportError:
        install = f"pip install 'radcal[{extra or name}]'"
        raise ImportError(f"{of} needs the package {name}, which is missing: type {install}{otherwise}.") from None


def open_results(folder: str | Path) -> Results:
    """Results of a finished calibration.

    Parameters
    ----------
    folder : path
        Results folder of a case, ``results/<case>``.

    Raises
    ------
    StoreError
        The folder has no ``summary.json``: it is no results folder, or its calibration is not finished.
    """
    folder = Path(folder)
    if not (folder / "summary.json").is_file():
        why = "has no summary.json: its calibration is not finished" if folder.is_dir() else "is no folder"
        raise StoreError(f"{folder} {why}, expected the results folder of a finished case, as results/dyke.")
    return Results(folder)
