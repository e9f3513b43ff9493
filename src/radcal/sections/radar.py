"""Sections ``radar`` and ``signals``: acquisition (pass) and image grid, and what raw signals need beside them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Mapping
from datetime import datetime
from typing import Annotated, Any, Literal, Self

from pydantic import (
    Discriminator,
    Field,
    ModelWrapValidatorHandler,
    SerializerFunctionWrapHandler,
    Tag,
    field_validator,
    model_serializer,
    model_validator,
)

from radcal.angles import depression_deg, incidence_deg
from radcal.bands import WIDTH_FACTOR, within_band
from radcal.sections.base import Section
from radcal.sections.errors import Wrong
from radcal.sections.limits import Altitude, Decibels, Frequency, Integer, Length, Looks, Positive, Real
from radcal.tables.sensors import SensorName, sensors

Radiometry = Literal["sigma0_ref", "sigma0_local", "beta0", "gamma0", "gamma0_rtc"]

# largest number of pixels per resolution cell, which determines the length of the sampled impulse response
_COARSEST = 1000.0


# keys that are left out of the description of a pass if they have their default, so that earlier runs stay valid
_LATER: Mapping[str, object] = {"sensor": None, "incidence_deg": None, "earth": "flat", "heading_deg": 0.0}
_Elevation = Annotated[Real, Field(gt=5, lt=85)]


_ORBITS_KM = (160.0, 2000.0)  # altitudes of low orbits
_STEEPEST = 85.0  # incidence [deg], as the limit of incidence_deg


class Radar(Section):
    """Acquisition (pass): track, sensor and image grid."""

    sensor: SensorName | None = Field(
        None, description="sensor and product that give the defaults of the other keys (docs/sensors.md)"
    )
    altitude_m: Altitude = Field(4000.0, description="height of the track above the scene's mean elevation [m]")
    depression_deg: _Elevation = Field(45.0, description="depression angle to the scene's centre [deg]")
    incidence_deg: _Elevation | None = Field(
        None, description="incidence on level ground at the scene's centre [deg]; for orbits, instead of depression_deg"
    )
    earth: Literal["flat", "curved"] = Field(
        "flat", description="shape of the earth between track and scene; curved if incidence_deg is given"
    )
    heading_deg: Annotated[Real, Field(ge=0, lt=360)] = Field(
        0.0, description="heading of the track at the scene, clockwise from north [deg]; 0 is grid north"
    )
    look_side: Literal["right", "left"] = Field(
        "right", description="side to which the radar looks: right (east of a northward track) or left"
    )
    band: str = Field("X", description="frequency band, such as X")
    frequency_ghz: Frequency | None = Field(
        None, description="carrier frequency [GHz]; required by laws that depend on frequency"
    )
    polarisation: Literal["HH", "HV", "VH", "VV"] = Field("HH", description="transmitted and received polarisation")
    range_resolution_m: Length = Field(2.0, description="-3 dB width of the response in slant range [m]")
    azimuth_resolution_m: Length = Field(3.5, description="-3 dB width of the response in azimuth [m]")
    range_spacing_m: Length = Field(1.5, description="pixel spacing in slant range [m]")
    azimuth_spacing_m: Length = Field(2.5, description="pixel spacing in azimuth [m]")
    looks: Looks = Field(
        4,
        description="(equivalent) number of independent looks averaged in power; for an external simulator, the number "
        "in its image",
    )
    nesz_db: Annotated[
        Annotated[Decibels, Tag("one level")]
        | Annotated[list[tuple[Annotated[Real, Field(ge=0, lt=90)], Decibels]], Field(min_length=2), Tag("a table")],
        Discriminator(lambda value: "a table" if isinstance(value, list) else "one level"),
    ] = Field(
        -27.0,
        description="noise-equivalent sigma0 [dB], or pairs of incidence on flat ground [deg] and noise [dB]; for an "
        "external simulator without noise, far below the image",
    )
    radiometry: Radiometry = Field(
        "sigma0_ref",
        description="quantity of a pixel: sigma0_ref (level ground), sigma0_local (no area term), beta0, gamma0, or "
        "gamma0_rtc (terrain-flattened)",
    )

    @model_validator(mode="wrap")
    @classmethod
    def _presets(cls, data: Any, handler: ModelWrapValidatorHandler[Self]) -> Self:
        """Pass with the sensor's values for missing keys, and with a curved earth if ``incidence_deg`` is given."""
        if not isinstance(data, dict):
            return handler(data)
        if data.get("incidence_deg") is not None and data.get("earth") is None:
            data = {**data, "earth": "curved"}
        name = data.get("sensor")
        sensor = sensors().get(name) if isinstance(name, str) else None
        if sensor is None:
            return handler(data)
        # lengths in slant range need the incidence, which the other keys give
        first = handler({**sensor.values_at(90.0), **data})
        angle = first.centre_incidence_deg
        return first if math.isnan(angle) else handler({**sensor.values_at(angle), **data})

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        given = {key: getattr(self, key) for key in self.model_fields_set}
        if self.sensor is not None and (missing := sensors()[self.sensor].missing(given)):
            *others, last = missing
            several = f"{', '.join(others)} and {last} are" if others else f"{last} is"
            raise ValueError(f"{several} missing, which sensor {self.sensor} does not give (docs/sensors.md)")
        self._check_angle()
        for way in ("range", "azimuth"):
            resolution, spacing = getattr(self, f"{way}_resolution_m"), getattr(self, f"{way}_spacing_m")
            if resolution > _COARSEST * spacing:
                raise ValueError(
                    f"{way}_resolution_m is {resolution:g}, expected at most {_COARSEST:g} times {way}_spacing_m "
                    f"({spacing:g})"
                )
        if self.frequency_ghz is not None and within_band(self.band, self.frequency_ghz * 1e9) is False:
            in_mhz = within_band(self.band, self.frequency_ghz * 1e6)
            raise Wrong(
                "frequency_ghz",
                f" is {self.frequency_ghz:g}, which is not in band {self.band!r}: correct one of them"
                + f" (in MHz? {self.frequency_ghz / 1000.0:g} GHz)" * bool(in_mhz),
            )
        return self

    def _check_angle(self) -> None:
        """Refuse two angles, an angle that the earth's shape contradicts, and an altitude in km."""
        if self.incidence_deg is not None:
            if "depression_deg" in self.model_fields_set:
                raise Wrong(
                    "depression_deg",
                    f" ({self.depression_deg:g}) and incidence_deg ({self.incidence_deg:g}) are both "
                    "given, expected one of them",
                )
            if self.earth == "flat":
                raise Wrong(
                    "incidence_deg",
                    f" is {self.incidence_deg:g} and earth is flat, expected earth: curved, or "
                    f"depression_deg: {90.0 - self.incidence_deg:g} instead of incidence_deg",
                )
            if _ORBITS_KM[0] <= self.altitude_m < _ORBITS_KM[1]:
                raise Wrong(
                    "altitude_m",
                    f" is {self.altitude_m:g} beside incidence_deg {self.incidence_deg:g}, expected metres: "
                    f"{1000.0 * self.altitude_m:g} if the track is {self.altitude_m:g} km high, or for an aircraft "
                    f"depression_deg: {90.0 - self.incidence_deg:g} instead of incidence_deg",
                )
        elif self.earth == "curved" and not self.centre_incidence_deg < _STEEPEST:
            raise Wrong(
                "depression_deg",
                f" is {self.depression_deg:g}, at which a track at altitude_m {self.altitude_m:g} sees "
                f"the curved earth at an incidence of {_STEEPEST:g} degrees or not at all, expected a larger one",
            )

    @model_serializer(mode="wrap")
    def _plain(self, handler: SerializerFunctionWrapHandler) -> dict[str, Any]:
        """Plain data without unused keys of later versions, and with only one of depression and incidence angle."""
        data: dict[str, Any] = handler(self)
        for key, default in _LATER.items():
            # with a sensor the heading is required, so that a heading of 0 in the case is not left out
            asked = self.sensor is not None and key in self.model_fields_set
            if getattr(self, key) == default and not asked:
                data.pop(key, None)
        if self.incidence_deg is not None:
            data.pop("depression_deg", None)
        return data

    def described(self) -> dict[str, Any]:
        """Plain data that identify the pass: without the sensor's name and without unused keys of later versions."""
        data = self.model_dump(mode="json", exclude={"sensor"})
        return {key: value for key, value in data.items() if key not in _LATER or value != _LATER[key]}

    @property
    def centre_incidence_deg(self) -> float:
        """Incidence on level ground at the scene's centre [deg]; a curved earth has its mean radius here."""
        if self.incidence_deg is not None:
            return self.incidence_deg
        if self.earth == "curved":
            return incidence_deg(self.depression_deg, self.altitude_m)
        return 90.0 - self.depression_deg

    @property
    def centre_depression_deg(self) -> float:
        """Depression angle towards the scene's centre [deg]; a curved earth has its mean radius here."""
        if self.incidence_deg is not None:
            return depression_deg(self.incidence_deg, self.altitude_m)
        return self.depression_deg

    @property
    def slant_per_ground(self) -> float:
        """Ratio of a change of slant range to the change of ground range, on level ground at the scene's centre."""
        if self.earth == "flat":
            return math.cos(math.radians(self.depression_deg))
        return math.sin(math.radians(self.centre_incidence_deg))

    def possible_resolution_m(self, way: str, wanted_m: float) -> float:
        """Resolution nearest to a wanted resolution that the pixel spacing allows [m], rounded to three digits.

        Parameters
        ----------
        way : str
            ``range`` or ``azimuth``.
        wanted_m : float
            Wanted resolution [m].
        """
        spacing = getattr(self, f"{way}_spacing_m")
        finest = WIDTH_FACTOR * spacing
        rounded = float(f"{min(max(wanted_m, finest), _COARSEST * spacing):.3g}")
        # rounded up if rounding to the nearest number would give a finer resolution than the spacing allows
        return rounded if rounded >= finest else float(f"{1.005 * finest:.3g}")

    @field_validator("nesz_db", mode="after")
    @classmethod
    def _table_ascends(cls, table: float | list[tuple[float, float]]) -> float | list[tuple[float, float]]:
        if not isinstance(table, float):
            angles = [angle for angle, _ in table]
            if any(second <= first for first, second in itertools.pairwise(angles)):
                raise ValueError(f"the incidence angles are {angles}, expected increasing angles")
        return table


