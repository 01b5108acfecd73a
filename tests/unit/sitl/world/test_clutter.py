"""Tests of clutter: its limits in a world, and its pieces of furniture."""

import hashlib
import math
import random
from pathlib import Path

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import ndimage
from scipy.spatial import cKDTree
from typer.testing import CliRunner

from companion.core.arrays import Mask
from companion.core.frames import Vector2
from sitl.commands.cli import commands
from sitl.running.options import FlightOptions
from sitl.testing import Sitl
from sitl.world.clutter import cluttered, leaves
from sitl.world.clutter.free_floor import START_CLEAR_M, FreeFloor
from sitl.world.clutter.furniture import KINDS
from sitl.world.clutter.pieces import Spot, any_direction
from sitl.world.format import Panel, Walls, World, WorldError, parse_world
from sitl.world.generator import random_world
from sitl.world.geometry.model import BODY_RADIUS_M, WorldModel
from sitl.world.loading import load_world
from sitl.world.plan import observable_points, samples, wall_surfaces
from sitl.world.writing import to_toml
from tests.examples import examples
from tests.worlds import SMALL_ROOM

BUILT_IN = ("office", "complex", "two_room_300", "room_100", "unusual", "exterior")
FLIGHT_M = 1.2
GRID_M = 0.1
WIDE_M, PASSABLE_M = 0.45, 0.38
"""Half width of a door passable without clutter, and of its narrowest free part with it, m."""
LIVED_IN = 0.5
"""Highest difficulty at which no door is shut."""
HALF_GAP_M = 0.3
"""Half the largest distance of two legs below a board that the hull could hit, m."""

seeds = st.integers(0, 10**6)
each_world = settings(max_examples=examples(8), deadline=None)


def pieces(before: World, after: World) -> list[Panel]:
    """Panels that clutter has added."""
    added = after.walls[len(before.walls) :]
    return [panel for walls in added for panel in walls.panels(after.height_m)]


@pytest.mark.parametrize("name", BUILT_IN)
def test_zero_clutter_leaves_the_world_unchanged(name: str) -> None:
    world = load_world(name)
    assert cluttered(world, 0.0, 1) is world
    setup, _ = FlightOptions(name, 1, "paper", "ardupilot").setup()
    assert setup.world == world


@each_world
@given(seeds, seeds, st.floats(0.05, 1))
def test_equal_seeds_give_equal_clutter_and_other_seeds_do_not(
    building: int, seed: int, difficulty: float
) -> None:
    world = random_world(building)
    once, again, other = (cluttered(world, difficulty, s) for s in (seed, seed, seed + 1))
    assert once == again
    assert to_toml(once) == to_toml(again)
    assert once.walls != other.walls
    for old, new in zip(world.walls, once.walls, strict=False):
        assert (old.points, old.thickness_m) == (new.points, new.thickness_m)
        assert new.doors[: len(old.doors)] == old.doors
    assert (once.boxes, once.starts) == (world.boxes, world.starts)


def test_a_seed_gives_the_same_clutter_on_every_machine() -> None:
    written = to_toml(cluttered(load_world("office"), LIVED_IN, 1))
    assert hashlib.sha256(written.encode()).hexdigest()[:8] == "1ad9a48b"


def test_higher_difficulty_adds_more_clutter() -> None:
    world = load_world("office")
    numbers = [len(cluttered(world, c, 3).walls) for c in (0.0, 0.25, 0.5, 1.0)]
    assert numbers == sorted(set(numbers))


@each_world
@given(seeds, st.sampled_from([LIVED_IN, 1.0]))
def test_starts_stay_free(seed: int, difficulty: float) -> None:
    world = random_world(seed)
    before, after = WorldModel(world), WorldModel(cluttered(world, difficulty, seed))
    for start in world.starts:
        for height_m in (0.3, FLIGHT_M):
            place = (*start.position, -height_m)
            least_m = min(before.clearance_m(place), START_CLEAR_M)
            assert after.clearance_m(place) >= least_m - 1e-3


