"""Target density per material: which pixels, and the skew normal fitted to them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import h5py
import numpy as np
from numpy.typing import NDArray

from radcal import skewnormal
from radcal.config import Target as TargetConfig
from radcal.errors import MeasurementError
from radcal.files import write_hdf5
from radcal.measurement.goodness import Goodness, effective_sample_size, goodness_of_fit
from radcal.measurement.model import Measurement
from radcal.radar.geometry import Geometry
from radcal.seeds import derived_rng

__all__ = [
    "MINIMUM_PIXELS",
    "Target",
    "eligible_pixels",
    "make_target",
    "read_targets",
    "sampling_rms",
    "write_targets",
]

MINIMUM_PIXELS = 50


@dataclass(frozen=True)
class Target:
    """Target density of one material.

    Attributes
    ----------
    pixels : ndarray of int64, shape (n,)
        Flat image indices of the pixels drawn.
    order : ndarray of int64, shape (n,)
        Their places in a record's pixels of the material.
    values_db : ndarray of float32, shape (n,)
        Measured backscatter [dB].
    incidence_deg : ndarray of float32, shape (n,)
        Local incidence angle [deg].
    dp : ndarray, shape (3,)
        Fitted direct parameters xi [dB], omega [dB], alpha.
    eligible : int
        Pixels that could have been drawn.
    at_boundary : bool
        The fit stands at the largest skewness.
    effective : float
        Number of independent pixels that those drawn stand for.
    rms_sampling : float
        Density rms [1/dB] that so many stand for.
    cp_error : ndarray, shape (3,)
        Standard errors of mean [dB], standard deviation [dB] and skewness; NaN at the boundary.
    cp_interval : ndarray, shape (3, 2)
        95 % confidence intervals of mean [dB], standard deviation [dB] and skewness, at the
        effective sample size.
    goodness : Goodness
        How well the density describes the pixels.
    penalised : bool
        The density, and that of every run, is the penalised likelihood's.
    """

    pixels: NDArray[np.int64]
    order: NDArray[np.int64]
    values_db: NDArray[np.float32]
    incidence_deg: NDArray[np.float32]
    dp: NDArray[np.float64]
    eligible: int
    at_boundary: bool
    effective: float
    rms_sampling: float
    cp_error: NDArray[np.float64]
    cp_interval: NDArray[np.float64]
    goodness: Goodness
    penalised: bool = False

    @property
    def cp(self) -> NDArray[np.float64]:
        """Centred parameters of the target."""
        return skewnormal.centred(self.dp)

    def score(self, pixels_db: NDArray[np.float32]) -> tuple[NDArray[np.float64], float]:
        """Fit the same pixels of a run.

        Parameters
        ----------
        pixels_db : ndarray
            Visible pixels of the material in a run [dB].

        Returns
        -------
        dp : ndarray, shape (3,)
            Direct parameters of the run's density.
        rms : float
            Its difference from the target [1/dB].
        """
        dp = skewnormal.fit(pixels_db[self.order], self.penalised).dp
        return dp, skewnormal.density_rms(dp, self.dp)


def eligible_pixels(
    name: str,
    geometry: Geometry,
    measurement: Measurement,
    config: TargetConfig,
    uncertainty_px: NDArray[np.float32] | None = None,
) -> NDArray[np.int64]:
    """Flat indices of the pixels of a material that may be drawn, ascending.

    Parameters
    ----------
    name : str
        Material.
    geometry : Geometry
        Material masks.
    measurement : Measurement
        Registered image.
    config : Target
        Margin to other materials.
    uncertainty_px : ndarray, shape (rows, columns), optional
        Standard error of the registration [pixels], 0 where there was none: two of them, and
        the half pixel that nearest neighbours may be off, widen the margin.

    Raises
    ------
    MeasurementError
        The material has no finite pixel or fewer than 50.
    """
    margin: int | NDArray[np.int64] = config.margin_px
    if uncertainty_px is not None:
        margin = margin + np.where(uncertainty_px > 0, np.ceil(2.0 * uncertainty_px + 0.5), 0).astype(np.int64)
    visible = geometry.pixels(name, margin)
    finite = visible[np.isfinite(measurement.image_db.ravel()[visible])]
    if visible.size >= MINIMUM_PIXELS and finite.size == 0:
        raise MeasurementError(
            f"materials.{name}: all {visible.size} of its pixels in the measured image ({measurement.source}) are NaN."
        )
    if finite.size < MINIMUM_PIXELS:
        raise MeasurementError(
            f"materials.{name}: {finite.size} usable pixels, expected at least {MINIMUM_PIXELS} "
            f"(visible {geometry.pixels(name).size}; {visible.size} of them further than target.margin_px = "
            f"{config.margin_px}{' and two standard errors of the registration' if uncertainty_px is not None else ''} "
            f"from other materials; {finite.size} of those finite in {measurement.source})."
        )
    return finite


def sampling_rms(
    dp: NDArray[np.float64], n: int, rng: np.random.Generator, draws: int = 40, penalised: bool = False
) -> float:
    """Density rms between a skew normal and the fit to a sample of it.

    Parameters
    ----------
    dp : ndarray, shape (3,)
        Direct parameters.
    n : int
        Sample size (independent values).
    rng : Generator
        Source of the samples.
    draws : int
        Number of samples.
    penalised : bool
        Whether they are fitted by penalised likelihood.

    Returns
    -------
    float
        Median over the samples [1/dB]: parametric bootstrap (Efron and Tibshirani 1993, section 6.5).
    """
    fits = (skewnormal.fit(skewnormal.sample(dp, n, rng), penalised) for _ in range(draws))
    return float(np.median([skewnormal.density_rms(found.dp, dp) for found in fits]))


def make_target(
    name: str,
    geometry: Geometry,
    measurement: Measurement,
    config: TargetConfig,
    seed: int,
    uncertainty_px: NDArray[np.float32] | None = None,
) -> Target:
    """Draw a material's pixels without replacement and fit their density.

    Parameters
    ----------
    name, geometry, measurement, config, uncertainty_px
        As for :func:`eligible_pixels`.
    seed : int
        Of the draw.

    Raises
    ------
    MeasurementError
        Not enough pixels.
    FitError
        The pixels cannot be fitted.
    """
    eligible = eligible_pixels(name, geometry, measurement, config, uncertainty_px)
    rng = derived_rng(seed, "target", name)
    drawn = np.sort(rng.choice(eligible, size=min(config.pixels, eligible.size), replace=False))
    values = measurement.image_db.ravel()[drawn]
    penalised = config.fit == "penalised"
    fit = skewnormal.fit(values, penalised)
    effective = effective_sample_size(measurement.image_db, eligible, drawn)
    return Target(
        pixels=drawn,
        order=np.searchsorted(geometry.pixels(name), drawn),
        values_db=values,
        incidence_deg=geometry.incidence_deg.ravel()[drawn],
        dp=fit.dp,
        eligible=int(eligible.size),
        at_boundary=fit.at_boundary,
        effective=effective,
        rms_sampling=sampling_rms(fit.dp, max(8, round(effective)), rng, penalised=penalised),
        cp_error=np.sqrt(np.diagonal(skewnormal.covariance(values, fit, effective))),
        cp_interval=skewnormal.intervals(values, fit, effective=effective),
        goodness=goodness_of_fit(values, fit.dp, rng, effective, penalised=penalised),
        penalised=penalised,
    )


_ARRAYS = ("pixels", "order", "values_db", "incidence_deg", "dp", "cp_error", "cp_interval")
_SCALARS = ("eligible", "at_boundary", "effective", "rms_sampling", "penalised")
_GOODNESS = ("ks", "ks_p", "ad", "ad_p")


def write_targets(path: str | Path, targets: Mapping[str, Target]) -> None:
    """Write the targets of all materials to HDF5, atomically."""
    with write_hdf5(path, track_order=True) as file:
        file.attrs["schema"] = 1
        for name, target in targets.items():
            group = file.create_group(name)
            for key in _ARRAYS:
                group[key] = getattr(target, key)
            for key in _SCALARS:
                group.attrs[key] = getattr(target, key)
            for key in _GOODNESS:
                group.attrs[key] = getattr(target.goodness, key)


def read_targets(path: str | Path) -> dict[str, Target]:
    """Read the targets that :func:`write_targets` wrote."""
    with h5py.File(path, "r") as file:
        return {
            name: Target(
                **{key: group[key][()] for key in _ARRAYS},
                eligible=int(group.attrs["eligible"]),
                at_boundary=bool(group.attrs["at_boundary"]),
                effective=float(group.attrs["effective"]),
                rms_sampling=float(group.attrs["rms_sampling"]),
                penalised=bool(group.attrs["penalised"]),
                goodness=Goodness(**{key: float(group.attrs[key]) for key in _GOODNESS}),
            )
            for name, group in file.items()
        }
