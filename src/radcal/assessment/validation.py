"""Ground kept out of the calibration, and how well its mean level is predicted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.calibration.grounds import GroundLaw, refit
from radcal.calibration.law_fit import fit_law
from radcal.measurement.classes import FEWEST
from radcal.measurement.ground import Ground
from radcal.radar.laws import Law
from radcal.radar.texture import log_speckle_cumulants

__all__ = ["CrossValidation", "HeldOut", "cross_validate", "held_out"]

_FEWEST = 20  # pixels in a block whose mean is compared
_FOLDS = 5
_LEVELS = 200  # that stand for the pixels of a predicted density
_TAIL = 0.99
_BAND = 1.6448536269514722  # standard deviations on each side that hold 90 % of a normal law


@dataclass(frozen=True)
class HeldOut:
    """Errors of block means [dB] on ground that no law has seen.

    Attributes
    ----------
    rmse_law_db, rmse_law_patch_db : float
        Of the law; of the law with the effects of the patches that were seen.
    rmse_constant_db : float
        Of the mean of the calibrated ground.
    rmse_best_db : float
        Of the same law fitted to these block means themselves.
    rmse_start_db : float
        Of the starting law; NaN where it has no curve.
    ks_law, ks_constant, ks_start : float
        Kolmogorov distance of the density of the held-out pixels from that which the law with its looks and
        patches predicts, from that of the calibrated ground, and from that of the starting law at the sensor's looks.
    tail_law_db, tail_constant_db, tail_start_db : float
        How far the 99 % quantile that each predicts lies above the measured one [dB].
    coverage_90 : float
        Share of the block means inside of the 90 % band.
    n_blocks : int
        Blocks compared.
    block : ndarray of int, shape (n,)
        Their numbers.
    mean_db, predicted_db, law_db, sd_db : ndarray, shape (n,)
        Means measured; predicted by law and patches; by the law; standard deviation of the prediction
        error [dB].
    """

    rmse_law_db: float
    rmse_law_patch_db: float
    rmse_constant_db: float
    rmse_best_db: float
    rmse_start_db: float
    ks_law: float
    ks_constant: float
    ks_start: float
    tail_law_db: float
    tail_constant_db: float
    tail_start_db: float
    coverage_90: float
    n_blocks: int
    block: NDArray[np.int64]
    mean_db: NDArray[np.float64]
    predicted_db: NDArray[np.float64]
    law_db: NDArray[np.float64]
    sd_db: NDArray[np.float64]

    @classmethod
    def pooled(cls, parts: Sequence[HeldOut]) -> HeldOut | None:
        """Several grounds as one, each block counting once; None for none."""
        if not parts:
            return None
        n = np.array([part.n_blocks for part in parts], dtype=np.float64)

        def mean(key: str) -> float:
            return float(np.average([getattr(part, key) for part in parts], weights=n))

        def together(key: str) -> float:
            return float(np.sqrt(np.average([getattr(part, key) ** 2 for part in parts], weights=n)))

        def all_of(key: str) -> NDArray[Any]:
            return np.concatenate([getattr(part, key) for part in parts])

        combined: dict[str, Any] = {"n_blocks": int(n.sum())}
        for field in fields(cls):
            if isinstance(getattr(parts[0], field.name), np.ndarray):
                combined[field.name] = all_of(field.name)
            elif field.name.startswith("rmse"):
                combined[field.name] = together(field.name)
            else:
                combined.setdefault(field.name, mean(field.name))
        return cls(**combined)


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


def _predict(found: GroundLaw, ground: Ground) -> dict[str, NDArray[np.float64]]:
    """Prediction of each block's mean, by law and patches, and its standard deviation."""
    cells, spread, effects = ground.cells, found.spread, found.effects
    levels = found.levels_db(ground.incidence_deg)
    law = cells.mean(levels)
    slope = cells.mean(found.slopes(ground.incidence_deg))
    # what an error of the law does to the patches' effects, which are taken from residuals of it
    seen = found.ground
    pulled = seen.cells.mean(found.slopes(seen.incidence_deg)) * effects.weight[:, None]
    of = np.searchsorted(effects.patch, seen.cells.patch)
    taken = np.stack([np.bincount(of, column, effects.patch.size) for column in pulled.T], axis=-1)

    place = np.minimum(np.searchsorted(effects.patch, cells.patch), effects.patch.size - 1)
    known = effects.patch[place] == cells.patch
    effect = np.where(known, effects.effect_db[place], 0.0)
    patch_variance = np.where(known, effects.variance[place], spread.between**2)
    slope = slope - np.where(known[:, None], taken[place], 0.0)

    block, of_block = np.unique(cells.block, return_inverse=True)
    count = np.bincount(of_block, cells.count)
    share = cells.count / count[of_block]

    def over(values: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.bincount(of_block, values), dtype=np.float64)

    slope = np.stack([over(share * column) for column in slope.T], axis=-1)
    # no patch has two cells in one block
    variance = over(share**2 * (patch_variance + spread.within**2 + ground.sampling))
    variance += np.einsum("kd,de,ke->k", slope, found.fit.covariance, slope)
    return {
        "pixels": levels + effect[cells.of_pixel],
        "pixel_sd": np.sqrt(patch_variance + spread.within**2)[cells.of_pixel],
        "block": block,
        "count": count,
        "mean": over(share * cells.mean(ground.values_db)),
        "incidence": over(share * cells.mean(ground.incidence_deg)),
        "law": over(share * law),
        "patch": over(share * (law + effect)),
        "sd": np.sqrt(variance),
    }


