"""Validation of a law: predictions of ground that is held out of the calibration or of a fit."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from radcal.assessment.budget import NORMAL_90
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

_FEWEST = 20  # least number of pixels in a block whose mean is compared
_FOLDS = 5
_LEVELS = 200  # number of levels that represent the pixels of a predicted density
_TAIL = 0.99
_CHANCE = 0.01
_LEAST_DB = 1e-3


@dataclass(frozen=True)
class HeldOut:
    """Errors of the predicted block means and densities of held-out ground.

    Attributes
    ----------
    rmse_law_db, rmse_law_patch_db : float
        Root mean square errors of the block means predicted by the law, without and with the effects of calibrated
        fields [dB].
    rmse_constant_db, rmse_constant_patch_db : float
        Root mean square errors of the constant, without and with the effects of calibrated fields [dB]. The constant is
        the generalised least squares mean of the calibrated ground over fields and cells.
    rmse_best_db : float
        Root mean square error that a law of the same form leaves if it is fitted to the held-out block means [dB].
    rmse_start_db : float
        Root mean square error of the starting law [dB]; NaN if it has no curve.
    ks_law, ks_constant, ks_start : float
        Kolmogorov-Smirnov distances of the held-out pixels from three predicted densities: that of the law with its
        looks and field effects, that of the calibrated ground, and that of the starting law at the sensor's looks.
    tail_law_db, tail_constant_db, tail_start_db : float
        Predicted minus measured 99 % quantile [dB], predicted by law, calibrated ground, and starting law.
    coverage_90 : float
        Share of the held-out block means that lie inside the predicted 90 % band.
    n_blocks, n_fields : int
        Number of blocks and number of fields that are compared.
    law_gain, law_gain_error, patch_gain, patch_gain_error : float
        Gain of the law over the constant and standard error of the gain (:class:`radcal.assessment.gain.Gain`): for
        predictions without, and with the effects of calibrated fields.
    block : ndarray of int, shape (n,)
        Numbers of the compared blocks.
    mean_db, predicted_db, law_db, sd_db : ndarray, shape (n,)
        Block means: measured, predicted by law and field effects, and predicted by the law alone; and standard
        deviation of the error of the prediction by law and field effects [dB].
    field : ndarray of int, shape (f,)
        Labels of the compared fields.
    field_law_gain, field_patch_gain : ndarray, shape (f,)
        Gain of the law in each field, without and with the effects of calibrated fields.
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
        """Gain of the law over the constant, both with the effects of calibrated fields."""
        return Gain(self.patch_gain, self.patch_gain_error, self.n_fields)

    @property
    def held_in_band(self) -> bool:
        """Whether the 90 % band is wide enough: False if so few block means inside have a probability below 1 %."""
        from scipy.stats import binom

        inside = round(self.coverage_90 * self.n_blocks)
        return bool(binom.cdf(inside, self.n_blocks, 0.9) >= _CHANCE)

    @classmethod
    def pooled(cls, parts: Sequence[HeldOut]) -> HeldOut | None:
        """Results for several held-out grounds, pooled with equal weight of all blocks; None without grounds."""
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
    """Mean gains over all fields, standard errors of these gains, and number of fields."""
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
    """Kolmogorov-Smirnov distance, and error of the 99 % quantile [dB], of predicted levels with speckle."""
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
    """Predict the block means and the density of held-out ground, and measure the errors of the predictions.

    Parameters
    ----------
    found : GroundLaw
        Law fitted to the calibrated ground.
    constant : Constant
        Constant fitted to the calibrated ground.
    ground : Ground
        Held-out ground; its fields have the labels that they have in the calibrated ground.
    start_db : ndarray, shape (pixels,), optional
        Expected dB value of each held-out pixel by the starting law [dB].

    Returns
    -------
    HeldOut or None
        Errors of the predictions; None if no block has 20 pixels.
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
        coverage_90=float(np.mean(np.abs(error) <= NORMAL_90 * blocks.sd_db)),
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
    """Root mean square error [dB] that a law leaves if it is fitted to the held-out block means themselves."""
    phi = np.radians(incidence_deg)
    fit = fit_law(lambda x, _: law(phi, x) - mean_db, bounds, 1.0, free_looks=False)
    return _rms(law(phi, fit.parameters) - mean_db)


@dataclass(frozen=True)
class CrossValidation:
    """Cross-validation of a law on the calibrated ground: each fifth of the blocks is predicted from the other blocks.

    Attributes
    ----------
    rmse_law_patch_db, rmse_constant_patch_db : float
        Root mean square errors of the block means predicted by law and by constant, both with the effects of fields
        [dB]; NaN if there are too few blocks, or too few pixels in the blocks.
    power : float
        Power of the comparison of law and constant (:func:`radcal.assessment.gain.power`).
    """

    rmse_law_patch_db: float
    rmse_constant_patch_db: float
    power: float = float("inf")

    @property
    def no_better(self) -> bool:
        """Whether the law predicts blocks no better than a constant; False if the comparison has too little power."""
        return self.power >= POWER and self.rmse_law_patch_db >= self.rmse_constant_patch_db

    def sentence(self, name: str) -> str:
        """Sentence that says that the law predicts blocks no better than a constant; empty if this is not shown."""
        if not self.no_better:
            return ""
        return (
            f"{name}: blocks of its own ground, each predicted from the others, are "
            f"{self.rmse_law_patch_db:.2f} dB off by law and field effects, {self.rmse_constant_patch_db:.2f} dB by a "
            "constant with field effects: they do not show the law's slope."
        )


def cross_validate(found: GroundLaw, constant: Constant, group: NDArray[np.int64]) -> CrossValidation:
    """Predict each fifth of the blocks of the calibrated ground from a law fitted to the other blocks.

    Parameters
    ----------
    found : GroundLaw
        Law fitted to all of the calibrated ground.
    constant : Constant
        Constant fitted to all of the calibrated ground.
    group : ndarray of int, shape (pixels,)
        Number of the group of blocks with which each pixel is left out; means are compared in the blocks of a group.

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
    # the errors of the better predictor bound those of the right one; with the effects of fields known, blocks share
    # no error
    own = np.full(mean.size, max(min(errors), _LEAST_DB) ** 2)
    return CrossValidation(*errors, power(block, law - level, np.zeros(mean.size), own))
