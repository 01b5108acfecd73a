"""The configuration reference, docs/config-reference.md, from the configuration's JSON schema.

`companion config reference > docs/config-reference.md` writes it anew.
"""

import json
from collections.abc import Collection, Iterable, Iterator

from companion.config.schema import JsonSchema, json_schema

HEAD = """\
# Configuration reference

Every key of the configuration file, with its default. [config.md](config.md) has examples.
`companion config reference` prints this page from the program's own definitions.
"""
COLUMNS = ("key", "type, unit", "default", "allowed", "meaning")
UNITS = {
    "_m_s": "m/s",
    "_deg_s": "°/s",
    "_percent": "%",
    "_deg": "°",
    "_m": "m",
    "_s": "s",
    "_v": "V",
    "baud": "Bd",
}
"""Unit of a key by how its name ends; the first that fits."""


def markdown() -> str:
    """The whole page."""
    schema = json_schema()
    return "\n".join([HEAD, *_sections(schema)])


def _sections(schema: JsonSchema) -> Iterator[str]:
    for name, section in schema["properties"].items():
        group = _resolved(schema, section)
        yield _section(f"## `[{name}]`", group["description"], schema, group)
        for key, field in group["properties"].items():
            if entries := field.get("additionalProperties"):
                yield from _by_beam(schema, f"### `[{name}.{key}]`", entries)
            if "$ref" in (items := field.get("items", {})):
                entry = _resolved(schema, items)
                heading = f"### `[[{name}.{key}]]`"
                yield _section(heading, entry["description"], schema, entry)


def _by_beam(schema: JsonSchema, heading: str, entries: JsonSchema) -> Iterator[str]:
    """The sections of a table with one entry for each beam."""
    beams = ", ".join(f"`{beam}`" for beam in schema["$defs"]["Beam"]["enum"])
    text = f"One entry for each beam: {beams}."
    if "oneOf" not in entries:
        yield _section(heading, text, schema, _resolved(schema, entries))
        return
    kinds = [_resolved(schema, entry) for entry in entries["oneOf"]]
    common = set.intersection(*(set(kind["properties"]) for kind in kinds)) - {"kind"}
    text = f"{text} `kind` names the sensor. Keys of every kind:"
    yield _section(heading, text, schema, _only(kinds[0], common))
    for kind in kinds:
        named = kind["properties"]["kind"]
        names = " or ".join(f'`"{name}"`' for name in named.get("enum", [named.get("const")]))
        own = _only(kind, set(kind["properties"]) - common - {"kind"})
        yield _section(f"#### `kind` = {names}", kind["description"], schema, own)


def _only(group: JsonSchema, keys: Collection[str]) -> JsonSchema:
    """A group with some of its keys, in its own order."""
    return {**group, "properties": {k: v for k, v in group["properties"].items() if k in keys}}


def _section(heading: str, text: str, schema: JsonSchema, group: JsonSchema) -> str:
    required = group.get("required", ())
    rows = [
        _row(key, _resolved(schema, field), is_required=key in required)
        for key, field in group["properties"].items()
    ]
    head = [_line(COLUMNS), _line(["---"] * len(COLUMNS))]
    return "\n".join([heading, "", text, "", *head, *rows, ""])


def _row(key: str, field: JsonSchema, *, is_required: bool) -> str:
    ways = [way for way in field.get("anyOf", [field]) if way.get("type") != "null"]
    is_address = key.endswith("address")
    types = " or ".join("table" if way["type"] == "object" else way["type"] for way in ways)
    unit = next((f", {unit}" for end, unit in UNITS.items() if key.endswith(end)), "")
    return _line(
        [
            f"`{key}`",
            types + unit,
            "required" if is_required else _default(field, is_address=is_address),
            ", ".join(filter(None, (_allowed(way, is_address=is_address) for way in ways))),
            field.get("description", ""),
        ]
    )


def _default(field: JsonSchema, *, is_address: bool) -> str:
    value = field.get("default")
    return "" if value is None else f"`{_written(value, is_address=is_address)}`"


def _allowed(way: JsonSchema, *, is_address: bool) -> str:
    if "enum" in way:
        return ", ".join(f"`{_written(value)}`" for value in way["enum"])
    bounds = []
    if "exclusiveMinimum" in way:
        bounds.append(f"above {way['exclusiveMinimum']:g}")
    if "minimum" in way:
        bounds.append(_written(way["minimum"], is_address=is_address))
    if "maximum" in way:
        bounds.append(_written(way["maximum"], is_address=is_address))
    return " to ".join(bounds)


def _written(value: object, *, is_address: bool = False) -> str:
    """As in a TOML file."""
    return f"0x{value:02X}" if is_address else json.dumps(value, ensure_ascii=False)


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def _resolved(schema: JsonSchema, part: JsonSchema) -> JsonSchema:
    """The definition that `part` refers to, with the part's own entries above it."""
    if "$ref" not in part:
        return part
    return {**schema["$defs"][part["$ref"].rpartition("/")[2]], **part}
