"""Wall segments from lines and hits, and the files of the map."""

import errno
import json
import math
import os
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
import trimesh

from companion.core.errors import OutputError
from companion.core.messages import Beam, FloorPlan, Hit, Pose, WallLine, WallSegment
from companion.estimation.smoothing.flight_record import NO_WALL
from companion.export.map_files import AutoSave, load_json, save
from companion.mapping.floor_plan import outline_closed, wall_segments

SQUARE_M = 2.0
LINES = [WallLine(math.radians(90 * i), SQUARE_M, 0.01) for i in range(4)]


def hits_along(
    line: WallLine, from_m: float, to_m: float, *, wall: int | None = 0, step_m: float = 0.1
) -> list[Hit]:
    cos_n, sin_n = math.cos(line.normal_rad), math.sin(line.normal_rad)
    count = round((to_m - from_m) / step_m) + 1
    places = [from_m + i * step_m for i in range(count)]
    return [
        Hit(
            0.0,
            Beam.FRONT,
            (line.offset_m * cos_n - a * sin_n, line.offset_m * sin_n + a * cos_n, -1.2),
            0.01**2,
            wall,
        )
        for a in places
    ]


def segments(lines: list[WallLine], hits: list[Hit]) -> tuple[WallSegment, ...]:
    points = np.array([hit.position_ned_m[:2] for hit in hits])
    walls = np.array([NO_WALL if hit.wall is None else hit.wall for hit in hits])
    return wall_segments(lines, points, walls)


def square() -> FloorPlan:
    hits = [hit for i, line in enumerate(LINES) for hit in hits_along(line, -1.8, 1.8, wall=i)]
    path = (Pose(0.0, 0.0, 0.0, -1.2, 0.0), Pose(0.1, 0.1, 0.0, -1.2, 0.0))
    return FloorPlan(segments(LINES, hits), tuple(hits), path, 2.6)


def test_walls_end_at_their_common_corners() -> None:
    walls = square().walls
    assert len(walls) == 4
    corners = {tuple(round(x, 6) for x in end) for w in walls for end in (w.start_ne_m, w.end_ne_m)}
    assert corners == {(n, e) for n in (-2, 2) for e in (-2, 2)}
    assert sum(wall.length_m for wall in walls) == pytest.approx(16)


def test_a_gap_without_hits_stays_open() -> None:
    line = WallLine(0.0, 2.0, 0.01)
    walls = segments([line], hits_along(line, -2.0, -0.5) + hits_along(line, 0.5, 2.0))
    assert sorted(round(wall.length_m, 2) for wall in walls) == [1.5, 1.5]


def test_a_few_stray_hits_form_no_wall() -> None:
    line = WallLine(0.0, 2.0, 0.01)
    assert segments([line], hits_along(line, 0.0, 0.2)) == ()


@pytest.mark.parametrize(("beyond", "end_m"), [(4, 2.0), (8, 2.8)])
def test_a_wall_ends_at_a_crossing_wall_unless_enough_hits_lie_beyond(
    beyond: int, end_m: float
) -> None:
    line, other = LINES[0], LINES[1]
    hits = hits_along(line, -1.8, 1.9) + hits_along(other, -1.9, 1.9, wall=1)
    hits += hits_along(line, 2.1, 2.0 + 0.1 * beyond)
    wall, _ = segments([line, other], hits)
    assert max(abs(east_m) for _, east_m in (wall.start_ne_m, wall.end_ne_m)) == pytest.approx(
        end_m, abs=0.01
    )


def test_hits_off_a_line_do_not_lengthen_it() -> None:
    line, other = WallLine(0.0, 2.0, 0.01), WallLine(0.0, 2.5, 0.01)
    (wall,) = segments([line], hits_along(line, 0.0, 1.0) + hits_along(other, 1.0, 3.0, wall=None))
    assert wall.length_m == pytest.approx(1.0)


def test_the_outline_is_closed_when_every_direction_has_a_wall() -> None:
    walls = square().walls
    assert outline_closed(walls, (0.0, 0.0)) == 1.0
    assert outline_closed(walls[:2], (0.0, 0.0)) == pytest.approx(0.5, abs=0.02)
    assert outline_closed((), (0.0, 0.0)) == 0.0


def test_the_files_contain_the_map(tmp_path: Path) -> None:
    plan = square()
    files = save(plan, tmp_path)
    assert [file.name for file in files] == ["map.json", "map.png", "map.ply"]
    loaded = load_json(tmp_path / "map.json")
    assert (loaded.walls, loaded.path, loaded.ceiling_m) == (plan.walls, plan.path, plan.ceiling_m)
    assert matplotlib.image.imread(tmp_path / "map.png").shape[0] > 400
    mesh = trimesh.load_mesh(tmp_path / "map.ply", process=False)
    assert len(mesh.faces) == 2 * 4
    low, high = mesh.bounds
    assert [*low, *high] == pytest.approx([-2, -2, 0, 2, 2, 2.6])
    assert {path.name for path in tmp_path.iterdir()} == {file.name for file in files}


def test_an_empty_map_can_be_saved_and_loaded(tmp_path: Path) -> None:
    save(FloorPlan(), tmp_path)
    assert load_json(tmp_path / "map.json").walls == ()


def test_the_map_is_saved_during_the_flight(tmp_path: Path) -> None:
    autosave = AutoSave(tmp_path, square, print)
    autosave.update(1.0)
    assert not list(tmp_path.iterdir())
    autosave.update(6.0)
    autosave.settle()
    assert len(json.loads((tmp_path / "map.json").read_text())["walls"]) == 4


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EROFS, errno.EIO])
def test_a_failed_autosave_is_reported_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(Path, "write_text", refuse)
    messages: list[str] = []
    autosave = AutoSave(tmp_path, square, messages.append)
    for second in range(40):
        autosave.update(float(second))
        autosave.settle()
    assert len(messages) == 1
    assert os.strerror(number) in messages[0]


def test_an_error_while_the_map_is_built_is_reported_once_and_not_raised(tmp_path: Path) -> None:
    def broken() -> FloorPlan:
        raise ArithmeticError("singular")

    messages: list[str] = []
    autosave = AutoSave(tmp_path, broken, messages.append)
    for second in range(20):
        autosave.update(float(second))
    assert len(messages) == 1


def test_the_other_files_of_the_map_are_written_if_one_fails(tmp_path: Path) -> None:
    (tmp_path / ".unfinished-map.png").symlink_to("/dev/full")
    with pytest.raises(OutputError, match=r"map\.png: No space left"):
        save(square(), tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"map.json", "map.ply"}
