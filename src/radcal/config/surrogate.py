"""Section ``surrogate``: outputs and training of the kriging models that predict the statistics of a run."""

from __future__ import annotations

import warnings
from typing import Any, Literal

from pydantic import Field, model_validator

from radcal.config.sections import Section

__all__ = ["SurrogateConfig"]


class SurrogateConfig(Section):
    """Outputs and training of the kriging models that predict the statistics of a run."""

    outputs: Literal["centred", "direct"] = Field(
        "centred",
        description="outputs of the kriging: centred (mean, log sd, skewness) or direct (xi, omega, alpha; only for "
        "objective: density)",
    )
    training: Literal["posterior", "smt"] = Field(
        "posterior",
        description="estimate of the length scales: posterior (likelihood times a weak prior) or smt (defaults of the "
        "library smt; only for objective: density)",
    )
    baseline: bool = Field(
        True,
        description="whether law, speckle and noise predict each run; kriging then models only the prediction error",
    )

    @model_validator(mode="before")
    @classmethod
    def _earlier_keys(cls, data: Any) -> Any:
        """Data without the obsolete ``retrain_every`` and ``training: warm``, which only cause a warning."""
        if not isinstance(data, dict) or ("retrain_every" not in data and data.get("training") != "warm"):
            return data
        warnings.warn(
            "surrogate.training: warm and surrogate.retrain_every have no effect any more: length scales are found "
            "from all runs in every iteration (training: posterior)",
            FutureWarning,
            stacklevel=2,
        )
        kept = {key: value for key, value in data.items() if key != "retrain_every"}
        return {**kept, "training": "posterior"} if kept.get("training") == "warm" else kept
