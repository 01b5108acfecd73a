"""Terminal output of `companion map`."""

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import TracebackType

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskID, TaskProgressColumn, TextColumn
from rich.table import Table
from rich.text import Text

from companion.offline.files import stretch_name, walls_length_m
from companion.offline.mapper import LogMap
from companion.offline.reading.log import Log


class LogProgress:
    """A progress bar per activity; none if the output is not a terminal."""

    def __init__(self, console: Console) -> None:
        self._bars = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TaskProgressColumn(),
            console=console,
            transient=True,
            disable=not console.is_terminal,
        )
        self._tasks: dict[str, TaskID] = {}

    def __enter__(self) -> "LogProgress":
        self._bars.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._bars.stop()

    def show(self, activity: str, share: float) -> None:
        if activity not in self._tasks:
            self._tasks[activity] = self._bars.add_task(activity, total=1.0)
        self._bars.update(self._tasks[activity], completed=share)


def log_summary(result: LogMap, stretches: Sequence[LogMap], files: list[Path]) -> Table:
    """A table of the result and its verdict, and of the stretches that hold."""
    table = Table(title=Text("log"), show_header=False, title_justify="left")
    for name, value in (
        ("verdict", f"{result.verdict.word}: {result.verdict.reason}"),
        *_reading_rows(result.log),
        *_result_rows(result),
        *_stretch_rows(result, stretches),
        ("files", ", ".join(str(file) for file in files)),
    ):
        table.add_row(name, Text(value))
    return table


def _stretch_rows(result: LogMap, stretches: Sequence[LogMap]) -> Iterator[tuple[str, str]]:
    begin_s = float(result.log.time_s[0])
    for number, stretch in enumerate(stretches, start=1):
        from_s, to_s = stretch.log.time_s[[0, -1]] - begin_s
        yield (
            stretch_name(number),
            f"holds by itself from {from_s:.0f} to {to_s:.0f} s: {stretch.verdict.reason}",
        )


def _reading_rows(log: Log) -> Iterator[tuple[str, str]]:
    reading = log.reading
    yield "rows", f"{reading.rows} read, {len(log.time_s)} used"
    for reason, skipped in (*reading.rows_skipped.items(), *reading.cells_skipped.items()):
        yield "skipped", f"{skipped.count}: {reason}; first {skipped.first}"
    if reading.columns_ignored:
        yield "ignored", "columns " + ", ".join(reading.columns_ignored)


def _result_rows(result: LogMap) -> Iterator[tuple[str, str]]:
    time_s, plan = result.log.time_s, result.plan
    yield "time", f"{time_s[-1] - time_s[0]:.1f} s"
    yield "walls", f"{len(plan.walls)}, {walls_length_m(plan):.2f} m in all"
    if plan.ceiling_m is not None:
        yield "ceiling", f"{plan.ceiling_m:.2f} m"
    if result.verdict.trusted:
        error = result.path - result.log.odometry
        yield "ranges", f"{100 * result.agreement.rms_m:.1f} cm rms from their walls"
        yield (
            "odometry",
            f"error up to {np.hypot(error[:, 0], error[:, 1]).max():.2f} m and "
            f"{math.degrees(np.abs(error[:, 2]).max()):.1f}°, "
            f"scale error {100 * result.odometry_scale_error:+.1f} %",
        )
    else:
        yield "odometry", "uncorrected"
