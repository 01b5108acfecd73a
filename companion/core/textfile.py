"""Reads text files written by people with any editor on any machine.

UTF-8 with or without a byte order mark, independent of the machine's locale; or UTF-16 with a mark,
as PowerShell writes it.
"""

import codecs
import json
import unicodedata
from pathlib import Path
from typing import Any

MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    # before UTF-16, whose mark has the same first bytes
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)
"""Byte order marks and their encodings."""


CONTROL = "Cc"
"""Unicode's category of control characters, which SVG cannot contain."""


class NotTextError(ValueError):
    """The bytes are no text; the message contains the line and the remedy."""


def encoding_of(begin: bytes) -> str:
    """The encoding of a file by its first bytes: that of its mark, or UTF-8."""
    return next((encoding for mark, encoding in MARKS if begin.startswith(mark)), "utf-8")


def has_control_character(text: str) -> bool:
    """True if a text contains a character that cannot be drawn, such as a line break."""
    return any(unicodedata.category(letter) == CONTROL for letter in text)


def read_text(path: Path) -> str:
    r"""The text of a file, with lines that end in \n.

    Raises:
        OSError: the file cannot be read.
        NotTextError: its encoding is unknown.
    """
    return decoded(path.read_bytes())


def decoded(data: bytes) -> str:
    r"""The text of a file's bytes, with lines that end in \n.

    Raises:
        NotTextError: the encoding is unknown.
    """
    encoding = encoding_of(data)
    try:
        text = data.decode(encoding)
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        name = encoding.removesuffix("-sig").upper()
        raise NotTextError(
            f"line {line}: byte 0x{data[error.start]:02x} is not {name}; save the file as UTF-8"
        ) from error
    if encoding == "utf-8" and "\0" in text[:2]:
        raise NotTextError("probably UTF-16 without a byte order mark; save the file as UTF-8")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def parsed_json(text: str) -> Any:
    """The value of a JSON text. A key that occurs twice is refused, as in TOML.

    Raises:
        ValueError: the text is not JSON.
        RecursionError: it is nested too deeply.
    """
    return json.loads(text, object_pairs_hook=_each_once)


def _each_once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    values = dict(pairs)
    if len(values) < len(pairs):
        keys = [key for key, _ in pairs]
        twice = next(key for key in keys if keys.count(key) > 1)
        raise ValueError(f"the key {twice!r} occurs {keys.count(twice)} times; remove all but one")
    return values


def reason(error: Exception) -> str:
    """Reason why a file cannot be read, to follow its name in a message."""
    return getattr(error, "strerror", None) or str(error)
