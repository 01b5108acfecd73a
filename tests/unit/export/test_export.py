"""Tests each export: another library reads the file, and its content matches the ground truth."""

import json
import math
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import ezdxf.filemanagement
import ezdxf.path
import ifcopenshell
import ifcopenshell.util.placement
import numpy as np
import pyoctomap
import pytest
import shapely
import trimesh
import yaml
from ezdxf.entities import Dimension
from fontTools.pens.recordingPen import RecordingPen
from fontTools.svgLib.path import parse_path
from hypothesis import given
from hypothesis import strategies as st
from ifcopenshell.util.element import get_psets
from PIL import Image
from pypcd4.pypcd4 import PointCloud
from pypdf import PdfReader
from pyproj import Geod, Transformer

from companion.core.arrays import Array
from companion.core.errors import OutputError
from companion.core.frames import Place, ned_to_enu, ned_to_gltf
from companion.core.messages import FloorPlan
from companion.export.cells import CELL_M
from companion.export.formats import WRITERS, export
from companion.export.map_files import save_json
from companion.export.plan.figure import INK
from companion.export.plan.labels import Labels
from companion.export.plan.sheet import EDGE_MM, FOOT_MM, choose_sheet
from companion.export.plan.survey import Survey, survey
from companion.export.plan.turned import Up
from sitl.testing import Flight, Sitl
from sitl.world.plan import wall_surfaces
from tests.unit.export.map_schema import deviations

pytestmark = pytest.mark.flights

PLACE = Place(47.3977, 8.5456, math.radians(30))
LABELS = Labels("a flight", PLACE, PLACE.heading_rad, up=Up.TAKE_OFF)
PT_M = 0.0254 / 72
WALL_PT = 2.0
WALL_STROKE = f"stroke: {INK}; stroke-width: {WALL_PT:g};"


@dataclass(frozen=True)
class Exported:
    """A flight and its map in all formats."""

    flight: Flight
    found: Survey
    folder: Path

    def path(self, suffix: str) -> Path:
        return self.folder / f"map.{suffix}"

    def off_truth_m(self, points_enu_m: Array) -> Array:
        """Distances (n,), m, of points (x east, y north of take-off) from the nearest true wall."""
        take_off = self.flight.truth.take_off
        cos, sin = math.cos(take_off.yaw_rad), math.sin(take_off.yaw_rad)
        turned = points_enu_m[:, 1::-1] @ np.array([[cos, sin], [-sin, cos]])
        world_ne_m = turned + take_off.position_ned_m[:2]
        surfaces = wall_surfaces(self.flight.setup.world, 1.2)
        distances: Array = shapely.distance(
            shapely.points(world_ne_m), shapely.MultiLineString(surfaces)
        )
        return distances

    def assert_walls(self, points_enu_m: Array, beyond_m: float = 0.0) -> None:
        """Assert that points match the ground truth as well as the map does.

        `beyond_m` is the additional error of the format.
        """
        assert len(points_enu_m)
        error_m = self.off_truth_m(points_enu_m).mean()
        assert error_m <= self.flight.report.wall_error_cm / 100 + beyond_m + 0.002


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Exported:
    folder = tmp_path_factory.mktemp("export")
    flight = Sitl(folder).fly("room_100", seed=3)
    found = survey(flight.plan)
    export(found, list(WRITERS), folder, "map", LABELS)
    return Exported(flight, found, folder)


def along(ends_enu_m: Array) -> Array:
    """Points (m, 2) on segments (n, 2, 2 or more), 200 on each."""
    share = np.linspace(0, 1, 200)[None, :, None]
    start, end = ends_enu_m[:, None, 0, :2], ends_enu_m[:, None, 1, :2]
    points: Array = ((1 - share) * start + share * end).reshape(-1, 2)
    return points


