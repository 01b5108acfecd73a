"""Reads TOML files and checks them against their groups.

Every error is a `ConfigError` of one line with file, key, value and allowed values.
"""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar, get_args

from pydantic import BaseModel, ValidationError

from companion.config.range_sensors import Group
from companion.core.errors import ConfigError
from companion.core.textfile import NotTextError, read_text, reason

_G = TypeVar("_G", bound=Group)


def read_toml(path: Path) -> dict[str, Any]:
    """Contents of a file, not yet checked."""
    text = text_of(path)
    try:
        return tomllib.loads(text)
    except (ValueError, RecursionError) as error:  # also for numbers and lists of excessive size
        raise ConfigError(f"{path}: not TOML: {error}") from error


def validated(model: type[_G], values: Mapping[str, Any], source: str) -> _G:
    """The settings, or a `ConfigError` of one line about the first invalid one."""
    try:
        return model.model_validate(values)
    except ValidationError as error:
        raise ConfigError(f"{source}: {complaint(model, error)}") from error


def text_of(path: Path) -> str:
    """Text of a file, or a `ConfigError` of one line."""
    try:
        return read_text(path)
    except (OSError, NotTextError) as error:
        raise ConfigError(f"{path}: {reason(error)}") from error


def complaint(model: type[BaseModel], error: ValidationError) -> str:
    """The first error as `key = value: what the value should be`."""
    first = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"])
    if first["type"] == "union_tag_invalid":
        context = first["ctx"]
        return f"{key}.kind = {context['tag']!r}: should be one of {context['expected_tags']}"
    if first["type"] == "extra_forbidden":
        known = ", ".join(sorted(_keys_at(model, first["loc"][:-1])))
        return f"{key} = {first['input']!r}: no such key; known here: {known}"
    told = first["msg"].removeprefix("Value error, ").replace("Input should", "should")
    setting = key if isinstance(first["input"], Mapping) else f"{key} = {first['input']!r}"
    return f"{setting}: {told}" if setting else told


def _keys_at(group: type[BaseModel], path: tuple[int | str, ...]) -> list[str]:
    """Known keys at a path: of a group, or of an entry of a table."""
    if not path:
        return list(group.model_fields)
    field, *rest = path
    annotation = group.model_fields[str(field)].annotation
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return _keys_at(annotation, tuple(rest))
    _, entry = get_args(annotation)  # a table by beam
    _, *kind = rest
    groups = [g for g in _groups(entry) if not kind or kind[0] in _kinds(g)]
    return _keys_at(groups[0], ())


def _groups(entry: Any) -> list[type[BaseModel]]:
    """Groups of a union discriminated by `kind`, or of one group."""
    if isinstance(entry, type):
        return [entry]
    union, *_ = get_args(entry)
    return list(get_args(union))


def _kinds(group: type[BaseModel]) -> tuple[object, ...]:
    return get_args(group.model_fields["kind"].annotation)
