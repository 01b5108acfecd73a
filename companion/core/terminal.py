"""What a command does before all else about the terminal, or the notebook, that it is run from."""

import io
import os
import sys


def set_up() -> None:
    """Have the command work the same wherever it is run; for programs, not for libraries.

    What the terminal's encoding lacks is written as ?. Pictures are drawn without a window, so
    that a notebook's or a desktop's matplotlib backend, which may not be installed here, is not
    asked for, nor by processes that are started from here.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="replace")
    os.environ["MPLBACKEND"] = "agg"
