"""Write the keys of ``docs/configuration.md`` from ``config/schema.json``.

python docs/keys.py > docs/configuration.md
"""

import json
import re
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
HEAD = """# Keys of a case

A case is one YAML file with the keys that differ from the defaults. Brackets give the values of a key and its default,
in bold. A key without default is unset, or its default depends on other keys. A key without values takes text. `by
name:` stands for keys with names of your own, as `*` does in a heading. Numbers outside of their limits (`0..64`, or
`>0..64` without 0) are refused.

Editors with the YAML language server complete keys if the first line of the case names the schema:

    # yaml-language-server: $schema=schema.json
"""


def number(value: float) -> str:
    """Text of a limit."""
    return f"{value:,.0f}" if isinstance(value, float) and value == round(value) and abs(value) < 1e13 else f"{value:,}"


def limits(schema: dict[str, Any]) -> str:
    """Text of the range of a number; the value of an environment variable has none."""
    if not schema.keys() & {"minimum", "exclusiveMinimum"}:
        return "number"
    low = number(schema["minimum"]) if "minimum" in schema else f">{number(schema['exclusiveMinimum'])}"
    high = number(schema["maximum"]) if "maximum" in schema else f"<{number(schema['exclusiveMaximum'])}"
    return f"{low}..{high}"


def _of_names(schema: dict[str, Any]) -> dict[str, Any]:
    """Schema of the values of a mapping by names; empty for another schema."""
    found: dict[str, Any] = schema.get("additionalProperties") or {}
    return found


def values(schema: dict[str, Any], headings: dict[str, str]) -> str:
    """Text on the values that a key admits."""

    def each(parts: list[dict[str, Any]]) -> str:
        # a mapping to null stands for text in braces without quotes
        told = [part for part in parts if "null" not in (part.get("type"), _of_names(part).get("type"))]
        return " or ".join(dict.fromkeys(values(part, headings) for part in told))

    if parts := schema.get("anyOf", schema.get("oneOf")):
        return each(parts)
    if "enum" in schema:
        return ", ".join(f"`{value}`" for value in schema["enum"])
    if "const" in schema:
        return f"`{schema['const']}`"
    if "$ref" in schema:
        return f"keys of {headings[kind(schema)]}"
    match schema.get("type"):
        case "boolean":
            return "`true` or `false`" if "default" not in schema else ""
        case "integer" | "number":
            return limits(schema)
        case "array":
            items = schema.get("items", {})
            if isinstance(items, list):
                return f"[{', '.join(values(item, headings) for item in items)}]"
            return f"list: {values(items, headings)}"
        case "object":
            return f"by name: {values(_of_names(schema), headings)}"
    return "text"


def kind(schema: dict[str, Any]) -> str:
    """Name of the class of a section."""
    return str(schema["$ref"].rpartition("/")[2])


def headings_of(schema: Any, models: dict[str, Any], path: str, found: dict[str, str]) -> dict[str, str]:
    """Heading of every section by its class: the first place where the section stands in a case."""
    if isinstance(schema, list):
        for item in schema:
            headings_of(item, models, path, found)
    elif isinstance(schema, dict) and "$ref" in schema:
        if (name := kind(schema)) not in found:
            properties = models[name]["properties"]
            tag = [f"`{key}: {own['const']}`" for key, own in properties.items() if "const" in own]
            found[name] = " with ".join([f"`{path}`", *tag])
            for key, own in properties.items():
                headings_of(own, models, f"{path}.{key}", found)
    elif isinstance(schema, dict):
        for word in ("anyOf", "oneOf", "items"):
            headings_of(schema.get(word, []), models, path, found)
        headings_of(schema.get("additionalProperties", []), models, f"{path}.*", found)
    return found


def linked(text: str) -> str:
    """Text in which the path of another page is a link with that page's title."""

    def link(path: re.Match[str]) -> str:
        title = (ROOT / path[0]).read_text(encoding="utf-8").partition("\n")[0].removeprefix("# ")
        return f"[{title}]({path[1]})"

    return re.sub(r"docs/(\w+\.md)", link, text)


def keys(section: dict[str, Any], headings: dict[str, str], described: dict[str, str], heading: str = "") -> str:
    """List of the keys of a section, without the key whose only value the heading states.

    Lines that stand under an earlier heading, too (``described``), are one line that names it.
    """
    lines, shared = [], {}
    for key, schema in section["properties"].items():
        if "const" in schema:
            continue
        admitted = [text] if (text := values(schema, headings)) not in ("", "text") else []
        if key in section.get("required", ()):
            admitted.append("required")
        elif "default" in schema:
            admitted.append(f"**{json.dumps(schema['default'])}**")
        limited = f" ({'; '.join(admitted)})" if admitted else ""
        line = f"- `{key}`{limited}: {linked(schema['description'])}"
        if described.setdefault(line, heading) != heading:
            shared.setdefault(described[line], []).append(f"`{key}`")
        else:
            lines.append(line)
    lines += [f"- {', '.join(names)}: as in {earlier}" for earlier, names in shared.items()]
    return "\n".join(lines)


def main() -> None:
    """Print the page."""
    schema = json.loads((ROOT / "config/schema.json").read_text(encoding="utf-8"))
    models, headings = schema["$defs"], {}
    for key, section in schema["properties"].items():
        headings_of(section, models, key, headings)
    single = {key: own for key, own in schema["properties"].items() if "keys of" not in values(own, headings)}
    print(f"{HEAD}\n{keys({'properties': single}, headings, {})}")
    described: dict[str, str] = {}
    for name, heading in headings.items():
        print(f"\n## {heading}\n")
        if "." not in heading:  # the list above describes the others
            print(linked(models[name]["description"].partition("\n")[0].replace("``", "`")), end="\n\n")
        print(keys(models[name], headings, described, heading))


if __name__ == "__main__":
    main()
