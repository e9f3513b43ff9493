"""Reader of a measured image: what its file says, and its backscatter on the pixels of the scene's image."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from radcal.config import FileMeasurement, Radar, expand_path
from radcal.config.inputs import vrt_folders
from radcal.errors import MeasurementError
from radcal.findings import Finding
from radcal.reading.base import FileReader, reader_of
from radcal.reading.images import Counts, ImageFile, to_db

if TYPE_CHECKING:
    from pyproj import CRS

    from radcal.image.acquisition import Acquisition
    from radcal.radar.geometry import Geometry
    from radcal.scene.model import Scene

# smallest share of impossible values for which an image is refused. At this share, a target of 1,000 pixels loses one
# pixel. A sector of random bytes in a float32 image of 10^6 pixels gives half of this share. Single-look power with a
# mean of 29, read as dB, has this share of values above 200, because exp(-200 / 29) = 0.001.
_IMPOSSIBLE_SHARE = 1e-3


@dataclass(frozen=True)
class Facts:
    """What the file of a measured image says; None where it does not say it.

    Attributes
    ----------
    polarisation : str or None
        Transmitted and received polarisation, such as "VV".
    frequency_hz : float or None
        Carrier frequency [Hz].
    radiometry : str or None
        Radiometry of the image as it is read.
    crs : pyproj.CRS or None
        Horizontal CRS.
    pixel_m : (float, float) or None
        Sides of a pixel on the ground, along rows and columns [m]; None unless the file has a CRS and a transform from
        its pixels to coordinates in this CRS.
    on_map : bool
        Whether the file gives the place of each pixel, so that the place does not depend on section ``radar``.
    acquisition : Acquisition or None
        Acquisition at a scene: looks, noise, resolutions, incidence and heading.
    findings : tuple of Finding
        Findings on the acquisition; an image that is read has them, too.
    """

    polarisation: str | None = None
    frequency_hz: float | None = None
    radiometry: str | None = None
    crs: CRS | None = None
    pixel_m: tuple[float, float] | None = None
    on_map: bool = False
    acquisition: Acquisition | None = None
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True)
class Grid:
    """Pixels of the scene's image, on which a measured image is read.

    Attributes
    ----------
    geometry : Geometry
        Geometry of the pass.
    scene : Scene or None
        Scene of the geometry; without it, every image is assumed to be in slant range.
    """

    geometry: Geometry
    scene: Scene | None = None

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns."""
        return self.geometry.shape[0], self.geometry.shape[1]

    @property
    def on_map(self) -> tuple[str, Sequence[float]] | None:
        """CRS and transform of the scene; None for a scene without map coordinates."""
        if self.scene is None or self.scene.crs is None or self.scene.transform is None:
            return None
        return self.scene.crs, self.scene.transform


@dataclass(frozen=True)
class ReadImage:
    """Measured image on the pixels of the scene's image.

    Attributes
    ----------
    image_db : ndarray of float32, shape (rows, columns)
        Backscatter [dB], NaN for pixels marked as no data and for zero or negative power.
    counts : Counts
        Number of NaN pixels for each reason.
    findings : tuple of Finding
        Findings on the image, such as the source of its levels.
    resampled : bool
        Whether each pixel is the one of the file that shows the same ground.
    pixel_m : (float, float) or None
        Sides of the file's pixels along slant range and azimuth [m], if it is on the map.
    """

    image_db: NDArray[np.float32]
    counts: Counts
    findings: tuple[Finding, ...] = ()
    resampled: bool = False
    pixel_m: tuple[float, float] | None = None


class Reader(FileReader):
    """Reader of one measured image.

    Parameters
    ----------
    path : path
        Path of the file or folder.
    config : FileMeasurement
        Configuration with the scale of the numbers, and with the dataset or band.
    radar : Radar
        Pass, whose polarisation may choose the image.
    """

    def __init__(self, path: Path, config: FileMeasurement, radar: Radar) -> None:
        self.path, self.config, self.radar = path, config, radar

    @property
    def name(self) -> str:
        """Name of the image in findings."""
        return self.path.name

    def facts(self, scene: Scene | None = None) -> Facts:
        """What the file says, without its pixels; the acquisition only with a scene.

        Raises
        ------
        MeasurementError
            The file is damaged, or does not show the scene.
        """
        del scene
        return Facts()

    @abstractmethod
    def read(self, grid: Grid) -> ReadImage:
        """Backscatter on the pixels of the scene's image.

        Raises
        ------
        MeasurementError
            The file cannot be read or holds no image of the scene, or its numbers contradict the scale.
        """

    def in_db(self, values: NDArray[Any], scale: str, shape: tuple[int, int] | None) -> tuple[Any, Counts]:
        """Image [dB] of the numbers of the file in a scale, and its counts, after a check of the numbers."""
        config = self.config.model_copy(update={"scale": scale})
        image, counts = to_db(values, image_file(self.path, config, shape))
        present = image[np.isfinite(image)]
        if present.min() == present.max():
            one = f"all {present.size:,} pixels of {self.path} are {present[0]:.4g} dB"
            raise MeasurementError(f"measurement.path: {one}, expected an image.")
        # speckle has an sd of 2 dB or more, so that an image with its median near 0 dB has negative values
        if scale == "db" and present.min() >= 0 and np.median(present) < 3.0:
            raise MeasurementError(
                f"measurement.path: the values of {self.path} run from {present.min():.3g} to {present.max():.3g} with "
                f"median {np.median(present):.3g}, none negative, which looks like power: set measurement.scale: power."
            )
        return image, counts


def opened(config: FileMeasurement, radar: Radar) -> Reader:
    """Reader of a measured image, of which nothing is read yet.

    Raises
    ------
    ConfigError
        The file is missing.
    """
    kind: Any = reader_of(config.path)
    reader: Reader = kind(expand_path(config.path, "measurement.path", folder=kind.folder), config, radar)
    return reader


def image_file(
    path: Path, config: FileMeasurement, shape: tuple[int, int] | None = None, resized: str = ""
) -> ImageFile:
    """File of a measured image, with the keys that error messages name; ``shape`` is the required size of the image."""
    return ImageFile(
        path,
        config,
        "measurement",
        "path",
        MeasurementError,
        shape=shape,
        resized=resized or ": crop or resample it to the same grid",
        impossible_share=_IMPOSSIBLE_SHARE,
        folders=vrt_folders(config),
    )
