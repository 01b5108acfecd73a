"""Types of arrays. Shapes, units and frames are in the docstrings of what uses them."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
"""Array of real numbers."""
Mask = NDArray[np.bool_]
"""Array of truth values."""
Indices = NDArray[np.int64]
"""Array of indices or other whole numbers."""
