"""Ground kept out of the calibration, and how well its mean level is predicted."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.assessment.constant import Constant
from radcal.assessment.gain import POWER, Gain, field_gains, power
from radcal.assessment.prediction import Prediction, predict
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
_CHANCE = 0.01
_LEAST_DB = 1e-3
_BAND = 1.6448536269514722  # standard deviations on each side that hold 90 % of a normal law


@dataclass(frozen=True)
class HeldOut:
    """Errors of block means [dB] on ground that no law has seen.

    Attributes
    ----------
    rmse_law_db, rmse_law_patch_db : float
        Of the law; of the law with the effects of the patches that were seen.
    rmse_constant_db, rmse_constant_patch_db : float
        Of the constant (generalised least squares over fields and cells) of the calibrated ground; of the constant
        with its own effects of the patches that were seen.
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
    n_blocks, n_fields : int
        Blocks and fields compared.
    law_gain, law_gain_error, patch_gain, patch_gain_error : float
        Gain of the law over the constant and its standard error (:class:`radcal.assessment.gain.Gain`): of both
        alone, and of both with the effects of fields.
    block : ndarray of int, shape (n,)
        Their numbers.
    mean_db, predicted_db, law_db, sd_db : ndarray, shape (n,)
        Means measured; predicted by law and patches; by the law; standard deviation of the prediction
        error [dB].
    field : ndarray of int, shape (f,)
        Labels of the fields.
    field_law_gain, field_patch_gain : ndarray, shape (f,)
        Gains of each.
    """

    rmse_law_db: float
    rmse_law_patch_db: float
    rmse_constant_db: float
    rmse_constant_patch_db: float
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
    n_fields: int
    law_gain: float
    law_gain_error: float
    patch_gain: float
    patch_gain_error: float
    block: NDArray[np.int64]
    mean_db: NDArray[np.float64]
    predicted_db: NDArray[np.float64]
    law_db: NDArray[np.float64]
    sd_db: NDArray[np.float64]
    field: NDArray[np.int64]
    field_law_gain: NDArray[np.float64]
    field_patch_gain: NDArray[np.float64]

    @property
    def gain(self) -> Gain:
        """Gain of like against like: law and constant, both with the effects of the fields that were seen."""
        return Gain(self.patch_gain, self.patch_gain_error, self.n_fields)

    @property
    def held_in_band(self) -> bool:
        """Whether the 90 % band holds; not if so few block means lie inside by chance in 1 % of the cases only."""
        from scipy.stats import binom

        inside = round(self.coverage_90 * self.n_blocks)
        return bool(binom.cdf(inside, self.n_blocks, 0.9) >= _CHANCE)

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

        field = all_of("field")
        combined: dict[str, Any] = {
            "n_blocks": int(n.sum()),
            **_gains(field, all_of("field_law_gain"), all_of("field_patch_gain")),
        }
        for item in fields(cls):
            if isinstance(getattr(parts[0], item.name), np.ndarray):
                combined[item.name] = all_of(item.name)
            elif item.name.startswith("rmse"):
                combined[item.name] = together(item.name)
            elif item.name not in combined:
                combined[item.name] = mean(item.name)
        return cls(**combined)


def _gains(field: NDArray[np.int64], law: NDArray[np.float64], patch: NDArray[np.float64]) -> dict[str, float | int]:
    """Gains over all fields, and their number."""
    alone, both = Gain.of(field, law), Gain.of(field, patch)
    return {
        "n_fields": alone.fields,
        "law_gain": alone.mean,
        "law_gain_error": alone.error,
        "patch_gain": both.mean,
        "patch_gain_error": both.error,
    }


def _rms(values: NDArray[np.float64]) -> float:
    return float(np.sqrt(np.mean(values**2)))


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


def held_out(
    found: GroundLaw, constant: Constant, ground: Ground, start_db: NDArray[np.float64] | None = None
) -> HeldOut | None:
    """Predict the block means of ground that was kept out, and its density.

    Parameters
    ----------
    found : GroundLaw
        Fitted to the ground that was kept.
    constant : Constant
        Constant of the same.
    ground : Ground
        Kept out, with the patches' labels of the other.
    start_db : ndarray, shape (pixels,), optional
        Expected mean of dB values of the starting law at its pixels [dB].

    Returns
    -------
    HeldOut or None
        None where no block has 20 pixels.
    """
    from scipy.stats import ks_2samp

    if not ground.values_db.size:
        return None
    cells = predict(found, constant, ground)
    blocks = cells.in_blocks(found.fit.covariance)
    many = blocks.count >= _FEWEST
    if not many.any():
        return None
    used = cells.part(np.isin(cells.block, blocks.block[many]))
    blocks = blocks.part(many)
    calibrated, values = found.ground.values_db, ground.values_db
    of = ground.cells.of_pixel
    expected = found.levels_db(ground.incidence_deg) + (cells.law_patch_db - cells.law_db)[of]
    spread_db = np.sqrt(cells.effect_variance + found.spread.within**2)[of]
    ks_law, tail_law = _against(values, expected, found.fit.looks, spread_db)
    start, ks_start, tail_start = (float("nan"),) * 3
    if start_db is not None:
        _, of_block = np.unique(ground.block, return_inverse=True)
        started = np.bincount(of_block, start_db) / np.bincount(of_block)
        start = _rms(blocks.mean_db - started[many])
        ks_start, tail_start = _against(values, start_db, found.method.looks)
    error = blocks.mean_db - blocks.law_patch_db
    field, law_gain = field_gains(used.patch, used.mean_db - used.law_db, used.mean_db - used.constant_db)
    _, patch_gain = field_gains(used.patch, used.mean_db - used.law_patch_db, used.mean_db - used.constant_patch_db)
    return HeldOut(
        rmse_law_db=_rms(blocks.mean_db - blocks.law_db),
        rmse_law_patch_db=_rms(error),
        rmse_constant_db=_rms(blocks.mean_db - blocks.constant_db),
        rmse_constant_patch_db=_rms(blocks.mean_db - blocks.constant_patch_db),
        rmse_best_db=_best(found.method.law, found.method.bounds, blocks.incidence_deg, blocks.mean_db),
        rmse_start_db=start,
        ks_law=ks_law,
        ks_constant=float(ks_2samp(calibrated, values).statistic),
        ks_start=ks_start,
        tail_law_db=tail_law,
        tail_constant_db=float(np.quantile(calibrated, _TAIL) - np.quantile(values, _TAIL)),
        tail_start_db=tail_start,
        coverage_90=float(np.mean(np.abs(error) <= _BAND * blocks.sd_db)),
        n_blocks=int(error.size),
        **_gains(field, law_gain, patch_gain),  # type: ignore[arg-type]
        block=blocks.block,
        mean_db=blocks.mean_db,
        predicted_db=blocks.law_patch_db,
        law_db=blocks.law_db,
        sd_db=blocks.sd_db,
        field=field,
        field_law_gain=law_gain,
        field_patch_gain=patch_gain,
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
    rmse_law_patch_db, rmse_constant_patch_db : float
        Of block means [dB], by law and by constant, both with the effects of the fields that were seen; NaN where
        there are too few blocks, or too few pixels in them.
    power : float
        As :func:`radcal.assessment.gain.power` gives it.
    """

    rmse_law_patch_db: float
    rmse_constant_patch_db: float
    power: float = float("inf")

    @property
    def no_better(self) -> bool:
        """Whether the law is seen to be no better than a constant; never without power or with too few blocks."""
        return self.power >= POWER and self.rmse_law_patch_db >= self.rmse_constant_patch_db

    def sentence(self, name: str) -> str:
        """Say so, or nothing."""
        if not self.no_better:
            return ""
        return (
            f"{name}: blocks of its own ground, each predicted from the others, are "
            f"{self.rmse_law_patch_db:.2f} dB off by law and field effects, {self.rmse_constant_patch_db:.2f} dB by a "
            "constant with field effects: do not use the law's slope."
        )