def test_ezdxf_finds_walls_rooms_and_dimensions_in_metres(exported: Exported) -> None:
    document = ezdxf.filemanagement.readfile(exported.path("dxf"))
    audit = document.audit()
    assert not audit.errors
    assert not audit.fixes
    assert document.units == ezdxf.units.M
    space = document.modelspace()
    walls = [
        [line.dxf.start.vec2, line.dxf.end.vec2] for line in space.query('LINE[layer=="WALLS"]')
    ]
    exported.assert_walls(along(np.array([[[p.x, p.y] for p in wall] for wall in walls])))
    dimensions = [d for d in space.query("DIMENSION") if isinstance(d, Dimension)]
    measured = sorted(d.get_measurement() for d in dimensions)
    assert measured == pytest.approx(sorted(w.length_m for w in exported.flight.plan.walls))
    (outline,) = space.query('LWPOLYLINE[layer=="ROOMS"]')
    corners = [(corner.x, corner.y) for corner in ezdxf.path.make_path(outline).control_vertices()]
    assert shapely.Polygon(corners).area == pytest.approx(100, rel=0.02)
    labels = [text.dxf.text for text in space.query('TEXT[layer=="LABELS"]')]
    assert labels == ["room 1", f"{exported.found.rooms[0].area_m2:.1f} m2"]


def test_ifcopenshell_finds_the_surfaces_of_the_walls(exported: Exported) -> None:
    """Each wall of the room was seen from inside, so its axis is the surface that was seen."""
    model: Any = ifcopenshell.open(exported.path("ifc"))
    ends = []
    for wall in model.by_type("IfcWall"):
        matrix = ifcopenshell.util.placement.get_local_placement(wall.ObjectPlacement)
        length_m = get_psets(wall)["Qto_WallBaseQuantities"]["Length"]
        ends.append([(matrix @ [along_m, 0, 0, 1])[:2] for along_m in (0, length_m)])
    assert len(ends) == 4
    exported.assert_walls(along(np.array(ends)))
    (space,) = model.by_type("IfcSpace")
    assert get_psets(space)["Qto_SpaceBaseQuantities"]["NetFloorArea"] == pytest.approx(
        100, rel=0.02
    )


def test_trimesh_finds_floor_walls_and_ceiling_in_the_glb(exported: Exported) -> None:
    scene = trimesh.load_scene(exported.path("glb"))
    assert set(scene.geometry) == {"walls", "floor", "ceiling"}
    walls = scene.geometry["walls"]
    exported.assert_walls(walls.triangles_center[:, [0, 2]] * [1, -1])
    ceiling_m = exported.flight.plan.ceiling_m
    assert ceiling_m is not None
    assert walls.bounds[:, 1] == pytest.approx([0, ceiling_m], abs=1e-4)
    assert scene.geometry["floor"].area == pytest.approx(100, rel=0.02)
    assert scene.geometry["floor"].bounds[:, 1] == pytest.approx([0, 0])
    assert scene.geometry["ceiling"].bounds[:, 1] == pytest.approx([ceiling_m] * 2, abs=1e-4)


def test_trimesh_and_pypcd4_read_the_hits_from_ply_and_pcd(exported: Exported) -> None:
    hits = np.array([ned_to_enu(hit.position_ned_m) for hit in exported.flight.plan.hits])
    ply = trimesh.load(exported.path("ply"))
    pcd = PointCloud.from_path(exported.path("pcd"))
    assert isinstance(ply, trimesh.PointCloud)
    assert np.asarray(ply.vertices) == pytest.approx(hits, abs=1e-5)
    assert pcd.numpy(("x", "y", "z")) == pytest.approx(hits, abs=1e-5)


def test_pillow_and_yaml_read_the_ros_map(exported: Exported) -> None:
    record = yaml.safe_load(exported.path("yaml").read_text())
    cells = np.asarray(Image.open(exported.folder / record["image"]))[::-1]
    rows, columns = np.nonzero(cells < 255 * (1 - record["occupied_thresh"]))
    centres = (np.column_stack([columns, rows]) + 0.5) * record["resolution"]
    exported.assert_walls(centres + record["origin"][:2], CELL_M / 2)
    free_m2 = np.count_nonzero(cells > 250) * record["resolution"] ** 2
    assert 40 < free_m2 < 102
    take_off = np.array([0.0, 0.0])
    column, row = ((take_off - record["origin"][:2]) / record["resolution"]).astype(int)
    assert cells[row, column] == 254
    assert cells[0, 0] == 205


