"""Sections ``ppi``, ``gmti``, ``products``: radar on a mast, channels for moving targets, what the workflow makes."""

from __future__ import annotations

import itertools
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from radcal.sections.base import Section
from radcal.sections.errors import Wrong
from radcal.sections.limits import Altitude, Coordinate, FalseAlarms, Integer, Length, Positive, Real

_HALF_LIGHT_M_S = 0.5 * 299_792_458.0  # distance of a target by the time of its echo
_LEAST_PULSES = 4  # in a beam width: fewer do not sample the two-way pattern

_Angle = Annotated[Real, Field(ge=0.05, le=90)]
_LandRow = tuple[Annotated[Real, Field(ge=0, le=90)], Annotated[Real, Field(ge=-100, le=30)], Positive]
_Land = dict[str, Literal["rural"] | Annotated[list[_LandRow], Field(min_length=1)]]


class Ppi(Section):
    """Surveillance radar with a rotating antenna on a mast; its band and polarisation are those of ``radar``."""

    site_m: tuple[Coordinate, Coordinate] | None = Field(
        None,
        description="place of the mast, east and north in the scene's CRS, or without CRS from its south-west corner "
        "[m]; by default the middle",
    )
    mast_m: Altitude = Field(30.0, description="height of the antenna above the ground [m]")
    power_w: Positive = Field(25_000.0, description="transmitted peak power [W]")
    pulse_us: Positive = Field(0.1, description="length of the transmitted pulse, before compression [us]")
    gain_db: Annotated[Real, Field(ge=0, le=80)] = Field(31.0, description="gain of the antenna [dB]")
    azimuth_beam_deg: _Angle = Field(1.2, description="one-way -3 dB width of the antenna's beam in azimuth [deg]")
    elevation_beam_deg: _Angle = Field(20.0, description="one-way -3 dB width of the beam in elevation [deg]")
    tilt_deg: Annotated[Real, Field(ge=-45, le=45)] = Field(
        -2.0, description="elevation of the beam's axis; negative below the horizontal [deg]"
    )
    losses_db: Annotated[Real, Field(ge=0, le=50)] = Field(3.0, description="losses, both ways together [dB]")
    noise_figure_db: Annotated[Real, Field(ge=0, le=50)] = Field(5.0, description="noise figure of the receiver [dB]")
    prf_hz: Positive = Field(2000.0, description="pulse repetition frequency [Hz]")
    rotation_rpm: Annotated[Real, Field(ge=0.01, le=1000)] = Field(24.0, description="turns of the antenna in a minute")
    pulses: Annotated[Integer, Field(ge=1, le=1000)] = Field(
        10, description="number of pulses whose powers are averaged to one ray of the image"
    )
    gate_m: Length = Field(15.0, description="length of a range gate, and range resolution [m]")
    range_m: Length = Field(1500.0, description="largest slant range [m]")
    stc_m: Annotated[Real, Field(ge=0, le=1e6)] = Field(
        0.0,
        description="range below which sensitivity time control multiplies echoes by the fourth power of range / stc_m "
        "[m]; 0 for none",
    )
    land: _Land = Field(
        {},
        description="land clutter by material, which replaces law and speckle: rural, or rows of lowest depression "
        "[deg], mean sigma0 [dB] and Weibull spread, by falling depression",
    )
    false_alarms: FalseAlarms = Field(
        1e-3, description="probability of a false alarm of the detector in uniform clutter"
    )
    training_gates: Annotated[Integer, Field(ge=2, le=1000)] = Field(
        24, description="number of gates, half on either side of the tested gate, whose mean power scales the threshold"
    )
    guard_gates: Annotated[Integer, Field(ge=0, le=100)] = Field(
        2, description="number of gates between the tested gate and the training gates, on either side"
    )

    @property
    def turn(self) -> int:
        """Number of pulses in a turn of the antenna."""
        return round(60.0 * self.prf_hz / self.rotation_rpm)

    @property
    def gates(self) -> int:
        """Number of range gates."""
        return int(self.range_m / self.gate_m)

    @model_validator(mode="after")
    def _sampled(self) -> Self:
        if self.range_m > (farthest := _HALF_LIGHT_M_S / self.prf_hz):
            raise Wrong("range_m", f" is {self.range_m:g}, expected at most {farthest:.0f}, unambiguous at prf_hz")
        if self.turn * self.azimuth_beam_deg < _LEAST_PULSES * 360.0:
            least = _LEAST_PULSES * 6.0 * self.rotation_rpm / self.azimuth_beam_deg
            raise Wrong(
                "prf_hz", f" is {self.prf_hz:g}, expected at least {least:.0f}: {_LEAST_PULSES} pulses in a beam"
            )
        if self.pulses > self.turn:
            raise Wrong("pulses", f" is {self.pulses}, expected at most {self.turn}, the pulses of a turn")
        if self.gates < (least := self.training_gates + 2 * self.guard_gates + 1):
            needed = least * self.gate_m
            raise Wrong("range_m", f" is {self.range_m:g}, expected at least {needed:g}: the detector's training gates")
        return self

    @field_validator("land")
    @classmethod
    def _falling(cls, land: _Land) -> _Land:
        for name, rows in land.items():
            if not isinstance(rows, str) and any(second[0] >= first[0] for first, second in itertools.pairwise(rows)):
                raise Wrong(name, f" has the depressions {[row[0] for row in rows]}, expected falling ones")
        return land


class Gmti(Section):
    """Channels by which the radar of ``signals`` detects moving targets, and the detector."""

    channels: Annotated[Integer, Field(ge=2, le=16)] = Field(
        3, description="number of receivers in line along the track"
    )
    spacing_m: Length | None = Field(
        None, description="distance between the receivers [m]; by default the length of the antenna, signals.antenna_m"
    )
    pulses: Annotated[Integer, Field(ge=2, le=128)] = Field(
        16, description="number of pulses of a coherent processing interval"
    )
    prf_hz: Positive = Field(2000.0, description="pulse repetition frequency [Hz]")
    false_alarms: FalseAlarms = Field(
        1e-6, description="probability of a false alarm in one test, that of one gate, direction and velocity"
    )
    scans: Annotated[Integer, Field(ge=1, le=1000)] = Field(1, description="number of scans of the scene")
    revisit_s: Positive = Field(2.0, description="time from scan to scan [s]")
    training_gates: Annotated[Integer, Field(ge=4, le=10_000)] | None = Field(
        None,
        description="number of gates from which the clutter's covariance is estimated; by default twice channels times "
        "pulses",
    )

    @property
    def training(self) -> int:
        """Number of training gates."""
        return self.training_gates or 2 * self.channels * self.pulses

    @model_validator(mode="after")
    def _enough(self) -> Self:
        if self.training < 2 * (size := self.channels * self.pulses):
            raise Wrong("training_gates", f" is {self.training}, expected at least {2 * size}: 2 x channels x pulses")
        return self


class Products(Section):
    """What ``radcal run CASE products`` simulates with the calibrated laws (docs/predictions.md)."""

    make: Annotated[
        list[Literal["intensity", "complex", "gmti", "iq", "focused", "ppi"]], Field(min_length=1, max_length=6)
    ] = Field(["intensity"], description="products, named as in radcal simulate --product")
    draws: Annotated[Integer, Field(ge=0, le=400)] = Field(
        0, description="number of laws drawn from the posterior that are simulated, too"
    )
