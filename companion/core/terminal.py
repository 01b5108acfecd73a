"""Prepares a command for the terminal or notebook that it runs in."""

import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager

EXIT_NOT_WRITTEN = 2
"""Exit status of a command whose output could not be written. Chosen."""
NOT_WRITTEN = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)
"""Errors of a full disk, a quota, a file that is too long, and a broken disk or terminal."""


def set_up() -> None:
    """Make output independent of the terminal; for programs, not for libraries.

    Characters that the terminal's encoding lacks are written as ?. Figures are drawn without a
    window, so the matplotlib backend of a notebook or desktop, which may not be installed here, is
    not loaded. This also holds for child processes.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    os.environ["MPLBACKEND"] = "agg"


@contextmanager
def checked_output(program: str) -> Iterator[None]:
    """End a program in one line on stderr if its output cannot be written, as to a full disk."""
    try:
        yield
    except OSError as error:
        if error.filename is not None or error.errno not in NOT_WRITTEN:
            raise
        with open(os.devnull, "wb") as null:  # else Python fails again when it writes the rest
            os.dup2(null.fileno(), sys.stdout.fileno())
        sys.stderr.write(f"{program}: its output cannot be written: {error.strerror}\n")
        raise SystemExit(EXIT_NOT_WRITTEN) from None
