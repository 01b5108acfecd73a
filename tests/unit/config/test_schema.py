"""JSON schema and reference, generated from the configuration's fields."""

import json
import re
import tomllib
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from companion.commands.cli import commands
from companion.config.reference import markdown
from companion.config.schema import json_schema
from companion.config.settings import Config, to_toml

PROJECT = Path(__file__).parents[3]
DOCS = PROJECT / "docs"
CHECKS: dict[str, Callable[[Any, Any], bool]] = {
    "minimum": lambda value, bound: value >= bound,
    "maximum": lambda value, bound: value <= bound,
    "exclusiveMinimum": lambda value, bound: value > bound,
    "enum": lambda value, choices: value in choices,
    "const": lambda value, only: value == only,
    "pattern": lambda value, pattern: re.search(pattern, value) is not None,
}
TYPES: dict[str, type | tuple[type, ...]] = {
    "string": str,
    "boolean": bool,
    "integer": int,
    "number": (int, float),
    "object": dict,
    "array": list,
    "null": type(None),
}


def deviations(value: Any, part: dict[str, Any], schema: dict[str, Any], at: str) -> Iterator[str]:
    """Deviations from the schema, for the keywords that pydantic's schemas use."""
    if "$ref" in part:
        part = {**schema["$defs"][part["$ref"].rpartition("/")[2]], **part}
    for choice in ("anyOf", "oneOf"):
        options = part.get(choice)
        if options and all(any(deviations(value, option, schema, at)) for option in options):
            yield f"{at} = {value!r}: none of {choice}"
    if "type" in part and not isinstance(value, TYPES[part["type"]]):
        yield f"{at} = {value!r}: not of type {part['type']}"
        return
    for keyword, holds in CHECKS.items():
        if keyword in part and not holds(value, part[keyword]):
            yield f"{at} = {value!r}: {keyword} {part[keyword]}"
    if part.get("type") == "object":
        yield from _deviations_of_table(value, part, schema, at)
    if part.get("type") == "array":
        for number, entry in enumerate(value):
            yield from deviations(entry, part["items"], schema, f"{at}[{number}]")


def _deviations_of_table(
    value: dict[str, Any], part: dict[str, Any], schema: dict[str, Any], at: str
) -> Iterator[str]:
    known, others = part.get("properties", {}), part.get("additionalProperties", True)
    yield from (f"{at}.{key}: missing" for key in part.get("required", ()) if key not in value)
    for key, entry in value.items():
        if key in known:
            yield from deviations(entry, known[key], schema, f"{at}.{key}")
        elif isinstance(others, dict):
            yield from deviations(entry, others, schema, f"{at}.{key}")
        elif not others:
            yield f"{at}.{key}: unknown key"


def deviations_of(text: str) -> list[str]:
    schema = json_schema()
    return list(deviations(tomllib.loads(text), schema, schema, ""))


def examples() -> dict[str, str]:
    """The installed configuration and each example of docs/config.md, by name."""
    blocks = re.findall(r"^```toml\n(.*?)^```", (DOCS / "config.md").read_text(), re.M | re.S)
    assert blocks
    shown = {f"docs/config.md, {number}": block for number, block in enumerate(blocks, start=1)}
    return {"deploy/drone.toml": (PROJECT / "deploy/drone.toml").read_text(), **shown}


@pytest.mark.parametrize("text", examples().values(), ids=examples().keys())
def test_examples_fit_schema_and_program(text: str) -> None:
    assert deviations_of(text) == []
    Config.model_validate(tomllib.loads(text))


def test_the_defaults_fit_the_schema() -> None:
    assert deviations_of(to_toml(Config())) == []


@pytest.mark.parametrize(
    "text",
    [
        "[mission]\nsped = 1",
        "[mission]\nspeed_m_s = 5.0",
        "[mission]\nstandoff = 'near'",
        "[mission]\nheight_m = 'low'",
        "[link]\nurl = 'com3'",
        "[sensors.ranges]\nfront = {kind = 'lidar'}",
        "[sensors.ranges]\nfront = {kind = 'sharp_mcp3008', channel = 8}",
        "[sensors.ranges]\nfront = {kind = 'tfmini_s'}",
        "[wings]\nspan = 1",
    ],
)
def test_the_schema_rejects_invalid_values(text: str) -> None:
    assert deviations_of(text) != []


def test_every_key_has_a_description() -> None:
    schema = json_schema()
    undocumented = [
        f"{name}.{key}"
        for name, definition in schema["$defs"].items()
        for key, field in definition.get("properties", {}).items()
        if key != "kind" and not field.get("description")
    ]
    assert undocumented == []


def test_the_reference_is_up_to_date() -> None:
    """`companion config reference > docs/config-reference.md` updates it."""
    assert (DOCS / "config-reference.md").read_text(encoding="utf-8") == markdown()


def test_the_commands_print_schema_and_reference() -> None:
    schema = CliRunner().invoke(commands, ["config", "schema"])
    assert json.loads(schema.stdout) == json_schema()
    reference = CliRunner().invoke(commands, ["config", "reference"])
    assert reference.stdout == markdown()
