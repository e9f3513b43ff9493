"""Making of targets: pixels of each material are drawn and level-normalised, then fitted, checked and binned."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from radcal import skewnormal
from radcal.config.part import Part
from radcal.errors import MeasurementError
from radcal.ground.bins import incidence_edges
from radcal.ground.correlation import estimate_correlation
from radcal.ground.goodness import goodness_of_fit
from radcal.ground.ground import Blocks, Ground
from radcal.ground.levels import Levels, image_levels, offset_levels
from radcal.ground.patches import label_patches, patches_seen
from radcal.ground.pixels import IN_THE_NOISE, eligible_pixels, noise_limited, point_targets
from radcal.image.looks import estimate_looks, local_looks
from radcal.inference.incidence_error import registration_error_deg
from radcal.inference.misfit import BinMisfit, Method, Misfit
from radcal.inference.pooled_laws import fit_laws
from radcal.laws import law_for
from radcal.radar.geometry import Geometry
from radcal.radar.radiometry import noise_floor_db
from radcal.registration.registered import Registered
from radcal.scene.model import Scene
from radcal.seeds import derived_rng
from radcal.targets.reach import check_reach
from radcal.targets.target import ClassTarget, Target, Targets

# Step to which a target's parameters are rounded, relative to its standard deviation; a thousandth of the sampling
# error of 1,000 pixels. Numerical noise, for example after a constant is added to the image, then changes no
# calibration.
_ROUNDING = 1e-5
_LEVEL_PIXELS = 1000  # pixels drawn of each reference material
HELD_OUT = "held out to check the law"  # reason for masking
_LEVEL_DB = 40.0  # half width of a bin level's bounds about the mean of the pixels, for laws without a curve


def sampling_rms(
    dp: NDArray[np.float64], n: int, rng: np.random.Generator, draws: int = 40, penalised: bool = False
) -> float:
    """Density rms between a skew normal and the fits to samples drawn from it (parametric bootstrap).

    Parameters
    ----------
    dp : ndarray, shape (3,)
        Direct parameters of the skew normal.
    n : int
        Number of independent values in each sample.
    rng : Generator
        Random number generator of the samples.
    draws : int
        Number of samples.
    penalised : bool
        Whether the samples are fitted by penalised likelihood.

    Returns
    -------
    float
        Median, over the samples, of the density rms [1/dB].

    References
    ----------
    Efron and Tibshirani, "An Introduction to the Bootstrap" (1993), section 6.5.
    """
    fits = (skewnormal.fit(skewnormal.sample(dp, n, rng), penalised) for _ in range(draws))
    return float(np.median([skewnormal.density_rms(found.dp, dp) for found in fits]))


def _rounded(dp: NDArray[np.float64]) -> NDArray[np.float64]:
    """Direct parameters computed from the rounded centred parameters of ``dp``."""
    mean, sd, skewness = skewnormal.centred(dp)
    step = _ROUNDING * 2.0 ** np.floor(np.log2(sd))
    rounded = [np.round(mean / step) * step, np.round(sd / step) * step, np.round(skewness / _ROUNDING) * _ROUNDING]
    return skewnormal.direct(rounded)


def make_target(
    case: Part,
    name: str,
    geometry: Geometry,
    registered: Registered,
    levels: Levels,
    flags: Mapping[str, NDArray[np.bool_]],
    scene: Scene | None,
) -> Target:
    """Target of one material: pixels drawn at random without replacement, and the density fitted to their values.

    Parameters
    ----------
    case, geometry, registered, scene
        Arguments of :func:`make_targets`.
    name : str
        Material.
    levels : Levels
        Level normalisation of the measured values.
    flags : mapping of str to ndarray of bool
        Masks of pixels that are excluded, by reason, besides those of held-out blocks.

    Raises
    ------
    MeasurementError
        Too few pixels are eligible.
    FitError
        The density cannot be fitted to the pixels.
    """
    measurement, config, validation = registered.measurement, case.target, case.validation
    blocks = Blocks.of(validation, geometry.shape[0])
    part = blocks.parts_of(np.arange(geometry.incidence_deg.size), geometry.shape[1])
    if validation is not None and validation.holds_out:
        flags = {**flags, HELD_OUT: ~blocks.kept(part, validation.keep).reshape(geometry.shape)}
    eligible = eligible_pixels(name, geometry, measurement, config, registered.uncertainty_px, flags)
    rng = derived_rng(case.seed, "target", name)
    drawn = np.sort(rng.choice(eligible.pixels, size=min(config.pixels, eligible.pixels.size), replace=False))
    values = Levels.apply(measurement.image_db.ravel()[drawn], levels.measured)
    penalised = config.fit == "penalised"
    fit = skewnormal.fit(values, penalised)
    correlation = estimate_correlation(measurement.image_db, eligible.pixels, geometry.incidence_deg)
    effective = correlation.effective(drawn)
    return Target(
        pixels=drawn,
        order=np.searchsorted(geometry.pixels(name), drawn),
        values_db=values,
        incidence_deg=geometry.incidence_deg.ravel()[drawn],
        dp=fit.dp if fit.at_boundary else _rounded(fit.dp),
        eligible=int(eligible.pixels.size),
        at_boundary=fit.at_boundary,
        effective=effective,
        rms_sampling=sampling_rms(fit.dp, max(8, round(effective)), rng, penalised=penalised),
        cp_error=np.sqrt(np.diagonal(skewnormal.covariance(values, fit, effective))),
        goodness=goodness_of_fit(values, fit.dp, rng, effective, penalised=penalised),
        penalised=penalised,
        left_out=eligible.masked,
        looks=local_looks(measurement.image_db, eligible.pixels, case.radar),
        patch=fields_of(name, geometry, scene)[drawn],
        block=part[drawn],
        correlation=correlation,
    )


def make_targets(
    case: Part,
    geometry: Geometry,
    registered: Registered,
    reference_db: NDArray[np.float32],
    misfit: type[Misfit] | None,
    partly: bool = False,
    scene: Scene | None = None,
) -> Targets:
    """Targets of all calibrated materials in one pass: made, checked and divided into incidence-angle bins.

    Parameters
    ----------
    case : Part
        Materials, pass, seed, and settings of the target.
    geometry : Geometry
        Geometry of the pass.
    registered : Registered
        Registered measured image.
    reference_db : ndarray, shape (rows, columns)
        Image of the reference run [dB].
    misfit : type of Misfit, or None
        Misfit of the objective, for which the pixels are divided into bins; None for an objective without bins.
    partly : bool
        Whether materials with too few pixels are left out, as long as one has enough; for further passes.
    scene : Scene, optional
        Scene whose connected areas are the materials' fields; by default, connected areas of the image are the fields.

    Raises
    ------
    MeasurementError
        A material has too few pixels, or the level cannot be estimated from any reference material.
    ConfigError
        Inside the bounds of X, a law cannot reach the measured level (:func:`radcal.targets.reach.check_level`).
    FitError
        The density of a material cannot be fitted to its pixels.
    """
    measurement, config = registered.measurement, case.target
    levels = make_levels(case, geometry, registered, reference_db)
    level = 0.0 if config.normalisation == "none" else levels.offset_db
    floor_db = noise_floor_db(case.radar, geometry.flat_incidence_deg)
    flags = {IN_THE_NOISE: noise_limited(measurement.image_db, floor_db + level, config.snr_db)}
    looks = estimate_looks(measurement.image_db, geometry.material, case.radar)
    if config.leave_out_point_targets:
        flags["point targets"] = point_targets(measurement.image_db, geometry.material, case.radar)
    targets: dict[str, Target] = {}
    for number, name in enumerate(case.calibrated, start=1):
        try:
            targets[name] = make_target(case, name, geometry, registered, levels, flags, scene)
        except MeasurementError:
            if not partly or (number == len(case.calibrated) and not targets):
                raise
    if case.simulator.own:
        for name, target in targets.items():
            power = 10.0 ** (floor_db[target.pixels // geometry.shape[1]] / 10.0)
            targets[name] = replace(target, noise_db=float(10.0 * np.log10(np.mean(power))))
    made = Targets(targets, levels, looks.looks if looks is not None else float("nan"))
    check_reach(case, made)
    if misfit is None:
        return made
    return bin_targets(case, made, geometry, registered, misfit, scene.slope_error_deg if scene is not None else 0.0)


def laws_of_image(
    case: Part, geometry: Geometry, registered: Registered, reference_db: NDArray[np.float32], scene: Scene
) -> dict[str, list[float]]:
    """Parameters X of the laws that fit the measured pixels in incidence-angle bins, without a simulator run.

    Parameters
    ----------
    case, geometry, registered, reference_db, scene
        Arguments of :func:`make_targets`; bins are used for every objective.

    Returns
    -------
    dict
        X of each calibrated material that has a law with a curve.
    """
    found = {}
    for name, target in make_targets(case, geometry, registered, reference_db, BinMisfit, scene=scene).items():
        if target.classes is not None and target.classes.first.size:
            x = target.classes.first
            found[name] = np.where(case.materials[name].integers, np.round(x), x).tolist()
    return found


def fields_of(name: str, geometry: Geometry, scene: Scene | None) -> NDArray[np.int64]:
    """Number of the field of each pixel of the image, shape (pixels,); 0 where the pixel is of another material."""
    number = geometry.names.index(name) + 1
    shown = geometry.material == number
    fields = label_patches(shown) if scene is None else patches_seen(shown, scene.material == number, geometry.ground)
    return fields.ravel()


def make_levels(case: Part, geometry: Geometry, registered: Registered, reference_db: NDArray[np.float32]) -> Levels:
    """Level normalisation from the measured image and the reference run; parameters as in :func:`make_targets`.

    Raises
    ------
    MeasurementError
        The normalisation is ``offset`` and no reference material has enough pixels.
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
        effective = estimate_correlation(measurement.image_db, eligible.pixels).effective(drawn)
        measured, simulated = (
            image.ravel()[drawn].astype(np.float64) for image in (measurement.image_db, reference_db)
        )
        error_db = float(np.sqrt((measured.var() + simulated.var()) / effective))
        if error_db > 0.0:
            differences[name] = (float(measured.mean() - simulated.mean()), error_db)
    if config.normalisation == "offset" and not differences:
        raise MeasurementError(f"target.normalisation: offset needs a material that says the level; {refused}")
    return offset_levels(config.normalisation, differences)


