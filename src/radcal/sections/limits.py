"""Types of the numbers in the configuration, with their allowed ranges; docs/configuration.md lists the ranges by key.

No real acquisition, scene or computer has a value outside the allowed range of a key. A value outside its range
therefore has a wrong unit or a wrong digit.
"""

from __future__ import annotations

from typing import Annotated

from pydantic import AfterValidator, BeforeValidator, Field, PlainSerializer
from pydantic_core import PydanticCustomError

ALL_PIXELS = 2**31 - 1  # number that stands for "all": more pixels than any material has
# longest run, and longest total wait between the attempts of a run; clusters grant no longer times
LONGEST_S = 30 * 86_400.0


def _not_bool(value: object) -> object:
    """Refuse YAML's yes, no, on, off, true and false as numbers, because Python would convert them to 1 and 0."""
    if isinstance(value, bool):
        raise PydanticCustomError("bool_as_number", "a number")
    return value


def _whole(value: float) -> float:
    """Number of looks, an integer if it is whole: records and messages show 4, as in earlier versions, not 4.0."""
    return int(value) if value == int(value) else value


Integer = Annotated[int, BeforeValidator(_not_bool)]
Real = Annotated[float, BeforeValidator(_not_bool)]
Seed = Annotated[Integer, Field(ge=0, le=2**63 - 1)]
Count = Annotated[Integer, Field(ge=1, le=1_000_000)]
Altitude = Annotated[Real, Field(ge=1, le=1e8)]  # geosynchronous orbits are at 3.6e7 m
Positive = Annotated[Real, Field(gt=0, le=1e9)]
Length = Annotated[Real, Field(ge=1e-3, le=1e6)]  # side of a cell or a pixel
# the serialiser has no type, because pydantic would write a whole number of type float as 4.0
Looks = Annotated[Real, Field(ge=1, le=64), AfterValidator(_whole), PlainSerializer(lambda value: value)]
Coordinate = Annotated[Real, Field(ge=-1e8, le=1e8)]  # the Earth's circumference is 4e7 m
Frequency = Annotated[Real, Field(ge=0.01, le=1000)]  # from HF to the highest radar bands
FalseAlarms = Annotated[Real, Field(ge=1e-9, le=0.1)]  # probability of a detector
Decibels = Annotated[Real, Field(ge=-200, le=200)]  # the same range as in images
# parameter of a law: its square and its cube are finite, and it fits into single precision
Parameter = Annotated[Real, Field(ge=-1e30, le=1e30)]
Timeout = Annotated[Real, Field(gt=0, le=LONGEST_S)]
RetryWait = Annotated[Real, Field(ge=0, le=86_400)]
