"""Plain data as TOML, which Python reads and does not write."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from typing import Any

__all__ = ["toml_text"]


def toml_text(data: Mapping[str, Any]) -> str:
    """Plain data as TOML 1.0: tables of text, numbers, truth values and lists of them.

    Parameters
    ----------
    data : mapping
        Values that are mappings become tables.

    Returns
    -------
    str
        None is left out, which TOML cannot write.

    References
    ----------
    https://toml.io/en/v1.0.0: basic strings take JSON's escapes.
    """

    def value(item: Any) -> str:
        if isinstance(item, list | tuple):
            return f"[{', '.join(map(value, item))}]"
        return json.dumps(item, ensure_ascii=False, allow_nan=False).replace("\x7f", "\\u007f")

    def table(items: Mapping[str, Any], path: tuple[str, ...]) -> Iterator[str]:
        for key, item in items.items():
            if item is not None and not isinstance(item, Mapping):
                yield f"{value(key)} = {value(item)}"
        for key, item in items.items():
            if isinstance(item, Mapping):
                inner = (*path, value(key))
                yield f"\n[{'.'.join(inner)}]"
                yield from table(item, inner)

    return "\n".join(table(data, ())) + "\n"
