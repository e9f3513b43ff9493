"""Tables: values of known sensors, classes of land-cover maps with the levels of their terrain, the demonstration case.

The tables are the YAML files of this package.
"""

from __future__ import annotations

import functools
from pathlib import Path
from typing import Any

__all__ = ["read_table"]


@functools.cache
def read_table(name: str) -> dict[str, Any]:
    """Content of the file ``<name>.yaml`` of this package."""
    import yaml

    return dict(yaml.safe_load(Path(__file__).with_name(f"{name}.yaml").read_text(encoding="utf-8")))
