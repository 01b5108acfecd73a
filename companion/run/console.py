"""Shows the progress and the summary of a flight on the terminal."""

from pathlib import Path
from types import TracebackType

from rich.console import Console
from rich.live import Live
from rich.table import Table
from rich.text import Text

from companion.core.messages import FloorPlan
from companion.pdps.flight.state import FlightState
from companion.ticks import Progress


class ProgressLine:
    """Progress line, updated in place; on a pipe, one line for each new activity."""

    def __init__(self, console: Console) -> None:
        self._console = console
        self._live = Live(console=console, refresh_per_second=8, transient=True)
        self._shown: Progress | None = None
        self._activity = self._notice = ""

    def __enter__(self) -> "ProgressLine":
        if self._console.is_terminal:
            self._live.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self._live.stop()

    def show(self, progress: Progress) -> None:
        if progress is self._shown:
            return
        self._shown = progress
        if self._console.is_terminal:
            self._live.update(Text(_line(progress)))
        if progress.notice != self._notice:
            self._notice = progress.notice
            self._console.print(Text(progress.notice, style="bold"), soft_wrap=True)
        if progress.activity != self._activity:
            self._activity = progress.activity
            self._console.print(_line(progress))


def _line(progress: Progress) -> str:
    minutes, seconds = divmod(int(max(progress.time_s, 0)), 60)
    line = (
        f"{minutes:02d}:{seconds:02d}  {progress.activity:<42} "
        f"outline {100 * progress.outline:3.0f} %  walls {progress.walls_m:5.1f} m"
    )
    return f"{line}  {progress.trouble}" if progress.trouble else line


def summary(
    flight: FlightState, plan: FloorPlan, files: list[Path], waited_s: float | None
) -> Table:
    """Table with the result of the flight, the map and the saved files.

    `waited_s`: waiting time in s; None omits it.
    """
    table = Table(title="flight", show_header=False, title_justify="left")
    table.add_row("result", flight.ending)
    length_m = sum(wall.length_m for wall in plan.walls)
    table.add_row("walls", f"{len(plan.walls)}, {length_m:.2f} m in all")
    if plan.ceiling_m is not None:
        table.add_row("ceiling", f"{plan.ceiling_m:.2f} m")
    if plan.tops:
        heights = sorted({f"{surface.height_m:.2f}" for surface in plan.tops})
        table.add_row("table tops and the like", f"{', '.join(heights)} m")
    if plan.path:
        flown_s = plan.path[-1].time_s - plan.path[0].time_s
        waited = "" if waited_s is None else f", {waited_s:.0f} s waited"
        table.add_row("time", f"{flown_s:.0f} s flown{waited}")
    if files:
        table.add_row("map", ", ".join(str(file) for file in files))
    return table