def _against(
    values_db: NDArray[np.float64],
    levels_db: NDArray[np.float64],
    looks: float,
    sd_db: NDArray[np.float64] | float = 0.0,
) -> tuple[float, float]:
    """Kolmogorov distance and excess of the 99 % quantile [dB] of gamma speckle about expected levels."""
    from scipy.optimize import brentq
    from scipy.special import gammainc

    levels = np.concatenate([levels_db - sd_db, levels_db + sd_db])
    levels = np.quantile(levels, (np.arange(_LEVELS) + 0.5) / _LEVELS) - log_speckle_cumulants(looks)[0]

    def below(x: NDArray[np.float64] | float) -> NDArray[np.float64]:
        power = 10.0 ** ((np.asarray(x)[..., None] - levels) / 10.0)
        return np.asarray(gammainc(looks, looks * power).mean(axis=-1))

    ordered = np.sort(values_db)
    at = np.unique(np.linspace(0, ordered.size - 1, 500).astype(np.int64))
    expected = below(ordered[at])
    distance = np.maximum(np.abs(expected - at / ordered.size), np.abs(expected - (at + 1) / ordered.size)).max()
    top = brentq(lambda x: float(below(x)) - _TAIL, levels.min() - 60.0, levels.max() + 60.0, xtol=1e-6)
    return float(distance), float(top - np.quantile(values_db, _TAIL))


