"""Tests of plans from other sources: repaired or rejected, with a report."""

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from typer.testing import CliRunner

from sitl.world.cli import commands
from sitl.world.format import WorldError
from sitl.world.geometry.model import WorldModel
from sitl.world.loading import load_world
from tests.examples import examples

PLANS = Path(__file__).parents[5] / "shared" / "floorplans"
SQUARE = [[0, 0, 5, 0], [5, 0, 5, 4], [5, 4, 0, 4], [0, 4, 0, 0]]


def write(tmp_path: Path, walls: object, **more: object) -> str:
    path = tmp_path / "plan.json"
    path.write_text(json.dumps({"name": "plan", "walls": walls, **more}))
    return str(path)


def test_x_is_east_and_y_is_north(tmp_path: Path) -> None:
    world = load_world(write(tmp_path, SQUARE))
    assert world.walls[0].points == ((0, 0), (0, 5))
    model = WorldModel(world)
    start = (*world.starts[0].position, -1.2)
    north_m = model.range_m(start, (1.0, 0.0, 0.0), 10)
    south_m = model.range_m(start, (-1.0, 0.0, 0.0), 10)
    assert north_m is not None
    assert south_m is not None
    assert north_m + south_m == pytest.approx(4)


def test_a_map_of_the_companion_is_a_plan(tmp_path: Path) -> None:
    walls = [{"start_ne_m": [y1, x1], "end_ne_m": [y2, x2]} for x1, y1, x2, y2 in SQUARE]
    mapped = load_world(write(tmp_path, walls, units={"length": "m"}))
    assert mapped.walls == load_world(write(tmp_path, SQUARE)).walls


def test_unusable_walls_are_left_out_and_reported(tmp_path: Path) -> None:
    reports: list[str] = []
    no_numbers = [[float("nan"), 0, 1, 1], [10**400, 0, 1, 1], [1, 2], "x"]
    no_walls = [[1, 1, 1, 1], [5, 0, 0, 0], [1e9, 0, 1, 1]]
    world = load_world(write(tmp_path, SQUARE + no_numbers + no_walls), reports.append)
    assert len(world.walls) == 4
    assert len(reports) == 4
    assert "left out 4 of 11 walls: not four finite numbers" in reports


@pytest.mark.parametrize(
    ("walls", "words"),
    [
        ([], "walls"),
        ([[0, 0, 0, 0]], "usable"),
        (7, "walls"),
        ([[0, 0, 5, 0]], "enclosed"),
    ],
)
def test_invalid_plans_are_refused(tmp_path: Path, walls: object, words: str) -> None:
    with pytest.raises(WorldError, match=words) as refused:
        load_world(write(tmp_path, walls))
    assert "\n" not in str(refused.value)


def test_other_units_are_refused(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match="units"):
        load_world(write(tmp_path, SQUARE, units="ft"))
    millimetres = [[1000 * x for x in wall] for wall in SQUARE]
    with pytest.raises(WorldError, match=r"none of 4 is usable: .* as if in millimetres"):
        load_world(write(tmp_path, millimetres))


def test_a_key_that_occurs_twice_is_refused(tmp_path: Path) -> None:
    """One of both lists of walls would vanish."""
    path = tmp_path / "plan.json"
    path.write_text(f'{{"walls": {SQUARE[:2]}, "walls": {SQUARE}}}')
    with pytest.raises(WorldError, match=r"plan\.json: the key 'walls' occurs 2 times; remove"):
        load_world(str(path))


@pytest.mark.parametrize("version", [2, "1"])
def test_a_map_of_a_later_version_is_refused(tmp_path: Path, version: object) -> None:
    walls = [{"start_ne_m": [y1, x1], "end_ne_m": [y2, x2]} for x1, y1, x2, y2 in SQUARE]
    with pytest.raises(WorldError, match=r"plan\.json: version = .* up to 1; update"):
        load_world(write(tmp_path, walls, format="pdps-map", version=version))
    assert load_world(write(tmp_path, walls, format="pdps-map", version=1)).walls


def test_a_plan_without_a_text_as_its_name_has_that_of_its_file(tmp_path: Path) -> None:
    for name in (None, ["a"], 7):
        assert load_world(write(tmp_path, SQUARE, name=name)).name == "plan"


@pytest.mark.parametrize(
    "name", ["flat 2/3", "/nowhere/house", "../house", "a\0b", "ü" * 300, "", "."]
)
def test_the_default_file_of_a_world_lies_in_this_folder_whatever_its_name(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    plan = write(tmp_path, SQUARE, name=name)
    (tmp_path / "here").mkdir()
    monkeypatch.chdir(tmp_path / "here")
    done = CliRunner().invoke(commands, ["export", plan])
    assert done.exit_code == 0, done.output
    (path,) = (tmp_path / "here").iterdir()
    assert path.suffix == ".toml"


def test_a_missing_file_and_a_folder_are_refused_with_the_reason_alone(tmp_path: Path) -> None:
    for suffix in (".json", ".yaml", ".toml", ".obj"):
        path = tmp_path / f"plan{suffix}"
        for reason in ("No such file or directory", "Is a directory"):
            with pytest.raises(WorldError) as refused:
                load_world(str(path))
            assert str(refused.value) == f"{path}: {reason}"
            path.mkdir(exist_ok=True)


@settings(max_examples=examples(60))
@given(st.binary(max_size=200) | st.text(max_size=200).map(str.encode))
def test_random_bytes_are_refused(data: bytes) -> None:
    import tempfile  # noqa: PLC0415 - hypothesis and tmp_path do not go together

    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "plan.json"
        path.write_bytes(data)
        with pytest.raises(WorldError):
            load_world(str(path))


@pytest.mark.skipif(not PLANS.exists(), reason="no ../shared/floorplans beside the checkout")
@pytest.mark.parametrize("plan", sorted(PLANS.glob("*.json")), ids=lambda path: path.stem)
def test_every_real_plan_loads_with_a_free_start(plan: Path) -> None:
    world = load_world(str(plan))
    model = WorldModel(world)
    for start in world.starts:
        assert model.clearance_m((*start.position, -1.2)) >= 0.6
