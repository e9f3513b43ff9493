"""Sections ``design``, ``surrogate``, ``optimiser`` and ``stop``: the search for the parameters X."""

from __future__ import annotations

import warnings
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from radcal.sections.base import CaseName, Section
from radcal.sections.limits import Count, Integer, Real


class Design(Section):
    """Runs made before any surrogate exists (design of experiments)."""

    sampler: Literal["monte_carlo", "latin_hypercube", "sobol"] = Field(
        "sobol", description="method that samples the parameters: monte_carlo, latin_hypercube or sobol"
    )
    size: Annotated[Integer, Field(ge=0, le=100_000)] | Literal["auto"] = Field(
        "auto",
        description="number of runs; auto: 2, or at least 8 if radcal cannot predict the runs (as with law: external); "
        "0: no design, which took the fewest runs in tests (docs/right_law.md); a larger design contains the runs of a "
        "smaller one",
    )
    chunk: Annotated[Integer, Field(ge=1, le=1000)] = Field(4, description="number of design runs in one workflow job")
    reuse: CaseName | None = Field(
        None, description="name of an earlier case with the same scene and simulator; its runs are reused"
    )


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


class Optimiser(Section):
    """Settings of NSGA-II on the surrogate, and of the least-squares fit that starts from NSGA-II's best point."""

    objective: Literal["theta", "rms"] = Field(
        "theta",
        description="what NSGA-II minimises: theta (sum of squared residuals) or, only with objective: density, rms "
        "(difference of the densities, which hardly changes far from its minimum)",
    )
    # Platypus sorts in pure Python: its time grows in proportion to evaluations times population. The least-squares
    # fit and the multi-start search compensate for a small population.
    population: Annotated[Integer, Field(ge=4, le=10_000)] = Field(
        40, description="number of solutions in a generation"
    )
    evaluations: Annotated[Integer, Field(ge=1, le=10_000_000)] = Field(
        1600, description="number of evaluations of the surrogate"
    )
    polish: bool = Field(True, description="whether a least-squares fit on the surrogate refines NSGA-II's best point")


class Stop(Section):
    """Criteria that end the calibration loop; after a change of the criteria, no finished run is repeated."""

    rms: Annotated[Real, Field(gt=0, le=100)] = Field(
        1.0e-5, description="tolerance of the rms difference between the densities [1/dB]; only for objective: density"
    )
    max_runs: Count = Field(200, description="largest total number of design and infill runs")
    stagnation_runs: Count = Field(
        20, description="number of infill runs without improvement after which the search ends"
    )
    law_db: Annotated[Real, Field(gt=0, le=200)] = Field(
        0.05,
        description="the search ends if the best law that the surrogate predicts differs by less than this number from "
        "the best law found [dB]; not for objective: density",
    )
    at_sampling_error: bool = Field(
        False,
        description="whether the search also ends after 5 runs without improvement at an rms below a third of the "
        "sampling error; by default true for simulator.kind: command if stop.rms is not set",
    )
