"""Sections of several kinds, of which other distributions may add kinds with keys of their own."""

from __future__ import annotations

import functools
import operator
from typing import Annotated, Any, Protocol

from pydantic import Field, TypeAdapter, ValidatorFunctionWrapHandler, WrapValidator

from radcal.plugins import Plugins
from radcal.sections.base import TAGS, Section

__all__ = ["HasSection", "with_foreign"]


class HasSection(Protocol):
    """Variant, such as a source of scenes, whose model of its section adds keys of its own."""

    section: type[Section]


def with_foreign(section: str, variants: Plugins[Any], *own: type[Section]) -> WrapValidator:
    """Validator of a section of several kinds that also takes the kinds of other distributions, by their models.

    Parameters
    ----------
    section : str
        Name of the section.
    variants : Plugins of HasSection
        Variants by the value of the key that chooses the kind.
    *own : type of Section
        Models of radcal's own kinds.
    """
    tag = TAGS[section]

    def validated(data: Any, handler: ValidatorFunctionWrapHandler) -> Any:
        kind = data.get(tag) if isinstance(data, dict) else getattr(data, tag, None)
        if not isinstance(kind, str) or kind in variants.builtin or not variants.foreign:
            return handler(data)
        kinds = (*own, *(variants[name].section for name in variants.foreign))
        union: Any = functools.reduce(operator.or_, kinds)
        return TypeAdapter[Any](Annotated[union, Field(discriminator=tag)]).validate_python(data)

    return WrapValidator(validated)
