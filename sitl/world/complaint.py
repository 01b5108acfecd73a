"""What is wrong with a file's keys and values, in few words."""

import reprlib
from typing import Any

from pydantic import ValidationError


def complaint(error: ValidationError) -> str:
    """The first thing that is wrong: key = value: what it should be."""
    first: Any = error.errors()[0]
    key = ".".join(str(part) for part in first["loc"])
    value = "" if isinstance(first["input"], dict) else f" = {_shown(first['input'])}"
    message = first["msg"].removeprefix("Value error, ").replace("Input should", "should")
    return f"{key}{value}: {message}" if key else message


def _shown(value: object) -> str:
    """Short, however long or deep the value is."""
    try:
        return reprlib.repr(value)
    except ValueError:  # Python refuses to print integers of thousands of digits
        return "a huge number"
