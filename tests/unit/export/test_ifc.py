"""The BIM model: IfcOpenShell finds it valid, and reads back what the drone has measured."""

import math
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import ifcopenshell
import ifcopenshell.geom
import ifcopenshell.util.element
import ifcopenshell.util.placement
import ifcopenshell.util.shape
import ifcopenshell.util.unit
import ifcopenshell.validate
import numpy as np
import pytest
import shapely
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from companion.core.frames import Place, Vector2
from companion.core.messages import FloorPlan
from companion.export.ifc.walls import NOMINAL_M, walls
from companion.export.ifc.write import DOORWAY_M, write_ifc
from companion.export.plan.building import building
from companion.export.plan.drawing import Contents
from companion.export.plan.labels import Labels
from companion.export.plan.survey import Opening, Survey, survey
from companion.export.plan.turned import turned
from tests.examples import examples
from tests.unit.export.plans import THICK_M, seen, two_rooms_with_a_doorway, wall

LABELS = Labels("a flight")
DOOR_M = 0.9
HEIGHT_M = 2.5


@pytest.fixture(scope="module")
def house() -> Survey:
    return survey(two_rooms_with_a_doorway(DOOR_M))


def written(survey: Survey, path: Path, labels: Labels = LABELS) -> ifcopenshell.file:
    write_ifc(survey, path, labels)
    model = ifcopenshell.open(path)
    assert isinstance(model, ifcopenshell.file)
    return model


def measured(entity: ifcopenshell.entity_instance, name: str) -> float:
    """A quantity of the standard."""
    quantities = ifcopenshell.util.element.get_psets(entity, qtos_only=True)
    (found,) = (each[name] for each in quantities.values() if name in each)
    return float(found)


def said(entity: ifcopenshell.entity_instance, name: str) -> object:
    """A property of our own; None if it has none of this name."""
    return ifcopenshell.util.element.get_pset(entity, "PDPS_Measurement", name)


def volume_m3(entity: ifcopenshell.entity_instance) -> float:
    shape: Any = ifcopenshell.geom.create_shape(ifcopenshell.geom.settings(), entity)
    return float(ifcopenshell.util.shape.get_volume(shape.geometry))


def complaints(path: Path, *, express_rules: bool = False) -> list[object]:
    """What IfcOpenShell's validator finds."""
    logger = ifcopenshell.validate.json_logger()
    ifcopenshell.validate.validate(path, logger, express_rules=express_rules)
    return list(logger.statements)


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # the validator's
def test_the_model_is_valid_with_all_that_can_be_said(house: Survey, tmp_path: Path) -> None:
    labels = Labels("Küche", Place(-33.5, -70.25), 0.3, "turned back with 40 % of the battery")
    openings = tuple(replace(each, sigma_m=0.03) for each in house.openings)
    written(replace(house, openings=openings), tmp_path / "house.ifc", labels)
    assert complaints(tmp_path / "house.ifc", express_rules=True) == []


def test_an_empty_map_is_a_valid_model(tmp_path: Path) -> None:
    written(survey(FloorPlan()), tmp_path / "empty.ifc")
    assert complaints(tmp_path / "empty.ifc") == []


def test_walls_are_as_thick_as_measured_and_a_nominal_thickness_says_so(
    house: Survey, tmp_path: Path
) -> None:
    model = written(house, tmp_path / "house.ifc")
    by_measured: dict[bool, list[ifcopenshell.entity_instance]] = {True: [], False: []}
    for each in model.by_type("IfcWall"):
        by_measured[bool(said(each, "IsThicknessMeasured"))].append(each)
    (partition,) = by_measured[True]
    assert measured(partition, "Width") == pytest.approx(THICK_M)
    assert measured(partition, "Length") == pytest.approx(5.0)
    assert measured(partition, "Height") == HEIGHT_M
    outer = by_measured[False]
    assert [measured(each, "Width") for each in outer] == pytest.approx([NOMINAL_M] * 4)
    lengths_m = sorted(measured(each, "Length") for each in outer)
    assert lengths_m == pytest.approx([5.0, 5.0, 8.0 + THICK_M, 8.0 + THICK_M])
    assert said(partition, "PositionSigma") == pytest.approx(0.01)


def test_a_nominal_wall_lies_behind_the_surface_that_was_seen(
    house: Survey, tmp_path: Path
) -> None:
    model = written(house, tmp_path / "house.ifc")
    settings = ifcopenshell.geom.settings()
    settings.set("use-world-coords", True)
    places = []
    for each in model.by_type("IfcWall"):
        shape: Any = ifcopenshell.geom.create_shape(settings, each)
        places.append(ifcopenshell.util.shape.get_vertices(shape.geometry))
    every = np.concatenate(places)
    low, high = every.min(axis=0), every.max(axis=0)
    assert low.tolist() == pytest.approx([-NOMINAL_M, -NOMINAL_M, 0.0])
    assert high.tolist() == pytest.approx([8.0 + THICK_M + NOMINAL_M, 5.0 + NOMINAL_M, HEIGHT_M])


