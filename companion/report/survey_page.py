"""Writes the report of a survey as one HTML page: what each flight added, and what is left."""

from collections.abc import Sequence
from html import escape
from pathlib import Path

from companion.core.figures import Axes, Figure, LineCollection, own_style
from companion.core.frames import Vector2
from companion.export.colours import flight_colour
from companion.export.plan.survey import Survey, survey
from companion.recording.reader import Recording
from companion.report.numbers import ending, recorded_s, walls_mapped
from companion.report.page import Head, filled, map_tables, save_page, table
from companion.report.pictures import INK, ROOM, STYLE, svg
from companion.survey.added import AddedPiece, pieces_added, walls_added_m
from companion.survey.left import Left
from companion.survey.merge import Merged


def write_survey_report(
    merged: Merged, recordings: Sequence[Recording], left: Left, folder: Path, path: Path
) -> None:
    """Write the report. `recordings`: those of `merged.flights`.

    Raises:
        OutputError: the file cannot be written.
    """
    found, pieces = survey(merged.plan), pieces_added(merged)
    is_complete = left.is_nothing
    head = Head(
        f"Survey {folder.name}",
        "complete" if is_complete else left.in_words(),
        is_complete,
        _facts(merged, recordings, found, left),
    )
    text = filled(
        "survey.html",
        head,
        plan=_plan_picture(merged, found, pieces, left),
        flights=_flights(merged, recordings, pieces),
        left_out=table(
            ("flight", "reason"),
            [(each.name, each.reason) for each in merged.left_out],
            "every flight is in the map",
        ),
        changes=_changes(merged),
        tables=map_tables(found),
        folder=escape(folder.name),
    )
    save_page(text, path)


def _facts(
    merged: Merged, recordings: Sequence[Recording], found: Survey, left: Left
) -> list[tuple[str, str]]:
    walls = merged.plan.walls
    length_m, sigma_m = walls_mapped(merged.plan)
    return [
        ("flights", f"{len(merged.flights)}"),
        ("recorded", f"{sum(map(recorded_s, recordings)) / 60:.1f} min"),
        ("walls", f"{len(walls)}, {length_m:.1f} m"),
        ("wall uncertainty", f"± {100 * sigma_m:.1f} cm (1 σ)"),
        ("rooms", f"{len(found.rooms)}, {sum(room.area_m2 for room in found.rooms):.1f} m²"),
        ("places left", f"{len(left.places_ne_m)}"),
        ("edge to unseen space", f"{left.edge_m:.1f} m"),
    ]


def _flights(merged: Merged, recordings: Sequence[Recording], pieces: Sequence[AddedPiece]) -> str:
    added_m = walls_added_m(pieces, len(merged.flights))
    rows = []
    for number, (flight, recording) in enumerate(zip(merged.flights, recordings, strict=True)):
        north_m, east_m, _ = flight.off_the_pad.tolist()
        rows.append(
            (
                f"{number + 1}",
                flight.name,
                f"{recorded_s(recording):.0f} s",
                ending(recording),
                f"{100 * float((north_m**2 + east_m**2) ** 0.5):.0f} cm",
                f"{added_m[number]:.1f} m",
                f"{flight.shared_walls}",
            )
        )
    heads = ("", "flight", "time", "ended", "began off the pad", "walls added", "walls shared")
    return table(heads, rows, "no flight")


def _changes(merged: Merged) -> str:
    rows = [
        (
            "new" if change.is_new else "gone",
            merged.flights[change.flight].name,
            _place(change.start_ne_m),
            _place(change.end_ne_m),
        )
        for change in merged.changes
    ]
    return table(("wall", "since", "from (north, east), m", "to"), rows, "nothing has changed")


def _place(place_ne_m: Vector2) -> str:
    return f"({place_ne_m[0]:.2f}, {place_ne_m[1]:.2f})"


def _plan_picture(merged: Merged, found: Survey, pieces: Sequence[AddedPiece], left: Left) -> str:
    """Draw walls by the flight that detected them first, paths, changes and what is left."""
    with own_style(STYLE):
        figure = Figure(figsize=(7.6, 7.0), layout="constrained")
        axes = figure.add_subplot(aspect="equal")
        axes.set_xlabel("east of the pad, m")
        axes.set_ylabel("north (first heading), m")
        for room in found.rooms:
            axes.fill([e for _, e in room.outline_ne_m], [n for n, _ in room.outline_ne_m], ROOM)
        for number, poses in enumerate(merged.plan.paths):
            path, colour = [pose.ne_m for pose in poses], flight_colour(number)
            walls = [
                [piece.start_ne_m, piece.end_ne_m] for piece in pieces if piece.flight == number
            ]
            _draw(axes, walls, colour, 2.5)
            _draw(axes, [path], colour, 0.8)
            axes.plot([], [], color=colour, label=f"flight {number + 1}")
        for change in merged.changes:
            style = "-" if change.is_new else ":"
            ends = [change.start_ne_m, change.end_ne_m]
            axes.plot([e for _, e in ends], [n for n, _ in ends], style, color=INK, linewidth=1.2)
        for north_m, east_m in left.places_ne_m:
            axes.plot(east_m, north_m, "o", markersize=7, markerfacecolor="none", color=INK)
        pads = [flight.pad.tolist() for flight in merged.flights if flight.pad is not None]
        for north_m, east_m in {(north_m, east_m) for north_m, east_m, _ in pads}:
            axes.plot(east_m, north_m, marker="^", markersize=9, color=INK)
            axes.annotate("pad", (east_m, north_m), (7, 5), textcoords="offset points", color=INK)
        axes.autoscale_view()
        axes.legend(frameon=False, loc="upper left", bbox_to_anchor=(1.0, 1.0))
        return svg(figure)


def _draw(axes: Axes, lines: Sequence[Sequence[Vector2]], colour: str, width: float) -> None:
    flat = [[(east_m, north_m) for north_m, east_m in line] for line in lines if line]
    axes.add_collection(LineCollection(flat, colors=colour, linewidths=width))
