"""The borders of an unfinished map: dashed where free space ends and nothing was seen beyond."""

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import ezdxf.filemanagement
import matplotlib.image
import numpy as np
import pytest
import shapely

from companion.core.messages import FloorPlan
from companion.export.dxf.write import write_dxf
from companion.export.map_files import save
from companion.export.plan.figure import WARNING
from companion.export.plan.labels import Labels
from companion.export.plan.sheet import write_pdf, write_svg
from companion.export.plan.survey import Survey, survey
from companion.export.plan.turned import Up
from companion.export.plan.unseen import unseen_borders
from tests.unit.export.plans import seen, two_rooms_with_a_doorway, wall

DOOR_M = 1.2
FINISHED = Labels("a flight", up=Up.TAKE_OFF)
UNFINISHED = replace(FINISHED, unfinished="turned back with 40 % of the battery")


def first_room() -> FloorPlan:
    """One room of 5 m by 4 m, from which a doorway leads to what was not seen."""
    corners = (0.0, 4.0), (0.0, 0.0), (5.0, 0.0), (5.0, 4.0), (1.0 + DOOR_M, 4.0)
    walls = [wall(a, b) for a, b in pairwise(corners)]
    places = (4.0, 2.0), (1.6, 2.0), (1.6, 3.9), (3.0, 1.0)
    return seen([*walls, wall((1.0, 4.0), (0.0, 4.0))], *places)


@pytest.fixture(scope="module")
def half() -> Survey:
    return survey(first_room())


def test_a_doorway_to_an_unseen_room_is_a_border(half: Survey) -> None:
    (border,) = unseen_borders(half.plan)
    doorway = shapely.LineString([(1.0, 4.0), (1.0 + DOOR_M, 4.0)])
    line = shapely.LineString(border)
    assert 0.5 * DOOR_M < line.length < 1.2 * DOOR_M
    assert line.hausdorff_distance(doorway) < 0.4


def test_a_house_that_was_seen_has_no_border() -> None:
    assert unseen_borders(two_rooms_with_a_doorway(DOOR_M)) == ()


def test_an_empty_map_has_no_border() -> None:
    assert unseen_borders(FloorPlan()) == ()


def test_where_walls_are_missing_the_border_is_as_long_as_they_are(half: Survey) -> None:
    """The wall of 5 m to the west and that of 4 m to the north are not in the map."""
    fewer = tuple(each for each in half.plan.walls if 5.0 not in each.end_ne_m)
    found = unseen_borders(replace(half.plan, walls=fewer))
    lengths_m = sorted(shapely.LineString(border).length for border in found)
    assert lengths_m == [pytest.approx(0.8, abs=0.3), pytest.approx(9.0, abs=1.0)]


def test_cad_has_the_borders_of_an_unfinished_map_only(half: Survey, tmp_path: Path) -> None:
    for labels, number in ((FINISHED, 0), (UNFINISHED, 1)):
        write_dxf(half, tmp_path / "plan.dxf", labels)
        document = ezdxf.filemanagement.readfile(tmp_path / "plan.dxf")
        assert not document.audit().errors
        assert len(document.modelspace().query('LWPOLYLINE[layer=="UNSEEN"]')) == number
        assert document.layers.get("UNSEEN").dxf.linetype == "DASHES"


def test_the_sheet_has_the_borders_of_an_unfinished_map_only(half: Survey, tmp_path: Path) -> None:
    for labels, is_there in ((FINISHED, False), (UNFINISHED, True)):
        write_svg(half, tmp_path / "plan.svg", labels)
        text = (tmp_path / "plan.svg").read_text(encoding="utf-8")
        assert ("stroke-dasharray" in text and f"stroke: {WARNING}" in text) == is_there
        assert ("nothing was seen beyond" in text) == is_there
    write_pdf(half, tmp_path / "plan.pdf", UNFINISHED)
    assert (tmp_path / "plan.pdf").stat().st_size


def test_the_picture_of_an_unfinished_flight_says_so(half: Survey, tmp_path: Path) -> None:
    """Red dashes, and the pale red of the stamp."""
    reds = []
    for unfinished in ("", "landed: turned back with 40 % of the battery"):
        save(half.plan, tmp_path, unfinished)
        red, green, blue = matplotlib.image.imread(tmp_path / "map.png")[..., :3].transpose(2, 0, 1)
        reds.append(np.count_nonzero((red > green + 0.15) & (abs(green - blue) < 0.1)))
    assert reds[1] > reds[0] + 5000
