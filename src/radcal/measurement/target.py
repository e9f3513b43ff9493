"""Target density of each material: selection of its pixels, and the skew normal fitted to them."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from radcal import skewnormal
from radcal.config import Radar, TargetConfig, Validation, stages
from radcal.errors import MeasurementError
from radcal.measurement.class_target import ClassTarget, put_classes, take_classes
from radcal.measurement.goodness import Goodness, effective_sample_size, goodness_of_fit
from radcal.measurement.ground import Blocks, Ground
from radcal.measurement.levels import Levels, image_levels, offset_levels
from radcal.measurement.looks import estimate_looks, local_looks
from radcal.measurement.model import Measurement
from radcal.measurement.patches import label_patches
from radcal.measurement.pixels import IN_THE_NOISE, eligible_pixels, noise_limited, point_targets
from radcal.radar.radiometry import noise_floor_db
from radcal.seeds import derived_rng
from radcal.storage.records import read_hdf5, write_hdf5

if TYPE_CHECKING:
    from radcal.measurement.registration import Registered
    from radcal.radar.geometry import Geometry

__all__ = [
    "KEPT_OUT",
    "Target",
    "Targets",
    "make_levels",
    "make_target",
    "make_targets",
    "read_targets",
    "sampling_rms",
    "write_targets",
]

# parameters are kept to this share of the standard deviation, a thousandth of what 1,000 pixels tell: what
# changes them by rounding only, such as another level of the same image, does not change the calibration
_SETTLED = 1e-5
_UNLIKELY = 0.01  # the smallest share that so many bootstrap samples can show
_TEXTURED = 0.7  # times the looks of homogeneous areas
_LEVEL_PIXELS = 1000  # of each reference material
KEPT_OUT = "held out to check the law"  # a reason why pixels are not in the target


@dataclass(frozen=True)
class Target:
    """Target density of one material.

    Attributes
    ----------
    pixels : ndarray of int64, shape (n,)
        Flat image indices of the pixels drawn.
    order : ndarray of int64, shape (n,)
        Their places in a record's pixels of the material.
    values_db : ndarray, shape (n,)
        Measured backscatter [dB], mapped by the levels: no longer dB for ``image``.
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
    left_out : mapping
        The material's other visible pixels by reason.
    looks : float
        Equivalent number of looks among neighbouring pixels; NaN where not known.
    penalised : bool
        The density, and that of every run, is the penalised likelihood's.
    patch, block : ndarray of int, shape (n,)
        Connected area of the material, and part of a block of the image, that each pixel lies in.
    kept_out : Ground or None
        Pixels of ground that no law has seen, for validation.
    classes : ClassTarget or None
        The same pixels by incidence-angle bin, where the objective uses bins.
    """

    pixels: NDArray[np.int64]
    order: NDArray[np.int64]
    values_db: NDArray[np.float64]
    incidence_deg: NDArray[np.float32]
    dp: NDArray[np.float64]
    eligible: int
    at_boundary: bool
    effective: float
    rms_sampling: float
    cp_error: NDArray[np.float64]
    cp_interval: NDArray[np.float64]
    goodness: Goodness
    left_out: Mapping[str, int] = field(default_factory=dict)
    looks: float = float("nan")
    penalised: bool = False
    patch: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    block: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, dtype=np.int64))
    kept_out: Ground | None = None
    classes: ClassTarget | None = None

    @property
    def ground(self) -> Ground:
        """The pixels with the areas that they lie in."""
        return Ground(
            values_db=np.asarray(self.values_db, dtype=np.float64),
            incidence_deg=np.asarray(self.incidence_deg, dtype=np.float64),
            patch=self.patch,
            block=self.block,
            independent=self.effective / self.pixels.size,
        )

    @property
    def cp(self) -> NDArray[np.float64]:
        """Centred parameters of the target."""
        return skewnormal.centred(self.dp)

    def score(
        self, pixels_db: NDArray[np.float32], mapping: tuple[float, float] = (0.0, 1.0)
    ) -> tuple[NDArray[np.float64], float]:
        """Fit the same pixels of a run.

        Parameters
        ----------
        pixels_db : ndarray
            Visible pixels of the material in a run [dB].
        mapping : (float, float)
            Shift and scale of the run's levels [dB].

        Returns
        -------
        dp : ndarray, shape (3,)
            Direct parameters of the run's density.
        rms : float
            Its difference from the target [1/dB].
        """
        dp = skewnormal.fit(Levels.apply(pixels_db[self.order], mapping), self.penalised).dp
        return dp, skewnormal.density_rms(dp, self.dp)


class Targets(dict[str, Target]):
    """Targets by calibrated material, and the levels that they and every run are compared at.

    Parameters
    ----------
    targets : mapping
        Target by material.
    levels : Levels
        What is taken out of both images.
    looks : float
        Equivalent number of looks of the measured image's homogeneous areas; NaN where not known.
    """

    def __init__(
        self, targets: Mapping[str, Target], levels: Levels | None = None, looks: float = float("nan")
    ) -> None:
        super().__init__(targets)
        self.levels = levels or Levels()
        self.looks = looks

    def textured(self, name: str) -> bool:
        """Whether a material has far fewer looks than the image's homogeneous areas: no surface with speckle alone."""
        return self[name].looks < _TEXTURED * self.looks

    def score(self, pixels_db: Mapping[str, NDArray[np.float32]]) -> dict[str, tuple[NDArray[np.float64], float]]:
        """Direct parameters and rms [1/dB] of every material in a run, from its visible pixels [dB]."""
        mapping = self.levels.simulated(pixels_db)
        return {name: target.score(pixels_db[name], mapping) for name, target in self.items()}

    def sentences(self) -> list[str]:
        """Lines on what is compared: one for the levels, one for each material."""
        levels = self.levels
        lines = [f"levels: {levels.sentence}"] if levels.normalisation != "none" or levels.doubtful else []
        for name, target in self.items():
            mean, sd, skewness = target.cp
            size = f"target of {name}: {len(target.pixels)} pixels"
            classes = f", {target.classes.classes.size} incidence-angle bins" if target.classes is not None else ""
            lines.append(f"{size}, {mean:.2f} +- {sd:.2f} {levels.unit}, skewness {skewness:.2f}{classes}")
        return [*lines, *self.warnings()]

    def warnings(self) -> list[str]:
        """Materials that a skew normal, or any law of a surface, does not describe."""
        lines = []
        for name, target in self.items():
            if target.goodness.ad_p <= _UNLIKELY:
                lines.append(
                    f"target of {name}: a skew normal describes its pixels only roughly (Kolmogorov-Smirnov distance "
                    f"{target.goodness.ks:.3f}, p {target.goodness.ad_p:.2g}): mixed ground, or incidence?"
                )
            if self.textured(name):
                lines.append(
                    f"target of {name}: its neighbours have the speckle of {target.looks:.1f} looks, the image's "
                    f"homogeneous areas {self.looks:.1f}: texture, buildings or point targets, which no law of a "
                    "surface describes."
                )
        return lines


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