def bin_targets(
    case: Part,
    targets: Targets,
    geometry: Geometry,
    registered: Registered,
    misfit: type[Misfit],
    slope_error_deg: float = 0.0,
) -> Targets:
    """Divide the pixels of all targets into incidence-angle bins, and estimate the variance between fields.

    The variance is estimated from the measured image alone, without simulator runs
    (:func:`radcal.inference.pooled_laws.fit_laws`), and pooled over the materials.

    Parameters
    ----------
    case : Part
        Laws and settings of the target.
    targets : Targets
        Targets of the calibrated materials.
    geometry : Geometry
        Geometry of the pass, with the local incidence.
    registered : Registered
        Registered measured image; the uncertainty of its registration gives the error of the local incidence if
        ``target.incidence_error_deg`` is not configured.
    misfit : type of Misfit
        Misfit of the pixels in a bin, with which the laws are fitted.
    slope_error_deg : float
        Standard error of the scene's slopes [deg]; it is added in quadrature to the error from the registration.

    Returns
    -------
    Targets
        Targets with their ``classes``.
    """
    laws, measured, methods, binned = case.laws, {}, {}, {}
    for name, target in targets.items():
        law, error, each = laws[name], case.target.incidence_error_deg, None
        if error is None:
            each = np.hypot(
                registration_error_deg(geometry.incidence_deg, registered.uncertainty_px, target.pixels),
                slope_error_deg,
            )
            error = float(np.sqrt(np.mean(each**2)))
        measured[name] = replace(target.ground, error_deg=each if law.has_curve else None)
        method = Method(
            law,
            case.materials[name].box,
            float(case.radar.looks),
            misfit=misfit,
            classes=case.target.incidence_classes,
            free_looks=case.target.looks == "free",
            priors=case.target.priors,
            incidence_error_deg=error,
        )
        methods[name] = method if law.has_curve else _without_curve(method, target.ground)
    for name, found in fit_laws(measured, methods).items():
        classes = ClassTarget(
            classes=found.classes.compared(case.simulator.draws),
            spread=found.spread,
            free_looks=found.method.free_looks,
            priors=case.target.priors,
            incidence_error_deg=found.method.incidence_error_deg,
            first=found.fit.parameters if laws[name].has_curve else np.empty(0),
            first_looks=found.fit.looks,
            error_deg=measured[name].error_deg,
        )
        binned[name] = replace(targets[name], classes=classes)
    return Targets(binned, targets.levels, targets.looks)


def _without_curve(method: Method, ground: Ground) -> Method:
    """Method that fits a level [dB] in each incidence-angle bin, in place of a law that only the simulator knows."""
    edges = incidence_edges(ground.incidence_deg, method.classes)
    mean = float(ground.values_db.mean())
    knots = 0.5 * (edges[1:] + edges[:-1]) if len(edges) > 2 else [edges[0] - 1.0, edges[0] + 1.0]
    levels = law_for("tabulated", angles_deg=tuple(knots))
    bounds = [(mean - _LEVEL_DB, mean + _LEVEL_DB)] * len(knots)
    return replace(method, law=levels, bounds=bounds, misfit=BinMisfit, priors=False, incidence_error_deg=0.0)
