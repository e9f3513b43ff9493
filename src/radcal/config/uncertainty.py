"""Section ``uncertainty``: what else than speckle leaves a law uncertain, and how the posterior is sampled."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from radcal.config.limits import Integer, Real
from radcal.config.sections import Section

__all__ = ["Uncertainty"]

Share = Annotated[Real, Field(ge=0, le=1)]
Error = Annotated[Real, Field(ge=0, le=20)]


class Uncertainty(Section):
    """Budget of the uncertainty of a law, the half-width up to which it counts as known, and sampler settings."""

    known_db: Annotated[Real, Field(gt=0, le=20)] = Field(
        1.5, description="half-width of the 90 % band of sigma0 up to which a law is called known [dB]"
    )
    level_db: Error = Field(
        0.33,
        description="standard error of the absolute calibration of the measured image [dB]; default: a third of the "
        "1 dB (three sigma) specified for Sentinel-1",
    )
    noise_db: Error = Field(
        2.0,
        description="standard error of radar.nesz_db [dB], which counts for ground near the noise; default: stated "
        "floors are worst cases, some dB above those of images",
    )
    field_db: Error = Field(
        0.5,
        description="scale of the half-t priors of the standard deviations between and within fields [dB], which "
        "count where the pixels hardly show them, as in a single field",
    )
    point_spread: Share = Field(
        0.1, description="relative standard error of the resolutions of radar, which flattens or steepens a law"
    )
    incidence_error: Annotated[Real, Field(ge=0, le=3)] = Field(
        0.3, description="standard error of the logarithm of the standard error of the local incidence"
    )
    incidence_floor_deg: Annotated[Real, Field(ge=0, le=30)] = Field(
        0.2,
        description="part of the local incidence's standard error that target.incidence_error_deg leaves out, added "
        "in quadrature [deg]",
    )
    walkers: Annotated[Integer, Field(ge=32, le=1000)] = Field(128, description="number of walkers of the sampler")
    steps: Annotated[Integer, Field(ge=100, le=100_000)] = Field(
        4000, description="largest number of steps of each walker; without convergence, the law's linear covariance"
    )
