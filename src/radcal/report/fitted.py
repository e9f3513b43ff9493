"""Results of the fit test of calibrated laws, as the archive and ``summary.json`` contain them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

from radcal.assessment.verdict import all_fit, first_line
from radcal.storage.dataclass_groups import About, Attribute

__all__ = ["Fitted", "misfit", "overall"]


@dataclass(frozen=True)
class Fitted:
    """Result of the fit test of a calibrated law (:class:`radcal.assessment.fit_test.FitTest`), and its verdict."""

    verdict: Annotated[str, About("verdict on the law in a sentence")]
    residual_sum: Annotated[float, About("sum of squared residuals of all incidence-angle bins and passes")]
    expected: Annotated[float, About("degrees of freedom: mean of `residual_sum` for a right law")]
    p: Annotated[
        float,
        About("p-value by parametric replicates, from `residual_sum` and from the sum for the bins' means alone"),
    ]
    worst_deg: Annotated[float, About("mean incidence of the bin with the largest misfit", "deg")]
    worst_mean_db: Annotated[float, About("simulated minus measured mean of the bin with the largest misfit", "dB")]
    worst_spread: Annotated[
        float, About("ratio of simulated to measured standard deviation in the bin with the largest misfit")
    ]
    mean_db: Annotated[float, About("simulated minus measured mean of all target pixels", "dB")]
    sd_db: Annotated[float, About("standard deviation of the simulated target pixels", "dB")]
    measured_sd_db: Annotated[float, About("standard deviation of the measured target pixels", "dB")]
    looks_limit: Annotated[
        str, About("limit of the effective looks beyond which the pixels ask for them: upper, lower or empty")
    ]
    bounds: Annotated[tuple[str, ...], Attribute(), About("parameters at a bound beyond which the pixels ask for them")]
    distance: Annotated[float, About("ratio of the best run's density rms to `rms_sampling`")]
    missed_db: Annotated[
        float,
        About("largest error of the law by a wrong form that the test finds in fewer than nine of ten images", "dB"),
    ] = float("nan")
    fits: Annotated[bool | None, About("whether the law fits; absent if the fit cannot be tested")] = None
    level_only: Annotated[bool, About("material is seen at one incidence: only its level can be known")] = False


def misfit(fitted: Fitted) -> dict[str, Any]:
    """Numbers of the test, for ``summary.json``."""
    numbers = {key: value for key, value in vars(fitted).items() if key not in ("fits", "verdict", "level_only")}
    return {**numbers, "bounds": list(fitted.bounds)}


def overall(fitted: Mapping[str, Fitted], converged: bool, warnings: int = 0) -> dict[str, Any]:
    """Whether the laws of all materials fit, and the verdict on all of them, for ``summary.json``.

    The verdict counts the warnings on the measured image, because the test of the fit can miss what they tell of.
    """
    fits = {name: one.fits for name, one in fitted.items()}
    verdicts = {name: one.verdict for name, one in fitted.items()}
    told = f" {warnings} warning{'s' * (warnings > 1)} on the measured image." * bool(warnings)
    return {"fits": all_fit(list(fits.values())), "verdict": first_line(verdicts, fits, converged) + told}
