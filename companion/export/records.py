"""Writes JSON with the whole content of the map, as `map_record` defines it."""

from pathlib import Path

from companion.export.map_record import OpeningRecord, RoomRecord, in_json, map_record
from companion.export.plan.survey import Survey


def write_json(survey: Survey, path: Path) -> None:
    """Write walls with covariance, openings, rooms and path; local NED, m, rad, s."""
    rooms = (
        RoomRecord(room.name, room.area_m2, room.outline_ne_m, room.holes_ne_m)
        for room in survey.rooms
    )
    openings = (
        OpeningRecord(each.start_ne_m, each.end_ne_m, each.width_m, each.sigma_m)
        for each in survey.openings
    )
    record = map_record(survey.plan, tuple(rooms), tuple(openings), with_positions=True)
    path.write_text(in_json(record), encoding="utf-8")
