"""Registration of the measured image onto the simulated image, checked on squares that are held out."""

from __future__ import annotations

import contextlib
import warnings
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from radcal.config import RegistrationConfig
from radcal.errors import MeasurementError, RadcalError
from radcal.findings import Finding
from radcal.image.model import Measurement
from radcal.registration.base import Method
from radcal.registration.displacement import squares, warp
from radcal.registration.gefolki import Flow, Level, find_flow, local_correlation, pyramid, rank_transform
from radcal.registration.spline_field import Prior
from radcal.sections.measurement import REGISTRATIONS
from radcal.storage.records import Stored

_SIGNIFICANT = 4.0  # standard errors
_SMALLEST_PX = 64
_LEAST_GAIN = 0.001  # smallest rise of the held-out correlation: the last digit that the sentence shows
_SIGN_WINDOW_PX = 65
_CONTRAST_PX = 16  # side of the squares whose levels show a contrast under the speckle
_TREND = 3  # degree of the polynomial in slant range that is removed from both halves of the squares
LEAST_CONTRAST_DB = 0.3
"""Smallest contrast of a simulated image onto which a measured image can be registered [dB]."""
_FITS = 3.0  # an image is called mirrored if a mirrored version has more than this many times its correlation
_MIRRORED = 1.5  # times the correlation of mirrored images, which is due to chance

Ranks = tuple[NDArray[np.float32], NDArray[np.float32]]


@dataclass(frozen=True)
class Registered(Stored, kind="registered"):
    """Measured image on the pixels of the simulated image, with the result of the registration.

    Attributes
    ----------
    measurement : Measurement
        Measurement with the registered image. The registered image takes the values of nearest pixels, which keeps the
        statistics of speckle, and NaN where the measured image has no pixel.
    unregistered_db : ndarray of float32, shape (rows, columns)
        Image before registration [dB].
    displacement_px : ndarray of float32, shape (2, rows, columns)
        Displacement of each pixel to its place in the measured image, along rows and columns [pixels].
    uncertainty_px : ndarray of float32, shape (rows, columns)
        Standard error of the displacement's length [pixels]; 0 without registration.
    correlation : float
        Mean local correlation of the ranks of both images, after registration; 0 if the method is none.
    method : str
        Method, or none.
    applied : bool
        Whether the image was moved.
    verdict : str
        Sentence on the result of the registration.
    refused_px : ndarray of float32, shape (2, rows, columns), or None
        Displacement that was found but not applied [pixels]; None if it was applied, or none was sought.
    findings : tuple of Finding
        Findings on the geometry of the pass.
    """

    measurement: Measurement
    unregistered_db: NDArray[np.float32]
    displacement_px: NDArray[np.float32]
    uncertainty_px: NDArray[np.float32]
    correlation: float
    method: str
    applied: bool
    verdict: str
    refused_px: NDArray[np.float32] | None = None
    findings: tuple[Finding, ...] = ()

    @property
    def found_px(self) -> NDArray[np.float32] | None:
        """Displacement that the registration has found [pixels], applied or not; None if none was sought."""
        return self.displacement_px if self.applied else self.refused_px


def without_images(registered: Registered) -> Registered:
    """Result of a registration with empty images."""
    nothing = np.empty((0, 0), dtype=np.float32)
    measurement = replace(registered.measurement, image_db=nothing, misregistration_px=None)
    return replace(
        registered,
        measurement=measurement,
        unregistered_db=nothing,
        displacement_px=nothing,
        uncertainty_px=nothing,
        refused_px=None,
    )


