"""Errors of predictions for held-out ground, as the archive contains them."""

from __future__ import annotations

import json
from dataclasses import dataclass
from typing import Annotated

import numpy as np
from numpy.typing import NDArray

from radcal.config.validation import Validation
from radcal.storage.dataclass_groups import About

__all__ = ["HeldOutBlocks", "LeftOutFields", "refitted"]

Doubles = NDArray[np.float64]
Integers = NDArray[np.int64]


@dataclass(frozen=True)
class HeldOutBlocks:
    """Errors of the predictions for held-out blocks (:class:`radcal.assessment.validation.HeldOut`)."""

    rmse_law_db: Annotated[float, About("rms error of the law's prediction of the means of held-out blocks", "dB")]
    rmse_law_patch_db: Annotated[
        float,
        About("rms error of the prediction by the law with random effects of fields that hold calibrated ground", "dB"),
    ]
    rmse_constant_db: Annotated[
        float, About("rms error of the constant: generalised least squares mean of the calibrated ground", "dB")
    ]
    rmse_constant_patch_db: Annotated[
        float, About("rms error of the constant with random effects of fields that hold calibrated ground", "dB")
    ]
    rmse_best_db: Annotated[float, About("rms error of the law after a fit to the held-out means themselves", "dB")]
    rmse_start_db: Annotated[float, About("rms error of the starting law; NaN where it has no curve", "dB")]
    ks_law: Annotated[
        float, About("Kolmogorov-Smirnov distance of held-out pixels from the density predicted by the law")
    ]
    ks_constant: Annotated[
        float, About("Kolmogorov-Smirnov distance of held-out pixels from the density of the calibrated ground")
    ]
    ks_start: Annotated[
        float, About("Kolmogorov-Smirnov distance of held-out pixels from the density predicted by the starting law")
    ]
    tail_law_db: Annotated[float, About("predicted minus measured 99 % quantile: prediction by the law", "dB")]
    tail_constant_db: Annotated[
        float, About("predicted minus measured 99 % quantile: density of the calibrated ground as prediction", "dB")
    ]
    tail_start_db: Annotated[
        float, About("predicted minus measured 99 % quantile: prediction by the starting law", "dB")
    ]
    coverage_90: Annotated[float, About("share of block means inside of the 90 % prediction band")]
    n_blocks: Annotated[int, About("number of held-out blocks that are compared")]
    n_fields: Annotated[int, About("number of fields in the held-out blocks that are compared")]
    law_gain: Annotated[
        float, About("mean over fields of ln(rms error of the constant / rms error of the law), without effects")
    ]
    law_gain_error: Annotated[float, About("standard error of `law_gain`; infinite for one field")]
    patch_gain: Annotated[float, About("as `law_gain`, with random effects of fields in both law and constant")]
    patch_gain_error: Annotated[float, About("standard error of `patch_gain`; infinite for one field")]
    block: Annotated[Integers, About("numbers of the held-out blocks", shape="b")]
    mean_db: Annotated[Doubles, About("measured means of the held-out blocks", "dB", "b")]
    predicted_db: Annotated[Doubles, About("means predicted by law and random effects of fields", "dB", "b")]
    law_db: Annotated[Doubles, About("means predicted by the law alone", "dB", "b")]
    sd_db: Annotated[Doubles, About("standard deviation of the prediction error", "dB", "b")]
    field: Annotated[Integers, About("labels of the fields in the held-out blocks", shape="f")]
    field_law_gain: Annotated[Doubles, About("`law_gain` of each field", shape="f")]
    field_patch_gain: Annotated[Doubles, About("`patch_gain` of each field", shape="f")]


@dataclass(frozen=True)
class LeftOutFields:
    """Errors of predictions for fields that were left out (:class:`radcal.assessment.recommendation.FieldCheck`)."""

    rmse_law_db: Annotated[float, About("rms error of the law's prediction of cell means; NaN for one field", "dB")]
    rmse_constant_db: Annotated[
        float, About("rms error of the generalised least squares constant for cell means; NaN for one field", "dB")
    ]
    gain: Annotated[float, About("mean over fields of ln(rms error of the constant / rms error of the law)")]
    gain_error: Annotated[float, About("standard error of `gain`; infinite for one field")]
    n_fields: Annotated[int, About("number of fields compared")]
    power: Annotated[float, About("gain that a right law is expected to show, in standard errors of the gain")]


def refitted(config: str) -> bool:
    """Whether laws were fitted anew to predict ground that the calibration has seen (``validation.keep``).

    Parameters
    ----------
    config : str
        Configuration of a case as JSON.
    """
    validation = json.loads(config).get("validation")
    return validation is not None and not Validation.model_validate(validation).holds_out
