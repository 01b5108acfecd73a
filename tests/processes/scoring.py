"""Scores the map and the true flight that processes have written."""

from pathlib import Path

from companion.export.map_files import load_json
from sitl.scoring.score import score_map
from sitl.simulation.record import TruthRecord
from sitl.world.loading import load_world
from sitl.world.plan import observable_points, wall_surfaces

HEIGHT_M = 1.2


def assert_good(map_file: Path, truth_file: Path, world: str, start: int = 0) -> None:
    """No collision, and all walls of the world mapped; `start` is the vehicle's start pose."""
    truth = TruthRecord.load(truth_file)
    assert truth.collisions == 0
    room = load_world(world)
    score = score_map(
        load_json(map_file),
        wall_surfaces(room, HEIGHT_M),
        observable_points(room, HEIGHT_M, room.starts[start].position),
        truth.take_off,
    )
    assert score.wall_error_aligned_cm < 10
    assert score.coverage > 0.9
    assert score.false_walls < 0.05
