"""Errors that end a `sitl` command with one line."""

import reprlib
from typing import Any

from pydantic import ValidationError


class SitlError(Exception):
    """Root of the errors that end a `sitl` command with one line."""


def error_line(error: ValidationError) -> str:
    """One validation error as one line, `key = value: what the value should be`.

    An unknown key comes first: a misspelt key is also reported as missing.
    """
    first: Any = min(error.errors(), key=lambda each: each["type"] != "extra_forbidden")
    key = ".".join(str(part) for part in first["loc"])
    value = "" if isinstance(first["input"], dict) else f" = {_shown(first['input'])}"
    message = first["msg"].removeprefix("Value error, ").replace("Input should", "should")
    message = "no such key" if first["type"] == "extra_forbidden" else message
    return f"{key}{value}: {message}" if key else message


def _shown(value: object) -> str:
    """A short representation, whatever the length or depth of the value."""
    try:
        return reprlib.repr(value)
    except ValueError:  # Python refuses to print integers of thousands of digits
        return "a huge number"
