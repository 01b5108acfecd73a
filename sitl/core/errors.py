"""What SITL can refuse, in one line for the person reading it."""

import reprlib
from typing import Any

from pydantic import ValidationError


class SitlError(Exception):
    """Root of the errors that end a `sitl` command with one line."""


def complaint(error: ValidationError) -> str:
    """The first thing that is wrong in a file: key = value: what it should be."""
    first: Any = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"])
    value = "" if isinstance(first["input"], dict) else f" = {_shown(first['input'])}"
    message = first["msg"].removeprefix("Value error, ").replace("Input should", "should")
    message = "no such key" if first["type"] == "extra_forbidden" else message
    return f"{key}{value}: {message}" if key else message


def _shown(value: object) -> str:
    """Short, however long or deep the value is."""
    try:
        return reprlib.repr(value)
    except ValueError:  # Python refuses to print integers of thousands of digits
        return "a huge number"
