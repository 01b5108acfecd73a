"""Text files that people write, with whichever editor, on whichever machine.

UTF-8, whatever the machine's locale says, with or without a byte order mark, as Notepad writes it;
or UTF-16 with its mark, as PowerShell does.
"""

import codecs
from pathlib import Path

MARKS = (
    (codecs.BOM_UTF8, "utf-8-sig"),
    # before UTF-16, whose mark begins alike
    (codecs.BOM_UTF32_LE, "utf-32"),
    (codecs.BOM_UTF32_BE, "utf-32"),
    (codecs.BOM_UTF16_LE, "utf-16"),
    (codecs.BOM_UTF16_BE, "utf-16"),
)


class NotTextError(ValueError):
    """Bytes that are no text; says where, and what to do."""


def encoding_of(begin: bytes) -> str:
    """The encoding of a file that begins so: what its mark says, else UTF-8."""
    return next((encoding for mark, encoding in MARKS if begin.startswith(mark)), "utf-8")


def read_text(path: Path) -> str:
    r"""The text of a file, its lines ended by \n.

    Raises:
        OSError: it cannot be read.
        NotTextError: it is in an encoding that it does not tell.
    """
    return decoded(path.read_bytes())


def decoded(data: bytes) -> str:
    r"""The text of a file's bytes, its lines ended by \n.

    Raises:
        NotTextError: they are in an encoding that they do not tell.
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
        raise NotTextError("looks like UTF-16 without its mark; save the file as UTF-8")
    return text.replace("\r\n", "\n").replace("\r", "\n")


def reason(error: OSError | ValueError) -> str:
    """Why a file cannot be read, to stand behind its name."""
    return getattr(error, "strerror", None) or str(error)