def test_a_doorway_is_an_opening_without_a_door(house: Survey, tmp_path: Path) -> None:
    model = written(house, tmp_path / "house.ifc")
    assert not model.by_type("IfcDoor")
    (opening,) = model.by_type("IfcOpeningElement")
    (voids,) = opening.VoidsElements
    host = voids.RelatingBuildingElement
    assert measured(opening, "Width") == pytest.approx(DOOR_M)
    assert measured(opening, "Depth") == pytest.approx(THICK_M)
    assert said(opening, "IsHeightMeasured") is False
    solid_m3 = THICK_M * (5.0 * HEIGHT_M - DOOR_M * DOORWAY_M)
    assert volume_m3(host) == pytest.approx(solid_m3, rel=1e-3)
    place = ifcopenshell.util.placement.get_local_placement(opening.ObjectPlacement)[:3, 3]
    assert sorted(place[:2].tolist()) == pytest.approx([1.0, 4.0 + THICK_M / 2])


def test_an_opening_has_the_tolerance_of_its_width(house: Survey, tmp_path: Path) -> None:
    openings = tuple(replace(each, sigma_m=0.03) for each in house.openings)
    model = written(replace(house, openings=openings), tmp_path / "house.ifc")
    (opening,) = model.by_type("IfcOpeningElement")
    assert said(opening, "WidthSigma") == pytest.approx(0.03)
    assert said(opening, "WidthTolerance") == pytest.approx(0.06)


def test_rooms_are_spaces_with_names_areas_and_heights(house: Survey, tmp_path: Path) -> None:
    contents = Contents(room_names={"room 1": "Küche"})
    model = written(house, tmp_path / "house.ifc", replace(LABELS, contents=contents))
    spaces = model.by_type("IfcSpace")
    assert [(each.Name, each.LongName) for each in spaces] == [
        ("room 1", "Küche"),
        ("room 2", "room 2"),
    ]
    for each in spaces:
        assert measured(each, "NetFloorArea") == pytest.approx(20.0, abs=0.1)
        assert measured(each, "Height") == HEIGHT_M
        assert volume_m3(each) == pytest.approx(measured(each, "NetFloorArea") * HEIGHT_M)


def test_a_height_that_was_not_measured_is_not_a_quantity(house: Survey, tmp_path: Path) -> None:
    low = replace(house, plan=replace(house.plan, ceiling_m=None))
    model = written(low, tmp_path / "house.ifc")
    assert said(model.by_type("IfcBuilding")[0], "IsHeightMeasured") is False
    quantities = ifcopenshell.util.element.get_psets(model.by_type("IfcSpace")[0], qtos_only=True)
    assert "Height" not in quantities["Qto_SpaceBaseQuantities"]


def test_lengths_are_metres_and_everything_is_in_one_storey(house: Survey, tmp_path: Path) -> None:
    model = written(house, tmp_path / "house.ifc")
    assert ifcopenshell.util.unit.calculate_unit_scale(model) == 1.0
    (storey,) = model.by_type("IfcBuildingStorey")
    for each in model.by_type("IfcWall"):
        assert ifcopenshell.util.element.get_container(each) == storey
    for each in model.by_type("IfcSpace"):
        assert ifcopenshell.util.element.get_aggregate(each) == storey


def test_there_is_no_georeference_without_a_place(house: Survey, tmp_path: Path) -> None:
    model = written(house, tmp_path / "house.ifc")
    (site,) = model.by_type("IfcSite")
    assert (site.RefLatitude, site.RefLongitude) == (None, None)
    assert not model.by_type("IfcMapConversion")
    assert model.by_type("IfcGeometricRepresentationContext")[0].TrueNorth is None


@pytest.mark.parametrize(
    ("lat_deg", "lon_deg"), [(47.3977, 8.5456), (-33.45, -70.66), (0.0, -0.0001)]
)
def test_the_place_of_take_off_is_that_of_the_site(
    house: Survey, tmp_path: Path, lat_deg: float, lon_deg: float
) -> None:
    labels = replace(LABELS, place=Place(lat_deg, lon_deg))
    model = written(house, tmp_path / "house.ifc", labels)
    (site,) = model.by_type("IfcSite")
    for parts, angle_deg in ((site.RefLatitude, lat_deg), (site.RefLongitude, lon_deg)):
        units = (1, 60, 3600, 3600e6)
        read_deg = sum(part / unit for part, unit in zip(parts, units, strict=True))
        assert read_deg == pytest.approx(angle_deg, abs=1e-9)
    assert model.by_type("IfcGeometricRepresentationContext")[0].TrueNorth is None


def test_true_north_needs_the_heading_and_no_place(house: Survey, tmp_path: Path) -> None:
    slanting = survey(
        turned(house.plan, math.radians(-20))
    )  # its main walls are at 20° to take-off
    model = written(slanting, tmp_path / "h.ifc", replace(LABELS, heading_rad=math.radians(30)))
    context = model.by_type("IfcGeometricRepresentationContext")[0]
    x, y = context.TrueNorth.DirectionRatios
    assert math.degrees(math.atan2(x, y)) == pytest.approx(-50, abs=0.1)


