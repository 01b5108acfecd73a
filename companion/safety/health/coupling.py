"""An open input of an ADC that shows what the chip has converted before: a distance, yet nobody's.

What is left of another channel's voltage follows that one's noise from tick to tick; no powered
sensor does. Second differences of the voltages leave the noise alone, since what the drone's motion
changes goes smoothly. Those of two sensors have nothing in common; an open input's are a share k of
the other's, and its voltage is k of the way from the level of open inputs to the other's.
"""

from collections import deque
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from companion.core.messages import Beam, RangeScan

WINDOW, PERIOD = 40, 5
"""Ticks that are compared, and after how many again."""
ALIKE, STILL_ALIKE = 0.88, 0.6
"""Correlation at which an input begins to be called open, and below which it is not any more. Of 40
second differences of independent noise it exceeds 0.88 less than once in 10^6."""
MAX_MEDIANS = 3.0
"""Larger differences are edges, which two beams may pass at once; they count as that much."""
MIN_LEVEL_V, MAX_LEVEL_V = 0.0, 0.9
"""Of open inputs, without what they show of others."""
MIN_POWERED_V = 1.1
SHARE_TOLERANCE = 0.15
Table = NDArray[np.float64]


class CouplingWatch:
    """All beams whose sensors put out a voltage."""

    def __init__(self) -> None:
        self.open: frozenset[Beam] = frozenset()
        """Beams at whose inputs there is no sensor."""
        self._rows: deque[dict[Beam, float]] = deque(maxlen=WINDOW + 2)
        self._ticks = 0

    def take(self, scan: RangeScan) -> None:
        """Take in one sweep."""
        self._rows.append({beam: reading.raw for beam, reading in scan.readings.items()})
        self._ticks += 1
        if len(self._rows) == WINDOW + 2 and self._ticks % PERIOD == 0:
            self.open = frozenset(self._open())

    def _open(self) -> Iterator[Beam]:
        named = list(self._rows[0])
        table = np.array([[row.get(beam, np.nan) for beam in named] for row in self._rows])
        told = np.flatnonzero(np.isfinite(table).all(axis=0))
        beams, volts = [named[i] for i in told], table[:, told]
        if len(beams) < 2:
            return
        means_v, noise = volts.mean(axis=0).tolist(), _noise(volts)
        # a chip's first input comes after its last one of the sweep before
        for mine, others in ((noise, noise), (noise[1:], noise[:-1])):
            for i, j, correlation, share in _alike(mine, others):
                enough = STILL_ALIKE if beams[i] in self.open else ALIKE
                if correlation > enough and _is_share(share, means_v[i], means_v[j]):
                    yield beams[i]


def _noise(volts: Table) -> Table:
    differences = np.diff(volts, 2, axis=0)
    most = MAX_MEDIANS * np.median(np.abs(differences), axis=0)
    clipped: Table = np.clip(differences, -most, most)
    return clipped


def _alike(mine: Table, others: Table) -> Iterator[tuple[int, int, float, float]]:
    """Pairs of unlike columns with their correlation, and the share of the other in mine."""
    both = mine.T @ others
    mine2, others2 = (mine**2).sum(axis=0), (others**2).sum(axis=0)
    is_alike = both > STILL_ALIKE * np.sqrt(np.outer(mine2, others2))  # false where there is none
    for i, j in np.argwhere(is_alike).tolist():
        if i != j:
            correlation = both[i, j] / np.sqrt(mine2[i] * others2[j])
            yield i, j, float(correlation), float(both[i, j] / others2[j])


def _is_share(share: float, my_v: float, other_v: float) -> bool:
    """Whether an input that shows so much of the other's voltage would stand where mine does."""
    if not MIN_POWERED_V < other_v > my_v:
        return False
    most, least = ((my_v - level_v) / (other_v - level_v) for level_v in (MIN_LEVEL_V, MAX_LEVEL_V))
    return least - SHARE_TOLERANCE < share < most + SHARE_TOLERANCE
