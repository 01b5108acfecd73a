"""Output files: one that fails does not prevent the others, and any file name works."""

import json
from itertools import pairwise
from pathlib import Path
from typing import cast

import ezdxf.filemanagement
import matplotlib.image
import numpy as np
import pytest
import yaml
from ezdxf.document import Drawing
from ezdxf.entities.vport import VPort
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from companion.commands.cli import commands as companion
from companion.core.arrays import Array
from companion.core.errors import OutputError
from companion.core.frames import Place, Vector2
from companion.core.messages import FloorPlan, Pose, WallSegment
from companion.export import formats, map_files
from companion.export.colours import flight_colour
from companion.export.dxf.write import write_dxf
from companion.export.formats import export
from companion.export.map_files import save
from companion.export.map_png import draw
from companion.export.plan.labels import Labels
from companion.export.plan.survey import survey
from companion.export.ros_map import write_ros_map
from sitl.commands.cli import commands as sitl
from sitl.core.errors import SitlError
from sitl.world.drawing import draw_plan
from sitl.world.loading import load_world
from tests.examples import examples
from tests.worlds import SMALL_ROOM

LABELS = Labels("a flight", Place(47.0, 8.0, 0.0))
LOG_HEADER = "time_s,odom_x_m,odom_y_m,odom_yaw_rad,front_m\n"


def room(north_m: float = 4.0, east_m: float = 3.0, corner: Vector2 = (0.0, 0.0)) -> FloorPlan:
    north, east = corner
    ring = [(north, east), (north + north_m, east), (north + north_m, east + east_m)]
    ring += [(north, east + east_m), (north, east)]
    return FloorPlan(
        walls=tuple(WallSegment(a, b, 0.01, 20, 0.01) for a, b in pairwise(ring)),
        ceiling_m=2.5,
    )


# File names


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    name=st.text(st.characters(exclude_characters="/\0", exclude_categories=["Cs"]), max_size=20)
    .map(lambda text: f"{text}x")
    .filter(lambda text: len(text.encode()) < 200)
)
@pytest.mark.parametrize(
    "always", ["kitchen #2", "flat 3: east wing", "- draft", "a\"b\\c'd", "😀"]
)
def test_a_ros_map_names_its_image_for_any_file_name(
    tmp_path: Path, name: str, always: str
) -> None:
    for stem in (name, always):
        path = tmp_path / f"{stem}.pgm"
        write_ros_map(survey(room()), path)
        record = yaml.safe_load(path.with_suffix(".yaml").read_text(encoding="utf-8"))
        assert record["image"] == path.name
        path.unlink()


def test_dollar_signs_in_a_name_are_not_parsed_as_a_formula(tmp_path: Path) -> None:
    world = load_world("room_100").model_copy(update={"name": "$x^ and $y"})
    draw_plan(world, tmp_path / "plan.png")
    assert (tmp_path / "plan.png").stat().st_size > 0


# Initial view of a DXF


def active_view(document: Drawing) -> VPort:
    (view,) = cast(list[VPort], document.viewports.get("*Active"))
    return view


@given(
    north_m=st.floats(1, 60),
    east_m=st.floats(1, 60),
    corner=st.tuples(st.floats(-100, 100), st.floats(-100, 100)),
)
@settings(max_examples=examples(10), suppress_health_check=[HealthCheck.function_scoped_fixture])
def test_the_initial_view_of_a_dxf_shows_the_whole_plan(
    tmp_path: Path, north_m: float, east_m: float, corner: Vector2
) -> None:
    write_dxf(survey(room(north_m, east_m, corner)), tmp_path / "plan.dxf", LABELS)
    document = ezdxf.filemanagement.readfile(tmp_path / "plan.dxf")
    low, high = document.header["$EXTMIN"], document.header["$EXTMAX"]
    (south, west), north, east = corner, corner[0] + north_m, corner[1] + east_m
    assert low[0] <= west + 0.01
    assert high[0] >= east - 0.01
    assert low[1] <= south + 0.01
    assert high[1] >= north - 0.01
    view = active_view(document)
    middle_x, middle_y, *_ = view.dxf.center
    assert abs(middle_y - (south + north) / 2) + north_m / 2 <= view.dxf.height / 2 + 0.01
    assert abs(middle_x - (west + east) / 2) + east_m / 2 <= view.dxf.height * 2 / 3 + 0.01
    assert view.dxf.height < 2 * max(north_m, east_m) + 4
    assert (document.header["$INSUNITS"], document.header["$MEASUREMENT"]) == (6, 1)


def test_the_initial_view_of_an_empty_dxf_shows_some_metres(tmp_path: Path) -> None:
    write_dxf(survey(FloorPlan()), tmp_path / "plan.dxf", LABELS)
    view = active_view(ezdxf.filemanagement.readfile(tmp_path / "plan.dxf"))
    assert 5 < view.dxf.height < 50


# Joint maps