def test_an_unfinished_map_says_so_in_the_model(house: Survey, tmp_path: Path) -> None:
    unfinished = replace(LABELS, unfinished="turned back with 40 % of the battery")
    for labels, is_complete in ((LABELS, True), (unfinished, False)):
        model = written(house, tmp_path / "house.ifc", labels)
        (whole,) = model.by_type("IfcBuilding")
        assert said(whole, "IsComplete") is is_complete
        assert said(whole, "Unfinished") == (labels.unfinished or None)
        description = model.by_type("IfcProject")[0].Description or ""
        assert description.startswith("INCOMPLETE") is not is_complete


def test_the_same_map_gives_objects_with_the_same_ids(house: Survey, tmp_path: Path) -> None:
    ids = [
        {each.GlobalId for each in written(house, tmp_path / name).by_type("IfcRoot")}
        for name in ("one.ifc", "other.ifc")
    ]
    assert ids[0] == ids[1]


# Walls of the model


def test_a_doorway_beside_a_one_sided_wall_is_in_the_measured_one() -> None:
    """Beyond the doorway the other room was not seen."""
    surfaces = [wall((0.0, 0.0), (3.0, 0.0)), wall((0.0, THICK_M), (3.0, THICK_M))]
    beyond = wall((4.0, 0.0), (7.0, 0.0))
    plan = seen([*surfaces, beyond], (1.5, -2.0), (1.5, 2.0), (5.0, -2.0))
    found = walls(building(plan), [Opening((3.0, 0.0), (4.0, 0.0))])
    assert len(found) == 2
    (host,) = (each for each in found if each.doorways)
    assert host.is_measured
    assert host.length_m == pytest.approx(4.0)
    assert host.doorways[0].middle_m == pytest.approx(3.5)


def test_an_opening_without_a_wall_in_line_gets_a_wall_of_its_own() -> None:
    (found,) = walls(building(FloorPlan()), [Opening((3.0, 0.0), (4.0, 0.0))])
    assert found.length_m == pytest.approx(1.0)
    assert not found.is_measured


def test_walls_that_end_near_a_corner_meet_there() -> None:
    gap_m = 0.1
    room = [
        wall((gap_m, 0.0), (6.0, 0.0)),
        wall((6.0, gap_m), (6.0, 4.0)),
        wall((6.0 - gap_m, 4.0), (0.0, 4.0)),
        wall((0.0, 4.0 - gap_m), (0.0, 0.0)),
    ]
    found = walls(building(seen(room, (3.0, 2.0))), ())
    assert len(found) == 4
    for one, other in pairwise((*found, found[0])):
        assert abs(one.end - other.start) == pytest.approx(0.0, abs=1e-9)
        assert one.corners[2] == pytest.approx(other.corners[1])
        assert one.corners[3] == pytest.approx(other.corners[0])
    assert sorted(each.length_m for each in found) == pytest.approx([4.0, 4.0, 6.0, 6.0])


@given(st.floats(-180, 180))
@settings(max_examples=examples(5), suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_walls_are_the_same_at_any_heading(house: Survey, turn_deg: float) -> None:
    level = house.turned(math.radians(turn_deg))
    found = walls(building(level.plan), level.openings)
    assert sorted(each.length_m for each in found) == pytest.approx(
        [5.0, 5.0, 5.0, 8.0 + THICK_M, 8.0 + THICK_M]
    )
    assert sum(len(each.doorways) for each in found) == 1


place = st.tuples(st.floats(0, 10), st.floats(0, 10))
opening = st.builds(
    lambda at, angle_rad, width_m: Opening(
        at, (at[0] + width_m * math.cos(angle_rad), at[1] + width_m * math.sin(angle_rad))
    ),
    place,
    st.floats(-4, 4),
    st.floats(0.5, 1.5),
)


@given(st.lists(st.tuples(place, place), max_size=12), st.lists(opening, max_size=3))
@settings(max_examples=examples(30))
def test_in_any_map_each_opening_is_in_one_wall(
    pieces: list[tuple[Vector2, Vector2]], openings: list[Opening]
) -> None:
    surfaces = [wall(*piece) for piece in pieces if math.dist(*piece) > 0.35]
    found = walls(building(FloorPlan(walls=tuple(surfaces))), openings)
    assert len([each for each in found for _ in each.doorways]) == len(openings)
    for each in found:
        assert each.length_m > 0.0
        outline = shapely.Polygon([(corner.real, corner.imag) for corner in each.corners])
        assert outline.is_valid
        assert outline.area > 0.5 * each.length_m * each.thickness_m
        for doorway in each.doorways:
            half_m = doorway.opening.width_m / 2
            assert half_m - 1e-9 <= doorway.middle_m <= each.length_m - half_m + 1e-9
            middle = np.mean([doorway.opening.start_ne_m, doorway.opening.end_ne_m], axis=0)
            assert abs(each.at(doorway.middle_m) - complex(*middle)) < 1.0
