"""Imports of matplotlib's figures, which are drawn without a display backend.

matplotlib fails to import if MPLBACKEND names a backend that is not installed, as in a process
started by a notebook. A program whose own backend is installed keeps it.
"""

import os
import sys
from contextlib import suppress

VARIABLE = "MPLBACKEND"
"""Environment variable that names matplotlib's backend."""

_is_first = "matplotlib" not in sys.modules
_named = os.environ.pop(VARIABLE, "") if _is_first else ""
try:
    from matplotlib import rc_context, rcParams
    from matplotlib.axes import Axes
    from matplotlib.collections import LineCollection
    from matplotlib.figure import Figure
    from matplotlib.patches import PathPatch, Polygon
    from matplotlib.path import Path as Outline
    from matplotlib.text import Text
finally:
    if _named:
        os.environ[VARIABLE] = _named
if _named:
    with suppress(ValueError):  # not installed here, and no figure needs it
        rcParams["backend"] = _named

__all__ = [
    "Axes",
    "Figure",
    "LineCollection",
    "Outline",
    "PathPatch",
    "Polygon",
    "Text",
    "rc_context",
]
