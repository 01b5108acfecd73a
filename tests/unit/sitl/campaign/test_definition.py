"""Tests of campaign files: which flights they name, and what is refused."""

from pathlib import Path

import pytest

from sitl.campaign.definition import Campaign, CampaignFileError, load_campaign
from sitl.campaign.flight import CampaignFlight
from sitl.sensors.beam import BeamPhysics


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "campaign.toml"


def loaded(file: Path, text: str) -> Campaign:
    file.write_text(text)
    return load_campaign(file)


def test_every_combination_is_a_flight(file: Path) -> None:
    campaign = loaded(
        file,
        """
        limit_s = 100
        [vary]
        world = ["room_100", "random_7"]
        seed = { from = 3, to = 5 }
        clutter = 0.5
        "mission.speed_m_s" = [0.5, 1]
        """,
    )
    assert len(campaign.flights) == 2 * 3 * 2
    assert len({flight.flight for flight in campaign.flights}) == 12
    assert campaign.varied == ("world", "seed", "mission.speed_m_s")
    assert campaign.limit_s == 100
    assert {flight.options.seed for flight in campaign.flights} == {3, 4, 5}
    assert {flight.options.clutter for flight in campaign.flights} == {0.5}


def test_a_set_stands_for_its_worlds(file: Path) -> None:
    assert len(loaded(file, '[vary]\nworld = ["paper", "office"]').flights) == 8


def test_drawn_flights_differ_and_are_the_same_each_time(file: Path) -> None:
    text = """
    [vary]
    world = ["room_100", "room_200"]
    seed = { from = 1, to = 1000 }
    clutter = { from = 0.0, to = 0.6 }
    [draw]
    flights = 200
    seed = 5
    """
    campaign = loaded(file, text)
    assert len({flight.flight for flight in campaign.flights}) == 200
    assert campaign == loaded(file, text)
    clutters = [flight.options.clutter for flight in campaign.flights]
    assert 0 <= min(clutters) < 0.1
    assert 0.5 < max(clutters) <= 0.6


def test_settings_reach_simulator_and_companion() -> None:
    flight = CampaignFlight(
        {
            "world": "room_100",
            "noise": 2.0,
            "beam.dropout": 0.1,
            "param.ANGLE_MAX": 2000,
            "mission.speed_m_s": 0.5,
            "sensors.mount_offset_m": 0.1,
        }
    )
    setup, settings, _ = flight.job().prepared()
    assert setup.odometry_noise.scale == pytest.approx(0.06)
    assert setup.beam == BeamPhysics(dropout=0.1)
    assert setup.parameters["ANGLE_MAX"] == 2000
    assert settings.mission.speed_m_s == 0.5
    assert setup.sensors.mount_offset_m == settings.sensors.mount_offset_m == 0.1


def test_the_number_of_a_flight_is_that_of_its_settings_and_of_the_worlds_content(
    tmp_path: Path,
) -> None:
    world = tmp_path / "world.toml"
    world.write_text("one")
    before = CampaignFlight({"world": str(world), "seed": 1}).flight
    assert CampaignFlight({"seed": 1, "world": str(world)}).flight == before
    assert CampaignFlight({"seed": 2, "world": str(world)}).flight != before
    world.write_text("another")
    assert CampaignFlight({"world": str(world), "seed": 1}).flight != before


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("flights = 3", "flights = 3: no such key"),
        ("[vary", "Expected ']' at the end of a table"),
        (f"[vary]\nseed = {'9' * 5000}", "not TOML: Exceeds the limit"),
        (f"[vary]\nseed = {'[' * 5000}", "not TOML: "),
        ("[vary]\nwrold = 'room_100'", r"wrold: no such setting; known are world, seed"),
        ("[vary]\nworld = 'nix'", "no world 'nix'"),
        ("[vary]\nseed = []", r"seed = \[\]: needs at least one value"),
        ("[vary]\nseed = { from = 3, to = 1 }", "seed: from 3 is more than to 1"),
        ("[vary]\nclutter = { from = 0.0, to = 0.5 }", r"clutter: .* can only be drawn; add \[dr"),
        ("[vary]\nteam = [1, 20]", "team = 20: should be less than or equal to 8"),
        ("[vary]\nteam = 3\nmission = 'room'", "team = 3: at most 2 drones fly 'room'"),
        ("[vary]\n'beam.dropout' = 3", "dropout = 3: should be less than or equal to 1"),
        ("[vary]\n'mission.speed_m_s' = [1, 7]", "mission.speed_m_s = 7"),
        ("[vary]\n'param.NO_SUCH' = 1", "no parameter NO_SUCH"),
        ("[vary]\nseed = [1, 2]\n[draw]\nflights = 7", "only 2 different flights were drawn"),
    ],
)
def test_a_bad_file_is_refused_with_key_value_and_remedy(text: str, words: str, file: Path) -> None:
    with pytest.raises(CampaignFileError, match=words):
        loaded(file, text)


def test_a_missing_file_is_named(file: Path) -> None:
    with pytest.raises(CampaignFileError, match=r"campaign\.toml: No such file"):
        load_campaign(file)
