"""Decides which part of a growing flight is solved: the whole, or its last part.

The whole flight is solved each time it has grown by a quarter. In between only its last part is
solved, with the rest as a marginal prior:

    |---------------- whole -----------------|
                                    |prior ends here
                                    |-- part --|
                                    |----- part -----|
    |------------------------- whole ------------------------|

So the cost per second of flight is bounded.
"""

import math

GROWN_BY = 1.25
"""Growth of the flight after which the whole is solved again. Chosen."""
OVERLAP_KEYFRAMES = 100
"""The last part overlaps the keyframes before it by this many. Chosen."""
MAX_PART_KEYFRAMES = 3 * OVERLAP_KEYFRAMES
"""The prior moves on when the last part is longer than this, keyframes. Chosen."""


class WindowSchedule:
    """The schedule of one flight."""

    def __init__(self, short_keyframes: int, max_whole_keyframes: float = math.inf) -> None:
        """The whole is always solved below `short_keyframes`, and never from the maximum on."""
        self._short_keyframes = short_keyframes
        self._max_whole_keyframes = max_whole_keyframes
        self._whole_keyframes = 0
        """Length of the flight when it was last solved as a whole, with a prior at its end."""

    def is_whole(self, keyframes: int) -> bool:
        """True if a flight of this length is to be solved as a whole."""
        has_grown = GROWN_BY * self._whole_keyframes < keyframes < self._max_whole_keyframes
        return self._whole_keyframes == 0 or keyframes < self._short_keyframes or has_grown

    def solved_whole(self, keyframes: int) -> None:
        """Note that a flight of this length was solved as a whole, and that the prior is moved."""
        self._whole_keyframes = keyframes


def prior_frame(keyframes: int, *, is_whole: bool) -> int | None:
    """The keyframe of a solved part of this length to which the prior moves; None: it stays."""
    min_keyframes = OVERLAP_KEYFRAMES if is_whole else MAX_PART_KEYFRAMES
    return keyframes - OVERLAP_KEYFRAMES if keyframes > min_keyframes else None
