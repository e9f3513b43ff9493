"""What the configuration asks a reader of measured images: whether a path is its own, its files, and what names say."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from pathlib import Path

from radcal.plugins import Plugins
from radcal.reading.products import NamedProduct, named_product
from radcal.reading.rasters import raster_files


class FileReader(ABC):
    """Reader of a kind of files, before a file is opened; :class:`radcal.image.base.Reader` reads the image.

    Attributes
    ----------
    called : str
        Name of the kind of file in messages, with its article.
    folder : bool
        Whether the path may be that of a folder.
    gives_radiometry : bool
        Whether a file may give its radiometry, so that the configuration need not.
    gives_acquisition : bool
        Whether a file describes the whole acquisition, from which section ``radar`` follows, and defines its scale.
    """

    called = "a raster"
    folder = False
    gives_radiometry = False
    gives_acquisition = False

    @classmethod
    @abstractmethod
    def matches(cls, path: Path) -> bool:
        """Whether the reader reads a path; the file need not exist, and the path may contain ``${NAME}``."""

    @classmethod
    def named(cls, path: str) -> NamedProduct | None:
        """What the name of a file says of its numbers; None for a name that says nothing."""
        return named_product(path)

    @classmethod
    def files(cls, path: Path, polarisation: str, folders: Sequence[Path]) -> list[Path]:
        """All files that are read for an image, the file that the case names first.

        Parameters
        ----------
        path : path
            Path of an existing file or folder.
        polarisation : str
            Polarisation of the pass.
        folders : sequence of path
            Folders in which the source files of a VRT may lie.

        Raises
        ------
        ValueError
            The reason for which the file cannot be read.
        """
        del polarisation
        return [path, *raster_files(path, folders)]


READERS: Plugins[type[FileReader]] = Plugins(
    "radcal.readers",
    {
        "sentinel1": "radcal.sentinel1.reader:Sentinel1Reader",
        "sicd": "radcal.image.sicd:SicdReader",
        "array": "radcal.image.raster:ArrayReader",
        "raster": "radcal.image.raster:RasterReader",
    },
)
"""Readers of measured images: those of other distributions are asked first, and ``raster`` reads all other files."""


def reader_of(path: str) -> type[FileReader]:
    """Reader of a path as the case file has it."""
    for name in (*READERS.foreign, *READERS.builtin):
        if READERS[name].matches(Path(path)):
            return READERS[name]
    raise ValueError(path)  # not reached: the last reader reads all files
