"""What SITL can refuse, in one line for the person reading it."""

from typing import Any

from pydantic import ValidationError


class SitlError(Exception):
    """Root of the errors that end a `sitl` command with one line."""


def complaint(error: ValidationError) -> str:
    """The first thing wrong, with key, value and bound."""
    first: Any = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"])
    value = "" if isinstance(first["input"], dict) else f" = {first['input']!r}"
    message = first["msg"].removeprefix("Value error, ").replace("Input should", "should")
    message = "no such key" if first["type"] == "extra_forbidden" else message
    return f"{key}{value}: {message}" if key else message