def reachable(world: World, half_m: float) -> Mask:
    """Mask of the grid places that a disc of radius `half_m` can reach from the first start."""
    (south, west), (north, east) = world.bounds
    norths, easts = np.arange(south, north, GRID_M), np.arange(west, east, GRID_M)
    cells = np.stack(np.meshgrid(norths, easts, indexing="ij"), axis=-1)
    tree = cKDTree(samples(wall_surfaces(world, FLIGHT_M)))
    parts, _ = ndimage.label(tree.query(cells)[0] > half_m)
    start = world.starts[0].position
    at_start = parts[round((start[0] - south) / GRID_M), round((start[1] - west) / GRID_M)]
    return np.asarray((parts == at_start) & (at_start > 0))


@each_world
@given(seeds, st.floats(0.1, LIVED_IN))
def test_reachable_places_stay_reachable(seed: int, difficulty: float) -> None:
    world = random_world(seed)
    after = cluttered(world, difficulty, seed)
    before = reachable(world, WIDE_M)
    low, _ = world.bounds
    places = np.array(low) + GRID_M * np.argwhere(before)
    surfaces = cKDTree(samples(wall_surfaces(after, FLIGHT_M)))
    is_free = surfaces.query(places)[0] > WIDE_M
    lost = is_free & ~reachable(after, PASSABLE_M)[before]
    assert lost.mean() < 0.03  # corners behind furniture


@pytest.mark.parametrize("difficulty", [LIVED_IN, 1.0])
@pytest.mark.parametrize("name", BUILT_IN)
def test_clutter_is_within_the_building(name: str, difficulty: float) -> None:
    world = load_world(name)
    (south, west), (north, east) = world.bounds
    for panel in pieces(world, cluttered(world, difficulty, 5)):
        for north_m, east_m in (panel.start, panel.end):
            assert south - 0.001 <= north_m <= north + 0.001
            assert west - 0.001 <= east_m <= east + 0.001
        assert 0 <= panel.bottom_m < panel.top_m <= world.height_m


def test_clutter_does_not_intersect_existing_furniture() -> None:
    world = load_world("office")
    solids = [
        shapely.box(*box.corner, box.corner[0] + box.size[0], box.corner[1] + box.size[1])
        for box in world.boxes
    ]
    for panel in pieces(world, cluttered(world, 1.0, 2)):
        line = shapely.LineString([panel.start, panel.end])
        assert not any(solid.intersects(line) for solid in solids)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.make.__name__)
@given(seeds)
@settings(max_examples=examples(25))
def test_furniture_has_the_documented_sizes(kind: object, seed: int) -> None:
    rng = random.Random(seed)
    make = kind.make  # type: ignore[attr-defined]
    piece = make(Spot((3.0, 4.0), any_direction(rng)), rng, 2.3)
    panels = [panel for walls in piece.walls for panel in walls.panels(2.4)]
    for panel in panels:
        assert panel.top_m <= 2.3
        for corner, _ in panel.outline:
            assert piece.footprint.distance(shapely.Point(corner)) < 0.03
    if make.__name__ == "_plant":
        assert 0.2 < math.sqrt(piece.footprint.area) < 0.6
        assert max(math.dist((3.0, 4.0), p) for p in piece.footprint.exterior.coords) <= 0.301
        return
    thin_m = min(min(math.dist(panel.start, panel.end), panel.thickness_m) for panel in panels)
    assert 0.029 <= thin_m <= 0.081


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.make.__name__)
@given(seeds)
@settings(max_examples=examples(25))
def test_beams_detect_the_parts_that_the_hull_can_touch(kind: object, seed: int) -> None:
    rng = random.Random(seed)
    piece = kind.make(Spot((3.0, 4.0)), rng, 2.3)  # type: ignore[attr-defined]
    panels = [panel for walls in piece.walls for panel in walls.panels(2.4)]
    touched = [side for p in panels if p.bottom_m < 1.49 and p.top_m > 0.95 for side in p.outline]
    at_beams = [side for p in panels if p.bottom_m < 1.1 and p.top_m > 1.3 for side in p.outline]
    if touched:
        assert cKDTree(samples(at_beams)).query(samples(touched))[0].max() <= HALF_GAP_M


