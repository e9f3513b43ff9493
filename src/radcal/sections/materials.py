"""Section ``materials``: backscatter law of each material, with fixed or calibrated parameters."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Annotated, Self

from pydantic import Discriminator, Field, Tag, model_validator

from radcal.laws import DEFAULT_LAW, EXTERNAL, FORMULA, OF_PASS, Law, law_for, laws_known, refuse_infinite
from radcal.sections.base import Section
from radcal.sections.errors import Wrong, nearest
from radcal.sections.limits import Parameter, Real
from radcal.tables import read_table

_DEFINING = ("law", "angles_deg", "formula", "names", "conditions")  # keys of a law that are not its parameters
_LARGEST_WHOLE = 2.0**53
# largest parameter: 1000 dB is a power of 10^100, which exceeds single precision; the unit must be wrong
_LARGEST = 1000.0


def _is_none(value: object) -> bool:
    return value is None


Knots = Annotated[list[Annotated[Real, Field(ge=0, le=90)]], Field(min_length=2)]


Conditions = Annotated[dict[str, Parameter], Field(min_length=1)]
_CONDITIONS = "known quantities that the law needs, by name, such as {permittivity: 5.5} (docs/laws.md)"


def _law_of(written: OtherLaw | Material) -> Law:
    """Law of a material, with what the case file gives for it."""
    law = law_for(
        written.law,
        angles_deg=written.angles_deg,
        formula=written.formula,
        names=written.names,
        units=getattr(written, "units", None),
        **(written.conditions or {}),
    )
    if missing := [key for key in law.needs if key not in OF_PASS]:
        raise ValueError(f"conditions: {missing[0]} is missing, law {law.name!r} depends on it")
    return law


def _numbers(count: int) -> str:
    return f"{count} number{'s' * (count != 1)}"


def _takes(law: Law) -> str:
    """Part of an error message: number of parameters of a law, and their names if the case file gives these names."""
    # the case file gives the parameter names of this law: an error in the names may be the cause
    named = f" (names: {', '.join(law.names) or 'none'})" if law.name in (EXTERNAL, FORMULA) else ""
    return f"law {law.name!r} takes {len(law.names)}{named}"


def check_parameters(key: str, values: Sequence[float], law: Law) -> None:
    """Raise an error if the number of parameters is wrong or a value lies outside the limits of the law.

    Parameters
    ----------
    key : str
        Configuration key of the parameters, for the error message.
    values : sequence of float, shape (d,)
        Parameters, each in the unit that the law defines.
    law : Law
        Law that defines the names and limits of the parameters.

    Raises
    ------
    ValueError
        The law has another number of parameters, or a value lies outside the limits of the law.
    """
    if len(values) != len(law.names):
        raise Wrong(key, f" has {_numbers(len(values))}, {_takes(law)}")
    # only the external simulator knows which values of its parameters are too large
    largest = _LARGEST if law.has_curve else math.inf
    limits = law.limits or ((-largest, largest),) * len(law.names)
    for parameter, x, (low, high) in zip(law.names, values, limits, strict=True):
        if not low <= x <= high:
            raise Wrong(key, f": {parameter} of law {law.name!r} is {x:g}, expected {low:g} to {high:g}")


class OtherLaw(Section):
    """Law and parameters of a material in an image whose law may differ from that in section ``materials``.

    It is the law of the reference run (``start``), or the hidden law of a synthetic measurement.
    """

    law: str = Field(description="law of the material")
    angles_deg: Knots | None = Field(
        None, description="incidence angles of a tabulated law, each with one parameter [deg]"
    )
    formula: str | None = Field(None, description="formula of this law (law: formula)")
    names: list[str] | None = Field(None, description="names of the parameters (law: formula)")
    conditions: Conditions | None = Field(None, description=_CONDITIONS, exclude_if=_is_none)
    parameters: list[Parameter] = Field(description="parameters of this law")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.law == EXTERNAL:
            raise Wrong(
                "law",
                f" is {EXTERNAL!r}, which only an external simulator can evaluate, expected one of "
                f"{', '.join(laws_known(external=False))}",
            )
        law = self.unbound_law
        check_parameters("parameters", self.parameters, law)
        refuse_infinite(law, at=self.parameters)
        return self

    @property
    def unbound_law(self) -> Law:
        """Law with the names of its parameters, without the frequency and polarisation of a pass."""
        return _law_of(self)


class Material(Section):
    """Surface material: a backscatter law with either fixed parameters or bounds for calibrated parameters."""

    calibrate: bool = Field(False, description="whether radcal calibrates the law parameters of this material")
    law: str = Field(DEFAULT_LAW, description="backscatter law (docs/laws.md)")
    angles_deg: Knots | None = Field(
        None, description="incidence angles of a tabulated law, each with one parameter [deg]"
    )
    formula: str | None = Field(
        None, description="formula of sigma0 [dB] with phi [rad] and the parameters (law: formula; docs/laws.md)"
    )
    names: list[str] | None = Field(None, description="names of the parameters (law: external or formula)")
    units: list[str] | None = Field(None, description="units of the parameters (law: external or formula)")
    conditions: Conditions | None = Field(None, description=_CONDITIONS, exclude_if=_is_none)
    integer: (
        Annotated[
            Annotated[list[str], Tag("a list")] | Annotated[bool, Tag("yes or no")],
            Discriminator(lambda value: "a list" if isinstance(value, list) else "yes or no"),
        ]
        | None
    ) = Field(None, description="names of the integer parameters, or true for all (law: external)")
    parameters: list[Parameter] | None = Field(None, description="fixed parameters (calibrate: false)")
    looks: Annotated[Real, Field(ge=0.01, le=1000)] | None = Field(
        None,
        description="effective looks of a material with calibrate: false; by default radar.looks; fewer looks simulate "
        "texture",
    )
    colour: Annotated[str, Field(pattern="^#[0-9A-Fa-f]{6}$")] | None = Field(
        None,
        exclude=True,  # the colours are kept in a section of their own, because runs do not depend on them
        description="colour in figures, such as #0072B2; the default depends on the name (docs/landcover.md)",
    )
    bounds: list[tuple[Parameter, Parameter]] | None = Field(
        None, description="[lower, upper] bound of each parameter that is calibrated"
    )
    start: (
        Annotated[
            Annotated[list[Parameter], Tag("a list")] | Annotated[OtherLaw, Tag("a law")],
            Discriminator(lambda value: "a law" if isinstance(value, dict | OtherLaw) else "a list"),
        ]
        | None
    ) = Field(
        None,
        description="parameters in the reference run, or its law as {law, parameters}; by default the middle of the "
            "bounds",
    )  # fmt: skip

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        law = self.unbound_law
        d = len(law.names)
        if not self.calibrate:
            if self.parameters is None and d > 0:
                raise ValueError(
                    f"a material that is not calibrated needs parameters: {_numbers(d)} ({', '.join(law.names)})"
                )
            check_parameters("parameters", self.parameters or [], law)
            self._check_integers()
            self.check_whole("parameters", self.parameters or [])
            refuse_infinite(law, at=self.parameters or [])
            return self
        if self.parameters is not None:
            raise ValueError("a calibrated material takes start and bounds, not parameters")
        if self.looks is not None:
            raise Wrong(
                "looks",
                f" is {self.looks:g} and calibrate is true, expected looks only with calibrate: false: those of a "
                "calibrated material are estimated",
            )
        if self.law == EXTERNAL and (d == 0 or self.bounds is None):
            raise ValueError("a calibrated material of law external needs names and bounds of its parameters")
        if self.bounds is None and law.bounds is None:
            raise Wrong(
                "bounds",
                f" is missing, law {self.law!r} has no default: expected [lower, upper] for each of "
                f"{', '.join(law.names)}",
            )
        if wrong := list(self._of_bounds(law)):
            raise ValueError(*wrong)
        self._check_integers()
        for values in zip(*self.box, strict=True):
            check_parameters("bounds", values, law)
            self.check_whole("bounds", values)
        refuse_infinite(law, box=self.box)
        if self.starts_with_another_law:
            return self
        if len(self.start_parameters) != d:
            raise Wrong("start", f" has {_numbers(len(self.start_parameters))}, {_takes(law)}")
        for name, x, (low, high) in zip(law.names, self.start_parameters, self.box, strict=True):
            if not low <= x <= high:
                raise Wrong("start", f" of {name} is {x:g}, expected inside its bounds [{low:g}, {high:g}]")
        self.check_whole("start", self.start_parameters)
        return self

    def _of_bounds(self, law: Law) -> Iterator[Wrong]:
        """Sentences on all bounds that are wrong."""
        if len(self.box) != len(law.names):
            yield Wrong("bounds", f" has {len(self.box)} interval{'s' * (len(self.box) != 1)}, {_takes(law)}")
        for name, (low, high) in zip(law.names, self.box, strict=False):
            if not low < high:
                yield Wrong("bounds", f" of {name} are [{low:g}, {high:g}], expected lower < upper")
            elif law.has_curve and max(abs(low), abs(high)) > _LARGEST:
                yield Wrong("bounds", f" of {name} are [{low:g}, {high:g}], expected within +-{_LARGEST:g}")

    def _check_integers(self) -> None:
        """Refuse the key ``integer`` for a law that is not external, and unknown parameter names in this key."""
        if self.integer and self.law != EXTERNAL:
            raise Wrong("integer", f" is for parameters of law: {EXTERNAL}, law is {self.law!r}")
        for name in self.integer if isinstance(self.integer, list) else ():
            if name not in self.parameter_names:
                raise Wrong("integer", f": no parameter {name!r}{nearest(name, self.parameter_names)}")

    def check_whole(self, key: str, values: Sequence[float]) -> None:
        """Raise an error if the value of an integer parameter is not a whole number.

        Parameters
        ----------
        key : str
            Configuration key of the parameters, for the error message.
        values : sequence of float, shape (d,)
            Value of each parameter.

        Raises
        ------
        ValueError
            The value of an integer parameter is not whole, or its size exceeds 2^53, above which doubles cannot
            represent every whole number.
        """
        for name, whole, x in zip(self.parameter_names, self.integers, values, strict=True):
            if whole and (x != round(x) or abs(x) > _LARGEST_WHOLE):
                raise Wrong(key, f": {name} is {x:g}, expected a whole number within +-2^53: the parameter is integer")

    @property
    def integers(self) -> tuple[bool, ...]:
        """Flags, one for each parameter: whether the parameter is an integer."""
        listed = self.integer if isinstance(self.integer, list) else self.parameter_names if self.integer else ()
        return tuple(name in listed for name in self.parameter_names)

    def handed(self, values: Sequence[float]) -> dict[str, float | int]:
        """Parameters by name, as passed to an external program: integer parameters have no decimal point.

        Parameters
        ----------
        values : sequence of float, shape (d,)
            Law parameters X.

        Raises
        ------
        ValueError
            The value of an integer parameter is not whole.
        """
        self.check_whole("X", values)
        named = zip(self.parameter_names, self.integers, values, strict=True)
        return {name: int(x) if whole else float(x) for name, whole, x in named}

    @property
    def unbound_law(self) -> Law:
        """Law with the names and units of its parameters, without the frequency and polarisation of a pass."""
        return _law_of(self)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Name of each parameter."""
        return self.unbound_law.names

    @property
    def parameter_units(self) -> tuple[str, ...]:
        """Unit of each parameter; an empty text for a parameter without unit."""
        return self.unbound_law.units

    @property
    def box(self) -> list[tuple[float, float]]:
        """Lower and upper bound of each parameter; the default bounds of the law if no bounds are configured."""
        return list(self.bounds if self.bounds is not None else self.unbound_law.bounds or ())

    @property
    def start_parameters(self) -> list[float]:
        """Parameters in the reference run, of the law that ``start`` names, or else of the calibrated law."""
        if not self.calibrate:
            return list(self.parameters or [])
        if isinstance(self.start, OtherLaw):
            return list(self.start.parameters)
        if self.start is not None:
            return list(self.start)
        middle = [0.5 * (low + high) for low, high in self.box]
        return [float(math.ceil(x)) if whole else x for x, whole in zip(middle, self.integers, strict=True)]

    @property
    def starts_with_another_law(self) -> bool:
        """Whether the law in the reference run differs from the calibrated law."""
        return (
            self.calibrate
            and isinstance(self.start, OtherLaw)
            and any(getattr(self.start, key) != getattr(self, key) for key in _DEFINING)
        )

    @property
    def at_start(self) -> Material:
        """Material as simulated in the reference run: with the law that ``start`` names, or else with its own law."""
        if not (self.starts_with_another_law and isinstance(self.start, OtherLaw)):
            return self
        return self.with_law(self.start)

    def with_law(self, other: OtherLaw) -> Material:
        """Material with another law, which starts at the parameters of that law."""
        # not validated again, because bounds, units and whole parameters belong to the calibrated law
        law = {key: getattr(other, key) for key in _DEFINING}
        nothing = dict.fromkeys(("bounds", "units", "integer"))
        return self.model_copy(update={**law, **nothing, "start": list(other.parameters)})


def default_materials() -> dict[str, Material]:
    """Materials of the default case.

    Returns
    -------
    dict
        Materials by name; the material ``dyke`` is calibrated, and six further materials have fixed parameters.
    """
    return {name: Material.model_validate(value) for name, value in read_table("demonstration")["materials"].items()}
