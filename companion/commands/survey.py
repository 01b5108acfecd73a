"""Shows, exports and reports the joint map of a survey: `companion survey`; runs on a laptop."""

from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer
from rich.console import Console
from rich.table import Table

from companion.commands.recording import Format
from companion.core.errors import SurveyError
from companion.core.extras import needs_extra

if TYPE_CHECKING:
    from companion.survey.folder import Survey, SurveyMap
    from companion.survey.left import Left

EXIT_LEFT = 1
"""Exit status of `status` if something is left to fly. Chosen."""


class What(StrEnum):
    """What to do with a survey."""

    STATUS = "status"
    MAP = "map"
    EXPORT = "export"
    REPORT = "report"


commands = typer.Typer()
Formats = Annotated[
    list[Format] | None, typer.Option("--format", help="Of the export; repeatable; default dxf.")
]


@commands.command("survey")
def survey_command(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the survey.")],
    what: Annotated[What, typer.Argument(help="status, map, export or report.")] = What.STATUS,
    format_: Formats = None,
) -> None:
    """Show a survey's flights and what is left, or write its map or report; see docs/surveys.md.

    Exit status 1 of `status` if something is left to fly.
    """
    from companion.survey.folder import Survey  # noqa: PLC0415 - not for the drone
    from companion.survey.left import left_to_fly  # noqa: PLC0415

    console = Console(highlight=False, markup=False)
    survey = Survey(folder, lambda line: console.print(line, soft_wrap=True))
    if not survey.files:
        raise SurveyError(f"{folder}: no recordings; fly with: companion fly --survey {folder}")
    joint = survey.make_map()
    if joint is None:
        raise SurveyError(f"{folder}: no recording can be used: {survey.index.left_out}")
    left = left_to_fly(joint.earlier, joint.recordings[-1].config)
    if what is What.EXPORT:
        _export(joint, left, folder, [each.value for each in format_ or [Format("dxf")]])
    console.print(_table(survey, joint))
    for name, reason in survey.index.left_out.items():
        console.print(f"not in the map: {name}: {reason}", soft_wrap=True)
    for change in joint.merged.changes:
        found_by = joint.merged.flights[change.flight].name
        console.print(change.in_words(found_by), soft_wrap=True)
    console.print(left.in_words())
    if what is What.REPORT:
        _report(joint, left, folder)
    if what is What.STATUS and not left.is_nothing:
        raise typer.Exit(EXIT_LEFT)


def _table(survey: "Survey", joint: "SurveyMap") -> Table:
    """A row for each flight: when, how long, how it ended, what it added."""
    from companion.report.numbers import recorded_s  # noqa: PLC0415 - not for the drone
    from companion.survey.added import pieces_added, walls_added_m  # noqa: PLC0415

    table = Table(title=f"survey {survey.folder}", title_justify="left")
    for column in ("flight", "time", "ended", "off the pad", "walls added"):
        table.add_column(column)
    added_m = walls_added_m(pieces_added(joint.merged), len(joint.merged.flights))
    for flight, recording, wall_m in zip(
        joint.merged.flights, joint.recordings, added_m, strict=True
    ):
        ended = recording.phases[-1] if recording.phases else None
        state = (ended.trouble or ended.activity) if ended else "cut short"
        flown_s = recorded_s(recording)
        north_m, east_m, _ = flight.off_the_pad.tolist()
        off_cm = 100 * (north_m**2 + east_m**2) ** 0.5
        table.add_row(flight.name, f"{flown_s:.0f} s", state, f"{off_cm:.0f} cm", f"{wall_m:.1f} m")
    length_m = sum(wall.length_m for wall in joint.merged.plan.walls)
    table.caption = f"{len(joint.merged.plan.walls)} walls, {length_m:.1f} m in all"
    return table


def _report(joint: "SurveyMap", left: "Left", folder: Path) -> None:
    path = folder / "survey.html"
    with needs_extra("export"):
        from companion.report.survey_page import write_survey_report  # noqa: PLC0415

        write_survey_report(joint.merged, joint.recordings, left, folder, path)
    print(path)


def _export(joint: "SurveyMap", left: "Left", folder: Path, formats: list[str]) -> None:
    with needs_extra("export"):
        from companion.export.formats import export  # noqa: PLC0415 - not for the drone
        from companion.export.plan.labels import Labels  # noqa: PLC0415
        from companion.export.plan.survey import survey  # noqa: PLC0415

        link = joint.recordings[0].config.link
        unfinished = "" if left.is_nothing else left.in_words()
        labels = Labels(f"Survey {folder.name}", link.place, unfinished=unfinished)
        export(survey(joint.merged.plan), formats, folder, "survey", labels, tell=print)