def test_octomap_distinguishes_walls_free_and_unknown_space(exported: Exported) -> None:
    tree = pyoctomap.OcTree(str(exported.path("bt")).encode())
    occupied, free = tree.extractPointCloud()
    assert tree.getResolution() == CELL_M
    exported.assert_walls(np.asarray(occupied)[:, :2], CELL_M / 2)
    height_m = exported.flight.plan.ceiling_m or 0.0
    faces_m = [
        leaf.getCoordinate()[2] + side * leaf.getSize() / 2
        for leaf in tree.begin_leafs()
        if tree.isNodeOccupied(leaf)
        for side in (-1, 1)
    ]
    assert min(faces_m) == pytest.approx(0, abs=1e-3)
    assert max(faces_m) == pytest.approx(height_m, abs=CELL_M)
    free_heights_m = np.asarray(free)[:, 2]
    assert np.median(free_heights_m) == pytest.approx(1.2, abs=0.1)
    assert tree.search([0.0, 0.0, 10.0]) is None


def test_shapely_and_proj_read_the_geojson(exported: Exported) -> None:
    collection = json.loads(exported.path("geojson").read_text())
    kinds = {feature["properties"]["kind"] for feature in collection["features"]}
    assert kinds == {"room", "wall", "path"}
    to_metres = Transformer.from_crs(
        "EPSG:4326",
        f"+proj=aeqd +lat_0={PLACE.lat_deg} +lon_0={PLACE.lon_deg} +ellps=WGS84",
        always_xy=True,
    )
    cos, sin = math.cos(PLACE.heading_rad), math.sin(PLACE.heading_rad)
    from_true_north = np.array([[cos, sin], [-sin, cos]])

    def local_enu_m(lon_lat: Array) -> Array:
        local: Array = np.column_stack(to_metres.transform(*lon_lat.T)) @ from_true_north
        return local

    walls = [
        local_enu_m(shapely.get_coordinates(shapely.from_geojson(json.dumps(f["geometry"]))))
        for f in collection["features"]
        if f["properties"]["kind"] == "wall"
    ]
    exported.assert_walls(along(np.array(walls)))
    (room,) = (f for f in collection["features"] if f["properties"]["kind"] == "room")
    polygon = shapely.from_geojson(json.dumps(room["geometry"]))
    assert isinstance(polygon, shapely.Polygon)
    assert shapely.is_ccw(polygon.exterior)
    area_m2, _ = Geod(ellps="WGS84").geometry_area_perimeter(polygon)
    assert area_m2 == pytest.approx(100, rel=0.02)


def test_json_has_walls_with_covariance_in_the_maps_own_frame(exported: Exported) -> None:
    record = json.loads(exported.path("json").read_text())
    plan = exported.flight.plan
    for read, wall in zip(record["walls"], plan.walls, strict=True):
        assert tuple(read["start_ne_m"]) == wall.start_ne_m
        covariance = np.array(read["covariance_across_direction"])
        assert np.sqrt(np.diag(covariance)) == pytest.approx([wall.sigma_m, wall.normal_sigma_rad])
    assert record["rooms"][0]["area_m2"] == pytest.approx(100, rel=0.02)
    assert len(record["path"]) == len(plan.path)


def test_both_json_files_of_a_flight_follow_the_published_schema(
    exported: Exported, tmp_path: Path
) -> None:
    save_json(exported.flight.plan, tmp_path / "map.json")
    for path in (exported.path("json"), tmp_path / "map.json"):
        assert deviations(path) == []


def off_paper(survey: Survey, points_up_pt: Array) -> Array:
    """Convert points (n, 2) on the sheet, in pt from its lower left corner, to ENU, m."""
    sheet = choose_sheet(survey, LABELS.contents)
    inset_m = np.array([EDGE_MM, EDGE_MM + FOOT_MM]) * sheet.scale / 1000
    enu_m: Array = points_up_pt * PT_M * sheet.scale - inset_m + [sheet.west_m, sheet.south_m]
    return enu_m


def assert_sheet(exported: Exported, size_pt: Sequence[float], wall_ends_up_pt: Array) -> None:
    """Assert the sheet's size, and that the ends of walls match the map and the ground truth."""
    sheet, walls = choose_sheet(exported.found, LABELS.contents), exported.flight.plan.walls
    assert np.array(size_pt) * PT_M == pytest.approx(
        [sheet.width_mm / 1000, sheet.height_mm / 1000]
    )
    ends_m = off_paper(exported.found, wall_ends_up_pt.reshape(-1, 2))
    mapped = np.array([(wall.start_ne_m[::-1], wall.end_ne_m[::-1]) for wall in walls])
    assert ends_m == pytest.approx(mapped.reshape(-1, 2), abs=0.001)
    exported.assert_walls(along(ends_m.reshape(-1, 2, 2)))