class Signals(Section):
    """Radar of the raw signals (``radcal simulate --product iq``) and of images focused from them (``focused``)."""

    mode: Literal["stripmap", "spotlight"] = Field(
        "stripmap", description="stripmap: the beam keeps its direction; spotlight: it follows the scene's middle"
    )
    squint_deg: Annotated[Real, Field(ge=-60, le=60)] = Field(
        0.0, description="angle of beam axis and processed band ahead of zero Doppler [deg]"
    )
    focusing: Literal["backprojection", "omega_k"] = Field(
        "backprojection",
        description="method of product focused: backprojection, for any track, or omega_k, for straight ones, with the "
        "package finufft of radcal[signals]",
    )
    speed_mps: Annotated[Real, Field(ge=1, le=1e4)] = Field(100.0, description="speed of the platform [m/s]")
    prf_hz: Positive | None = Field(
        None,
        description="pulse rate [Hz]; by default 1.1 times the lowest at which no aliased echo falls into the image",
    )
    antenna_m: Length | None = Field(
        None,
        description="length of the antenna along the track [m]; by default its two-way gain is 8 dB down at the edges "
        "of the band that radar.azimuth_resolution_m and radar.looks need, in spotlight mode at the scene's "
        "corners",
    )
    gain_db: Annotated[Real, Field(ge=0, le=100)] = Field(30.0, description="gain of the antenna, one way [dB]")
    pulse_us: Positive = Field(10.0, description="length of the transmitted chirp [us]")
    power_w: Positive | None = Field(
        None,
        description="transmitted peak power [W]; by default that for a noise of radar.nesz_db in the scene's middle",
    )
    noise_figure_db: Annotated[Real, Field(ge=0, le=30)] = Field(
        4.0, description="noise figure of the receiver with its losses [dB]; used only with power_w"
    )
    bits: Annotated[Integer, Field(ge=2, le=16)] | None = Field(
        None, description="bits of the converter for each of I and Q; by default the signal is not quantised"
    )
    motion_m: Annotated[Real, Field(ge=0, le=100)] = Field(
        0.0, description="rms deviation of the track from a straight line, in ground range and in height [m]"
    )
    motion_length_m: Positive = Field(
        200.0, description="standard deviation of the Gaussian filter that smooths this deviation along the track [m]"
    )
    origin: tuple[Annotated[Real, Field(ge=-89, le=89)], Annotated[Real, Field(ge=-180, le=180)]] | None = Field(
        None,
        description="latitude and longitude of the scene's middle [deg], for product iq; by default from the map or "
        "the built-in scene",
    )
    start_utc: str | None = Field(
        None,
        description="time of the first pulse, as 2026-01-01T12:00:00Z, for product iq; invented for the built-in scene",
    )

    @field_validator("start_utc")
    @classmethod
    def _date_and_time(cls, value: str | None) -> str | None:
        if value is not None:
            try:
                datetime.strptime(value, "%Y-%m-%dT%H:%M:%SZ")
            except ValueError:
                raise ValueError(f"is {value!r}, expected date and time in UTC, as 2026-01-01T12:00:00Z") from None
        return value
