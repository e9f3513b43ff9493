"""Level normalisation: offset or scale removed from the measured image and from every run before comparison."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.findings import Finding


@dataclass(frozen=True)
class Levels:
    """Mapping of the values of the measured and the simulated image before densities are fitted.

    Attributes
    ----------
    normalisation : {'none', 'offset', 'image'}
        ``none``: values are unchanged. ``offset``: one level is subtracted from the measured image. ``image``: each
        image is mapped to zero median and unit interquartile range.
    offset_db : float
        Level of the measured image minus level of the reference run [dB], estimated from the reference materials, or
        for ``image`` from the medians; NaN if unknown.
    offset_error_db : float
        Standard error of the offset [dB], NaN if unknown.
    scale : float
        For ``image``, ratio of the interquartile range of the measured image to that of the reference run; else 1.
    references : tuple of str
        Materials with a fixed law, from which the offset is estimated.
    measured : (float, float)
        Shift that is subtracted from the measured values, and scale by which they are then divided [dB].
    others_db : ndarray of float32
        For ``image``: valid pixels, in the reference run, of all materials that are not calibrated [dB]. These pixels
        are the same in every run, except for the influence of neighbouring pixels.
    valid : mapping
        For ``image``: indices of each calibrated material's valid pixels among its pixels in a run record.
    """

    normalisation: str = "none"
    offset_db: float = float("nan")
    offset_error_db: float = float("nan")
    scale: float = 1.0
    references: tuple[str, ...] = ()
    measured: tuple[float, float] = (0.0, 1.0)
    others_db: NDArray[np.float32] = field(default_factory=lambda: np.empty(0, dtype=np.float32))
    valid: Mapping[str, NDArray[np.int64]] = field(default_factory=dict)

    @property
    def unit(self) -> str:
        """Unit of the mapped values: dB, or IQR for the interquartile range of an image."""
        return "dB" if self.normalisation != "image" else "IQR"

    @property
    def finding(self) -> Finding:
        """Level of the measured image against the reference run, and what is done with it."""
        if self.normalisation == "image":
            code = "images_mapped" if self.others_db.size else "all_images_mapped"
            return Finding(code, "note", "", {"offset_db": self.offset_db, "scale": self.scale})
        if not self.references:
            return Finding("level_of_image", "note", "")
        code = "level_subtracted" if self.normalisation == "offset" else "level_found"
        numbers = {"offset_db": self.offset_db, "error_db": self.offset_error_db}
        return Finding(code, "note", ", ".join(self.references), numbers)

    def simulated(self, pixels_db: Mapping[str, NDArray[np.float32]]) -> tuple[float, float]:
        """Shift to subtract from a run's values, and scale by which to divide them.

        Parameters
        ----------
        pixels_db : mapping
            The run's visible pixels by calibrated material [dB].

        Returns
        -------
        (float, float)
            Shift and scale [dB].
        """
        if self.normalisation != "image":
            return 0.0, 1.0
        parts = [pixels_db[name][places] for name, places in self.valid.items()]
        return median_and_range(np.concatenate([self.others_db, *parts]))

    @staticmethod
    def apply(values_db: ArrayLike, mapping: tuple[float, float]) -> NDArray[np.float64]:
        """Subtract a shift [dB] from values [dB], and divide the result by a scale."""
        shift, scale = mapping
        return (np.asarray(values_db, dtype=np.float64) - shift) / scale


def median_and_range(values_db: ArrayLike) -> tuple[float, float]:
    """Median and interquartile range of values [dB]."""
    low, middle, high = np.percentile(np.asarray(values_db, dtype=np.float64), [25.0, 50.0, 75.0])
    return float(middle), float(high - low)


def pooled_offset(differences_db: ArrayLike, errors_db: ArrayLike) -> tuple[float, float]:
    """Level offset [dB], pooled over several materials whose laws may be wrong by more than their sampling errors.

    Parameters
    ----------
    differences_db : array_like, shape (k,)
        Measured minus simulated mean of each material [dB].
    errors_db : array_like, shape (k,)
        Standard errors from sampling [dB].

    Returns
    -------
    (float, float)
        Offset and its standard error [dB].

    References
    ----------
    DerSimonian and Laird, "Meta-analysis in clinical trials", Controlled Clinical Trials 7
    (1986): the variance between materials from the moments, then inverse-variance weights.
    """
    found = np.asarray(differences_db, dtype=np.float64)
    weight = 1.0 / np.square(np.asarray(errors_db, dtype=np.float64))
    mean = np.average(found, weights=weight)
    between = 0.0
    if found.size > 1:
        excess = np.sum(weight * (found - mean) ** 2) - (found.size - 1)
        between = max(0.0, excess / (weight.sum() - np.sum(weight**2) / weight.sum()))
    weight = 1.0 / (1.0 / weight + between)
    return float(np.average(found, weights=weight)), float(1.0 / np.sqrt(weight.sum()))


def offset_levels(normalisation: str, differences: Mapping[str, tuple[float, float]]) -> Levels:
    """Level normalisation from an offset that is estimated from the materials with a fixed law.

    Parameters
    ----------
    normalisation : {'none', 'offset'}
        ``offset`` if the offset is subtracted, ``none`` if the offset is only reported.
    differences : mapping
        Measured minus simulated mean and its standard error by material [dB].
    """
    if not differences:
        return Levels(normalisation)
    offset, error = pooled_offset(*zip(*differences.values(), strict=True))
    return Levels(
        normalisation,
        offset,
        error,
        references=tuple(differences),
        measured=(offset if normalisation == "offset" else 0.0, 1.0),
    )


def image_levels(
    measured_db: NDArray[np.float32],
    reference_db: NDArray[np.float32],
    material: NDArray[np.uint8],
    calibrated: Mapping[str, int],
) -> Levels:
    """Level normalisation that maps whole images to zero median and unit interquartile range.

    Parameters
    ----------
    measured_db, reference_db : ndarray, shape (rows, columns)
        Registered measured image and image of the reference run [dB].
    material : ndarray of uint8, shape (rows, columns)
        Material id of each pixel, 0 where a pixel holds no material or several.
    calibrated : mapping
        Material id of each calibrated material, by name.

    Returns
    -------
    Levels
        Level normalisation from the pixels that hold a single material and have a measured value.
    """
    valid = (material > 0) & np.isfinite(measured_db)
    others = valid & ~np.isin(material, list(calibrated.values()))
    places = {name: np.flatnonzero(valid[material == k]) for name, k in calibrated.items()}
    measured = median_and_range(measured_db[valid])
    simulated = median_and_range(reference_db[valid])
    return Levels(
        "image",
        measured[0] - simulated[0],
        scale=measured[1] / simulated[1],
        measured=measured,
        others_db=reference_db[others],
        valid=places,
    )


def without_level(image_db: NDArray[np.float32], levels: Levels) -> NDArray[np.float32]:
    """Measured image [dB] after subtraction of its assumed level."""
    return image_db - np.float32(0.0 if levels.normalisation == "none" else levels.offset_db)