def assert_words(exported: Exported, words: str) -> None:
    sheet = choose_sheet(exported.found, LABELS.contents)
    assert f"1 : {sheet.scale} on {sheet.paper}" in words
    assert f"{exported.found.rooms[0].area_m2:.1f} m²" in words


def test_fonttools_finds_the_walls_to_scale_in_the_svg(exported: Exported) -> None:
    drawing = ElementTree.parse(exported.path("svg")).getroot()
    size_pt = [float(drawing.attrib[side].removesuffix("pt")) for side in ("width", "height")]
    walls = []
    for path in drawing.iter("{http://www.w3.org/2000/svg}path"):
        if WALL_STROKE in path.get("style", ""):
            pen = RecordingPen()
            parse_path(path.attrib["d"], pen)
            walls.append([point for _, points in pen.value for point in points])
    ends_up_pt = np.array(walls) * [1, -1] + [0, size_pt[1]]
    assert_sheet(exported, size_pt, ends_up_pt)
    assert_words(exported, " ".join(drawing.itertext()))


def test_pypdf_finds_the_walls_to_scale_in_the_pdf(exported: Exported) -> None:
    page = PdfReader(exported.path("pdf")).pages[0]
    walls: list[list[list[float]]] = []
    line: list[list[float]] = []
    width_pt = 0.0

    def draw(operator: bytes, operands: list[float], *_: object) -> None:
        nonlocal width_pt, line
        match operator:
            case b"w":
                width_pt = operands[0]
            case b"m":
                line = [operands]
            case b"l":
                line.append(operands)
            case b"S" if width_pt == WALL_PT:
                walls.append(line)

    words = page.extract_text(visitor_operand_before=draw)
    assert_sheet(exported, page.mediabox[2:], np.array(walls, dtype=float))
    assert_words(exported, words)


def test_the_same_map_gives_the_same_files(exported: Exported, tmp_path: Path) -> None:
    same = ["svg", "pdf", "pgm", "ply", "pcd", "glb", "bt", "geojson", "json"]
    for path in export(exported.found, same, tmp_path, "map", LABELS):
        assert path.read_bytes() == exported.path(path.suffix[1:]).read_bytes()


@pytest.mark.parametrize("name", WRITERS)
def test_an_empty_map_is_exported(name: str, tmp_path: Path) -> None:
    if name in ("ply", "glb"):  # these formats cannot be empty
        with pytest.raises(OutputError, match="the map has no"):
            export(survey(FloorPlan()), [name], tmp_path, "map", LABELS)
        return
    (path,) = export(survey(FloorPlan()), [name], tmp_path, "map", LABELS)
    assert path.stat().st_size


def test_a_folder_at_the_path_of_the_file_is_an_error(exported: Exported, tmp_path: Path) -> None:
    (tmp_path / "map.json").mkdir()
    with pytest.raises(OutputError, match=r"map\.json"):
        export(exported.found, ["json"], tmp_path, "map", LABELS)


def test_the_area_of_a_flown_room_has_an_error_below_two_percent(exported: Exported) -> None:
    """Tests in tests/flights check the areas of other rooms."""
    assert [room.area_m2 for room in exported.found.rooms] == pytest.approx([100.0], rel=0.02)


@given(st.tuples(*[st.floats(-100, 100)] * 3))
def test_gltf_is_enu_with_y_up(ned: tuple[float, float, float]) -> None:
    x, y, z = ned_to_gltf(ned)
    assert (x, -z, y) == ned_to_enu(ned)


@given(st.floats(-80, 80), st.floats(-180, 180), st.floats(-100, 100), st.floats(-100, 100))
def test_geographic_positions_match_those_of_proj(
    lat_deg: float, lon_deg: float, north_m: float, east_m: float
) -> None:
    lon, lat = Place(lat_deg, lon_deg).lon_lat_deg(north_m, east_m)
    azimuth_deg = math.degrees(math.atan2(east_m, north_m))
    true_lon, true_lat, _ = Geod(ellps="WGS84").fwd(
        lon_deg, lat_deg, azimuth_deg, math.hypot(north_m, east_m)
    )
    off = Geod(ellps="WGS84").inv(lon, lat, true_lon, true_lat)[2]
    assert off < 0.02
