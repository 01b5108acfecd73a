"""Prepares a command for the terminal or notebook that it runs in."""

import io
import os
import sys


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
