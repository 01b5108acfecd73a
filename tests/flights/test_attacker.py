"""Tests with an attacker on the link: forged setpoints, modes, commands, heartbeats, replays."""

from collections.abc import Callable, Iterator
from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.app import App
from companion.config.settings import Config
from companion.link.signing import Signing
from companion.link.transports.transport import Message, make_codec, pipe_pair
from companion.run.hardware import make_rig
from companion.run.loop import ControlLoop
from companion.ticks import Progress
from sitl.autopilot.ardupilot import LAND, LOITER
from sitl.simulation.lockstep import LockstepClock
from sitl.simulation.simulation import Setup, Simulation
from sitl.world.loading import load_world
from tests.worlds import SMALL_ROOM

KEY, OTHER_KEY = b"k" * 32, b"x" * 32
FROM_S = 12.0
YEARS_S = 1e8
Frames = tuple[list[bytes], list[bytes]]
"""Frames to the autopilot, and frames to the companion."""


def for_autopilot() -> Iterator[Message]:
    yield mavlink.MAVLink_set_position_target_local_ned_message(
        0, 1, 1, 8, 0x05C7, *(0, 0, 0), *(0, 2.0, 0), *(0, 0, 0), 0, 0
    )
    yield mavlink.MAVLink_command_long_message(1, 1, 176, 0, 1, LAND, 0, 0, 0, 0, 0)
    yield mavlink.MAVLink_set_mode_message(1, 1, LAND)
    yield mavlink.MAVLink_command_long_message(1, 1, 400, 0, 0, 21196, 0, 0, 0, 0, 0)
    yield mavlink.MAVLink_param_set_message(1, 1, b"GUID_TIMEOUT", 5.0, 9)


def for_companion() -> Iterator[Message]:
    yield mavlink.MAVLink_heartbeat_message(2, 3, 209, LOITER, 4, 3)
    yield mavlink.MAVLink_local_position_ned_message(2**31, 9, 9, 9, 5, 5, 0)


def forged(to_autopilot: Any, to_companion: Any) -> Frames:
    """Frames that imitate the companion and the autopilot."""
    return (
        [bytes(m.pack(to_autopilot)) for m in for_autopilot()],
        [bytes(m.pack(to_companion)) for m in for_companion()],
    )


def unsigned(recorded: Frames) -> Frames:
    return forged(make_codec(1, 191), make_codec(1, 1))


def with_another_key(recorded: Frames) -> Frames:
    def signed(component: int) -> Any:
        return make_codec(1, component, Signing(OTHER_KEY, clock=lambda: 1.8e9 + YEARS_S))

    return forged(signed(191), signed(1))


def replayed(recorded: Frames) -> Frames:
    return recorded[0][-200::10], recorded[1][-200::10]


def flown(
    *, signed: bool, attack: Callable[[Frames], Frames] | None = None
) -> tuple[App, Simulation]:
    """A flight with an attacker between both ends, who receives all frames and adds some."""
    config = Config.model_validate({"sensors": {"profile": "paper"}})
    signing = (Signing(KEY), Signing(KEY)) if signed else (None, None)
    autopilot_end, companion_end = pipe_pair(1, signing)
    setup = Setup(load_world(SMALL_ROOM), SMALL_ROOM, 1, config.sensors)
    simulation = Simulation(setup, [autopilot_end])
    to_companion, to_autopilot = autopilot_end._outbox, companion_end._outbox  # type: ignore[attr-defined]
    recorded: Frames = ([], [])

    def between() -> None:
        recorded[0].extend(to_autopilot)
        recorded[1].extend(to_companion)
        if attack is not None and simulation.time_s > FROM_S:
            mine = attack(recorded)
            to_autopilot.extend(mine[0])
            to_companion.extend(mine[1])

    def watch(progress: Progress) -> None:
        """Ignore the progress."""

    app = App(config)
    clock = LockstepClock(simulation, between)
    rig = make_rig(config, companion_end, simulation.board.bus, clock)
    ControlLoop(app, rig, watch).run()
    return app, simulation


@pytest.fixture(scope="module")
def undisturbed() -> tuple[App, Simulation]:
    return flown(signed=False)


@pytest.mark.parametrize("attack", [unsigned, with_another_key, replayed])
def test_an_attacker_does_not_affect_a_signed_flight(
    undisturbed: tuple[App, Simulation], attack: Callable[[Frames], Frames]
) -> None:
    app, simulation = flown(signed=True, attack=attack)
    assert app.flight.completed, app.flight.ending
    assert simulation.record.path == undisturbed[1].record.path


def test_an_attacker_disrupts_an_unsigned_flight() -> None:
    app, _ = flown(signed=False, attack=unsigned)
    assert not app.flight.completed
