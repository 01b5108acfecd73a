"""Blocks of a DXF with attributes, which CAD programs list and edit.

OPENING  from 0 to 1 along x, stretched to the opening; WIDTH and TOLERANCE, invisible
TITLE    below the plan, in mm of paper; TITLE, FACTS, NOTES and SCALE
ARROW    along y, in mm of paper; NAME
"""

import math

from ezdxf.document import Drawing as Document
from ezdxf.enums import TextEntityAlignment
from ezdxf.layouts.layout import Modelspace
from ezdxf.math import Vec2

from companion.core.values import value
from companion.export.plan.drawing import Doorway, Layer
from companion.export.plan.title import Arrow

OPENING, TITLE, ARROW = "OPENING", "TITLE", "ARROW"
"""Names of the blocks."""
DASHES = "DASHES"
"""Name of the line type of dashed lines."""
TITLE_WIDTH_MM, TITLE_HEIGHT_MM = 140.0, 24.0
"""Size of the title block, mm. Chosen."""
TITLE_LINES_MM = {"TITLE": (-7.0, 3.9), "FACTS": (-13.0, 2.0), "NOTES": (-18.0, 2.0)}
"""Base line below the upper edge, and height of capitals, of each text of the title block, mm.
Chosen."""
SCALE_MM = (-22.5, 2.0)
"""The same for the scale, mm. Chosen."""
ARROW_MM, HEAD_MM, HALF_HEAD_MM = 5.5, 3.0, 0.9
"""Half the length of the arrow, and length and half width of its head, mm. Chosen."""
ATTRIBUTE_M = 0.1
"""Height of the invisible attributes of an opening, m. Chosen."""


@value
class Title:
    """The words of the title block."""

    title: str
    facts: str
    notes: str
    scale: str
    arrow: Arrow


def define(document: Document) -> None:
    """Define the blocks. What they draw is on layer 0, so it has the layer of the insertion."""
    opening = document.blocks.new(OPENING)
    opening.add_line((0, 0), (1, 0), dxfattribs={"linetype": DASHES})
    for number, tag in enumerate(("WIDTH", "TOLERANCE")):
        hidden = opening.add_attdef(tag, (0, number * ATTRIBUTE_M), height=ATTRIBUTE_M)
        hidden.is_invisible = True
    title = document.blocks.new(TITLE)
    title.add_line((0, 0), (TITLE_WIDTH_MM, 0))
    for tag, (base_mm, height_mm) in (*TITLE_LINES_MM.items(), ("SCALE", SCALE_MM)):
        title.add_attdef(tag, (0, base_mm), height=height_mm)
    arrow = document.blocks.new(ARROW)
    arrow.add_line((0, -ARROW_MM), (0, ARROW_MM))
    neck_mm = ARROW_MM - HEAD_MM
    arrow.add_solid([(-HALF_HEAD_MM, neck_mm), (HALF_HEAD_MM, neck_mm), (0, ARROW_MM)])


def insert_opening(space: Modelspace, doorway: Doorway) -> None:
    """Insert an opening at its place, with its width."""
    start, end = Vec2(doorway.start_xy_m), Vec2(doorway.end_xy_m)
    width_m = (end - start).magnitude
    block = space.add_blockref(
        OPENING,
        start,
        dxfattribs={
            "layer": Layer.OPENINGS,
            "xscale": width_m,
            "rotation": math.degrees((end - start).angle),
        },
    )
    for tag, text in (
        ("WIDTH", f"{width_m:.3f}"),
        ("TOLERANCE", f"{doorway.tolerance_m:.3f}" if doorway.tolerance_m else ""),
    ):
        hidden = block.add_attrib(
            tag, text, start, dxfattribs={"layer": Layer.OPENINGS, "height": ATTRIBUTE_M}
        )
        hidden.is_invisible = True


def insert_title(space: Modelspace, title: Title, upper_left_m: Vec2, m_per_mm: float) -> None:
    """Insert the title block and the arrow below a place."""
    attributes = {"layer": Layer.TITLE, "xscale": m_per_mm, "yscale": m_per_mm, "zscale": m_per_mm}
    block = space.add_blockref(TITLE, upper_left_m, dxfattribs=attributes)
    block.add_auto_attribs(
        {"TITLE": title.title, "FACTS": title.facts, "NOTES": title.notes, "SCALE": title.scale}
    )
    middle_m = upper_left_m + m_per_mm * Vec2(TITLE_WIDTH_MM - ARROW_MM, -9.5)
    arrow = space.add_blockref(
        ARROW,
        middle_m,
        dxfattribs={**attributes, "rotation": -math.degrees(title.arrow.heading_rad)},
    )
    below_m = middle_m - m_per_mm * Vec2(0, ARROW_MM + 4)
    name = arrow.add_attrib(
        "NAME", title.arrow.name, dxfattribs={"layer": Layer.TITLE, "height": 2 * m_per_mm}
    )
    name.set_placement(below_m, align=TextEntityAlignment.MIDDLE_CENTER)