def a_doorway(width_m: float) -> World:
    """Two rooms of 5 × 5 m with a doorway of this width."""
    wall = {
        "points": [(0, 5), (5, 5)],
        "thickness_m": 0.1,
        "doors": [{"centre": (2.5, 5), "width_m": width_m}],
    }
    outer = Walls(points=((0, 0), (5, 0), (5, 10), (0, 10)), closed=True)
    start = {"name": "start", "position": (2.5, 2)}
    return World(
        name="doorway",
        height_m=2.5,
        walls=(outer, Walls.model_validate(wall)),
        starts=(start,),
    )


@given(seeds, st.floats(0.7, 1.4))
@settings(max_examples=examples(30), deadline=None)
def test_an_open_door_leaves_its_doorway_wide_enough(seed: int, width_m: float) -> None:
    world = a_doorway(width_m)
    rng = random.Random(seed)
    floor = TakesAll()
    doorways = leaves.doorways_of(world, floor)  # type: ignore[arg-type]
    assert len(doorways) == 1
    for leaf in leaves.leaves(doorways, floor, LIVED_IN, rng):  # type: ignore[arg-type]
        [panel] = leaf.walls[0].panels(2.5)
        assert panel.thickness_m == leaves.LEAF_M
        assert math.dist(panel.start, panel.end) == pytest.approx(width_m - 0.02, abs=0.002)
        polygon = shapely.Polygon([start for start, _ in panel.outline])
        jambs = [(2.5 + side * width_m / 2, 5 + face) for side in (-1, 1) for face in (-0.05, 0.05)]
        far = [jamb for jamb in jambs if polygon.distance(shapely.Point(jamb)) > 0.3]
        assert len(far) == 2
        free_m = min(polygon.distance(shapely.Point(jamb)) for jamb in far)
        assert free_m >= min(width_m, 0.9 if width_m >= 0.9 else 0.8) - 0.003


class TakesAll:
    """A floor that accepts every piece."""

    def take(self, piece: object) -> bool:
        return True

    shut = take

    def is_clear(self, near: Vector2, far: Vector2) -> bool:
        return True


def test_a_beam_passes_through_glass_and_the_hull_does_not() -> None:
    world = load_world("room_100")
    room = cluttered(world, 1.0, 1)
    panes = [panel for walls in room.walls if walls.glass for panel in walls.panels(2.6)]
    assert panes
    (south, west), (north, east) = world.bounds
    model, clean = WorldModel(room), WorldModel(world)
    through = 0
    for pane in panes:
        # 20 cm outside the outer wall, where no other obstacle is near
        middle = np.add(pane.start, pane.end) / 2
        out = np.array([middle[0] in {south, north}, middle[1] in {west, east}], dtype=float)
        out *= np.sign(middle - np.array([(south + north) / 2, (west + east) / 2]))
        along = np.subtract(pane.end, pane.start) / math.dist(pane.start, pane.end)
        for x_m in np.arange(-0.5, 0.5, 0.02):
            n, e = middle + 0.2 * out + x_m * along
            beam = -float(out[0]), -float(out[1]), 0.0
            at_m = model.range_m((float(n), float(e), -FLIGHT_M), beam, 0.3)
            assert clean.range_m((float(n), float(e), -FLIGHT_M), beam, 0.3) == pytest.approx(0.2)
            through += at_m is None
            assert model.clearance_m((float(n), float(e), -FLIGHT_M)) <= 0.201
        assert not any(
            {pane.start, pane.end} == set(segment) for segment in wall_surfaces(room, FLIGHT_M)
        )
    assert through > 10 * len(panes)


def test_no_pane_is_as_wide_as_the_hull() -> None:
    room = cluttered(load_world("room_100"), 1.0, 1)
    walls = shapely.MultiLineString(wall_surfaces(room, FLIGHT_M))
    for pane in (panel for panel in room.panels if panel.glass):
        glass = shapely.LineString([pane.start, pane.end])
        gaps = glass.difference(walls.buffer(0.005))
        for gap in getattr(gaps, "geoms", [gaps]):
            assert gap.length < 2 * BODY_RADIUS_M