def cross_validate(found: GroundLaw, constant: Constant, group: NDArray[np.int64]) -> CrossValidation:
    """Leave out each fifth of the calibrated ground's blocks in turn.

    Parameters
    ----------
    found : GroundLaw
        Fitted to all of it.
    constant : Constant
        Constant of all of it.
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
    parts: list[Prediction] = []
    for k in range(min(_FOLDS, groups.size) if groups.size > 1 else 0):
        rest, out = found.ground.part(fold != k), found.ground.part(fold == k)
        if rest.values_db.size < FEWEST:
            continue
        again = refit(found, rest)
        blocks = predict(again, replace(constant, ground=rest), out).in_blocks(again.fit.covariance)
        parts.append(blocks.part(blocks.count >= _FEWEST))
    if not sum(part.count.size for part in parts):
        return CrossValidation(float("nan"), float("nan"), 0.0)
    mean, law, level, block = (
        np.concatenate([getattr(part, key) for part in parts])
        for key in ("mean_db", "law_patch_db", "constant_patch_db", "block")
    )
    errors = _rms(mean - law), _rms(mean - level)
    # the errors of the better predictor bound those of the right one; a block's are its own, its fields are known
    own = np.full(mean.size, max(min(errors), _LEAST_DB) ** 2)
    return CrossValidation(*errors, power(block, law - level, np.zeros(mean.size), own))
