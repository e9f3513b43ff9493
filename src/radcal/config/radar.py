"""Section ``radar``: acquisition (pass) and image grid."""

from __future__ import annotations

import itertools
from typing import Annotated, Literal, Self

from pydantic import Discriminator, Field, Tag, field_validator, model_validator

from radcal.config.limits import Altitude, Decibels, Frequency, Integer, Length, Real
from radcal.config.sections import Section
from radcal.radar.bands import within_band

__all__ = ["Radar", "Radiometry"]

Radiometry = Literal["sigma0_ref", "sigma0_local", "beta0", "gamma0", "gamma0_rtc"]

_COARSEST = (
    1000.0  # largest number of pixels per resolution cell, which determines the length of the sampled impulse response
)


class Radar(Section):
    """Acquisition (pass): track, sensor and image grid."""

    altitude_m: Altitude = Field(4000.0, description="height of the track above the scene's mean elevation [m]")
    depression_deg: Annotated[Real, Field(gt=5, lt=85)] = Field(
        45.0, description="depression angle towards the centre of the scene [deg]"
    )
    look_side: Literal["right", "left"] = Field(
        "right", description="side to which the radar looks: right (east) or left (west); the track heads north"
    )
    band: str = Field("X", description="name of the frequency band of the carrier, such as X")
    frequency_ghz: Frequency | None = Field(
        None, description="carrier frequency [GHz]; required by laws that depend on frequency"
    )
    polarisation: Literal["HH", "HV", "VH", "VV"] = Field("HH", description="transmitted and received polarisation")
    range_resolution_m: Length = Field(2.0, description="-3 dB width of the response in slant range [m]")
    azimuth_resolution_m: Length = Field(3.5, description="-3 dB width of the response in azimuth [m]")
    range_spacing_m: Length = Field(1.5, description="pixel spacing in slant range [m]")
    azimuth_spacing_m: Length = Field(2.5, description="pixel spacing in azimuth [m]")
    looks: Annotated[Integer, Field(ge=1, le=64)] = Field(
        4,
        description="number of independent looks averaged in power; for an external simulator, the number in its image",
    )
    nesz_db: Annotated[
        Annotated[Decibels, Tag("one level")]
        | Annotated[list[tuple[Annotated[Real, Field(ge=0, lt=90)], Decibels]], Field(min_length=2), Tag("a table")],
        Discriminator(lambda value: "a table" if isinstance(value, list) else "one level"),
    ] = Field(
        -27.0,
        description="noise-equivalent sigma0 [dB], or a table of [incidence on flat ground in degrees, dB]; for an "
        "external simulator without noise, set a level far below the image",
    )
    radiometry: Radiometry = Field(
        "sigma0_ref",
        description="quantity of a pixel: sigma0_ref (level ground), sigma0_local (no area term), beta0, gamma0, or "
        "gamma0_rtc (terrain-flattened)",
    )

    @field_validator("nesz_db", mode="after")
    @classmethod
    def _table_ascends(cls, table: float | list[tuple[float, float]]) -> float | list[tuple[float, float]]:
        if not isinstance(table, float):
            angles = [angle for angle, _ in table]
            if any(second <= first for first, second in itertools.pairwise(angles)):
                raise ValueError(f"the incidence angles are {angles}, expected increasing angles")
        return table

    @model_validator(mode="after")
    def _sampled(self) -> Self:
        for way in ("range", "azimuth"):
            resolution, spacing = getattr(self, f"{way}_resolution_m"), getattr(self, f"{way}_spacing_m")
            if resolution > _COARSEST * spacing:
                raise ValueError(
                    f"{way}_resolution_m is {resolution:g}, expected at most {_COARSEST:g} times {way}_spacing_m "
                    f"({spacing:g})"
                )
        return self

    @model_validator(mode="after")
    def _one_band(self) -> Self:
        if self.frequency_ghz is not None and within_band(self.band, self.frequency_ghz * 1e9) is False:
            raise ValueError(
                f"frequency_ghz is {self.frequency_ghz:g}, which is not in band {self.band!r}: correct one of them"
            )
        return self
