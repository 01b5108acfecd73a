"""Tests the pages in a real browser: flights, playback, live view, and access control."""

import json
import socket
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from playwright.sync_api import Browser, Page, expect

from benchmarks.pictures.browser import choose
from sitl.testing import Sitl
from sitl.world.loading import world_names
from tests.browser.browser import (
    chromium,
    coloured,
    drop,
    has_row,
    looked_at,
    number,
    opened,
    overlapping,
    press,
    row,
    served,
    text_field,
    unfold,
)
from tests.processes.started import (
    companion,
    flying,
    free_udp_port,
    running_sitl,
)
from tests.processes.started import sitl as sitl_command
from tests.waiting import until

TOKEN = "0123456789abcdef"


@pytest.fixture(scope="module")
def browser() -> Iterator[Browser]:
    with chromium() as browser:
        yield browser


@contextmanager
def simulator(browser: Browser, *arguments: str) -> Iterator[Page]:
    with (
        served(sitl_command("view", *arguments, "--port", "0", "--no-browser")) as address,
        opened(browser, address) as page,
    ):
        yield page


def test_the_page_starts_and_shows_a_flight(browser: Browser, tmp_path: Path) -> None:
    with simulator(browser, "office") as page:
        expect(page).to_have_title("PDPS simulator")
        press(page, "room_100")
        looked_at(page, "before", tmp_path, "Start", "Mission")
        choose(page, "speed", "10 ×")
        press(page, "Start")
        until(lambda: walls_m(page) > 1, "the first wall")
        before_m = walls_m(page)
        until(lambda: walls_m(page) > before_m + 5, "the map grows")
        until(lambda: coloured(page, 0.5, 1) > 500, "the map is drawn")
        press(page, "Pause")
        until(lambda: row(page, "speed") == "paused", "a pause")
        looked_at(page, "flying", tmp_path, "doing", "battery", "coverage")
        assert number(page, "least clearance") > 0
        unfold(page, "Display")
        page.get_by_label("hide the truth", exact=True).check()
        until(lambda: not has_row(page, "least clearance"), "no truth")
        until(lambda: coloured(page, 0, 0.45) < 50, "no true path")
        page.get_by_label("hide the truth", exact=True).uncheck()
        choose(page, "speed", "all")

        expect(page.get_by_role("button", name="geojson")).to_be_visible()
        assert row(page, "doing") == "mission complete"
        until(lambda: number(page, "coverage") >= 95, "coverage")
        assert number(page, "wall error, aligned") < 6
        looked_at(page, "ended", tmp_path, "doing", "coverage")
        with page.expect_download() as waiting:
            press(page, "json")
        waiting.value.save_as(tmp_path / "map.json")
        text = (tmp_path / "map.json").read_text()
        assert len(json.loads(text)["walls"]) == 4

        page.get_by_role("tab", name="Plan").click()
        expect(page.locator(".pdps-plan .wall")).to_have_count(4)
        expect(page.get_by_text("± 0.1")).to_have_count(4)
        assert overlapping(page, ".pdps-plan text") == 0
        drop(page, "map.json", text)
        expect(page.locator(".pdps-plan .wall")).to_have_count(0)
        expect(page.locator(".pdps-plan .true")).to_have_count(4)
        expect(page.get_by_role("button", name="geojson")).to_have_count(0)
        assert not has_row(page, "time")
        until(lambda: coloured(page, 0.5, 1) < 50, "nothing of the last flight")


def test_the_pilot_pauses_steps_and_takes_over(browser: Browser) -> None:
    with simulator(browser) as page:
        press(page, "Pause")
        expect(page.get_by_text("no flight is under way; press Start")).to_be_visible()
        text_field(page, "file or name").fill("nowhere.toml")
        press(page, "Open")
        expect(
            page.get_by_text("nowhere.toml: No such file").or_(
                page.get_by_text("No such file or directory: 'nowhere.toml'")
            )
        ).to_be_visible()
        text_field(page, "stand-off").fill("near")
        press(page, "Start")
        expect(page.get_by_text("should be metres, or range or accurate")).to_be_visible()
        text_field(page, "stand-off").fill("0.1")
        press(page, "Start")
        expect(page.get_by_text("mission.standoff = 0.1: should be from 0.6")).to_be_visible()

        text_field(page, "stand-off").fill("1.5")
        choose(page, "speed", "5 ×")
        press(page, "Start")
        until(lambda: walls_m(page) > 5, "walls")
        press(page, "Pause")
        paused_s = settled(page)
        press(page, "Step")
        until(lambda: number(page, "time") > paused_s, "a step")
        assert settled(page) == pytest.approx(paused_s + 0.05, abs=0.06)

        unfold(page, "Pilot and faults")
        choose(page, "action", "unplug")
        press(page, "Inject")
        press(page, "Resume")
        until(lambda: has_row(page, "trouble"), "a fault")
        press(page, "Start")
        until(lambda: number(page, "time") < paused_s, "another flight")
        until(lambda: number(page, "height") > 0.3, "a take-off")
        choose(page, "speed", "1 ×")  # faster, the turn might end between two reads
        until(lambda: "turning 360°" in row(page, "doing"), "in the air again")
        choose(page, "action", "pilot mode")
        press(page, "Inject")
        until(lambda: "mode changed to LOITER" in row(page, "doing"), "handed over")


