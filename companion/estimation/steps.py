"""Which steps of the pose are believed.

In a corridor where the beams to the sides fold back, walls are taken for others for a while, and
the smoothed flight ends metres aside, surely as it seems. What truly is so comes out again and
again.
"""

SIGMAS, LEAST_M = 5.0, 0.2
"""A step by more than both is wild."""
TIMES = 3
"""So often in a row, and it is believed."""


class Steps:
    """Counts the wild ones."""

    def __init__(self) -> None:
        self._wild = 0

    def believes(self, step_m: float, sigma_m: float) -> bool:
        """Whether the pose, sure to `sigma_m`, is to make this step."""
        is_wild = step_m > max(SIGMAS * sigma_m, LEAST_M)
        self._wild = self._wild + 1 if is_wild else 0
        if self._wild == TIMES:
            self._wild = 0
            return True
        return not is_wild