def contrast_db(image_db: NDArray[np.float32]) -> float:
    """Contrast of an image [dB]: standard deviation, without speckle, of the mean level of squares of 16 x 16 pixels.

    The contrast is the square root of the covariance between the mean levels of the left and right halves of the
    squares. Independent speckle does not contribute to the covariance of the halves. A smooth change of the level from
    the first row to the last, such as the decrease of a law over the swath, is removed first.

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Image [dB]; NaN where a pixel has no value.
    """
    side, values = _CONTRAST_PX, np.asarray(image_db, dtype=np.float64)
    parts = squares(np.where(np.isfinite(values), values, np.nan), side)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RuntimeWarning)  # squares without a pixel
        # speckle of pixels that are two apart is independent
        halves = [
            np.nanmean(parts[..., cut], axis=(1, 3)) for cut in (slice(0, side // 2 - 1), slice(side // 2 + 1, side))
        ]
    whole = np.isfinite(halves[0]) & np.isfinite(halves[1])
    if np.count_nonzero(whole) <= 2 * (_TREND + 1):
        return float("nan")
    row = np.nonzero(whole)[0] / max(len(whole) - 1, 1)
    degree = min(_TREND, len(np.unique(row)) - 1)  # a polynomial of a higher degree is not determined
    left, right = (half[whole] - np.polynomial.Polynomial.fit(row, half[whole], degree)(row) for half in halves)
    return float(np.sqrt(max(0.0, float(np.mean(left * right)))))


def register(
    fixed_db: NDArray[np.float32], measurement: Measurement, config: RegistrationConfig, same_area: bool = False
) -> Registered:
    """Register a measured image onto a simulated one.

    The displacement field is estimated three times: from all pixels, and, with the same prior, from the squares of each
    of the two colours of a chequerboard. The squares of the other colour are held out, and the correlation of the two
    images on the held-out squares answers two questions. The first question is whether the images have anything in
    common; for comparison, mirrored images are registered, too. The second question is whether the registration
    improves the agreement; the correlation on the held-out squares must rise by at least 0.001. The standard error of
    the displacement field is the standard deviation of its posterior distribution.

    Parameters
    ----------
    fixed_db : ndarray, shape (rows, columns)
        Simulated image [dB].
    measurement : Measurement
        Measured image of the same size as the simulated image.
    config : RegistrationConfig
        Method and limits of the registration.
    same_area : bool
        Whether the images are known to show the same area, so that no comparison with mirrored images is needed.

    Returns
    -------
    Registered
        Registered image. If the registration does not raise the correlation, or would move the image by more than
        ``max_displacement_px``, the image is returned unregistered, with the reason.

    Raises
    ------
    MeasurementError
        The measured image has nothing in common with the simulated image, or is too small.
    """
    moving_db, source = measurement.image_db, measurement.source
    nothing = np.zeros((2, *fixed_db.shape))
    if config.method == "none":
        return _kept(measurement, 0.0, "none", "not registered, because registration.method is none.")
    if min(fixed_db.shape) < _SMALLEST_PX:
        raise MeasurementError(
            f"registration.method is {config.method}, the image has {fixed_db.shape[0]} x {fixed_db.shape[1]} pixels, "
            f"expected at least {_SMALLEST_PX} in both directions: set registration.method: none."
        )
    levels = pyramid(fixed_db, moving_db)
    ranks = rank_transform(fixed_db), rank_transform(moving_db)
    start = None
    if config.global_shift:
        from skimage.registration import phase_cross_correlation

        shift, *_ = phase_cross_correlation(*ranks, upsample_factor=4, normalization=None)
        start = -np.asarray(shift, dtype=np.float64)
    chequered = _chequerboard((fixed_db.shape[0], fixed_db.shape[1]))
    flow = find_flow(levels, start=start)
    both, prior = flow.displacement_px, flow.posterior.prior
    halves = [find_flow(levels, keep, start, prior).displacement_px for keep in (chequered, ~chequered)]
    method: Method = REGISTRATIONS[config.method]
    field = method(*ranks, start, both)

    before = _held_out(ranks, (nothing, nothing), chequered)
    after = _held_out(ranks, (halves[0], halves[1]), chequered)
    of = "on squares that the registration did not use"
    found = f"correlation {before.mean():.3f} before and {after.mean():.3f} after, {of}"
    furthest = float(np.hypot(*field).max())
    raised = float((after - before).mean()) >= _LEAST_GAIN
    # an image that is used unregistered must agree with the simulated image without any displacement
    correlation = after if raised and furthest <= config.max_displacement_px else before
    found_out = f"{found}, standard error {_standard_error(after):.3f}"
    if not same_area:
        _check_agreement(ranks, levels, flow, correlation, source, found_out, contrast_db(fixed_db))
    if furthest > config.max_displacement_px or not raised:
        why = (
            f"the registration would move {source} by up to {furthest:.1f} pixels, more than "
            f"registration.max_displacement_px = {config.max_displacement_px:g}"
            if furthest > config.max_displacement_px
            else f"the registration did not raise the correlation of {source} with the simulated image ({found})"
        )
        agreement = float(np.mean(local_correlation(*ranks)))
        kept = _kept(measurement, agreement, config.method, f"{why}: the image is used unregistered.")
        return replace(kept, refused_px=field.astype(np.float32))
    # the posterior belongs to the field of GeFolki: for another method, the distance between both fields is added
    variance = np.square(flow.standard_error_px()) + np.square(field - both).sum(axis=0)
    uncertainty = np.sqrt(variance)
    typical = float(np.sqrt(np.mean(np.square(field).sum(axis=0))))
    return Registered(
        measurement=replace(measurement, image_db=warp(moving_db, field)),
        unregistered_db=moving_db,
        displacement_px=field.astype(np.float32),
        uncertainty_px=uncertainty.astype(np.float32),
        correlation=float(np.mean(local_correlation(ranks[0], np.nan_to_num(warp(ranks[1], field))))),
        method=config.method,
        applied=True,
        verdict=f"registered with {config.method}: moved by {typical:.1f} pixels (rms, at most {furthest:.1f}) with a "
        f"standard error of {np.median(uncertainty):.2f}; {found}.",
    )


def register_again(image_db: NDArray[np.float32], first: Registered, config: RegistrationConfig) -> Registered:
    """Register the measured image onto another simulated image, and choose the registration that agrees better.

    A registration compares patterns of brightness. The reference run has the starting laws. If a starting law differs
    much from the real law, other slopes are bright in the reference run than in the measured image, and the
    displacement has an error that its standard error does not contain. A run of the laws found with the first
    registration usually has a pattern that is nearer to that of the measured image (``docs/registration.md``).

    Parameters
    ----------
    image_db : ndarray, shape (rows, columns)
        Simulated image of the laws found with the first registration [dB].
    first : Registered
        Measured image, registered onto the reference run.
    config : RegistrationConfig
        Method and limits of the registration.

    Returns
    -------
    Registered
        Registration with the higher mean local correlation of the measured image with its simulated image. The
        sentence ``verdict`` names the choice. Findings are those of the first registration.
    """
    again = register(image_db, replace(first.measurement, image_db=first.unregistered_db), config, same_area=True)
    numbers = f"mean local correlation {again.correlation:.3f}; of the first registration {first.correlation:.3f}"
    if again.correlation < first.correlation:
        kept = f"A second one, onto a run with laws fitted after the first, agrees less and is not used ({numbers})."
        return replace(first, verdict=f"{first.verdict} {kept}")
    onto = f"This is the second registration, onto a run with laws fitted after the first ({numbers})."
    return replace(again, verdict=f"{again.verdict} {onto}", findings=first.findings)


def _check_agreement(
    ranks: Ranks,
    levels: list[Level],
    flow: Flow,
    correlation: NDArray[np.float64],
    source: str,
    found: str,
    contrast: float,
) -> None:
    """Raise an error if the correlation is not significant, or not clearly above the correlation of mirrored images."""
    common = _common(ranks, flow.displacement_px)
    mirrored = _mirrored(ranks, levels, flow.posterior.prior)
    best = max(mirrored, key=lambda name: mirrored[name])
    if _z(correlation) < _SIGNIFICANT or common < _MIRRORED * mirrored[best]:
        fits = mirrored[best] > _FITS * common
        hint = f"it fits {best}" if fits else "is it the same area, seen from the same side, not turned or mirrored?"
        why = f"{source} has nothing in common with the simulated image ({found}): {hint}"
        if contrast < LEAST_CONTRAST_DB:
            why = (
                f"the image simulated at the start has no contrast between materials (the level of its squares varies "
                f"by {contrast:.2f} dB), so that {source} cannot be laid on it ({found}): give the materials starts "
                "that differ (materials.*.start, as radcal new writes them)."
            )
        elif _z(correlation) >= _SIGNIFICANT and not fits:
            why = (
                f"{source} agrees with the simulated image ({found}), but not clearly better than its mirrored "
                f"versions, which agree by chance (mean local correlation {common:.3f}, mirrored {mirrored[best]:.3f}, "
                f"expected at least {_MIRRORED:g} times as much): are starting or fixed laws wrong (materials.*.start, "
                "materials.*.parameters), or is it another area, turned or mirrored?"
            )
        raise MeasurementError(
            f"registration: {why} If it lies on the simulated image's pixels already, set registration.method: none."
        )


def _kept(measurement: Measurement, correlation: float, method: str, verdict: str) -> Registered:
    """Measured image that is used unregistered, with the reason as its verdict."""
    still = np.zeros((2, *measurement.image_db.shape), dtype=np.float32)
    return Registered(measurement, measurement.image_db, still, still[0], correlation, method, False, verdict)


def _chequerboard(shape: tuple[int, int]) -> NDArray[np.bool_]:
    """Mask of the squares of one colour of a chequerboard."""
    rows, columns = np.indices(shape) // _square(shape)
    return np.asarray((rows + columns) % 2 == 0)


def _square(shape: tuple[int, ...]) -> int:
    """Side of a chequerboard square [pixels]; small images get small squares, to have enough for a standard error."""
    return 32 if min(shape) >= 256 else 16


def _held_out(
    ranks: Ranks, fields: tuple[NDArray[np.float64], NDArray[np.float64]], chequered: NDArray[np.bool_]
) -> NDArray[np.float64]:
    """Correlation of both images in each square, with the field found from the squares of the other colour."""
    fixed, moving = ranks
    total = np.zeros(fixed.shape)
    for field, used in zip(fields, (chequered, ~chequered), strict=True):
        moved = np.nan_to_num(warp(moving, field))
        # the sign of the contrast is also estimated on the squares that are not held out
        sign = np.sign(local_correlation(fixed * used, moved * used, _SIGN_WINDOW_PX))
        total += np.where(used, 0.0, fixed * moved * sign)
    blocks = squares(total, _square(fixed.shape)).mean(axis=(1, 3)).ravel()
    return np.asarray(blocks / (fixed.std() * moving.std() + 1e-12))


def _standard_error(values: NDArray[np.float64]) -> float:
    return float(values.std(ddof=1) / np.sqrt(values.size))


def _z(values: NDArray[np.float64]) -> float:
    """Ratio of a mean to its standard error."""
    return float(values.mean() / (_standard_error(values) + 1e-12))


def _common(ranks: Ranks, field: NDArray[np.float64]) -> float:
    """Mean absolute local correlation of the fixed image and the moving image displaced by a field."""
    moved = np.nan_to_num(warp(ranks[1], field))
    return float(np.abs(local_correlation(ranks[0], moved, _SIGN_WINDOW_PX)).mean())


def _mirrored(ranks: Ranks, levels: list[Level], prior: Prior) -> dict[str, float]:
    """Correlation with mirrored moving images, which is due to chance unless the measured image is mirrored itself."""
    as_it_is, turned = slice(None), slice(None, None, -1)
    found = {}
    for name, (along, across) in {
        "mirrored in slant range.": (turned, as_it_is),
        "mirrored in azimuth.": (as_it_is, turned),
        "turned by 180 degrees.": (turned, turned),
    }.items():
        images = [level.mirrored(along, across) for level in levels]
        found[name] = _common((ranks[0], ranks[1][along, across]), find_flow(images, prior=prior).displacement_px)
    return found


def registered_as(
    path: Path, predicted_db: NDArray[np.float32], found: Measurement, config: RegistrationConfig
) -> tuple[Registered, str]:
    """Registration of a measured image for the comparison with a predicted image.

    If the case of the measured image has already registered this image with this method, that registration is taken.
    Otherwise the measured image is registered onto the predicted one.

    Parameters
    ----------
    path : path
        ``registered.h5`` of the image's case, which need not exist or be readable.
    predicted_db : ndarray, shape (rows, columns)
        Predicted image [dB], onto which the measured image is registered if necessary.
    found : Measurement
        Measured image.
    config : RegistrationConfig
        Method and limits.

    Returns
    -------
    registered : Registered
        Registered measured image.
    by : str
        Words that name the simulated image onto which the measured image is registered.

    Raises
    ------
    MeasurementError
        The image has nothing in common with the predicted one.
    """
    with contextlib.suppress(RadcalError):
        stored = Registered.read(path)
        if stored.method == config.method and np.array_equal(stored.unregistered_db, found.image_db, equal_nan=True):
            return stored, f"as in {path.parent}"
    return register(predicted_db, found, config), "onto the predicted image"
