"""Variants of one kind by name, such as laws or readers: radcal's own, and those that other distributions add.

A distribution adds a variant by an entry point in one of the groups ``radcal.laws``, ``radcal.readers``,
``radcal.scenes``, ``radcal.simulators``, ``radcal.objectives`` and ``radcal.registrations``. The name of the entry
point is the name that a case file uses. radcal's own variants are not entry points, because the entry points of an
editable installation are those of the day on which it was installed.

The metadata of the installed distributions are read once in a process, and only for a name that radcal does not have
itself, or for the list of all names: most jobs of a case without foreign variants do not pay for them. A case file is
read only if no name belongs to two distributions.
"""

from __future__ import annotations

import functools
import operator
import pkgutil
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Annotated, Any, Protocol, TypeVar, cast

from pydantic import BaseModel, Field, TypeAdapter, ValidatorFunctionWrapHandler, WrapValidator

from radcal.errors import ConfigError

if TYPE_CHECKING:
    from importlib.metadata import EntryPoint

T = TypeVar("T")


@functools.cache
def _installed() -> Any:
    from importlib.metadata import entry_points

    return entry_points()


def _entry_points(group: str) -> tuple[EntryPoint, ...]:
    return tuple(_installed().select(group=group))


def _distribution(entry: EntryPoint) -> tuple[str, str]:
    """Name and version of the distribution of an entry point."""
    return (entry.dist.name, entry.dist.version) if entry.dist is not None else ("unknown", "unknown")


class Plugins(Mapping[str, T]):
    """Variants of one kind by name: first radcal's own in their order, then those of other distributions.

    Parameters
    ----------
    group : str
        Group of entry points, such as "radcal.laws".
    builtin : mapping
        radcal's own variants by name: each a variant, or the place "package.module:name" of one that is imported when
        it is first used.
    """

    def __init__(self, group: str, builtin: Mapping[str, T | str]) -> None:
        self.group = group
        self.builtin = builtin

    @property
    def foreign(self) -> dict[str, EntryPoint]:
        """Entry points of other distributions by name.

        Raises
        ------
        ConfigError
            Two distributions have a variant of the same name.
        """
        found: dict[str, EntryPoint] = {}
        for entry in _entry_points(self.group):
            if entry.name in self.builtin or entry.name in found:
                other = _distribution(found[entry.name])[0] if entry.name in found else "radcal"
                theirs = " ".join(_distribution(entry))
                raise ConfigError(f"{self.group}: {other} and {theirs} both have {entry.name!r}: uninstall the latter.")
            found[entry.name] = entry
        return found

    def __getitem__(self, name: str) -> T:
        """Variant of a name; a KeyError for an unknown name, a ConfigError if a foreign one cannot be used."""
        if name in self.builtin:
            own = self.builtin[name]
            return cast("T", pkgutil.resolve_name(own)) if isinstance(own, str) else own
        entry = self.foreign[name]
        called = f"{self.group}: {name!r} of {' '.join(_distribution(entry))}"
        try:
            found = entry.load()
        except Exception as error:  # whatever a foreign module raises when it is imported
            what = f"{type(error).__name__}: {error}"
            raise ConfigError(f"{called} cannot be imported from {entry.value}: {what}.") from error
        if lacking := sorted(getattr(found, "__abstractmethods__", ())):
            raise ConfigError(f"{called} lacks {', '.join(lacking)}, expected as its base class describes them.")
        return cast("T", found)

    def __contains__(self, name: object) -> bool:
        """Whether there is a variant of a name; a foreign one is not imported."""
        return name in self.builtin or name in self.foreign

    def __iter__(self) -> Iterator[str]:
        return iter((*self.builtin, *self.foreign))

    def __len__(self) -> int:
        return len(self.builtin) + len(self.foreign)

    def origin(self, name: str) -> dict[str, str]:
        """Distribution and version of a foreign variant, for the description of a run; empty for radcal's own."""
        if name in self.builtin:
            return {}
        return dict(zip(("distribution", "version"), _distribution(self.foreign[name]), strict=True))


class HasSection(Protocol):
    """Variant, such as a source of scenes, with the model of its section, which adds keys of its own."""

    section: type[BaseModel]


def with_foreign(tag: str, variants: Plugins[HasSection], *own: type[BaseModel]) -> WrapValidator:
    """Validator of a section of several kinds that also takes the kinds of other distributions, by their models.

    Parameters
    ----------
    tag : str
        Key that chooses the kind.
    variants : Plugins of HasSection
        Variants by the value of this key.
    *own : type of model
        Models of radcal's own kinds.
    """

    def validated(data: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        kind = data.get(tag) if isinstance(data, dict) else getattr(data, tag, None)
        if not isinstance(kind, str) or kind in variants.builtin or not variants.foreign:
            return handler(data)
        models: Any = functools.reduce(operator.or_, (*own, *(variants[name].section for name in variants.foreign)))
        return TypeAdapter[Any](Annotated[models, Field(discriminator=tag)]).validate_python(data)

    return WrapValidator(validated)
