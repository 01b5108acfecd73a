"""Tests of many missions: selection, processes, and results."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from PIL import Image
from rich.console import Console
from typer.testing import CliRunner

from companion.core.errors import ConfigError
from sitl.bench import engine
from sitl.bench.missions import Flown, Job, Sketch, Watch, fly, lost
from sitl.bench.sets import jobs_for, places
from sitl.bench.sheet import draw_sheet
from sitl.bench.summary import by_world, failed_flights, show, sum_up, summarise
from sitl.commands.cli import commands
from sitl.running.options import Autopilot, FlightOptions
from sitl.scoring.report import Report
from sitl.world.format import WorldError

ROOM = [[0, 0, 5, 0], [5, 0, 5, 8], [5, 8, 0, 8], [0, 8, 0, 0]]


def job(world: str, seed: int = 1) -> Job:
    return Job(FlightOptions(world, seed, "paper", "ardupilot"))


def row(**more: object) -> Report:
    values: dict[str, object] = {
        **{"world": "room", "profile": "paper", "start": "1", "seed": 1},
        **{"completed": True, "lost": False, "ending": "mission complete", "collisions": 0},
        **{"coverage": 1.0, "clearance_m": 0.5, "return_m": 0.2, "trace_over_least": None},
        **{"wall_error_aligned_cm": 1.0, "flight_time_s": 60.0},
        **more,
    }
    return values  # type: ignore[return-value]


@pytest.fixture
def plans(tmp_path: Path) -> Path:
    """A folder with a plan, an invalid plan, and another file."""
    folder = tmp_path / "plans"
    folder.mkdir()
    (folder / "a_room.json").write_text(json.dumps({"walls": ROOM}))
    (folder / "broken.json").write_text("{}")
    (folder / "README.md").write_text("nothing to fly")
    return folder


def test_sets_are_lists_of_worlds() -> None:
    assert len(places("paper")) == 7
    assert len(places("random")) == 50
    assert len(places("all")) == 59
    assert places("random_7") == [("random_7", None)]


def test_a_folder_gives_every_plan_with_up_to_three_starts(plans: Path) -> None:
    room, broken = str(plans / "a_room.json"), str(plans / "broken.json")
    assert places(str(plans)) == [(room, "1"), (room, "2"), (broken, "1")]


def test_jobs_combine_places_seeds_and_profiles(plans: Path) -> None:
    jobs = jobs_for([str(plans), "office"], 2, ["paper", "gp2y0a710k0f"], "room", crop_m=20.0)
    assert len(jobs) == len(set(map(str, (job.key for job in jobs)))) == 16
    assert {job.options.crop_m for job in jobs} == {20.0}


def test_a_job_has_the_requested_autopilot_and_battery() -> None:
    (only,) = jobs_for(["office"], 1, ["paper"], autopilot=Autopilot.PX4, battery_s=1800.0)
    assert only.key["autopilot"] == "px4"
    setup, _ = only.options.setup()
    assert setup.battery_s == 1800
    assert only.options.settings({}).mission.time_limit_s == 1800
    assert only.options.settings({"mission.time_limit_s": 90.0}).mission.time_limit_s == 90


def test_every_world_is_flown_with_every_clutter() -> None:
    jobs = jobs_for(["office", "room_100"], 2, ["paper"], clutters=[0.0, 0.5], clutter_seed=9)
    assert [job.key["clutter"] for job in jobs] == 2 * [0.0, 0.0, 0.5, 0.5]
    worlds = {job.options.setup()[0].world.name for job in jobs}
    assert worlds == {"office", "office_clutter_0.5", "room_100", "room_100_clutter_0.5"}
    assert {job.options.clutter_seed for job in jobs} == {9}


def test_each_world_gets_the_mission_of_its_kind() -> None:
    jobs = jobs_for(["room_200", "complex", "exterior"], 1, ["paper"])
    assert [job.mission for job in jobs] == ["room", "building", "exterior"]


def test_an_invalid_mission_is_refused_before_the_first_flight() -> None:
    with pytest.raises(ConfigError, match=r"mission\.kind = 'swim'"):
        jobs_for(["paper"], 1, ["paper"], "swim")


def test_an_unknown_set_name_lists_the_known_sets(tmp_path: Path) -> None:
    with pytest.raises(WorldError, match="exterior, random, all"):
        places("everything")
    with pytest.raises(WorldError, match="no plans"):
        places(str(tmp_path))


@pytest.mark.flights
def test_a_flight_returns_its_report_job_and_trace() -> None:
    flown = fly(job("room_100", seed=3))
    assert flown.row["completed"]
    assert (flown.row["world"], flown.row["start"], flown.row["seed"]) == ("room_100", "1", 3)
    assert 1.0 < float(flown.row["trace_over_least"] or 0) < 2.5
    for line in (*flown.sketch.mapped, *flown.sketch.paths):
        for north, east in line:
            assert -0.5 < north < 10.5
            assert -0.5 < east < 10.5


def test_a_continuous_alarm_counts_once() -> None:
    watched = Watch()
    for trouble in ("", "range sensor failed: left", "range sensor failed: left, front", ""):
        watched.tick("scanning", trouble)
    assert watched.alarms == 1
    for trouble in ("the gyro is silent", "range sensor failed: right", "mode changed"):
        watched.tick("holding", trouble)
    assert watched.alarms == 2


def test_an_error_becomes_a_row_with_its_reason() -> None:
    flown = fly(job("no_such_world"))
    assert not flown.row["completed"]
    assert str(flown.row["ending"]).startswith("lost: WorldError: no world 'no_such_world'")
    assert "\n" not in str(flown.row["ending"])


def test_the_summary_counts_flights_and_ignores_missing_values() -> None:
    rows = [
        row(coverage=0.5, trace_over_least=1.2),
        row(coverage=1.0, clearance_m=0.3, return_m=0.6),
        row(completed=False, ending="landed: time limit", collisions=2, coverage=None),
        lost(job("room"), "a\nreason").row,
    ]
    summary = summarise(rows)
    assert (summary["flights"], summary["completed"], summary["lost"]) == (4, 2, 1)
    assert summary["collisions"] == 2
    assert (summary["coverage_mean"], summary["coverage_min"]) == (0.75, 0.5)
    assert summary["coverage_median"] == 0.75
    assert (summary["clearance_min_m"], summary["return_max_m"]) == (0.3, 0.6)
    assert summary["trace_over_least_mean"] == 1.2
    assert summary["endings"] == {"landed: time limit; collisions: 2": 1, "lost: a reason": 1}
    assert len(failed_flights(rows)) == 2
    assert failed_flights(rows)[0].startswith("room, paper, start 1, seed 1: landed")


def test_worlds_and_profiles_are_summarised_separately() -> None:
    rows = [row(), row(world="hall"), row(), row(profile="gp2y0a710k0f")]
    groups = [(group["world"], group["profile"], group["flights"]) for group in by_world(rows)]
    assert groups == [("room", "paper", 2), ("hall", "paper", 1), ("room", "gp2y0a710k0f", 1)]


def test_clutter_levels_are_summarised_separately_with_alarms_per_hour() -> None:
    rows = [
        row(clutter=0.0, false_alarms=0, false_walls=0.0),
        row(clutter=0.5, false_alarms=1, false_walls=0.02, flight_time_s=90.0),
        row(clutter=0.5, false_alarms=2, false_walls=0.04, flight_time_s=90.0),
        row(clutter=0.5, false_alarms=None, flight_time_s=900.0),
        {**lost(job("room"), "a reason").row, "profile": "paper", "clutter": 0.5},
    ]
    clean, cluttered = by_world(rows)
    assert (clean["clutter"], clean["false_alarms_per_h"]) == (0.0, 0.0)
    assert (cluttered["clutter"], cluttered["flights"]) == (0.5, 4)
    assert cluttered["false_alarms_per_h"] == 60
    assert cluttered["false_walls_mean"] == pytest.approx(0.03)


def test_the_table_fits_80_columns_and_shows_clutter_only_if_present() -> None:
    def shown(*rows: Report) -> str:
        console = Console(width=80)
        with console.capture() as capture:
            show(sum_up(rows), console)
        return capture.get()

    clean = row(world="three_room_450", false_alarms=0, false_walls=0.0)
    cluttered = {**clean, "clutter": 0.25, "false_alarms": 3, "false_walls": 0.1}
    assert "clut-" not in shown(clean)
    text = shown(cluttered)
    assert "clut-" in text
    assert "…" not in text
    assert " 180 " in text
    assert " 10% " in text


def test_the_sheet_has_a_plan_for_every_flight(tmp_path: Path) -> None:
    crashed = row(clutter=0.5, completed=False, collisions=1, false_alarms=2)
    room = [((0.0, 0.0), (4.0, 0.0)), ((4.0, 0.0), (4.0, 3.0))]
    flown = Flown(crashed, Sketch(room, room, [[(1.0, 1.0), (2.0, 1.0)]]))
    lost_ones = [lost(job("room"), "nothing to draw")] * 4
    draw_sheet([flown, *lost_ones], tmp_path / "sheet.png")
    with Image.open(tmp_path / "sheet.png") as image:
        assert image.size[0] == 3 * 360


def test_the_command_prints_and_saves_the_results_and_saves_the_sheet(
    plans: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(engine, "run_all", lambda jobs, on_result, *_: [fly(job) for job in jobs])
    (plans / "a_room.json").unlink()
    out = tmp_path / "out"
    done = CliRunner().invoke(
        commands,
        [
            *("bench", "missions", f"--worlds={plans}", "--json", f"--out={out}"),
            *("--clutter=0", "--clutter=0.5", f"--sheet={tmp_path / 'own.png'}"),
        ],
    )
    printed = json.loads(done.stdout)
    assert printed["totals"]["flights"] == printed["totals"]["lost"] == 2
    assert done.exit_code == 1
    assert [group["clutter"] for group in printed["groups"]] == [0, 0.5]
    assert printed == json.loads((out / "missions.json").read_text())
    assert (out / "missions.png").exists()
    assert (tmp_path / "own.png").exists()


def test_an_interrupted_campaign_keeps_its_finished_flights(
    plans: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def crash(jobs: list[Job], on_result: Callable[[Flown], None], *_: object) -> list[Flown]:
        on_result(lost(jobs[0], "blown away"))
        raise MemoryError

    monkeypatch.setattr(engine, "run_all", crash)
    done = CliRunner().invoke(
        commands, ["bench", "missions", f"--worlds={plans}", f"--out={tmp_path}"]
    )
    assert isinstance(done.exception, MemoryError)
    left = json.loads((tmp_path / "missions.json").read_text())
    assert [row["ending"] for row in left["rows"]] == ["lost: blown away"]
