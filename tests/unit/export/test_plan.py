"""The drawn plan: squared, with thick walls, furniture, and texts that do not overlap."""

import math
from dataclasses import replace
from itertools import combinations
from pathlib import Path

import ezdxf.filemanagement
import pytest
import shapely
import shapely.affinity
from ezdxf.entities import Dimension as DxfDimension
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.errors import ConfigError
from companion.core.frames import Vector2
from companion.core.messages import FloorPlan
from companion.export.dxf.write import write_dxf
from companion.export.plan.building import building
from companion.export.plan.dimensions import CHARACTER, Dimension
from companion.export.plan.drawing import Contents, draw
from companion.export.plan.labels import Labels
from companion.export.plan.room_names import read_room_names
from companion.export.plan.sheet import choose_sheet, sheet_figure, write_svg
from companion.export.plan.survey import Survey, survey
from companion.export.plan.turned import Up, main_direction_rad, turned, up_rad
from tests.unit.export.plans import THICK_M, ring, seen, two_rooms, wall

LABELS = Labels("a flight", heading_rad=math.radians(30))
SCALE = 100
WORD_LETTERS = "abcmW 0"


@given(st.floats(-44, 44), st.floats(12, 78))
def test_the_main_walls_stand_upright_at_any_heading_of_take_off(
    turn_deg: float, shelf_deg: float
) -> None:
    """A shelf aslant in the room does not turn the plan."""
    room = ring((0.0, 0.0), (6.0, 0.0), (6.0, 9.0), (0.0, 9.0))
    aslant = math.radians(shelf_deg)
    shelf = wall((2.0, 2.0), (2.0 + 2 * math.cos(aslant), 2.0 + 2 * math.sin(aslant)))
    plan = turned(FloorPlan(walls=(*room, shelf)), -math.radians(turn_deg))
    assert math.degrees(main_direction_rad(plan.walls)) == pytest.approx(turn_deg, abs=0.01)
    for each in turned(plan, up_rad(plan, Up.WALLS, 0.0)).walls[:4]:
        off_m = [abs(a - b) for a, b in zip(each.start_ne_m, each.end_ne_m, strict=True)]
        assert min(off_m) < 0.01


@pytest.mark.parametrize(
    ("up", "wanted_deg"), [(Up.TAKE_OFF, 0.0), (Up.NORTH, -30.0), (Up.WALLS, 20.0)]
)
def test_walls_the_heading_or_true_north_can_be_up(up: Up, wanted_deg: float) -> None:
    room = turned(two_rooms(), -math.radians(20))
    assert math.degrees(replace(LABELS, up=up).up_rad(room)) == pytest.approx(wanted_deg, abs=0.5)


def test_a_wall_seen_from_both_sides_is_solid_and_has_its_thickness() -> None:
    (solid,) = building(two_rooms()).solids
    assert solid.thickness_m == pytest.approx(THICK_M)
    assert shapely.Polygon(solid.ring_ne_m).area == pytest.approx(5 * THICK_M)


def test_the_space_between_two_walls_of_a_corridor_is_no_wall() -> None:
    corridor = [wall((0.0, 0.0), (6.0, 0.0)), wall((0.0, 0.45), (6.0, 0.45))]
    assert not building(seen(corridor, (1.0, 0.22), (5.0, 0.22))).solids


def test_the_outer_walls_were_seen_from_inside() -> None:
    outer = [face for face in building(two_rooms()).faces if face.start_ne_m[1] == 0.0]
    assert outer
    for face in outer:
        if face.end_ne_m[1] == 0.0:
            assert face.behind_ne == pytest.approx((0.0, -1.0))


def test_what_stands_free_is_furniture_and_gets_no_dimension(tmp_path: Path) -> None:
    plan = two_rooms()
    parts = building(plan)
    assert parts.furniture == plan.walls[8:]
    write_dxf(survey(plan), tmp_path / "plan.dxf", LABELS)
    space = ezdxf.filemanagement.readfile(tmp_path / "plan.dxf").modelspace()
    assert len(space.query('LINE[layer=="FURNITURE"]')) == 4
    assert len(space.query('LINE[layer=="WALLS"]')) == 8
    dimensions = [each for each in space.query("DIMENSION") if isinstance(each, DxfDimension)]
    measured = sorted(each.get_measurement() for each in dimensions)
    assert measured == pytest.approx([4, 4, 4, 4, 5, 5, 5, 8 + THICK_M])


def test_a_short_map_is_all_building() -> None:
    """Before a long wall is seen nothing can be told apart."""
    plan = FloorPlan(walls=(wall((0.0, 0.0), (1.0, 0.0)),))
    assert building(plan).walls == plan.walls


def box(dimension: Dimension) -> shapely.Polygon:
    """The rectangle of a text on the paper, m."""
    height_m = dimension.height_mm * SCALE / 1000
    half_m = CHARACTER * height_m * len(dimension.text) / 2
    text = shapely.box(-half_m, -height_m / 2, half_m, height_m / 2)
    turn = shapely.affinity.rotate(text, dimension.angle_rad, origin=(0, 0), use_radians=True)
    return shapely.affinity.translate(turn, *dimension.text_xy_m)


corner = st.tuples(st.floats(0, 10), st.floats(0, 10))


@given(st.lists(st.tuples(corner, corner), min_size=1, max_size=25))
def test_no_text_lies_on_another_or_on_a_line(pieces: list[tuple[Vector2, Vector2]]) -> None:
    walls = [wall(*piece) for piece in pieces if math.dist(*piece) > 0.2]
    drawing = draw(FloorPlan(walls=tuple(walls)), (), (), Contents(), SCALE / 1000)
    texts = [box(each) for each in drawing.dimensions]
    for one, other in combinations(texts, 2):
        assert not one.intersects(other)
    for text in texts:
        for each in walls:
            line = shapely.LineString([each.start_ne_m[::-1], each.end_ne_m[::-1]])
            assert not line.intersects(text)
        for drawn in drawing.dimensions:
            assert not shapely.LineString(drawn.line.reshape(2, 2)).intersects(text)


