"""The JSON files of a map: one published definition, which old and new programs read."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from jsonschema import Draft202012Validator
from typer.testing import CliRunner

from companion.commands.cli import commands
from companion.core.errors import RecordingError
from companion.core.messages import FloorPlan, Pose, Surface, WallSegment
from companion.export.map_files import load_json, save_json
from companion.export.map_record import map_schema, write_json
from companion.export.plan.survey import survey
from tests.unit.export.map_schema import PUBLISHED, deviations, schema
from tests.unit.export.plans import two_rooms_with_a_doorway

BEFORE_VERSIONS = """{
 "frame": "local NED: origin at take-off, x along the first heading, z down",
 "ceiling_m": 2.5,
 "floor_m": null,
 "tops": [{"centre_ne_m": [1.0, 2.0], "height_m": 0.7, "area_m2": 0.5}],
 "walls": [{"start_ne_m": [0.0, 1.0], "end_ne_m": [4.0, 1.0], "sigma_m": 0.01,
            "normal_sigma_rad": 0.002, "hits": 20}],
 "path": [{"time_s": 1.0, "north_m": 1.0, "east_m": 2.0, "down_m": -1.2, "yaw_rad": 0.1}]
}"""
"""A `map.json` without a version, as programs wrote it before."""
PLAN = FloorPlan(
    walls=(WallSegment((0.0, 1.0), (4.0, 1.0), 0.01, 20, 0.002),),
    path=(Pose(1.0, 1.0, 2.0, -1.2, 0.1),),
    ceiling_m=2.5,
    tops=(Surface((1.0, 2.0), 0.7, 0.5),),
)


def test_the_published_schema_is_up_to_date() -> None:
    """`companion map-schema > docs/map.schema.json` updates it."""
    printed = CliRunner().invoke(commands, ["map-schema"]).stdout
    assert printed == PUBLISHED.read_text(encoding="utf-8")
    assert json.loads(printed) == map_schema()


def test_the_schema_is_one_and_every_key_has_a_description() -> None:
    Draft202012Validator.check_schema(schema())
    undocumented = [
        f"{name}.{key}"
        for name, definition in schema()["$defs"].items()
        for key, field in definition["properties"].items()
        if not field.get("description")
    ]
    assert undocumented == []


@pytest.mark.parametrize("plan", [FloorPlan(), PLAN, two_rooms_with_a_doorway(0.9)])
def test_both_files_follow_the_schema(plan: FloorPlan, tmp_path: Path) -> None:
    save_json(plan, tmp_path / "map.json")
    write_json(survey(plan), tmp_path / "export.json")
    for name in ("map.json", "export.json"):
        assert deviations(tmp_path / name) == []
        assert json.loads((tmp_path / name).read_text())["version"] == 1


@pytest.mark.parametrize(
    ("key", "wrong"),
    [("version", 2), ("walls", [{}]), ("path", None), ("units", {"length": "mm"})],
)
def test_the_schema_finds_what_is_wrong(tmp_path: Path, key: str, wrong: object) -> None:
    save_json(PLAN, tmp_path / "map.json")
    record = json.loads((tmp_path / "map.json").read_text())
    (tmp_path / "map.json").write_text(json.dumps({**record, key: wrong}))
    assert deviations(tmp_path / "map.json")


def test_an_export_has_rooms_and_openings(tmp_path: Path) -> None:
    write_json(survey(two_rooms_with_a_doorway(0.9)), tmp_path / "export.json")
    record = json.loads((tmp_path / "export.json").read_text())
    assert [round(room["area_m2"]) for room in record["rooms"]] == [20, 20]
    assert record["openings"][0]["width_m"] == pytest.approx(0.9)
    pose = record["path"][0]
    assert pose["position_ned_m"] == [pose["north_m"], pose["east_m"], pose["down_m"]]


def test_a_map_of_a_program_before_versions_is_read(tmp_path: Path) -> None:
    (tmp_path / "map.json").write_text(BEFORE_VERSIONS)
    assert load_json(tmp_path / "map.json") == PLAN


def test_a_program_before_versions_reads_the_map(tmp_path: Path) -> None:
    """It takes these keys, and of a pose no others."""
    save_json(PLAN, tmp_path / "map.json")
    record, before = json.loads((tmp_path / "map.json").read_text()), json.loads(BEFORE_VERSIONS)
    assert record["path"] == before["path"]
    assert record["walls"][0].items() >= before["walls"][0].items()
    for key in ("frame", "ceiling_m", "floor_m", "tops"):
        assert record[key] == before[key]


def test_a_map_of_a_later_version_is_refused(tmp_path: Path) -> None:
    (tmp_path / "map.json").write_text('{"version": 2}')
    with pytest.raises(RecordingError, match=r"map\.json: version = 2: .* up to 1; update"):
        load_json(tmp_path / "map.json")


def test_numbers_of_numpy_are_written(tmp_path: Path) -> None:
    save_json(replace(PLAN, ceiling_m=np.float64(2.5)), tmp_path / "map.json")
    assert load_json(tmp_path / "map.json") == PLAN
