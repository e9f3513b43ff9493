"""Writer of the default case as YAML with comments."""

from __future__ import annotations

import math

import yaml
from pydantic import BaseModel

from radcal.config.case import Case

_HEADER = """\
# yaml-language-server: $schema=schema.json
# The default case. Every key below is a default: a case of your own needs only the keys that differ. The mismatches in
# measurement.synthetic (offset_db, relief_m, resolution_factor, parameters of fixed materials) are defaults only of a
# case of the built-in simulator without the sections scene, materials and measurement.
# Written by: python -m radcal.config > config/config.yaml
"""


def default_yaml() -> str:
    """Text of ``config/config.yaml``: the default case as YAML with comments."""
    return _HEADER + "\n" + "\n".join(_lines(Case())) + "\n"


def _lines(section: BaseModel, indent: str = "") -> list[str]:
    """Lines of YAML for a section: one line per key, with the key's description; nested sections are indented."""
    lines = []
    for name, field in type(section).model_fields.items():
        value = getattr(section, name)
        if field.alias is not None:  # of the only pass
            name, value = field.alias, value[0]
        if value is None:
            continue
        nested = value if isinstance(value, dict) else {}
        if isinstance(value, BaseModel):
            lines += [f"{indent}{name}:", *_lines(value, indent + "  ")]
        elif any(isinstance(item, BaseModel) for item in nested.values()):
            lines.append(f"{indent}{name}:")
            for key, item in nested.items():
                lines += [f"{indent}  {key}:", *_lines(item, indent + "    ")]
        else:
            comment = f"  # {field.description}" if field.description else ""
            lines.append(f"{indent}{name}: {inline(value)}{comment}")
    return lines


class _Dumper(yaml.SafeDumper):
    """PyYAML's safe dumper, which writes whole numbers without a decimal point."""


def _number(dumper: _Dumper, x: float) -> yaml.Node:
    return dumper.represent_int(int(x)) if x.is_integer() else dumper.represent_float(x)


_Dumper.add_representer(float, _number)


def inline(value: object) -> str:
    """YAML of plain data on one line."""
    text = yaml.dump(
        value, Dumper=_Dumper, default_flow_style=True, sort_keys=False, allow_unicode=True, width=math.inf
    )
    return text.removesuffix("\n").removesuffix("\n...")
