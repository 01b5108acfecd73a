"""Detects open ADC inputs, whose voltage is left over from the channel that was converted before.

An open input reads as a distance although no sensor is connected. Its voltage follows the noise of
the other channel from tick to tick. That of a powered sensor does not. Second differences of the
voltages contain the noise alone, since the drone's motion changes the voltages smoothly. Those of
two sensors are uncorrelated. Those of an open input are a share k of the other channel's. Its
voltage lies at the share k between the level of open inputs and the other channel's voltage.
"""

from collections import deque
from collections.abc import Iterator

import numpy as np

from companion.core.arrays import Array
from companion.core.messages import Beam, RangeScan

WINDOW, PERIOD = 40, 5
"""Number of ticks in a comparison, and between two comparisons. Chosen."""
ALIKE, STILL_ALIKE = 0.88, 0.6
"""Correlation above which an input becomes open, and below which it is no longer open. For 40
second differences of independent noise, it exceeds 0.88 less than once in 10^6."""
MAX_MEDIANS = 3.0
"""Limit of a second difference, in medians. Chosen: larger ones are edges, which two beams may pass
at once."""
MIN_LEVEL_V, MAX_LEVEL_V = 0.0, 0.9
"""Range of the level of open inputs, without the share of other channels, V. Chosen."""
MIN_POWERED_V = 1.1
"""Minimum mean voltage of the other channel, V. Chosen."""
SHARE_TOLERANCE = 0.15
"""Tolerance of the share k. Chosen."""


class CouplingWatch:
    """Check of all beams whose sensors output a voltage."""

    def __init__(self) -> None:
        self.open: frozenset[Beam] = frozenset()
        """Beams without a sensor at their input."""
        self._rows: deque[dict[Beam, float]] = deque(maxlen=WINDOW + 2)
        self._ticks = 0

    def take(self, scan: RangeScan) -> None:
        """Add one sweep."""
        self._rows.append({beam: reading.raw for beam, reading in scan.readings.items()})
        self._ticks += 1
        if len(self._rows) == WINDOW + 2 and self._ticks % PERIOD == 0:
            self.open = frozenset(self._open())

    def _open(self) -> Iterator[Beam]:
        named = list(self._rows[0])
        table = np.array([[row.get(beam, np.nan) for beam in named] for row in self._rows])
        given = np.flatnonzero(np.isfinite(table).all(axis=0))
        beams, volts = [named[i] for i in given], table[:, given]
        if len(beams) < 2:
            return
        means_v, noise = volts.mean(axis=0).tolist(), _noise(volts)
        # a chip converts its first input after its last one of the previous sweep
        for mine, others in ((noise, noise), (noise[1:], noise[:-1])):
            for i, j, correlation, share in _alike(mine, others):
                enough = STILL_ALIKE if beams[i] in self.open else ALIKE
                if correlation > enough and _is_share(share, means_v[i], means_v[j]):
                    yield beams[i]


def _noise(volts: Array) -> Array:
    differences = np.diff(volts, 2, axis=0)
    most = MAX_MEDIANS * np.median(np.abs(differences), axis=0)
    clipped: Array = np.clip(differences, -most, most)
    return clipped


def _alike(mine: Array, others: Array) -> Iterator[tuple[int, int, float, float]]:
    """Pairs of different columns (mine, other), their correlation, and other's share in mine."""
    both = mine.T @ others
    mine2, others2 = (mine**2).sum(axis=0), (others**2).sum(axis=0)
    is_alike = both > STILL_ALIKE * np.sqrt(np.outer(mine2, others2))  # false without noise
    for i, j in np.argwhere(is_alike).tolist():
        if i != j:
            correlation = both[i, j] / np.sqrt(mine2[i] * others2[j])
            yield i, j, float(correlation), float(both[i, j] / others2[j])


def _is_share(share: float, my_v: float, other_v: float) -> bool:
    """Return True if `share` of the other channel's voltage explains the voltage `my_v`."""
    if not MIN_POWERED_V < other_v > my_v:
        return False
    most, least = ((my_v - level_v) / (other_v - level_v) for level_v in (MIN_LEVEL_V, MAX_LEVEL_V))
    return least - SHARE_TOLERANCE < share < most + SHARE_TOLERANCE
