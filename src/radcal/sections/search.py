"""Sections ``design``, ``surrogate``, ``optimiser`` and ``stop``: the search for the parameters X."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from radcal.sections.base import CaseName, Section
from radcal.sections.limits import Count, Integer, Real


class Design(Section):
    """Runs made before any surrogate exists (design of experiments)."""

    sampler: Literal["monte_carlo", "latin_hypercube", "sobol"] = Field(
        "sobol", description="method that samples the parameters"
    )
    size: Annotated[Integer, Field(ge=0, le=100_000)] | Literal["auto"] = Field(
        "auto",
        description="number of runs; auto: 0, but 2 if a material starts with another law, and at least 8 without a "
        "baseline (as with law: external; docs/right_law.md); larger designs contain smaller ones",
    )
    chunk: Annotated[Integer, Field(ge=1, le=1000)] = Field(4, description="number of design runs in one workflow job")
    reuse: CaseName | None = Field(
        None, description="earlier case with the same scene and simulator, whose runs are reused"
    )


class SurrogateConfig(Section):
    """Kriging models that predict the statistics of a run."""

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
        description="whether law, speckle and noise predict each run, and kriging learns only the prediction's error",
    )


class Optimiser(Section):
    """Search on the surrogate: NSGA-II, then least squares from its best point."""

    objective: Literal["theta", "rms"] = Field(
        "theta",
        description="what NSGA-II minimises: theta (sum of squared residuals) or, only with objective: density, rms",
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


class Infill(Section):
    """Proposals of an iteration of the search."""

    batch: Annotated[Integer, Field(ge=1, le=64)] = Field(
        1,
        description="largest number of runs that an iteration proposes and makes in parallel; more need fewer "
        "iterations, but more runs in all",
    )


class Stop(Section):
    """Criteria that end the search; after a change, no finished run is repeated."""

    rms: Annotated[Real, Field(gt=0, le=100)] = Field(
        1.0e-5, description="tolerance of the rms difference between the densities [1/dB]; only for objective: density"
    )
    max_runs: Count = Field(200, description="largest total number of design and infill runs")
    max_hours: Annotated[Real, Field(gt=0, le=1_000_000)] | None = Field(
        None,
        description="largest total time of design and infill runs [h]; the search ends if a further run of mean "
        "duration would exceed it",
    )
    stagnation_runs: Count = Field(20, description="number of infill runs without improvement that ends the search")
    law_db: Annotated[Real, Field(gt=0, le=200)] = Field(
        0.05,
        description="the search ends if the surrogate's best law differs by less than this from the best law that was "
        "run [dB]; not for objective: density",
    )
    at_sampling_error: bool = Field(
        False,
        description="whether 5 runs without improvement end the search at an rms below a third of the sampling error; "
        "by default true for simulator.kind: command without stop.rms",
    )
