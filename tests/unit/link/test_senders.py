"""Vehicles that are not flown are named, and receive no requests."""

from typing import Any

import pytest
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import LinkConfig
from companion.core.messages import Command, CommandKind, VehicleState
from companion.link.link import Link
from companion.link.transports.transport import Message
from companion.pdps.flight.ground import CONNECT_TIMEOUT_S
from companion.pdps.flight.phases import step
from companion.pdps.flight.state import FlightState, Phase
from tests.unit.pdps.flight.flight_ticks import PLAN, view

ARDUPILOT, PX4, GENERIC, NONE = 3, 12, 0, 8
QUADROTOR, ROVER, PLANE, GCS, ONBOARD = 2, 10, 1, 6, 18


class Air:
    """A `Transport` on which any component can send."""

    def __init__(self, **config: Any) -> None:
        self._waiting: list[Message] = []
        self.sent: list[Message] = []
        self.link = Link(self, LinkConfig.model_validate(config))
        self.now_s = 0.0

    def receive(self) -> list[Message]:
        waiting, self._waiting = self._waiting, []
        return waiting

    def send(self, message: Message) -> None:
        self.sent.append(message)

    def close(self) -> None: ...

    def deliver(self, message: Message, system: int = 1, component: int = 1) -> VehicleState:
        message._header.srcSystem, message._header.srcComponent = system, component
        self._waiting.append(message)
        self.now_s += 0.25
        return self.link.poll(self.now_s).vehicle

    @property
    def asked(self) -> list[str]:
        return [m.get_type() for m in self.sent if m.get_type() != "HEARTBEAT"]


def beat(autopilot: int = ARDUPILOT, kind: int = QUADROTOR, mode: int = 0) -> Message:
    return mavlink.MAVLink_heartbeat_message(kind, autopilot, 81, mode, 3, 3)


def attitude(ms: int) -> Message:
    return mavlink.MAVLink_attitude_message(ms, 0, 0, 0, 0, 0, 0)


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
@pytest.mark.parametrize("kind", [2, 13, 14, 15, 29, 35])
def test_multicopters_are_flown(autopilot: int, kind: int) -> None:
    vehicle = Air().deliver(beat(autopilot, kind))
    assert (vehicle.connected, vehicle.unfit) == (True, "")


@pytest.mark.parametrize("autopilot", [ARDUPILOT, PX4])
@pytest.mark.parametrize(
    ("kind", "words"),
    [
        (ROVER, "a ground rover"),
        (PLANE, "a fixed wing"),
        (4, "a helicopter"),
        (7, "an airship"),
        (11, "a surface boat"),
        (12, "a submarine"),
        (20, "a vtol quadrotor"),
        (0, "a vehicle of no known type"),
    ],
)
def test_other_vehicles_are_named_and_receive_no_requests(
    autopilot: int, kind: int, words: str
) -> None:
    air = Air()
    vehicle = air.deliver(beat(autopilot, kind, mode=4))
    air.link.send(air.now_s, None, Command(CommandKind.ARM))
    assert not vehicle.connected
    assert vehicle.unfit == f"{words} at udpin:127.0.0.1:14550: only multicopters are flown"
    assert air.asked == []


def test_another_system_is_named_with_the_configuration_key() -> None:
    air = Air()
    assert air.deliver(beat(), system=3).unfit == "system 3 sends there, not 1: link.system_id"
    both = air.deliver(beat(), system=2).unfit
    assert both == "systems 2 and 3 send there, not 1: link.system_id"
    assert air.deliver(beat(), system=1).unfit == ""


def test_an_autopilot_of_another_kind_is_named() -> None:
    unfit = Air().deliver(beat(GENERIC)).unfit
    assert unfit.startswith("unsupported autopilot GENERIC at udpin:127.0.0.1:14550:")
    assert unfit.endswith("ArduPilot and PX4 are supported")


def test_an_autopilot_of_another_component_is_named() -> None:
    assert "component 5" in Air().deliver(beat(), component=5).unfit


def test_ground_stations_and_gimbals_do_not_count_as_autopilots() -> None:
    air = Air()
    air.deliver(beat(NONE, GCS), system=255, component=190)
    unfit = air.deliver(beat(NONE, 26), component=154).unfit
    assert "no autopilot at" in unfit
    assert "GCS (system 255, component 190)" in unfit
    assert "GIMBAL (system 1, component 154)" in unfit
    assert "router" in unfit


def test_the_flight_fails_with_the_reason_that_the_vehicle_is_not_flown() -> None:
    vehicle = Air().deliver(beat(kind=ROVER))
    waiting = FlightState(Phase.CONNECT, since_s=99.0)
    patient, _ = step(waiting, view(vehicle), PLAN)
    assert patient.phase is Phase.CONNECT  # PX4 reports no valid type while it starts
    ended, _ = step(patient, view(vehicle, time_s=99.1 + CONNECT_TIMEOUT_S), PLAN)
    assert (ended.phase, ended.trouble) == (Phase.FAILED, vehicle.unfit)


@pytest.mark.parametrize("other", [beat(PX4), beat(kind=ROVER), beat(PX4, 13)])
def test_two_different_autopilots_with_one_system_id_are_reported(other: Message) -> None:
    air = Air()
    for _ in range(3):
        air.deliver(beat())
        vehicle = air.deliver(other)
    assert "two autopilots" in vehicle.unfit
    assert "system id" in vehicle.unfit


def test_a_ground_station_with_the_ids_of_the_autopilot_is_reported() -> None:
    air = Air()
    for _ in range(3):
        air.deliver(beat())
        vehicle = air.deliver(beat(NONE, GCS))
    assert "GCS uses system 1, component 1, the autopilot's" in vehicle.unfit


def test_two_autopilots_of_one_kind_are_distinguished_by_their_clocks() -> None:
    air = Air()
    air.deliver(beat())
    for tick in range(4):
        air.deliver(attitude(90_000 + 50 * tick))
        vehicle = air.deliver(attitude(20_000 + 50 * tick))
    assert "two autopilots" in vehicle.unfit


def test_a_restarted_autopilot_is_not_reported_as_two() -> None:
    air = Air()
    air.deliver(beat(PX4))
    air.deliver(attitude(90_000))
    air.deliver(attitude(100))
    air.deliver(beat(PX4, kind=0))
    vehicle = air.deliver(beat(PX4))
    assert vehicle.unfit == ""


@pytest.mark.parametrize(
    "message",
    [
        beat(NONE, ONBOARD),
        mavlink.MAVLink_set_position_target_local_ned_message(
            0, 1, 1, 8, 0x05C7, *(0.0,) * 9, 0.0, 0.0
        ),
    ],
)
def test_another_companion_with_our_component_id_is_reported(message: Message) -> None:
    air = Air()
    air.deliver(beat())
    vehicle = air.deliver(message, component=191)
    assert vehicle.connected
    assert "another sender uses system 1, component 191" in vehicle.unfit
    assert "link.component_id" in vehicle.unfit
    flight, action = step(FlightState(Phase.PREPARE, since_s=99.0), view(vehicle), PLAN)
    assert (flight.phase, flight.trouble) == (Phase.FAILED, vehicle.unfit)
    assert action.command is None


def test_a_companion_with_another_component_id_is_accepted() -> None:
    air = Air(component_id=192)
    air.deliver(beat())
    assert air.deliver(beat(NONE, ONBOARD), component=191).unfit == ""
