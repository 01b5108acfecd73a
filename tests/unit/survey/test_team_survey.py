"""Tests of a survey that a team flies: each drone knows the earlier flights from its own pad."""

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from companion.config import settings
from companion.config.team import PadConfig, TeamConfig
from companion.core.errors import SurveyError
from companion.core.frames import inverse_starts, places_moved_to
from companion.earlier import SURVEY_PAD, EarlierFlights
from companion.recording.reader import Recording
from companion.survey.folder import Survey
from companion.survey.team_starts import check_same_team, team_starts
from sitl.running.sorties import PAD, Sortie, Sorties
from sitl.sensors.beam import RAY
from sitl.simulation.simulation import Setup
from sitl.testing.flight import ReportView
from sitl.world.loading import load_world
from tests.worlds import TWO_ROOMS

pytestmark = pytest.mark.flights

BATTERY_S = 90.0
"""Too short for two drones to see both rooms."""
SETTINGS = settings.load(None, {"mission.kind": "building", "mission.time_limit_s": BATTERY_S})
PADS = (PadConfig(), PadConfig(north_m=1.0, east_m=-2.0, heading_deg=90.0))


@dataclass(frozen=True)
class FlownSurvey:
    folder: Path
    sorties: list[Sortie]


@pytest.fixture(scope="module")
def flown(tmp_path_factory: pytest.TempPathFactory) -> FlownSurvey:
    """Two sorties of two drones, in two rooms."""
    folder = tmp_path_factory.mktemp("survey")
    (folder / "world.toml").write_text(TWO_ROOMS)
    world = load_world(str(folder / "world.toml"))
    setup = Setup(world, "two rooms", 2, SETTINGS.sensors, battery_s=BATTERY_S, beam=RAY)
    sorties = Sorties(setup, SETTINGS, lambda _: None, folder, print, drones=2)
    return FlownSurvey(folder, list(sorties.fly(2)))


def test_the_second_sortie_flies_what_the_first_has_left(flown: FlownSurvey) -> None:
    first, second = flown.sorties
    assert [(row["sortie"], row["drone"]) for row in second.rows] == [(2, 1), (2, 2)]
    assert not all(row["completed"] for row in first.rows)
    before, after = ReportView(first.joint), ReportView(second.joint)
    assert after.coverage > before.coverage + 0.1
    assert after.coverage > 0.85
    assert after.collisions == 0
    assert after.apart_m > 0.6
    assert after.wall_error_aligned_cm < 4
    for row in map(ReportView, (*first.rows, *second.rows)):
        assert row.return_m < 0.3


def test_the_folder_of_a_team_is_a_survey(flown: FlownSurvey) -> None:
    """Its recordings say on which pad each flight began; the map is that of the simulator."""
    survey = Survey(flown.folder, print)
    joint = survey.make_map()
    assert joint is not None
    assert len(joint.merged.flights) == 4
    assert not joint.merged.left_out
    assert [wall.length_m for wall in joint.merged.plan.walls] == pytest.approx(
        [wall.length_m for wall in flown.sorties[-1].merged.plan.walls], abs=0.01
    )
    for flight in joint.merged.flights:
        assert math.hypot(*flight.off_the_pad[:2]) < 0.3

    second_drone = joint.recordings[1].config.team
    begun = Survey(flown.folder, print, second_drone).earlier()
    assert begun is not None
    assert begun.pad == pytest.approx(joint.merged.flights[1].pad)
    kept = Survey(flown.folder, pytest.fail, second_drone).earlier()  # a file; nothing is solved
    assert kept is not None
    assert np.array_equal(kept.walls.walls, begun.walls.walls)


def test_the_map_from_another_pad_is_the_same_map(flown: FlownSurvey) -> None:
    merged, pad = flown.sorties[-1].merged, np.array([1.5, -0.5, math.radians(70)])
    here = merged.for_next_flight(PAD.sigma)
    there = EarlierFlights.from_bytes(merged.for_next_flight(PAD.sigma, pad).to_bytes())
    assert np.array_equal(here.pad, SURVEY_PAD)
    assert np.array_equal(there.pad, pad)

    back = there.walls.moved_to(pad)
    for name in ("walls", "reach_m", "covariance"):
        assert getattr(back, name) == pytest.approx(getattr(here.walls, name), abs=1e-9)
    assert places_moved_to(pad, there.overhead[:, :2]) == pytest.approx(here.overhead[:, :2])
    places = [
        np.array([place for group in each.tried[0] for place in group]) for each in (here, there)
    ]
    assert places_moved_to(pad, places[1]) == pytest.approx(places[0], abs=0.002)

    space, other = here.spaces[0], there.spaces[0]
    free = np.argwhere(space.free)
    to_other = inverse_starts(pad[None])[0]
    moved = places_moved_to(to_other, np.array([space.place((n, e)) for n, e in free.tolist()]))
    is_free = [
        other.has(other.cell((n, e))) and bool(other.free[other.cell((n, e))])
        for n, e in moved.tolist()
    ]
    assert np.mean(is_free) > 0.95


def team(number: int, pads: tuple[PadConfig, ...] = PADS) -> Recording:
    values = {"team": TeamConfig(name="house", drone=number, pads=pads)}
    config = settings.Config().model_copy(update=values)
    return Recording(Path(f"drone{number}.mcap"), config)


def test_only_the_drones_of_a_team_have_pads() -> None:
    alone = Recording(Path("alone.mcap"))
    starts = team_starts([team(2), team(1), alone])
    assert list(starts) == ["drone1.mcap"]
    assert starts["drone1.mcap"] == pytest.approx([2.0, 1.0, -math.pi / 2])
    assert team_starts([alone, alone]) == {}


def test_recordings_with_other_pads_are_refused() -> None:
    check_same_team([team(1), Recording(Path("alone.mcap")), team(2)])
    moved = (PadConfig(), PadConfig(north_m=3.0))
    with pytest.raises(SurveyError, match=r"drone2\.mcap: team\.name or team\.pads differs"):
        check_same_team([team(1), team(2, moved)])
