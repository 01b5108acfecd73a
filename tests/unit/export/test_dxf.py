"""What CAD programs find in a DXF: blocks with attributes, hatches, dashes, readable dimensions."""

import math
from dataclasses import replace
from pathlib import Path

import ezdxf.filemanagement
import pytest
import shapely
from ezdxf.document import Drawing
from ezdxf.entities import Dimension as DxfDimension
from ezdxf.entities import Hatch
from ezdxf.entities.boundary_paths import PolylinePath
from ezdxf.entities.insert import Insert
from ezdxf.path import make_path

from companion.export.dxf.write import write_dxf
from companion.export.plan.labels import Labels
from companion.export.plan.sheet import choose_sheet
from companion.export.plan.survey import Survey, survey
from companion.export.plan.turned import Up, turned
from tests.unit.export.plans import THICK_M, two_rooms_with_a_doorway

LABELS = Labels("Flat 3, 2026-11-30")
DOOR_M = 0.9


@pytest.fixture(scope="module")
def house() -> Survey:
    found = survey(two_rooms_with_a_doorway(DOOR_M))
    return replace(found, openings=tuple(replace(each, sigma_m=0.03) for each in found.openings))


def written(survey: Survey, path: Path, labels: Labels = LABELS) -> Drawing:
    write_dxf(survey, path, labels)
    document = ezdxf.filemanagement.readfile(path)
    audit = document.audit()
    assert not audit.errors
    assert not audit.fixes
    return document


def inserted(document: Drawing, name: str) -> Insert:
    """The only block of a name."""
    (found,) = document.modelspace().query(f'INSERT[name=="{name}"]')
    assert isinstance(found, Insert)
    return found


def words(block: Insert) -> dict[str, str]:
    return {each.dxf.tag: each.dxf.text for each in block.attribs}


def test_an_opening_is_a_block_with_its_width_and_tolerance(house: Survey, tmp_path: Path) -> None:
    block = inserted(written(house, tmp_path / "house.dxf"), "OPENING")
    assert block.dxf.layer == "OPENINGS"
    assert words(block) == {"WIDTH": "0.900", "TOLERANCE": "0.060"}
    assert all(each.is_invisible for each in block.attribs)
    (line,) = block.virtual_entities()
    ends = sorted((end.x, end.y) for end in make_path(line).control_vertices())
    assert ends == [pytest.approx((4.0, 1.0)), pytest.approx((4.0, 1.0 + DOOR_M))]


def test_a_width_without_a_tolerance_has_none(house: Survey, tmp_path: Path) -> None:
    openings = tuple(replace(each, sigma_m=0.0) for each in house.openings)
    document = written(replace(house, openings=openings), tmp_path / "house.dxf")
    assert words(inserted(document, "OPENING"))["TOLERANCE"] == ""


def test_the_width_of_an_opening_is_written_beside_it(house: Survey, tmp_path: Path) -> None:
    space = written(house, tmp_path / "house.dxf").modelspace()
    (text,) = space.query('TEXT[layer=="DIMENSIONS"]')
    assert text.dxf.text == "0.90 %%p 0.06"
    assert text.dxf.rotation == pytest.approx(90)
    assert abs(text.dxf.align_point.y - (1.0 + DOOR_M / 2)) < 0.1
    assert 0.1 < abs(text.dxf.align_point.x - 4.0) < 0.5


def test_the_dashes_of_an_opening_are_short_on_the_paper(house: Survey, tmp_path: Path) -> None:
    document = written(house, tmp_path / "house.dxf")
    pattern = document.linetypes.get("DASHES").pattern_tags.tags
    longest = max(abs(tag.value) for tag in pattern if tag.code == 49)
    dash_m = longest * document.header["$LTSCALE"]
    assert dash_m / choose_sheet(house, LABELS.contents).m_per_mm == pytest.approx(2.0)


def test_a_wall_seen_from_both_sides_is_a_solid_hatch(house: Survey, tmp_path: Path) -> None:
    space = written(house, tmp_path / "house.dxf").modelspace()
    area_m2 = 0.0
    for hatch in space.query('HATCH[layer=="WALLS-SOLID"]'):
        assert isinstance(hatch, Hatch)
        assert hatch.has_solid_fill
        for ring in hatch.paths:
            assert isinstance(ring, PolylinePath)
            area_m2 += shapely.Polygon([(x, y) for x, y, _ in ring.vertices]).area
    assert area_m2 == pytest.approx((5.0 - DOOR_M) * THICK_M)


def test_the_title_block_has_title_accuracy_scale_and_north(house: Survey, tmp_path: Path) -> None:
    labels = replace(LABELS, heading_rad=math.radians(30), up=Up.TAKE_OFF)
    document = written(house, tmp_path / "house.dxf", labels)
    said = words(inserted(document, "TITLE"))
    assert said["TITLE"] == LABELS.title
    assert said["FACTS"].startswith("2 rooms, 40")
    assert "19 of 20 within 2 cm" in said["FACTS"]
    assert said["SCALE"] == "1 : 50 on A4"
    arrow = inserted(document, "ARROW")
    assert words(arrow) == {"NAME": "N"}
    assert arrow.dxf.rotation == pytest.approx(30)  # true north is to the left of the heading


def test_the_arrow_is_the_first_heading_if_north_is_not_known(
    house: Survey, tmp_path: Path
) -> None:
    aslant = replace(house, plan=turned(house.plan, math.radians(-20)))
    arrow = inserted(written(aslant, tmp_path / "house.dxf"), "ARROW")
    assert words(arrow) == {"NAME": "heading"}
    assert arrow.dxf.rotation == pytest.approx(20, abs=0.1)


def test_the_title_block_is_below_the_plan(house: Survey, tmp_path: Path) -> None:
    document = written(house, tmp_path / "house.dxf")
    assert inserted(document, "TITLE").dxf.insert.y < 0
    assert document.header["$EXTMIN"][1] < inserted(document, "TITLE").dxf.insert.y


@pytest.mark.parametrize("turn_deg", [-0.5, 0.0, 0.5])
def test_dimensions_are_readable_from_below_and_from_the_right(
    house: Survey, tmp_path: Path, turn_deg: float
) -> None:
    aslant = house.turned(math.radians(turn_deg))
    document = written(aslant, tmp_path / "house.dxf", replace(LABELS, up=Up.TAKE_OFF))
    dimensions = [
        each for each in document.modelspace().query("DIMENSION") if isinstance(each, DxfDimension)
    ]
    assert dimensions
    for each in dimensions:
        for text in each.virtual_entities():
            if text.dxftype() in {"TEXT", "MTEXT"}:
                assert -85 < (text.dxf.rotation + 180) % 360 - 180 <= 95
