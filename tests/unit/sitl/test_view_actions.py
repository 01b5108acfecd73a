"""Tests that the page offers every action of the simulator, with its arguments."""

from collections.abc import Iterator

import pytest

from companion.view.access.server import PageServer, open_page
from sitl.core.errors import SitlError
from sitl.testing.actions.table import ACTIONS
from sitl.view.action_controls import FIRST_MODE, ActionControls
from sitl.view.faults import action, names, summary


@pytest.fixture(scope="module")
def server() -> Iterator[PageServer]:
    server, _ = open_page("127.0.0.1", 0, None, "test")
    yield server
    server.stop()


@pytest.mark.parametrize("autopilot", list(FIRST_MODE))
def test_each_action_is_offered_and_its_first_arguments_are_valid(
    server: PageServer, autopilot: str
) -> None:
    controls = ActionControls(server.gui, lambda: autopilot)
    assert {name.replace(" ", "_") for name in controls.action.options} == set(ACTIONS)
    for name in ACTIONS:
        controls.action.value = name.replace("_", " ")  # type: ignore[misc]
        controls.offer()
        assert controls.name == name
        assert action(name, controls.arguments)
        assert summary(name).endswith(".")


def test_the_pilot_comes_first() -> None:
    assert names()[:2] == ["pilot_mode", "pilot_arms"]


@pytest.mark.parametrize(
    ("name", "arguments", "words"),
    [
        ("unplug", {"beam": "aft"}, "no beam 'aft'; known: front"),
        ("battery", {}, "battery: percent"),
        ("pilot_mode", {"name": "FAST"}, "no mode 'FAST'"),
        ("mute", {"message": "ATTITUDE", "for_s": "soon"}, "for_s = 'soon'"),
    ],
)
def test_an_invalid_argument_is_refused(
    name: str, arguments: dict[str, object], words: str
) -> None:
    with pytest.raises(SitlError, match=words):
        action(name, arguments)
