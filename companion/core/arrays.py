"""Types of arrays. Shapes, units and frames are in the docstrings of what uses them."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Numbers."""
Mask = NDArray[np.bool_]
"""Truth values."""
Indices = NDArray[np.int64]
"""Indices or whole numbers."""