def _settled(dp: NDArray[np.float64]) -> NDArray[np.float64]:
    """Direct parameters whose centred ones are rounded."""
    mean, sd, skewness = skewnormal.centred(dp)
    step = _SETTLED * 2.0 ** np.floor(np.log2(sd))
    rounded = [np.round(mean / step) * step, np.round(sd / step) * step, np.round(skewness / _SETTLED) * _SETTLED]
    return skewnormal.direct(rounded)


def make_target(
    name: str,
    geometry: Geometry,
    measurement: Measurement,
    config: TargetConfig,
    seed: int,
    uncertainty_px: NDArray[np.float32] | None = None,
    *,
    levels: Levels | None = None,
    flags: Mapping[str, NDArray[np.bool_]] | None = None,
    radar: Radar | None = None,
    validation: Validation | None = None,
) -> Target:
    """Draw a material's pixels without replacement and fit their density.

    Parameters
    ----------
    name, geometry, measurement, config, uncertainty_px, flags
        As for :func:`~radcal.measurement.pixels.eligible_pixels`.
    seed : int
        Of the draw.
    levels : Levels, optional
        What is taken out of the measured values.
    radar : Radar, optional
        Resolutions and pixel spacings, for the looks.
    validation : Validation, optional
        Which blocks are held out.

    Raises
    ------
    MeasurementError
        Not enough pixels.
    FitError
        The pixels cannot be fitted.
    """
    blocks = Blocks.of(validation, geometry.shape[0])
    part = blocks.parts_of(np.arange(geometry.incidence_deg.size), geometry.shape[1])
    out = np.zeros(part.shape, dtype=np.bool_)
    if validation is not None and validation.keep != "both":
        out = ~blocks.kept(part, validation.keep)
        flags = {**(flags or {}), KEPT_OUT: out.reshape(geometry.shape)}
    eligible = eligible_pixels(name, geometry, measurement, config, uncertainty_px, flags)
    rng = derived_rng(seed, "target", name)
    drawn = np.sort(rng.choice(eligible.pixels, size=min(config.pixels, eligible.pixels.size), replace=False))
    values = Levels.apply(measurement.image_db.ravel()[drawn], (levels or Levels()).measured)
    penalised = config.fit == "penalised"
    fit = skewnormal.fit(values, penalised)
    effective = effective_sample_size(measurement.image_db, eligible.pixels, drawn)
    patches = label_patches(geometry.material == geometry.names.index(name) + 1).ravel()
    kept_out = None
    if out.any():
        others = {reason: flag for reason, flag in (flags or {}).items() if reason != KEPT_OUT}
        with_it = eligible_pixels(name, geometry, measurement, config, uncertainty_px, others).pixels
        held = with_it[out[with_it]]
        kept_out = Ground(
            values_db=Levels.apply(measurement.image_db.ravel()[held], (levels or Levels()).measured),
            incidence_deg=geometry.incidence_deg.ravel()[held].astype(np.float64),
            patch=patches[held],
            block=part[held],
            # correlated as the others are, but all of them and not some
            independent=effective_sample_size(measurement.image_db, held, held) / held.size if held.size else 1.0,
        )
    return Target(
        pixels=drawn,
        order=np.searchsorted(geometry.pixels(name), drawn),
        values_db=values,
        incidence_deg=geometry.incidence_deg.ravel()[drawn],
        dp=fit.dp if fit.at_boundary else _settled(fit.dp),
        eligible=int(eligible.pixels.size),
        at_boundary=fit.at_boundary,
        effective=effective,
        rms_sampling=sampling_rms(fit.dp, max(8, round(effective)), rng, penalised=penalised),
        cp_error=np.sqrt(np.diagonal(skewnormal.covariance(values, fit, effective))),
        cp_interval=skewnormal.intervals(values, fit, effective=effective),
        goodness=goodness_of_fit(values, fit.dp, rng, effective, penalised=penalised),
        penalised=penalised,
        left_out=eligible.left_out,
        looks=local_looks(measurement.image_db, eligible.pixels, radar) if radar is not None else float("nan"),
        patch=patches[drawn],
        block=part[drawn],
        kept_out=kept_out,
    )