def test_the_page_offers_every_setting_and_stops_a_flight_of_a_team(browser: Browser) -> None:
    with simulator(browser) as page:
        for world in world_names():
            button = page.get_by_role("button", name=world, exact=True)
            expect(button).to_be_visible()
        text_field(page, "file or name").fill("random_17")
        press(page, "Open")
        choose(page, "kind", "building")
        text_field(page, "stand-off").fill("1.2")
        fill(page, "speed, m/s", "0.8")
        fill(page, "seed", "3")
        unfold(page, "Sensors and noise")
        expect(page.get_by_text("range, m", exact=True)).to_be_hidden()
        choose(page, "profile", "own")
        fill(page, "range, m", "4")
        fill(page, "noise σ, cm", "2")
        fill(page, "odometry ×", "0.5")
        choose(page, "autopilot", "px4")
        choose(page, "speed", "all")
        press(page, "Add UAV")
        expect(page.get_by_text("on its pad")).to_have_count(2)
        press(page, "Start")
        until(lambda: walls_m(page) > 1, "the first wall")
        choose(page, "drone", "2")
        assert number(page, "battery") > 50
        assert number(page, "height") == pytest.approx(1.2, abs=0.5)
        for plot in ("ranges, m", "heading, °", "gyro bias, °/s"):
            expect(page.get_by_text(plot, exact=True)).to_be_visible()
        press(page, "Stop: land now")
        expect(page.get_by_role("button", name="geojson")).to_be_visible()
        assert row(page, "doing") == "landed: landing was requested"
        press(page, "Remove UAV")
        expect(page.get_by_label("drone", exact=True)).to_be_hidden()


def fill(page: Page, label: str, value: str) -> None:
    field = text_field(page, label)
    field.fill(value)
    field.press("Enter")


def walls_m(page: Page) -> float:
    """Length of the mapped walls so far."""
    return number(page, "walls mapped") if has_row(page, "walls mapped") else 0.0


def settled(page: Page) -> float:
    """The flight's time when it no longer advances."""
    seen = [-1.0]

    def has_stopped() -> bool:
        seen.append(number(page, "time"))
        page.wait_for_timeout(400)
        return number(page, "time") == seen[-1]

    until(has_stopped, "a pause")
    return seen[-1]


def test_a_recording_is_played_back(browser: Browser, sitl: Sitl, tmp_path: Path) -> None:
    flight = sitl.fly("room_100", profile="paper", record=tmp_path)
    (recording,) = tmp_path.glob("*.mcap")
    end_s = flight.simulation.time_s
    with simulator(browser, str(recording)) as page:
        expect(page.get_by_role("button", name="geojson")).to_be_visible()
        press(page, "Play")
        until(lambda: walls_m(page) > 5, "walls")
        fill(page, "time, s", f"{end_s:.1f}")
        until(lambda: row(page, "doing") == "mission complete", "its end")
        assert row(page, "walls mapped").startswith(f"{len(flight.plan.walls)},")
        fill(page, "time, s", "5")
        until(lambda: number(page, "time") < 6, "its beginning")


def test_access_requires_the_token(browser: Browser, tmp_path: Path) -> None:
    token_file = tmp_path / "token"
    token_file.write_text(TOKEN)
    token_file.chmod(0o600)
    options = ("--host", "0.0.0.0", "--token-file", str(token_file), "--port", "0", "--no-browser")
    with served(sitl_command("view", *options)) as address, browser.new_page() as stranger:
        here = address.replace("0.0.0.0", "127.0.0.1")
        refused = stranger.goto(here.partition("?")[0])
        assert refused is not None
        assert refused.status == 403
        assert "needs its token" in stranger.content()
        with opened(browser, here) as page:
            expect(page.get_by_role("button", name="Start")).to_be_visible()
            assert TOKEN not in page.url


def test_the_page_shows_a_flying_drone(browser: Browser, tmp_path: Path) -> None:
    port = free_udp_port()
    config = tmp_path / "drone.toml"
    config.write_text(f'[view]\nlisten = "127.0.0.1:{port}"\n')
    with running_sitl("--speed", "10") as (_, mavlink_port, bus_port):
        drone = flying(mavlink_port, bus_port, tmp_path / "out", "--config", str(config))
        try:
            until(lambda: is_listening(port), "the feed")
            command = companion("view", f"127.0.0.1:{port}", "--port", "0", "--no-browser")
            with served(command) as address, opened(browser, address) as page:
                until(lambda: walls_m(page) > 5, "walls")
                until(lambda: coloured(page, 0, 1) > 300, "the map is drawn")
                assert page.get_by_role("button", name="Start").count() == 0
        finally:
            drone.kill()
            drone.communicate()


def is_listening(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0
