"""Shows numbers and plots beside the scene: ranges, heading and gyro bias."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from viser import GuiApi, GuiHtmlHandle, GuiUplotHandle, uplot

from companion.core.arrays import Array
from companion.core.messages import Beam, RangeReading
from companion.export.colours import flight_colour
from companion.team.teammate import Heard
from companion.view.scene.mapped import SIGMA_COLOURS, UNSURE_M
from companion.view.snapshot import Snapshot

WINDOW_S = 60.0
"""Time span of the plots, s. Chosen."""
PERIOD_S = 1.0
"""Wall-clock time between updates, s. Chosen: plots load a browser more than the scene."""
MAX_DOTS = 150
"""Target number of dots of a series. Chosen."""
PLOTTED = (Beam.FRONT, Beam.LEFT, Beam.RIGHT, Beam.UP, Beam.DOWN)
COLOURS = ("#e76f51", "#2a9d8f", "#3a86c8", "#b5838d", "#8d99ae")
HEIGHT_PX = 150
"""Height of a plot, pixels. Chosen."""
PHONE_ONLY = """<style>@media (min-width: 36em) {{.pdps-phone {{display: none}}}}</style>
<div class="pdps-phone">{}</div>"""
"""Shows its content only where viser puts all panels into one sheet, of which the controls are the
upper part."""
MAX_RANGE_M = 8.0
"""Upper end of the axis of ranges, m. Chosen."""
BIAS_DEG_S = (-1.0, 1.0)
"""Axis of the gyro bias, °/s. Chosen."""


@dataclass(frozen=True, slots=True)
class Member:
    """One drone in the table of a team."""

    drone: int
    """Its number."""
    activity: str
    battery: float | None
    """Remaining charge, 0 to 1; None if it is unknown."""

    @classmethod
    def of(cls, snapshot: Snapshot) -> "Member":
        return cls(snapshot.drone, snapshot.activity, snapshot.battery)

    @classmethod
    def of_mate(cls, mate: Heard) -> "Member":
        return cls(mate.drone, mate.phase, mate.battery)


class Instruments:
    """A table of numbers, to which callers add rows, and three plots of the last minute."""

    def __init__(self, gui: GuiApi, phone: GuiHtmlHandle) -> None:
        """`phone`: where a phone shows the numbers."""
        self._phone = phone
        self._team = gui.add_html("", visible=False)
        self._table = gui.add_html("")
        gui.add_html(_legend())
        self._ranges = _plot(gui, "ranges, m", PLOTTED, COLOURS, (0, MAX_RANGE_M))
        self._yaw = _plot(
            gui, "heading, °", ("estimated", "true"), (COLOURS[4], COLOURS[2]), (-180, 180)
        )
        self._bias = _plot(gui, "gyro bias, °/s", ("estimated",), (COLOURS[0],), BIAS_DEG_S)

    def clear(self) -> None:
        """Show no flight."""
        self._table.content = self._phone.content = ""
        for plot in (self._ranges, self._yaw, self._bias):
            plot.data = tuple(
                np.full(1, math.nan) if number else np.zeros(1) for number in range(len(plot.data))
            )

    def tell_team(self, members: Sequence[Member]) -> None:
        """Show what each drone does; nothing for a drone that flies alone."""
        self._team.visible = len(members) > 1
        self._team.content = _team_table(members)

    def tell(self, snapshot: Snapshot, more: Mapping[str, str]) -> None:
        """Show the numbers of a snapshot, and the rows in `more`."""
        pose = snapshot.pose
        rows = {
            "doing": snapshot.activity,
            **({"trouble": snapshot.trouble} if snapshot.trouble else {}),
            "time": f"{snapshot.time_s:.2f} s",
            "height": "–" if pose is None else f"{pose.height_m:.2f} m",
            "position, 1σ": "–" if pose is None else f"{100 * pose.position_sigma_m:.1f} cm",
            "battery": _charge(snapshot.battery),
            **more,
        }
        self._table.content = table = _html_table(rows)
        self._phone.content = PHONE_ONLY.format(table)

    def plot(self, window: Sequence[Snapshot], true_yaw_rad: Sequence[float] | None = None) -> None:
        """Plot the last minute of the snapshots, which are in order of time.

        `true_yaw_rad` has one element per snapshot.
        """
        if not window:
            return
        since_s = window[-1].time_s - WINDOW_S
        first = next(i for i, snapshot in enumerate(window) if snapshot.time_s >= since_s)
        stride = max(1, (len(window) - first) // MAX_DOTS)
        shown = list(window)[first::stride]
        times = np.array([snapshot.time_s for snapshot in shown])
        self._ranges.data = (
            times,
            *(_column(shown, lambda s, b=beam: _range_m(s.readings.get(b))) for beam in PLOTTED),  # type: ignore[misc]
        )
        yaw = _column(shown, lambda s: math.degrees(s.pose.yaw_rad) if s.pose else math.nan)
        true = (
            np.degrees(true_yaw_rad[first::stride])
            if true_yaw_rad
            else np.full(len(shown), math.nan)
        )
        self._yaw.data = (times, yaw, np.asarray(true, dtype=float))
        self._bias.data = (times, _column(shown, _bias_deg_s))


def _column(shown: Sequence[Snapshot], value: Callable[[Snapshot], float]) -> Array:
    return np.array([value(snapshot) for snapshot in shown], dtype=float)


def _bias_deg_s(snapshot: Snapshot) -> float:
    bias_rad_s = snapshot.gyro_bias_rad_s
    return math.nan if bias_rad_s is None else math.degrees(bias_rad_s)


def _range_m(reading: RangeReading | None) -> float:
    return reading.distance_m if reading is not None and reading.is_distance else math.nan


def _plot(
    gui: GuiApi,
    title: str,
    names: Sequence[str],
    colours: Sequence[str],
    between: tuple[float, float],
) -> GuiUplotHandle:
    """Add an empty plot. Missing values are NaN, so the scale is fixed: uPlot cannot derive one."""
    empty = np.zeros(1)
    # dots, because a line would bridge missing values
    dots = [
        uplot.Series(
            label=str(name),
            stroke=colour,
            width=0,
            points=uplot.Series_Points(show=True, size=3, fill=colour),
        )
        for name, colour in zip(names, colours, strict=True)
    ]
    return gui.add_uplot(
        (empty, *(np.full(1, math.nan) for _ in names)),
        (uplot.Series(label="s"), *dots),
        title=title,
        scales={"x": uplot.Scale(time=False), "y": uplot.Scale(range=between)},
        legend=uplot.Legend(show=len(names) > 1),
        height=HEIGHT_PX,
    )


def _charge(battery: float | None) -> str:
    return "–" if battery is None else f"{battery:.0%}"


def _team_table(members: Sequence[Member]) -> str:
    cells = "".join(
        f'<tr><td style="color:{flight_colour(each.drone - 1)}">⬤</td><td><b>{each.drone}</b></td>'
        f'<td style="width:100%">{_plain(each.activity)}</td><td>{_charge(each.battery)}</td></tr>'
        for each in members
    )
    return f'<table style="font-size:.85em;margin:.4em .8em;border-spacing:.3em 0">{cells}</table>'


def _html_table(rows: Mapping[str, str]) -> str:
    cells = "".join(
        f'<tr><td style="opacity:.65;padding-right:.8em;white-space:nowrap">{_plain(key)}</td>'
        f"<td><b>{_plain(value)}</b></td></tr>"
        for key, value in rows.items()
    )
    return f'<table style="font-size:.85em;margin:.4em .8em">{cells}</table>'


def _plain(text: str) -> str:
    """Escape text for HTML."""
    return text.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")


def _legend() -> str:
    gradient = ",".join("rgb({},{},{})".format(*colour) for colour in SIGMA_COLOURS)
    return (
        '<div style="font-size:.8em;margin:.2em 1em .6em">wall uncertainty (1σ): 0 '
        '<span style="display:inline-block;width:7em;height:.7em;'
        f'background:linear-gradient(90deg,{gradient})"></span> {100 * UNSURE_M:.0f} cm</div>'
    )