def make_targets(
    case: stages.Target, geometry: Geometry, registered: Registered, reference_db: NDArray[np.float32]
) -> Targets:
    """Targets of all calibrated materials, and the levels.

    Parameters
    ----------
    case : stages.Target
        Materials, pass, seed, and settings of the target.
    geometry : Geometry
        Of the pass.
    registered : Registered
        The measured image.
    reference_db : ndarray, shape (rows, columns)
        The reference run's image [dB].

    Raises
    ------
    MeasurementError
        A material has too few pixels, or no reference material says the level.
    FitError
        The pixels cannot be fitted.
    """
    measurement, config = registered.measurement, case.target
    levels = make_levels(case, geometry, registered, reference_db)
    level = 0.0 if config.normalisation == "none" else levels.offset_db
    noise_db = noise_floor_db(case.radar, geometry.flat_incidence_deg) + level
    flags = {IN_THE_NOISE: noise_limited(measurement.image_db, noise_db, config.snr_db)}
    looks = estimate_looks(measurement.image_db, geometry.material, case.radar)
    if config.leave_out_point_targets:
        flags["point targets"] = point_targets(measurement.image_db, geometry.material, case.radar)
    return Targets(
        {
            name: make_target(
                name,
                geometry,
                measurement,
                config,
                case.seed,
                registered.uncertainty_px,
                levels=levels,
                flags=flags,
                radar=case.radar,
                validation=case.validation,
            )
            for name in case.calibrated
        },
        levels,
        looks.looks if looks is not None else float("nan"),
    )


