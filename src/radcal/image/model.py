"""Measured image with its source and findings, written to and read from an HDF5 file."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from radcal.findings import Finding
from radcal.storage.records import Stored


@dataclass(frozen=True)
class Measurement(Stored, kind="measurement"):
    """Measured image with as many rows and columns as the simulated image of the scene.

    Attributes
    ----------
    image_db : ndarray of float32, shape (slant range, azimuth)
        Backscatter in the configured radiometry [dB], NaN where a pixel has no value.
    source : str
        Source of the image in words, for the report.
    hidden : mapping
        True parameters X by material of a synthetic measurement, else empty.
    misregistration_px : ndarray of float32, shape (2, rows, columns), or None
        True displacement of a synthetic measurement, from pixels of the scene's image to those of the measured image
        [pixels]; None for other measurements.
    findings : tuple of Finding
        Findings on the image's file, such as the meaning of its levels and the number of unusable pixels.
    """

    image_db: NDArray[np.float32]
    source: str
    hidden: Mapping[str, tuple[float, ...]] = field(default_factory=dict)
    misregistration_px: NDArray[np.float32] | None = None
    findings: tuple[Finding, ...] = ()
