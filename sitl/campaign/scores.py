"""The scores that summaries, plots and comparisons of campaigns show."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

Row = dict[str, Any]
"""A flight of a campaign: its settings, and the keys of its report."""
CONFIDENCE = 0.95


@dataclass(frozen=True, slots=True)
class Score:
    """A column of the results."""

    key: str
    title: str
    form: str
    scale: float = 1.0
    """Factor from the column's unit to that of the title."""


SCORES = (
    Score("wall_error_aligned_cm", "wall error, cm", "{:.2f}"),
    Score("coverage", "coverage, %", "{:.1f}", 100.0),
    Score("false_walls", "false walls, %", "{:.2f}", 100.0),
    Score("ate_cm", "trajectory error, cm", "{:.2f}"),
    Score("clearance_m", "least clearance, m", "{:.3f}"),
    Score("return_m", "landing from start, m", "{:.3f}"),
    Score("flight_time_s", "time in the air, s", "{:.1f}"),
    Score("collisions", "collisions", "{:.3f}"),
)


@dataclass(frozen=True, slots=True)
class Mean:
    """A mean with its 95 % confidence interval, by Student's t."""

    mean: float
    half: float | None
    """Half of the interval; None with less than two values."""
    number: int

    @classmethod
    def of(cls, values: list[float]) -> "Mean":
        number = len(values)
        if number < 2:
            return cls(values[0] if values else 0.0, None, number)
        error = float(np.std(values, ddof=1)) / float(np.sqrt(number))
        half = error * float(stats.t.ppf((1 + CONFIDENCE) / 2, number - 1))
        return cls(float(np.mean(values)), half, number)

    def as_json(self, scale: float = 1.0) -> dict[str, float | None] | None:
        """The mean in a unit that is `scale` times larger; None without values."""
        half = None if self.half is None else self.half / scale
        return {"mean": self.mean / scale, "half": half, "n": self.number} if self.number else None


def values(rows: list[Row], score: Score) -> list[float]:
    """A score of all flights that have it, in the unit of its title."""
    return [score.scale * float(row[score.key]) for row in rows if row.get(score.key) is not None]
