"""Geometry of a pass against its measured image: depression, relief and place, after the first registration."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from radcal.angles import depression_deg
from radcal.config import Radar
from radcal.errors import MeasurementError
from radcal.findings import Finding, Severity
from radcal.radar.geometry import Geometry
from radcal.registration.displacement import squares, warp
from radcal.registration.registered import LEAST_CONTRAST_DB, Registered
from radcal.registration.relief import relief_slopes
from radcal.words import sentence

Doubles = NDArray[np.float64]

_LEAST_SHARE = 0.8  # of the variance of a displacement that a line explains; right geometry had up to 0.6
_LEAST_PX = 0.5  # displacement by the line (rms), below which a small image shows no angle
_WARNED_DEG, _REFUSED_DEG = 1.2, 4.0
_FLAT, _STEEP = 0.5, 2.0  # ratio of the slopes on relief; right geometry had 0.6 to 1.7, heights in feet 0.1
_CERTAIN = 4.0  # standard errors
_SQUARE_PX = 24
_APART = 2  # squares by which an image is shifted at least
_FEWEST, _MOST = 16, 128  # shifts
_TREND = 3  # degree of the polynomial over rows that a law may add


def range_line(displacement_px: NDArray[np.float32]) -> tuple[float, float]:
    """Straight line of the displacement along slant range over the rows.

    The line goes through the medians of the rows, so that a few columns that are displaced otherwise do not turn it.

    Parameters
    ----------
    displacement_px : ndarray, shape (2, rows, columns)
        Displacement along rows and columns [pixels].

    Returns
    -------
    slope : float
        Displacement in pixels per row.
    share : float
        Share of the variance of the displacement along rows that the line explains, at most 1; 0 without displacement.
    """
    along = displacement_px[0].astype(np.float64)
    row = np.arange(along.shape[0]) - 0.5 * (along.shape[0] - 1)
    slope = float(row @ np.median(along, axis=1) / (row @ row))
    left, whole = float(np.var(along - slope * row[:, None])), float(np.var(along))
    return slope, 1.0 - left / whole if whole > 0.0 else 0.0


def depression(registered: Registered, geometry: Geometry, radar: Radar) -> list[Finding]:
    """Finding on the depression angle that the displacement along slant range implies.

    Level ground is projected to slant range by the sine of the incidence. If the image was taken at another incidence
    than declared, its rows are further apart by the ratio of the sines; an error of the row spacing or of the scene's
    cell size by the same factor has the same effect.

    Parameters
    ----------
    registered : Registered
        Measured image, registered onto a simulated image.
    geometry : Geometry
        Geometry of the pass.
    radar : Radar
        Pass.

    Returns
    -------
    list of Finding
        ``depression``: a refusal if the implied angle is 4 degrees or more from the declared one, a warning from 1.2
        degrees. ``geometry_unchecked``: a note if nothing was registered.
    """
    key = "depression_deg" if radar.incidence_deg is None else "incidence_deg"
    about, declared = registered.measurement.source, float(getattr(radar, key))
    numbers: dict[str, float | str] = {"key": f"radar.{key}", "declared_deg": declared}
    found_px = registered.found_px
    if found_px is None:
        return [Finding("geometry_unchecked", "note", about, numbers)]
    slope, share = range_line(found_px)
    rows = found_px.shape[1]
    on_map = bool(np.isfinite(geometry.ground).any())  # a scene in slant range is not projected
    if share <= _LEAST_SHARE or abs(slope) * rows / np.sqrt(12.0) < _LEAST_PX or not on_map:
        return []
    sine = min((1.0 + slope) * np.sin(np.radians(radar.centre_incidence_deg)), 1.0)
    implied = float(np.degrees(np.arcsin(sine)))
    if key == "depression_deg":
        implied = 90.0 - implied if radar.earth == "flat" else depression_deg(implied, radar.altitude_m)
    off = abs(implied - declared)
    if off < _WARNED_DEG:
        return []
    severity: Severity = "refusal" if off >= _REFUSED_DEG else "warning"
    numbers |= {
        "implied_deg": implied,
        "px_per_100_rows": 100.0 * slope,
        "share_percent": 100.0 * share,
        "off_percent": 100.0 * abs(slope),
    }
    return [Finding("depression", severity, about, numbers, f"radar.{key}: {implied:.1f}")]


def relief(
    image_db: NDArray[np.float32],
    simulated_db: NDArray[np.float32],
    geometry: Geometry,
    radar: Radar,
    about: str,
    slope_error_deg: float,
) -> list[Finding]:
    """Finding on an image that changes with the scene's relief much less, or much more, than the simulated image.

    Starting laws may be flatter or steeper than those of the ground. The slope must therefore also lie beyond the limit
    in relation to ground of constant gamma (:class:`.ReliefSlope`).

    Parameters
    ----------
    image_db, simulated_db : ndarray, shape (rows, columns)
        Measured image on the pixels of the simulated image, and simulated image [dB].
    geometry, radar
        Pass.
    about : str
        Name of the image.
    slope_error_deg : float
        Standard error of the slopes of the scene's elevation [deg]; slopes of this size make an image look flatter.

    Returns
    -------
    list of Finding
        ``relief``, a refusal, if both ratios are below 1/2 or above 2 by four standard errors.
    """
    slopes = relief_slopes([simulated_db, image_db], geometry, radar)
    if not slopes:
        return []
    found = slopes[1]
    ratios = found.against_first, found.against_gamma
    flat = all(ratio + _CERTAIN * error < _FLAT for ratio, error in ratios)
    steep = all(ratio - _CERTAIN * error > _STEEP for ratio, error in ratios)
    if not steep and not (flat and 2.0 * slope_error_deg**2 < found.spread_deg**2):
        return []
    numbers = {
        "db_per_deg": found.db_per_deg,
        "error_db_per_deg": found.error,
        "of_simulated": found.against_first[0],
        "of_simulated_error": found.against_first[1],
    }
    return [Finding("relief", "refusal", about, numbers, "scene.elevation")]


def _squares(values: NDArray[np.generic]) -> Doubles:
    """Means of squares without a trend over rows; 0 for a square of which less than half has values."""
    parts = squares(values.astype(np.float64), _SQUARE_PX)
    count = np.isfinite(parts).sum(axis=(1, 3))
    means = np.where(count >= _SQUARE_PX**2 / 2, np.nansum(parts, axis=(1, 3)) / np.maximum(count, 1), np.nan)
    row, _ = np.nonzero(known := np.isfinite(means))
    degree = min(_TREND, np.unique(row).size - 1)
    away = np.zeros(means.shape)
    if degree >= 0:
        away[known] = means[known] - np.polynomial.Polynomial.fit(row, means[known], degree)(row)
    return away


def place(
    image_db: NDArray[np.float32], simulated_db: NDArray[np.float32], geometry: Geometry, about: str
) -> list[Finding]:
    """Finding on an image whose squares agree with the simulated image no better than if it is shifted.

    The mean levels of squares of 24 x 24 pixels are compared with those of the simulated image, and with these and the
    share of each material, because starting laws may give the materials a wrong order of brightness. The image is
    shifted by two squares or more, around the edges.

    Parameters
    ----------
    image_db, simulated_db : ndarray, shape (rows, columns)
        Measured image on the pixels of the simulated image, and simulated image [dB].
    geometry : Geometry
        Geometry of the pass.
    about : str
        Name of the image.

    Returns
    -------
    list of Finding
        ``place``, a refusal, if neither agreement is above that of all shifts; empty for an image of fewer than 16
        shifts, or a simulated image without contrast.
    """
    measured, simulated = _squares(image_db), _squares(simulated_db)
    rows, columns = measured.shape
    shifts = [(i, j) for i in range(rows) for j in range(columns) if max(min(i, rows - i), min(j, columns - j)) > 1]
    if len(shifts) < _FEWEST or simulated.std() < LEAST_CONTRAST_DB or not measured.any():
        return []
    shares = [_squares(geometry.material == number) for number in range(1, len(geometry.names) + 1)]
    basis, scale = np.linalg.qr(np.stack([simulated, *shares], axis=-1).reshape(rows * columns, -1))
    basis = basis[:, np.abs(np.diag(scale)) > 1e-9 * np.abs(scale).max()]
    basis[:, 0] *= np.sign(scale[0, 0])
    step = -(-len(shifts) // _MOST)
    moved = np.stack([measured.ravel()] + [np.roll(measured, shift, axis=(0, 1)).ravel() for shift in shifts[::step]])
    along = moved @ basis / np.linalg.norm(measured)
    correlation, explained = along[:, 0], np.square(along).sum(axis=1)
    if correlation[0] > correlation[1:].max() or explained[0] > explained[1:].max():
        return []
    numbers = {
        "square_px": float(_SQUARE_PX),
        "correlation": float(correlation[0]),
        "shifted": float(correlation[1:].max()),
    }
    return [Finding("place", "refusal", about, numbers, "measurement.path")]


def checked(
    registered: Registered, simulated_db: NDArray[np.float32], geometry: Geometry, radar: Radar, slope_error_deg: float
) -> Registered:
    """Registered image with findings on depression, relief and place.

    Relief and place are judged on the image moved by the displacement that was found, applied or not.

    Parameters
    ----------
    registered : Registered
        Measured image, registered onto the simulated image.
    simulated_db : ndarray, shape (rows, columns)
        Simulated image [dB].
    geometry, radar
        Pass.
    slope_error_deg : float
        Standard error of the slopes of the scene's elevation [deg].

    Raises
    ------
    MeasurementError
        A finding is a refusal, and ``registration.method`` is not ``none``.
    """
    about, image_db = registered.measurement.source, registered.unregistered_db
    if registered.found_px is not None:
        image_db = warp(image_db, registered.found_px.astype(np.float64))
    findings = (
        *depression(registered, geometry, radar),
        *relief(image_db, simulated_db, geometry, radar, about, slope_error_deg),
        *place(image_db, simulated_db, geometry, about),
    )
    refused = [one for one in findings if one.severity == "refusal"]
    if refused and registered.method != "none":
        raise MeasurementError(f"registration: {sentence(refused[0], prefix=False)}")
    return replace(registered, findings=findings)
