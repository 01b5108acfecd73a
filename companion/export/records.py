"""Writes JSON with the whole content of the map: local NED, m, rad, s."""

import json
from pathlib import Path

from companion.core.messages import WallSegment
from companion.export.plan.survey import Survey


def write_json(survey: Survey, path: Path) -> None:
    """Write walls with covariance, openings, rooms and path."""
    plan = survey.plan
    record = {
        "frame": "local NED: origin at take-off, x along the first heading, z down",
        "units": {"length": "m", "angle": "rad", "time": "s", "area": "m2"},
        "ceiling_m": plan.ceiling_m,
        "walls": [_wall(wall) for wall in plan.walls],
        "openings": [
            {
                "start_ne_m": opening.start_ne_m,
                "end_ne_m": opening.end_ne_m,
                "width_m": opening.width_m,
                "sigma_m": opening.sigma_m,
            }
            for opening in survey.openings
        ],
        "rooms": [
            {
                "name": room.name,
                "area_m2": room.area_m2,
                "outline_ne_m": room.outline_ne_m,
                "holes_ne_m": room.holes_ne_m,
            }
            for room in survey.rooms
        ],
        "path": [
            {
                "time_s": pose.time_s,
                "position_ned_m": (pose.north_m, pose.east_m, pose.down_m),
                "yaw_rad": pose.yaw_rad,
            }
            for pose in plan.path
        ],
    }
    path.write_text(json.dumps(record, indent=1) + "\n", encoding="utf-8")


def _wall(wall: WallSegment) -> dict[str, object]:
    """A wall; covariance of (offset across the wall at its middle, direction): m², m·rad, rad²."""
    return {
        "start_ne_m": wall.start_ne_m,
        "end_ne_m": wall.end_ne_m,
        "length_m": wall.length_m,
        "hits": wall.hits,
        "covariance_across_direction": [[wall.sigma_m**2, 0.0], [0.0, wall.normal_sigma_rad**2]],
    }
