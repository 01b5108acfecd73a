"""Writes the report as one HTML page without scripts or other files."""

import json
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from string import Template

from companion.core.errors import OutputError
from companion.core.messages import FloorPlan, RangeState
from companion.export.plan.survey import Survey, survey
from companion.recording.reader import Recording
from companion.report.numbers import (
    Span,
    beam_uses,
    ending,
    flown_m,
    outline_seen,
    spans,
    walls_mapped,
)
from companion.report.pictures import plan_picture, plots_picture, timeline_picture


def write_report(recording: Recording, plan: FloorPlan, title: str, path: Path) -> None:
    """Write the report of a flight.

    Raises:
        OutputError: the file cannot be written.
    """
    save_page(report_page(recording, survey(plan), title), path)


def save_page(text: str, path: Path) -> None:
    """Write a page.

    Raises:
        OutputError: the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{path}: {error.strerror}") from error


@dataclass(frozen=True, slots=True)
class Head:
    """What stands at the top of a page."""

    title: str
    result: str
    is_good: bool
    facts: Sequence[tuple[str, str]]
    """Names and values."""


def filled(template: str, head: Head, **parts: str) -> str:
    """A page with the body of a template of this package; `parts` are HTML."""
    body = Template(_text(template)).substitute(parts)
    facts = (f"<div><dt>{escape(k)}</dt><dd>{escape(v)}</dd></div>" for k, v in head.facts)
    return Template(_text("page.html")).substitute(
        style=_text("page.css"),
        title=escape(head.title),
        result=escape(head.result),
        result_class="good" if head.is_good else "bad",
        facts="".join(facts),
        body=body,
    )


def _text(name: str) -> str:
    return (files("companion.report") / name).read_text(encoding="utf-8")


def report_page(recording: Recording, found: Survey, title: str) -> str:
    """HTML text of the report."""
    end_s = recording.ticks[-1].now_s if recording.ticks else 0.0
    activities = spans(recording.phases, end_s)
    result = ending(recording)
    head = Head(title, result, result == "mission complete", _facts(recording, found, end_s))
    return filled(
        "flight.html",
        head,
        plan=plan_picture(found, activities, recording.faults),
        tables=map_tables(found),
        timeline=timeline_picture(activities, recording.faults),
        activities=_activities(activities),
        faults=_faults(recording),
        plots=plots_picture(recording, found.plan),
        beams=_beams(recording),
        config=escape(json.dumps(recording.config.model_dump(mode="json"), indent=2)),
        file=escape(recording.path.name),
        version=escape(recording.companion_version),
    )


def _facts(recording: Recording, found: Survey, end_s: float) -> list[tuple[str, str]]:
    plan = found.plan
    length_m, sigma_m = walls_mapped(plan)
    mission, sensors = recording.config.mission, recording.config.sensors
    return [
        ("mission", f"{mission.kind}, {mission.speed_m_s:g} m/s at {mission.height_m:g} m"),
        ("range sensors", f"{len(sensors.channels)} × {sensors.profile}"),
        ("recorded", f"{end_s:.0f} s"),
        ("flown", f"{flown_m(plan):.1f} m"),
        ("rooms", f"{len(found.rooms)}, {sum(room.area_m2 for room in found.rooms):.1f} m²"),
        ("walls", f"{len(plan.walls)}, {length_m:.1f} m"),
        ("wall uncertainty", f"± {100 * sigma_m:.1f} cm (1 σ)"),
        ("ceiling", "not detected" if plan.ceiling_m is None else f"{plan.ceiling_m:.2f} m"),
        ("outline mapped", f"{100 * outline_seen(plan):.0f} % of all directions"),
        ("faults", f"{sum(not fault.is_over for fault in recording.faults)}"),
    ]


def map_tables(found: Survey) -> str:
    """Walls, rooms and openings beside each other."""
    tables = (
        ("Walls", _walls(found.plan)),
        ("Rooms", _rooms(found)),
        ("Openings", _openings(found)),
    )
    sections = (f"<section><h3>{name}</h3>{rows}</section>\n" for name, rows in tables)
    return f'<div class="side">\n{"".join(sections)}</div>'


def _rooms(found: Survey) -> str:
    rows = [(room.name, f"{room.area_m2:.2f} m²") for room in found.rooms]
    return table(("room", "area"), rows, "no closed room: too many walls are missing")


def _openings(found: Survey) -> str:
    rows = [
        (f"{gap.width_m:.2f} m", _place(gap.start_ne_m, gap.end_ne_m)) for gap in found.openings
    ]
    return table(("opening", "from – to (north, east), m"), rows, "no opening detected")


def _walls(plan: FloorPlan) -> str:
    rows = [
        (
            f"{number}",
            f"{wall.length_m:.2f} m",
            f"{100 * wall.sigma_m:.1f} cm",
            f"{math.degrees(wall.normal_sigma_rad):.2f}°",
            f"{wall.hits}",
            _place(wall.start_ne_m, wall.end_ne_m),
        )
        for number, wall in enumerate(plan.walls, start=1)
    ]
    heads = ("wall", "length", "± across", "± direction", "returns", "from – to (north, east), m")
    return table(heads, rows, "no wall mapped")


def _place(start_ne_m: Sequence[float], end_ne_m: Sequence[float]) -> str:
    (north_a, east_a), (north_b, east_b) = start_ne_m, end_ne_m
    return f"({north_a:.2f}, {east_a:.2f}) – ({north_b:.2f}, {east_b:.2f})"


def _activities(activities: Sequence[Span]) -> str:
    rows = [
        (f"{span.begin_s:.1f} s", f"{span.end_s - span.begin_s:.1f} s", span.activity)
        for span in activities
    ]
    return table(("from", "for", "activity"), rows, "no activity")


def _faults(recording: Recording) -> str:
    rows = [(f"{fault.time_s:.1f} s", fault.source, fault.text) for fault in recording.faults]
    texts = [(f"{time_s:.1f} s", text) for time_s, text in recording.autopilot_texts]
    return table(("at", "source", "fault"), rows, "no faults") + table(
        ("at", "autopilot message"), texts, "no messages from the autopilot"
    )


def _beams(recording: Recording) -> str:
    rows = [
        (use.beam.value, *(f"{100 * use.shares.get(state, 0.0):.1f} %" for state in RangeState))
        for use in beam_uses(recording)
    ]
    return table(("beam", *(state.value for state in RangeState)), rows, "no reading")


def table(heads: Sequence[str], rows: Iterable[Sequence[str]], when_empty: str) -> str:
    rows = list(rows)
    if not rows:
        return f"<p class='none'>{escape(when_empty)}</p>"
    head = "".join(f"<th>{escape(text)}</th>" for text in heads)
    body = "".join(
        "<tr>" + "".join(f"<td>{escape(text)}</td>" for text in row) + "</tr>" for row in rows
    )
    return f"<table><thead><tr>{head}</tr></thead><tbody>{body}</tbody></table>"