@pytest.mark.parametrize("east_m", [2.5, 4.0, 5.5])
def test_the_name_of_a_room_is_not_on_furniture(east_m: float) -> None:
    """A board stands in the middle of the room of 5 m by 8 m."""
    room = ring((0.0, 0.0), (5.0, 0.0), (5.0, 8.0), (0.0, 8.0))
    board = wall((2.0, east_m), (3.0, east_m))
    plan = seen([*room, board], (1.0, 1.0), (4.0, 1.0), (1.0, 7.0), (4.0, 7.0))
    names = draw(plan, survey(plan).rooms, (), Contents(), SCALE / 1000).labels
    line = shapely.LineString([(east_m, 2.0), (east_m, 3.0)])
    assert names
    for label in names:
        assert line.distance(shapely.Point(label.at_xy_m)) > 1.0


def test_an_office_of_16_by_10_m_fits_on_a4_at_any_heading() -> None:
    office = FloorPlan(walls=tuple(ring((0.0, 0.0), (16.0, 0.0), (16.0, 10.0), (0.0, 10.0))))
    squared = survey(turned(office, -0.3)).turned(-up_rad(turned(office, 0.3), Up.WALLS, 0.0))
    assert choose_sheet(squared, Contents()).paper == "A4"


def test_an_unfinished_map_says_so_on_the_sheet_and_in_cad(tmp_path: Path) -> None:
    unfinished = replace(LABELS, unfinished="turned back with 40 % of the battery")
    for labels, is_said in ((LABELS, False), (unfinished, True)):
        write_svg(survey(two_rooms()), tmp_path / "plan.svg", labels)
        assert ("INCOMPLETE" in (tmp_path / "plan.svg").read_text()) == is_said
        write_dxf(survey(two_rooms()), tmp_path / "plan.dxf", labels)
        space = ezdxf.filemanagement.readfile(tmp_path / "plan.dxf").modelspace()
        texts = [text.dxf.text for text in space.query("TEXT")]
        assert any("40 % of the battery" in text for text in texts) == is_said


TALL_AND_WIDE = [
    survey(FloorPlan(tuple(ring((0.0, 0.0), (north_m, 0.0), (north_m, 5.0), (0.0, 5.0)))))
    for north_m in (14.0, 3.0)
]


@settings(deadline=None, max_examples=30)
@given(
    st.sampled_from(TALL_AND_WIDE),
    st.text(WORD_LETTERS, max_size=120),
    st.text(WORD_LETTERS, max_size=120),
)
def test_the_words_of_the_title_block_fit_on_the_paper(
    tall_or_wide: Survey, title: str, unfinished: str
) -> None:
    labels = Labels(title, unfinished=unfinished, up=Up.TAKE_OFF)
    sheet = sheet_figure(tall_or_wide, labels)
    words = [text.get_window_extent() for text in sheet.axes[-1].texts if text.get_text()]
    paper = shapely.box(*sheet.bbox.extents)
    assert all(paper.contains(shapely.box(*box.extents)) for box in words)
    assert not any(one.overlaps(other) for one, other in combinations(words, 2))


def test_the_path_and_the_points_can_be_left_out(tmp_path: Path) -> None:
    for contents, number in ((Contents(), 1), (Contents(path=False, points=False), 0)):
        write_dxf(survey(two_rooms()), tmp_path / "plan.dxf", replace(LABELS, contents=contents))
        space = ezdxf.filemanagement.readfile(tmp_path / "plan.dxf").modelspace()
        assert len(space.query('LWPOLYLINE[layer=="PATH"]')) == number
        assert bool(space.query("POINT")) == bool(number)


def test_rooms_get_the_names_of_a_file(tmp_path: Path) -> None:
    found = survey(two_rooms())
    file = tmp_path / "names.toml"
    file.write_text('"room 1" = "Küche"\n')
    names = read_room_names(file, [room.name for room in found.rooms])
    write_svg(found, tmp_path / "plan.svg", replace(LABELS, contents=Contents(room_names=names)))
    text = (tmp_path / "plan.svg").read_text(encoding="utf-8")
    assert "Küche" in text
    assert "room 2" in text


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('"room 9" = "Attic"', "room 9 = 'Attic': no such room; the map has: room 1, room 2"),
        ('"room 1" = 3', 'room 1 = 3 is no text; write "room 1" = "Kitchen"'),
        ("room 1", "not TOML"),
        ('"room 1" = "Küche"', "line 1: byte 0xfc is not UTF-8"),
        ('"room 1" = "Kitchen\\u0007"', "room 1 = 'Kitchen\\x07': contains a control character"),
    ],
)
def test_names_that_do_not_fit_the_map_are_refused(tmp_path: Path, text: str, said: str) -> None:
    file = tmp_path / "names.toml"
    file.write_text(text, encoding="latin-1")
    with pytest.raises(ConfigError) as refused:
        read_room_names(file, ["room 1", "room 2"])
    assert str(file) in str(refused.value)
    assert said in str(refused.value)


def test_names_in_a_file_that_cannot_be_read_are_refused_in_one_line(tmp_path: Path) -> None:
    (tmp_path / "folder.toml").mkdir()
    for name, said in (
        ("missing.toml", "No such file or directory"),
        ("folder.toml", "Is a directory"),
    ):
        with pytest.raises(ConfigError) as refused:
            read_room_names(tmp_path / name, ["room 1"])
        assert str(refused.value) == f"{tmp_path / name}: {said}"
