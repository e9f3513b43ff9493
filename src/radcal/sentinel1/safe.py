"""Files of a Sentinel-1 product: a SAFE folder, whose manifest lists images, annotations and calibration tables."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from radcal.reading.intake import read_xml

MANIFEST = "manifest.safe"
_POLARISATIONS = frozenset(("HH", "HV", "VH", "VV"))
_PARTS = {"annotation": "", "calibration": "calibration-", "noise": "noise-"}  # prefixes of the names of files


@dataclass(frozen=True)
class SafeImage:
    """Files of one polarisation of a product.

    Attributes
    ----------
    polarisation : str
        Transmitted and received polarisation, such as "VV".
    annotation : path
        Annotation of the image: times, orbit, processing, geolocation grid.
    calibration : path
        Calibration tables.
    noise : path
        Noise tables.
    pixels : path
        GeoTIFF of the digital numbers.
    """

    polarisation: str
    annotation: Path
    calibration: Path
    noise: Path
    pixels: Path

    @property
    def files(self) -> tuple[Path, ...]:
        """All files of the image."""
        return (self.annotation, self.calibration, self.noise, self.pixels)


def safe_folder(path: Path) -> Path:
    """SAFE folder, from the path of the folder itself or of its manifest."""
    return path.parent if path.name.lower() == MANIFEST else path


def safe_images(path: Path) -> list[SafeImage]:
    """Images that the manifest of a SAFE folder lists; their files may be missing.

    Parameters
    ----------
    path : path
        The folder, or its file ``manifest.safe``.

    Raises
    ------
    ValueError
        The manifest is missing or cannot be read, names a file outside of the folder, or lists no image.

    References
    ----------
    Sentinel-1 Product Specification, S1-RS-MDA-52-7441, section 3: contents of the SAFE package and of its manifest.
    """
    folder = safe_folder(path)
    manifest = folder / MANIFEST
    if manifest.resolve().parent != folder.resolve():
        raise ValueError(f"{MANIFEST} is a link to {manifest.resolve()}, expected a file of the folder")
    try:
        root = read_xml(manifest)
    except FileNotFoundError:
        raise ValueError(f"it has no {MANIFEST}, expected the whole folder of a Sentinel-1 product") from None
    except (OSError, ValueError) as error:
        raise ValueError(f"{MANIFEST}: {error}") from None
    files: dict[str, Path] = {}
    pixels: list[Path] = []
    for item in root.iter("dataObject"):
        location = item.find(".//fileLocation")
        if location is None:
            continue
        file = _inside(folder, str(location.get("href")))
        files[file.name] = file
        if item.get("repID") == "s1Level1MeasurementSchema":
            pixels.append(file)
    found = [_image(file, files) for file in pixels]
    if not found:
        raise ValueError(f"{MANIFEST} lists no measured image, expected a level-1 product")
    return found


def chosen_image(images: Sequence[SafeImage], polarisation: str) -> SafeImage:
    """Image of one polarisation, after a check that its files exist.

    Raises
    ------
    ValueError
        The product has no image of the polarisation, or a file of this image is missing.
    """
    for image in images:
        if image.polarisation == polarisation:
            for file in image.files:
                if not file.is_file():
                    raise ValueError(f"{MANIFEST} lists {file.name}, which is missing")
            return image
    there = [image.polarisation for image in images if all(file.is_file() for file in image.files)]
    raise ValueError(f"it has {' and '.join(there) or 'no whole image'}, radar.polarisation is {polarisation}")


def _inside(folder: Path, href: str) -> Path:
    """Path of a file that the manifest names; a file outside of the folder is refused."""
    path = folder / href
    if ":" in href or not path.resolve().is_relative_to(folder.resolve()):
        raise ValueError(f"{MANIFEST} names {href!r}, expected a file of the folder")
    return path


def _image(pixels: Path, files: Mapping[str, Path]) -> SafeImage:
    """Files of an image, whose names all derive from the name of the file of pixels."""
    polarisation = next((part.upper() for part in pixels.stem.split("-") if part.upper() in _POLARISATIONS), None)
    if polarisation is None:
        raise ValueError(f"the name of {pixels.name} has no polarisation, expected s1a-iw-grd-vv-...")
    others = {}
    for part, prefix in _PARTS.items():
        name = f"{prefix}{pixels.stem}.xml"
        if name not in files:
            raise ValueError(f"{MANIFEST} lists no {part} of {pixels.name} ({name})")
        others[part] = files[name]
    return SafeImage(polarisation, pixels=pixels, **others)