def test_space_behind_a_shut_door_is_not_required_by_the_score(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr(leaves, "SHUT_SHARE", 100.0)
    monkeypatch.setattr(leaves, "WITH_LEAF_SHARE", 1.0)
    monkeypatch.setattr("sitl.world.clutter.free_floor.MAX_SHUT", 0.9)
    world = cluttered(a_doorway(1.0), 0.51, 1)
    seen = observable_points(world, FLIGHT_M, world.starts[0].position)
    assert (seen[:, 1] < 5.9).all()
    assert len(seen) > 300


def test_windows_get_no_door_leaves_when_clutter_is_added_again() -> None:
    once = cluttered(load_world("room_100"), 1.0, 1)
    assert any(walls.glass for walls in once.walls)
    assert leaves.doorways_of(once, FreeFloor(once)) == []


def test_no_door_is_shut_that_closes_off_too_much_space(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(leaves, "SHUT_SHARE", 100.0)
    world = cluttered(a_doorway(1.0), 1.0, 1)
    assert (observable_points(world, FLIGHT_M, world.starts[0].position)[:, 1] > 7).any()


@each_world
@given(seeds)
def test_a_written_world_is_equal_when_read_back(seed: int) -> None:
    world = cluttered(random_world(seed), LIVED_IN, seed)
    assert parse_world(to_toml(world), "written") == world


def test_clutter_uses_the_flight_seed_unless_it_has_its_own_seed() -> None:
    def world(seed: int, clutter_seed: int | None) -> World:
        options = FlightOptions(
            "office", seed, "paper", "ardupilot", clutter=0.3, clutter_seed=clutter_seed
        )
        return options.setup()[0].world

    assert world(1, None) == world(2, 1) == cluttered(load_world("office"), 0.3, 1)
    assert world(1, None) != world(2, None)


def test_a_cropped_world_is_cluttered_within_its_border() -> None:
    options = FlightOptions("complex", 1, "paper", "ardupilot", crop_m=8.0, clutter=1.0)
    world = options.setup()[0].world
    (south, west), (north, east) = world.bounds
    assert (north - south, east - west) == pytest.approx((8, 8), abs=0.01)


@pytest.mark.flights
def test_scripted_flights_accept_clutter() -> None:
    flight = Sitl(Path()).fly(SMALL_ROOM, clutter=0.25, clutter_seed=4, seed=2)
    assert flight.setup.world == cluttered(load_world(SMALL_ROOM), 0.25, 4)
    assert flight.report.coverage > 0.3
    assert flight.plan.walls


def test_arguments_of_a_flight_include_its_clutter() -> None:
    options = FlightOptions("office", 1, "paper", "ardupilot", clutter=0.5, clutter_seed=7)
    assert {"--clutter=0.5", "--clutter-seed=7"} <= set(options.arguments())
    clean = FlightOptions("office", 1, "paper", "ardupilot").arguments()
    assert not any("clutter" in argument for argument in clean)


@pytest.mark.parametrize("difficulty", [-0.1, 1.1, math.nan])
def test_difficulty_outside_0_to_1_is_refused(difficulty: float) -> None:
    with pytest.raises(WorldError, match="from 0 to 1"):
        cluttered(load_world("office"), difficulty, 1)


def test_world_commands_accept_clutter(tmp_path: Path) -> None:
    run = CliRunner().invoke
    checked = run(commands, ["world", "check", "office", "--clutter=0.5"])
    assert "office_clutter_0.5" in checked.stdout
    assert "good" in checked.stdout
    drawn, written = tmp_path / "a.png", tmp_path / "a.toml"
    run(commands, ["world", "show", "office", "--clutter=0.5", f"--out={drawn}"])
    assert drawn.stat().st_size > 1000
    run(commands, ["world", "export", "office", "--clutter=0.5", f"--out={written}"])
    assert load_world(str(written)) == cluttered(load_world("office"), 0.5, 1)


def directions(count: int) -> list[Vector2]:
    rng = random.Random(1)
    return [any_direction(rng) for _ in range(count)]


def test_any_direction_returns_unit_vectors_in_all_quadrants() -> None:
    norths, easts = np.array(directions(400)).T
    assert np.hypot(norths, easts) == pytest.approx(1)
    quadrants = np.sign(norths) + 3 * np.sign(easts)
    assert min(np.unique(quadrants, return_counts=True)[1]) > 60
