"""Tests with pymavlink's `mavutil` as client, the base of many MAVLink scripts."""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from pymavlink import mavutil
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.parameters.table import load_table
from tests.processes.started import free_udp_port, vehicle_at
from tests.waiting import DEADLINE_S, until


@contextmanager
def connected(firmware: str) -> Iterator[Any]:
    """A connection that has received the vehicle's heartbeat."""
    port = free_udp_port()
    with vehicle_at(port, firmware):
        vehicle = mavutil.mavlink_connection(f"udpin:127.0.0.1:{port}", dialect="ardupilotmega")
        try:
            assert vehicle.wait_heartbeat(timeout=DEADLINE_S)
            assert vehicle.target_system == 1
            yield vehicle
        finally:
            vehicle.close()


def receives(vehicle: Any, kind: str, **wanted: object) -> bool:
    """True if a message with these fields arrives; False after 0.5 s without any message."""
    while message := vehicle.recv_match(type=kind, blocking=True, timeout=0.5):
        if all(getattr(message, field) == value for field, value in wanted.items()):
            return True
    return False


def fetches_all_parameters(vehicle: Any, firmware: str) -> None:
    table = load_table(firmware)
    vehicle.param_fetch_all()
    last = {"param_count": len(table), "param_index": len(table) - 1}
    until(lambda: receives(vehicle, "PARAM_VALUE", **last), "the last parameter")
    assert set(vehicle.params) - {"_HASH_CHECK"} == set(table)


def enters(vehicle: Any, mode: str) -> None:
    def is_entered() -> bool:
        vehicle.wait_heartbeat(timeout=2)
        return bool(vehicle.flightmode == mode)

    vehicle.set_mode(mode)
    until(is_entered, mode)


def is_armed(vehicle: Any, *, armed: bool) -> bool:
    """The condition of `motors_armed_wait`, which has no deadline."""
    vehicle.wait_heartbeat(timeout=2)
    return bool(vehicle.motors_armed()) == armed


def has_origin(vehicle: Any) -> bool:
    """The origin is ignored until the estimator has settled."""
    vehicle.mav.set_gps_global_origin_send(1, 473977000, 85456000, 488000)
    return receives(vehicle, "GPS_GLOBAL_ORIGIN")


def test_mavutil_sets_up_and_arms_ardupilot() -> None:
    with connected("ardupilot") as vehicle:
        fetches_all_parameters(vehicle, "ardupilot")
        vehicle.param_set_send("GUID_TIMEOUT", 0.5)
        answer = {"param_id": "GUID_TIMEOUT", "param_value": 0.5}
        until(lambda: receives(vehicle, "PARAM_VALUE", **answer), "the parameter")
        for mode in ("LOITER", "GUIDED"):
            assert mode in vehicle.mode_mapping()
            enters(vehicle, mode)
        until(lambda: has_origin(vehicle), "the origin")
        vehicle.arducopter_arm()
        until(lambda: is_armed(vehicle, armed=True), "armed")
        vehicle.motors_armed_wait()
        vehicle.arducopter_disarm()
        until(lambda: is_armed(vehicle, armed=False), "disarmed")


def test_mavutil_sets_up_and_arms_px4() -> None:
    arm = (mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0, 1, *[0] * 6)
    rejected = {"result": mavlink.MAV_RESULT_TEMPORARILY_REJECTED}
    with connected("px4") as vehicle:
        fetches_all_parameters(vehicle, "px4")
        until(lambda: has_origin(vehicle), "the origin")
        enters(vehicle, "OFFBOARD")  # disarmed it accepts any mode, but arming is rejected
        vehicle.mav.command_long_send(1, 1, *arm)  # without a stream of setpoints
        assert receives(vehicle, "COMMAND_ACK", command=arm[0], **rejected)
        for mode in ("POSCTL", "LOITER"):
            enters(vehicle, mode)
        vehicle.mav.command_long_send(1, 1, *arm)
        until(lambda: is_armed(vehicle, armed=True), "armed")
        vehicle.set_mode("OFFBOARD")
        assert receives(vehicle, "COMMAND_ACK", command=176, **rejected)
        assert is_armed(vehicle, armed=True)
        assert vehicle.flightmode == "LOITER"
