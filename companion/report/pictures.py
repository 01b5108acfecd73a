"""Draws the report's figures as inline SVG."""

import io
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from companion.core.figures import Axes, Figure, own_style
from companion.core.messages import Beam, FloorPlan
from companion.export.plan.survey import Survey
from companion.recording.reader import RecordedFault, Recording
from companion.report.numbers import Span, walls_over_time

INK, FAINT, WALL, RETURN, FAULT, ROOM = (
    "#1d2b33",
    "#8b989f",
    "#22333b",
    "#e07a1f",
    "#c1121f",
    "#f1efe8",
)
BEAM_COLOURS: Mapping[Beam, str] = {
    Beam.FRONT: "#1d3557",
    Beam.LEFT: "#2a9d8f",
    Beam.RIGHT: "#e07a1f",
    Beam.BACK: "#8338ec",
    Beam.UP: "#8b989f",
    Beam.DOWN: "#b5a27f",
}
PHASE_COLOURS = {
    "TAKE_OFF": "#8ecae6",
    "ROOM": "#2a9d8f",
    "BUILDING": "#219ebc",
    "HOME": "#8338ec",
    "HOLD": "#c1121f",
    "LAND": "#ffb703",
}
STYLE: Any = {
    "svg.hashsalt": "report",
    "svg.fonttype": "none",
    "text.parse_math": False,
    "font.size": 9,
    "font.family": "sans-serif",
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "xtick.color": FAINT,
    "ytick.color": FAINT,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.facecolor": "none",
    "savefig.transparent": True,
}


def plan_picture(survey: Survey, spans: Sequence[Span], faults: Sequence[RecordedFault]) -> str:
    """Draw numbered walls, the path coloured by time, and the positions of faults."""
    with own_style(STYLE):
        figure = Figure(figsize=(7.6, 7.0), layout="constrained")
        axes = figure.add_subplot(aspect="equal")
        axes.set_xlabel("east of take-off, m")
        axes.set_ylabel("north (first heading), m")
        plan = survey.plan
        for room in survey.rooms:
            axes.fill([e for _, e in room.outline_ne_m], [n for n, _ in room.outline_ne_m], ROOM)
        hits = np.array([hit.position_ned_m[:2] for hit in plan.hits]).reshape(-1, 2)
        axes.scatter(
            hits[:, 1], hits[:, 0], s=2, color=RETURN, alpha=0.4, linewidths=0, rasterized=True
        )
        _draw_walls(axes, survey)
        if plan.path:
            _draw_path(figure, axes, plan)
            _draw_faults(axes, plan, faults)
        return svg(figure)


def _draw_walls(axes: Axes, survey: Survey) -> None:
    for number, wall in enumerate(survey.plan.walls, start=1):
        (north_a, east_a), (north_b, east_b) = wall.start_ne_m, wall.end_ne_m
        axes.plot([east_a, east_b], [north_a, north_b], color=WALL, linewidth=2.5)
        axes.text(
            (east_a + east_b) / 2,
            (north_a + north_b) / 2,
            f"{number}",
            ha="center",
            va="center",
            color="white",
            fontsize=8,
            bbox={"boxstyle": "circle,pad=0.25", "facecolor": WALL, "edgecolor": "white"},
        )


def _draw_path(figure: Figure, axes: Axes, plan: FloorPlan) -> None:
    dots = axes.scatter(
        [pose.east_m for pose in plan.path],
        [pose.north_m for pose in plan.path],
        c=[pose.time_s for pose in plan.path],
        s=5,
        cmap="viridis",
        linewidths=0,
        rasterized=True,
    )
    figure.colorbar(dots, ax=axes, shrink=0.5, label="time, s")
    axes.plot(0, 0, marker="^", markersize=9, color=INK)
    axes.annotate("take-off", (0, 0), (7, 5), textcoords="offset points", color=INK)


def _draw_faults(axes: Axes, plan: FloorPlan, faults: Sequence[RecordedFault]) -> None:
    times_s = [pose.time_s for pose in plan.path]
    for fault in faults:
        if not fault.is_over and times_s[0] <= fault.time_s <= times_s[-1]:
            pose = plan.path[int(np.searchsorted(times_s, fault.time_s))]
            axes.plot(pose.east_m, pose.north_m, marker="x", markersize=9, color=FAULT)