def flown_twice() -> FloorPlan:
    """Two flights to the north: one from the origin, one 8 m east of it."""
    path = tuple(Pose(0.0, north, east, -1.0, 0.0) for east in (0.0, 8.0) for north in (0.0, 4.0))
    return FloorPlan(path=path, begins=(0, 2))


def test_each_flight_of_a_joint_map_has_a_path_of_its_own(tmp_path: Path) -> None:
    draw(flown_twice(), tmp_path / "map.png")
    picture = np.rint(255 * matplotlib.image.imread(tmp_path / "map.png")[..., :3])
    rows, columns, _ = picture.shape
    above_the_legend = picture[: int(0.9 * rows)]

    def columns_of(number: int) -> Array:
        colour = tuple(bytes.fromhex(flight_colour(number)[1:]))
        is_there: Array = (above_the_legend == colour).all(axis=2).any(axis=0)
        share: Array = np.flatnonzero(is_there) / columns
        return share

    first, second = columns_of(0), columns_of(1)
    assert len(first)
    assert len(second)
    assert first.max() < 0.3
    assert second.min() > 0.7

    write_dxf(survey(flown_twice()), tmp_path / "map.dxf", LABELS)
    drawing = ezdxf.filemanagement.readfile(tmp_path / "map.dxf")
    assert len(drawing.modelspace().query('LWPOLYLINE[layer=="PATH"]')) == 2


# Failing output files


def broken(*_: object) -> None:
    raise RuntimeError("an error inside a library")


@pytest.mark.parametrize("victim", ["map.json", "map.png", "map.ply"])
def test_a_map_file_that_fails_does_not_prevent_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, victim: str
) -> None:
    monkeypatch.setitem(map_files.MAP_WRITERS, victim, broken)
    with pytest.raises(OutputError, match=rf"^\S+{victim}: .*an error inside a library"):
        save(room(), tmp_path)
    left = {"map.json", "map.png", "map.ply"} - {victim}
    assert {path.name for path in tmp_path.iterdir()} == left


@pytest.mark.parametrize("victim", ["map.png", "map.json", "trajectory.tum", "report.json"])
def test_an_output_file_of_a_log_that_fails_does_not_prevent_the_others(
    tmp_path: Path, victim: str
) -> None:
    rows = [f"{0.1 * i},{0.1 * i},0,0,{4 - 0.1 * i}" for i in range(20)]
    (tmp_path / "log.csv").write_text(LOG_HEADER + "\n".join(rows))
    out = tmp_path / "out"
    (out / victim / "in the way").mkdir(parents=True)
    result = CliRunner().invoke(companion, ["map", str(tmp_path / "log.csv"), "--out", str(out)])
    assert isinstance(result.exception, OutputError)
    assert str(out / victim) in str(result.exception)
    assert "verdict" in result.output
    written = {path.name for path in out.iterdir() if path.is_file()}
    every = {"map.png", "map.json", "map.ply", "trajectory.tum", "report.json"}
    assert written == every - {victim}


def test_a_format_that_fails_does_not_prevent_the_others(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(formats.WRITERS, "dxf", ("gone", "write_dxf"))
    (tmp_path / "map.svg").mkdir()
    written: list[Path] = []
    with pytest.raises(OutputError) as refused:
        export(
            survey(room()),
            ["dxf", "svg", "pgm", "json"],
            tmp_path,
            "map",
            LABELS,
            tell=written.append,
        )
    assert "pip install 'pdps-companion[export]'" in str(refused.value)
    assert f"{tmp_path / 'map.svg'}: Is a directory" in str(refused.value)
    assert [path.name for path in written] == ["map.pgm", "map.json"]
    assert json.loads((tmp_path / "map.json").read_text())["walls"]


@pytest.mark.flights
def test_a_simulated_flight_is_scored_if_its_map_cannot_be_written(tmp_path: Path) -> None:
    (tmp_path / "map.png" / "in the way").mkdir(parents=True)
    result = CliRunner().invoke(sitl, ["fly", SMALL_ROOM, "--out", str(tmp_path)])
    assert isinstance(result.exception, OutputError)
    assert "map.png" in str(result.exception)
    assert "coverage" in result.output
    assert json.loads((tmp_path / "report.json").read_text())["completed"]
    assert json.loads((tmp_path / "map.json").read_text())["walls"]


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"walls": [1]}'])
def test_an_invalid_map_or_ground_truth_is_a_one_line_error(tmp_path: Path, text: str) -> None:
    (tmp_path / "map.json").write_text(text)
    files = [str(tmp_path / "map.json")] * 2
    result = CliRunner().invoke(sitl, ["score", SMALL_ROOM, *files])
    assert isinstance(result.exception, SitlError)
    assert str(result.exception).startswith(files[0])
    assert "\n" not in str(result.exception)


def test_a_plan_that_cannot_be_written_is_an_error_with_its_path(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    out = str(tmp_path / "file" / "plan.png")
    result = CliRunner().invoke(sitl, ["world", "show", "room_100", "--out", out])
    assert isinstance(result.exception, OutputError)
    assert out in str(result.exception)