def make_levels(
    case: stages.Target, geometry: Geometry, registered: Registered, reference_db: NDArray[np.float32]
) -> Levels:
    """Levels of the measured image against the reference run; arguments as for :func:`make_targets`.

    Raises
    ------
    MeasurementError
        ``offset`` is asked for and no reference material has enough pixels.
    """
    measurement, config = registered.measurement, case.target
    if config.normalisation == "image":
        calibrated = {name: geometry.names.index(name) + 1 for name in case.calibrated}
        return image_levels(measurement.image_db, reference_db, geometry.material, calibrated)
    differences, refused = {}, ""
    for name in case.reference_materials:
        try:
            eligible = eligible_pixels(name, geometry, measurement, config, registered.uncertainty_px)
        except MeasurementError as error:
            refused = str(error)
            continue
        rng = derived_rng(case.seed, "levels", name)
        drawn = np.sort(rng.choice(eligible.pixels, size=min(_LEVEL_PIXELS, eligible.pixels.size), replace=False))
        effective = effective_sample_size(measurement.image_db, eligible.pixels, drawn)
        measured, simulated = (
            image.ravel()[drawn].astype(np.float64) for image in (measurement.image_db, reference_db)
        )
        error_db = float(np.sqrt((measured.var() + simulated.var()) / effective))
        if error_db > 0.0:
            differences[name] = (float(measured.mean() - simulated.mean()), error_db)
    if config.normalisation == "offset" and not differences:
        raise MeasurementError(f"target.normalisation: offset needs a material that says the level; {refused}")
    return offset_levels(config.normalisation, differences)


_ARRAYS = ("pixels", "order", "values_db", "incidence_deg", "dp", "cp_error", "cp_interval", "patch", "block")
_GROUND = ("values_db", "incidence_deg", "patch", "block")
_SCALARS = ("eligible", "at_boundary", "effective", "rms_sampling", "looks", "penalised")
_GOODNESS = ("ks", "ks_p", "ad", "ad_p")
_LEVELS = ("normalisation", "offset_db", "offset_error_db", "scale", "measured")


def write_targets(path: str | Path, targets: Targets) -> None:
    """Write the targets of all materials, and the levels, to HDF5, atomically."""
    with write_hdf5(path, "target", track_order=True) as file:
        file.attrs["looks"] = targets.looks
        materials = file.create_group("materials", track_order=True)
        for name, target in targets.items():
            group = materials.create_group(name)
            for key in _ARRAYS:
                group[key] = getattr(target, key)
            for key in _SCALARS:
                group.attrs[key] = getattr(target, key)
            for key in _GOODNESS:
                group.attrs[key] = getattr(target.goodness, key)
            group.attrs["left_out"] = json.dumps(target.left_out)
            if target.kept_out is not None:
                held = group.create_group("kept_out")
                for key in _GROUND:
                    held.create_dataset(key, data=getattr(target.kept_out, key), compression="gzip", compression_opts=1)
                held.attrs["independent"] = target.kept_out.independent
            if target.classes is not None:
                put_classes(group.create_group("classes"), target.classes)
        levels = file.create_group("levels")
        for key in _LEVELS:
            levels.attrs[key] = getattr(targets.levels, key)
        levels.attrs["references"] = json.dumps(targets.levels.references)
        levels.create_dataset("others_db", data=targets.levels.others_db, compression="gzip", compression_opts=1)
        for name, places in targets.levels.valid.items():
            levels.create_dataset(f"valid/{name}", data=places, compression="gzip", compression_opts=1)


def _read_ground(group: Any) -> Ground:
    return Ground(**{key: group[key][()] for key in _GROUND}, independent=float(group.attrs["independent"]))


def read_targets(path: str | Path) -> Targets:
    """Read the targets that :func:`write_targets` wrote.

    Raises
    ------
    StoreError
        The file is missing, damaged, or of another version or case.
    """
    with read_hdf5(path, "target") as file:
        targets = {
            name: Target(
                **{key: group[key][()] for key in _ARRAYS},
                eligible=int(group.attrs["eligible"]),
                at_boundary=bool(group.attrs["at_boundary"]),
                effective=float(group.attrs["effective"]),
                rms_sampling=float(group.attrs["rms_sampling"]),
                penalised=bool(group.attrs["penalised"]),
                goodness=Goodness(**{key: float(group.attrs[key]) for key in _GOODNESS}),
                left_out=json.loads(group.attrs["left_out"]),
                looks=float(group.attrs["looks"]),
                kept_out=_read_ground(group["kept_out"]) if "kept_out" in group else None,
                classes=take_classes(group["classes"]) if "classes" in group else None,
            )
            for name, group in file["materials"].items()
        }
        group = file["levels"]
        shift, scale = group.attrs["measured"]
        levels = Levels(
            normalisation=str(group.attrs["normalisation"]),
            offset_db=float(group.attrs["offset_db"]),
            offset_error_db=float(group.attrs["offset_error_db"]),
            scale=float(group.attrs["scale"]),
            references=tuple(json.loads(group.attrs["references"])),
            measured=(float(shift), float(scale)),
            others_db=group["others_db"][()],
            valid={name: item[()] for name, item in group["valid"].items()} if "valid" in group else {},
        )
        return Targets(targets, levels, float(file.attrs["looks"]))
