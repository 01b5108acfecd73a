"""A recorded log as arrays, independent of the file format."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np

from companion.core.arrays import Array
from companion.core.errors import LogError
from companion.core.messages import Beam
from companion.offline.reading.plausible import check_clock, check_units

Watch = Callable[[str, float], None]
"""Progress callback: activity, and share done."""


def ignore(activity: str, share: float) -> None:
    """Ignore the progress."""


@dataclass(slots=True)
class Skipped:
    """Rows or cells skipped for one reason."""

    count: int = 0
    first: str = ""
    """Position and content of the first."""


@dataclass(slots=True)
class Reading:
    """Statistics of the reading of a log."""

    rows: int = 0
    """Rows in the file, used or not."""
    rows_skipped: dict[str, Skipped] = field(default_factory=dict)
    cells_skipped: dict[str, Skipped] = field(default_factory=dict)
    """Invalid ranges in used rows."""
    columns_ignored: tuple[str, ...] = ()
    rows_sorted: int = 0
    """Rows that follow a later one."""

    def skip_row(self, reason: str, where: str) -> None:
        _note(self.rows_skipped, reason, where)

    def skip_cell(self, reason: str, where: str) -> None:
        _note(self.cells_skipped, reason, where)


def _note(table: dict[str, Skipped], reason: str, where: str) -> None:
    entry = table.setdefault(reason, Skipped(first=where))
    entry.count += 1


@dataclass(frozen=True, slots=True)
class Log:
    """Rows in order of time, each time once.

    Odometry is in its own drifting NED frame, yaw clockwise and unwrapped. A range is NaN without a
    return.
    """

    time_s: Array
    """(n,), strictly increasing."""
    odometry: Array
    """(n, 3): north, east, yaw."""
    ranges_m: dict[Beam, Array]
    """(n,) each, as recorded."""
    gyro_rad_s: Array | None
    """(n,): yaw rate, clockwise; NaN where missing."""
    reading: Reading

    def part(self, rows: slice) -> "Log":
        """Some of its rows."""
        return replace(
            self,
            time_s=self.time_s[rows],
            odometry=self.odometry[rows],
            ranges_m={beam: values[rows] for beam, values in self.ranges_m.items()},
            gyro_rad_s=None if self.gyro_rad_s is None else self.gyro_rad_s[rows],
        )

    @staticmethod
    def of(
        time_s: Array,
        odometry: Array,
        ranges_m: dict[Beam, Array],
        gyro_rad_s: Array | None,
        reading: Reading,
    ) -> "Log":
        """Sort rows, and keep only the first row of each time.

        Raises:
            LogError: there is no row, or the clock or the units are not plausible.
        """
        if not len(time_s):
            raise LogError("no row is valid" + _skipped_rows(reading.rows_skipped))
        check_clock(time_s)
        reading.rows_sorted = int((np.diff(time_s) < 0).sum())
        order = np.argsort(time_s, kind="stable")
        is_new = np.diff(time_s[order], prepend=-np.inf) > 0
        repeated = int((~is_new).sum())
        if repeated:
            at_s = float(time_s[order][~is_new][0])
            reading.rows_skipped["time repeated"] = Skipped(repeated, f"time_s = {at_s:g}")
        kept = order[is_new]
        odometry = odometry[kept]
        gyro_rad_s = gyro_rad_s[kept] if gyro_rad_s is not None else None
        check_units(time_s[kept], odometry, gyro_rad_s)
        odometry[:, 2] = np.unwrap(odometry[:, 2])
        return Log(
            time_s[kept],
            odometry,
            {beam: values[kept] for beam, values in ranges_m.items()},
            gyro_rad_s,
            reading,
        )


def _skipped_rows(skipped: dict[str, Skipped]) -> str:
    if not skipped:
        return ""
    reason, entry = next(iter(skipped.items()))
    return f"; {entry.count} rows skipped ({reason}), the first at {entry.first}"