def timeline_picture(spans: Sequence[Span], faults: Sequence[RecordedFault]) -> str:
    """Draw one row for each activity, and one for faults."""
    with own_style(STYLE):
        rows = list(dict.fromkeys(span.activity for span in spans))
        figure = Figure(figsize=(10, 0.6 + 0.26 * (len(rows) + 1)), layout="constrained")
        axes = figure.add_subplot()
        for span in spans:
            colour = PHASE_COLOURS.get(span.phase, FAINT)
            width_s = span.end_s - span.begin_s
            axes.barh(rows.index(span.activity), width_s, left=span.begin_s, color=colour)
        for fault in faults:
            mark = "o" if fault.is_over else "x"
            axes.plot(fault.time_s, len(rows), mark, color=FAULT, markersize=5)
        axes.set_yticks(range(len(rows) + 1), [*rows, "faults"])
        axes.invert_yaxis()
        axes.set_xlabel("time, s")
        return svg(figure)


def plots_picture(recording: Recording, plan: FloorPlan) -> str:
    """Plot ranges, height, speed, heading, uncertainty and mapping progress over time."""
    with own_style(STYLE):
        figure = Figure(figsize=(10, 11), layout="constrained")
        axes = figure.subplots(6, 1, sharex=True, height_ratios=(2, 1, 1, 1, 1, 1))
        _plot_ranges(axes[0], recording)
        _plot_height(axes[1], recording)
        _plot_speed(axes[2], recording)
        _plot_turning(axes[3], recording)
        _plot_certainty(axes[4], recording)
        axes[5].plot(*walls_over_time(plan), color=INK, linewidth=1)
        axes[5].set_ylabel("share of final\nwalls detected")
        axes[5].set_ylim(0, 1.02)
        axes[5].set_xlabel("time, s")
        for one in axes:
            one.grid(color="#e5e7e6", linewidth=0.6)
        figure.align_ylabels(axes)
        return svg(figure)


def _plot_ranges(axes: Axes, recording: Recording) -> None:
    for beam, colour in BEAM_COLOURS.items():
        seen = [
            (tick.now_s, reading.distance_m)
            for tick in recording.ticks
            if (reading := tick.inputs.scan.readings.get(beam)) is not None and reading.is_distance
        ]
        if seen:
            times_s, ranges_m = zip(*seen, strict=True)
            label = beam.value
            axes.plot(
                times_s, ranges_m, ".", markersize=1.6, color=colour, label=label, rasterized=True
            )
    axes.set_ylabel("ranges, m")
    if axes.get_legend_handles_labels()[0]:
        axes.legend(ncols=6, frameon=False, markerscale=6, loc="lower right", bbox_to_anchor=(1, 1))


def _plot_height(axes: Axes, recording: Recording) -> None:
    poses = recording.poses
    axes.plot([p.time_s for p in poses], [p.height_m for p in poses], color=INK, linewidth=1)
    axes.axhline(recording.config.mission.height_m, color=FAINT, linewidth=0.8, linestyle="--")
    axes.set_ylabel("height, m\n(dashed: setpoint)")


def _plot_speed(axes: Axes, recording: Recording) -> None:
    odometry = [
        tick.inputs.telemetry.odometry for tick in recording.ticks if tick.inputs.telemetry.odometry
    ]
    speeds_m_s = [float(np.hypot(*o.velocity_ned_m_s[:2])) for o in odometry]
    asked = recording.setpoints
    asked_m_s = [float(np.hypot(s.forward_m_s, s.right_m_s)) for _, s in asked]
    axes.plot([o.time_s for o in odometry], speeds_m_s, color=INK, linewidth=1)
    axes.plot([time_s for time_s, _ in asked], asked_m_s, color=FAINT, linewidth=0.8, ls="--")
    axes.set_ylabel("speed, m/s\n(dashed: setpoint)")


def _plot_turning(axes: Axes, recording: Recording) -> None:
    poses = recording.poses
    yaws_rad = np.unwrap([pose.yaw_rad for pose in poses])
    axes.plot([pose.time_s for pose in poses], np.degrees(yaws_rad), color=INK, linewidth=1)
    axes.set_ylabel("heading, °\n(clockwise)")


def _plot_certainty(axes: Axes, recording: Recording) -> None:
    poses = recording.poses
    times_s = [pose.time_s for pose in poses]
    axes.plot(times_s, [100 * p.position_sigma_m for p in poses], color=INK, linewidth=1)
    axes.set_ylabel("position, cm (σ)")
    heading = axes.twinx()
    sigmas_deg = np.degrees([p.yaw_sigma_rad for p in poses])
    heading.plot(times_s, sigmas_deg, color=RETURN, linewidth=1)
    heading.set_ylabel("heading, ° (σ)", color=RETURN)


def svg(figure: Figure) -> str:
    """SVG element of a figure, without the XML header of a separate file."""
    file = io.StringIO()
    figure.savefig(file, format="svg", metadata={"Date": None})
    text = file.getvalue()
    return text[text.index("<svg") :]