def held_out(found: GroundLaw, ground: Ground, start_db: NDArray[np.float64] | None = None) -> HeldOut | None:
    """Predict the block means of ground that was kept out, and its density.

    Parameters
    ----------
    found : GroundLaw
        Fitted to the ground that was kept.
    ground : Ground
        Kept out, with the patches' labels of the other.
    start_db : ndarray, shape (pixels,), optional
        Expected mean of dB values of the starting law at its pixels [dB].

    Returns
    -------
    HeldOut or None
        None where no block has 20 pixels.

    References
    ----------
    Robinson, "That BLUP is a good thing: the estimation of random effects", Statistical Science 6
    (1991): predictions and their variances, that of the fixed effects included.
    """
    from scipy.stats import ks_2samp

    if not ground.values_db.size:
        return None
    blocks = _predict(found, ground)
    many = blocks["count"] >= _FEWEST
    if not many.any():
        return None
    block, mean, law, patch, sd, angle = (
        blocks[key][many] for key in ("block", "mean", "law", "patch", "sd", "incidence")
    )
    calibrated, values = found.ground.values_db, ground.values_db
    ks_law, tail_law = _against(values, blocks["pixels"], found.fit.looks, blocks["pixel_sd"])
    start, ks_start, tail_start = (float("nan"),) * 3
    if start_db is not None:
        _, of_block = np.unique(ground.block, return_inverse=True)
        expected = np.bincount(of_block, start_db) / np.bincount(of_block)
        start = _rms(mean - expected[many])
        ks_start, tail_start = _against(values, start_db, found.method.looks)
    return HeldOut(
        rmse_law_db=_rms(mean - law),
        rmse_law_patch_db=_rms(mean - patch),
        rmse_constant_db=_rms(mean - found.ground.values_db.mean()),
        rmse_best_db=_best(found.method.law, found.method.bounds, angle, mean),
        rmse_start_db=start,
        ks_law=ks_law,
        ks_constant=float(ks_2samp(calibrated, values).statistic),
        ks_start=ks_start,
        tail_law_db=tail_law,
        tail_constant_db=float(np.quantile(calibrated, _TAIL) - np.quantile(values, _TAIL)),
        tail_start_db=tail_start,
        coverage_90=float(np.mean(np.abs(mean - patch) <= _BAND * sd)),
        n_blocks=int(mean.size),
        block=block.astype(np.int64),
        mean_db=mean,
        predicted_db=patch,
        law_db=law,
        sd_db=sd,
    )


def _best(law: Law, bounds: ArrayLike, incidence_deg: NDArray[np.float64], mean_db: NDArray[np.float64]) -> float:
    """Root mean square [dB] that the law leaves when fitted to the means themselves."""
    phi = np.radians(incidence_deg)
    fit = fit_law(lambda x, _: law(phi, x) - mean_db, bounds, 1.0, free_looks=False)
    return _rms(law(phi, fit.parameters) - mean_db)


@dataclass(frozen=True)
class CrossValidation:
    """What the calibrated ground itself says of its law, each fifth of its blocks predicted from the others.

    Attributes
    ----------
    rmse_law_patch_db, rmse_constant_db : float
        Of block means [dB]; NaN where there are too few blocks, or too few pixels in them.
    """

    rmse_law_patch_db: float
    rmse_constant_db: float

    @property
    def no_better(self) -> bool:
        """Whether the law is seen to be no better than a constant; never where there are too few blocks."""
        return self.rmse_law_patch_db >= self.rmse_constant_db

    def sentence(self, name: str) -> str:
        """Say so, or nothing."""
        if not self.no_better:
            return ""
        return (
            f"{name}: its law is no better than a constant: blocks of its own ground, each predicted from the others, "
            f"are {self.rmse_law_patch_db:.2f} dB off, from a constant {self.rmse_constant_db:.2f} dB."
        )


def cross_validate(found: GroundLaw, group: NDArray[np.int64]) -> CrossValidation:
    """Leave out each fifth of the calibrated ground's blocks in turn.

    Parameters
    ----------
    found : GroundLaw
        Fitted to all of it.
    group : ndarray of int, shape (pixels,)
        Block that each pixel is left out with: of several that means are compared in.

    Returns
    -------
    CrossValidation

    References
    ----------
    Hastie, Tibshirani and Friedman, "The Elements of Statistical Learning", 2nd edition (2009),
    section 7.10.
    """
    groups = np.unique(group)
    fold = np.searchsorted(groups, group) % min(_FOLDS, groups.size)
    law, constant = [], []
    for k in range(min(_FOLDS, groups.size) if groups.size > 1 else 0):
        rest, out = found.ground.part(fold != k), found.ground.part(fold == k)
        if rest.values_db.size < FEWEST:
            continue
        blocks = _predict(refit(found, rest), out)
        many = blocks["count"] >= _FEWEST
        law.append((blocks["mean"] - blocks["patch"])[many])
        constant.append((blocks["mean"] - rest.values_db.mean())[many])
    if not law or not sum(part.size for part in law):
        return CrossValidation(float("nan"), float("nan"))
    return CrossValidation(_rms(np.concatenate(law)), _rms(np.concatenate(constant)))
