"""The words and the arrow of the title block, for paper and CAD."""

from typing import TYPE_CHECKING

from companion.core.messages import FloorPlan
from companion.core.values import value
from companion.export.plan.labels import Labels

if TYPE_CHECKING:  # it needs a library that the drone does without
    from companion.export.plan.survey import Survey

INCOMPLETE = "INCOMPLETE"
"""Word on an unfinished map."""
MEASURED = "metres, measured between surfaces"
"""What the dimensions are."""


@value
class Arrow:
    """An arrow on the paper."""

    name: str
    heading_rad: float
    """Clockwise from what is up on the paper."""


def facts(survey: "Survey") -> str:
    """Rooms, walls, accuracy and height in words."""
    plan = survey.plan
    area_m2 = sum(room.area_m2 for room in survey.rooms)
    length_m = sum(wall.length_m for wall in plan.walls)
    sigma_m = sum(wall.length_m * wall.sigma_m for wall in plan.walls) / (length_m or 1.0)
    rooms = f"{len(survey.rooms)} room{'' if len(survey.rooms) == 1 else 's'}, {area_m2:.1f} m²"
    said = [rooms] if survey.rooms else []
    accuracy = f"19 of 20 within {200 * sigma_m:.0f} cm as seen from the take-off"
    said.append(f"{length_m:.1f} m of wall, {accuracy}")
    if plan.ceiling_m is not None:
        said.append(f"ceiling {plan.ceiling_m:.2f} m")
    return "; ".join(said)


def arrow(plan: FloorPlan, labels: Labels) -> Arrow:
    """The arrow to true north; along the first heading if true north is not known.

    `plan`: in the map's frame, before it is turned.
    """
    up_rad = labels.up_rad(plan)
    if labels.heading_rad is None:
        return Arrow("heading", -up_rad)
    return Arrow("N", -(labels.heading_rad + up_rad))
