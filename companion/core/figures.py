"""Imports of matplotlib's figures, which are drawn without a display backend, in one style.

matplotlib fails to import if MPLBACKEND names a backend that is not installed, as in a process
started by a notebook. A program whose own backend is installed keeps it.
"""

import os
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any

VARIABLE = "MPLBACKEND"
"""Environment variable that names matplotlib's backend."""

_is_first = "matplotlib" not in sys.modules
_named = os.environ.pop(VARIABLE, "") if _is_first else ""
try:
    from matplotlib import rcParams, style
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
    "own_style",
]


@contextmanager
def own_style(settings: Mapping[str, Any] | None = None) -> Iterator[None]:
    """Draw in matplotlib's default style with these settings; also a decorator.

    A user's matplotlibrc would crop a sheet that is to scale, or set text in a TeX that is missing.
    """
    with style.context(["default", dict(settings or {})]):
        yield
