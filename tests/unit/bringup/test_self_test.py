"""`companion check` reports the state and the remedy of each part."""

import math
import re
from dataclasses import replace
from random import Random
from typing import Any

import pytest

from companion.bringup.capture import readings_of, rest_bias_rad_s, turn_rad
from companion.bringup.findings import CheckResult, Finding
from companion.bringup.hand_test import changed_beam, verdict
from companion.bringup.self_test import Examination
from companion.config.settings import Config
from companion.core.messages import Beam, RangeReading, RangeState
from companion.link.transports.serial_transport import SerialTransport
from companion.link.transports.transport import direct_pair
from companion.run.hardware import make_rig
from companion.run.loop import Rig
from sitl.core.radio import LinkErrors
from sitl.simulation.simulation import Setup, Simulation
from sitl.testing import battery, claim, mute, other_rates
from sitl.world.loading import load_world
from tests.contract.bench import STILL, Bench, make_bench


class Drone:
    """A simulated drone on the floor, with an `Examination` of it."""

    def __init__(
        self,
        parameters: dict[str, float] | None = None,
        *,
        send_pose: bool = False,
        mission: dict[str, Any] | None = None,
        **sensor_settings: Any,
    ) -> None:
        defaults = Config()
        world = load_world("room_100")
        setup = Setup(world, "room_100", 1, defaults.sensors, parameters=parameters or {})
        sitl_end, companion_end = direct_pair(setup.system_id)
        self.simulation = Simulation(setup, [sitl_end])
        link = {"send_pose": send_pose}
        groups = {"sensors": sensor_settings, "link": link, "mission": mission or {}}
        config = Config.model_validate(groups)
        self.examination = Examination(config, companion_end, self.simulation.board.bus)

    def examined(self, seconds: float = 6.0) -> dict[str, Finding]:
        findings: list[Finding] = []
        for _ in range(round(seconds / 0.05)):
            self.simulation.advance(self.simulation.time_s + 0.05)
            findings = self.examination.step(self.simulation.time_s)
        return {finding.part: finding for finding in findings}


def test_every_part_of_a_drone_without_faults_is_good() -> None:
    findings = Drone().examined()
    assert set(findings) == {*Beam.__members__.values()} - {"back"} | {
        *("gyro", "link", "battery", "autopilot", "avoidance")
    }
    assert {finding.verdict for finding in findings.values()} == {CheckResult.GOOD}


def test_a_wrong_address_is_reported_with_the_addresses_that_answer() -> None:
    front = {"kind": "sharp_ads1115", "address": 0x4A, "channel": 0}
    left = {"kind": "sharp_ads1115", "address": 0x48, "channel": 1}
    findings = Drone(ranges={"front": front, "left": left}).examined(1.0)
    assert findings["front"].verdict is CheckResult.BAD
    assert "0x4a" in findings["front"].remedy
    assert "something answers at 0x48, 0x49" in findings["front"].remedy
    assert findings["left"].verdict is CheckResult.GOOD


def test_a_wrong_gyro_address_is_reported() -> None:
    findings = Drone(gyro_address=0x6A).examined(1.0)
    assert findings["gyro"].verdict is CheckResult.BAD
    assert "0x6a" in findings["gyro"].remedy


def test_an_unplugged_sensor_is_detected_by_its_voltage() -> None:
    drone = Drone()
    drone.simulation.board.unplug("left")
    findings = drone.examined(1.0)
    assert findings["left"].verdict is CheckResult.BAD
    assert " V, outside the output range" in findings["left"].seen
    assert "plug" in findings["left"].remedy
    assert findings["right"].verdict is CheckResult.GOOD


def test_a_missing_autopilot_is_reported_with_the_url_of_the_link() -> None:
    drone = Drone()
    drone.simulation.disturb_link(LinkErrors(loss=1.0))
    link = drone.examined()["link"]
    assert link.verdict is CheckResult.BAD
    assert "udpin:127.0.0.1:14550" in link.remedy


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"FLOW_TYPE": 0}, "no velocity source"),
        ({"EK3_SRC1_VELXY": 0}, "no velocity source"),
    ],
)
def test_a_missing_velocity_source_is_reported_with_the_remedy(
    parameters: dict[str, float], words: str
) -> None:
    autopilot = Drone(parameters).examined()["autopilot"]
    assert autopilot.verdict is CheckResult.WAIT
    assert words in autopilot.seen
    assert "optical flow" in autopilot.remedy


@pytest.mark.parametrize(
    ("vehicle", "autopilot", "words"),
    [
        ("GROUND_ROVER", None, "a ground rover at udpin:127.0.0.1:14550: only multicopters"),
        (None, "GENERIC", "unsupported autopilot GENERIC at"),
        (None, "INVALID", "no autopilot at"),
    ],
)
def test_an_unsupported_vehicle_or_autopilot_is_reported(
    vehicle: str | None, autopilot: str | None, words: str
) -> None:
    drone = Drone()
    claim(vehicle, autopilot).begin(drone.simulation)
    link = drone.examined()["link"]
    assert link.verdict is CheckResult.BAD
    assert words in link.remedy


def test_an_unexpected_system_id_is_reported() -> None:
    assert "link.system_id" in Drone({"SYSID_THISMAV": 3}).examined()["link"].remedy


@pytest.mark.parametrize(("percent", "good"), [(15, False), (20, False), (21, True), (100, True)])
def test_a_battery_at_or_below_the_return_threshold_is_not_good(percent: float, good: bool) -> None:
    drone = Drone()
    battery(percent).begin(drone.simulation)
    found = drone.examined()["battery"]
    assert found.seen == f"{percent} % left"
    assert (found.verdict is CheckResult.GOOD) == good
    assert good == ("battery_home_percent" not in found.remedy)


def test_a_missing_battery_report_is_good_and_has_a_remedy() -> None:
    drone = Drone()
    mute("SYS_STATUS").begin(drone.simulation)
    found = drone.examined()["battery"]
    assert (found.verdict, found.seen) == (CheckResult.GOOD, "not reported")
    assert "BATT_MONITOR" in found.remedy


def test_the_check_waits_for_the_landed_state() -> None:
    drone = Drone()
    mute("EXTENDED_SYS_STATE").begin(drone.simulation)
    autopilot = drone.examined()["autopilot"]
    assert autopilot.verdict is CheckResult.WAIT
    assert "EXTENDED_SYS_STATE" in autopilot.seen


def test_send_pose_with_the_compass_as_yaw_source_is_bad() -> None:
    """The autopilot takes the position from our pose and the heading from its compass."""
    half = {"VISO_TYPE": 1.0, "EK3_SRC1_POSXY": 6.0}
    finding = Drone(half, send_pose=True).examined()["autopilot"]
    assert finding.verdict is CheckResult.BAD
    assert finding.seen == "link.send_pose: EK3_SRC1_YAW is 1, set it to 6"
    assert Drone(half | {"EK3_SRC1_YAW": 6.0}, send_pose=True).examined()["autopilot"].verdict in (
        CheckResult.GOOD,
        CheckResult.WAIT,
    )


def test_the_check_waits_until_the_autopilots_estimator_has_settled() -> None:
    autopilot = Drone().examined(1.6)["autopilot"]
    assert autopilot.verdict is CheckResult.WAIT


@pytest.mark.parametrize(
    ("parameters", "good"),
    [
        ({"PRX1_TYPE": 2, "AVOID_MARGIN": 2}, False),
        ({"PRX1_TYPE": 2, "AVOID_MARGIN": 1}, True),
        ({"PRX1_TYPE": 2, "AVOID_MARGIN": 2, "AVOID_ENABLE": 1}, True),
        ({"PRX1_TYPE": 0, "AVOID_MARGIN": 2}, True),
    ],
)
def test_an_avoidance_margin_larger_than_the_standoff_is_reported(
    parameters: dict[str, float], good: bool
) -> None:
    avoidance = Drone(parameters).examined()["avoidance"]
    assert (avoidance.verdict is CheckResult.GOOD) == good
    assert good or "AVOID_MARGIN to 1" in avoidance.remedy


FENCE = {"FENCE_ENABLE": 1, "FENCE_TYPE": 3, "FENCE_MARGIN": 1, "FENCE_ACTION": 2}


@pytest.mark.parametrize(
    ("parameters", "good", "words"),
    [
        ({}, True, "the companion's only"),
        ({**FENCE, "FENCE_ALT_MAX": 3.5, "FENCE_RADIUS": 9}, True, "max_height_m 2.5 m"),
        ({**FENCE, "FENCE_ALT_MAX": 3.0, "FENCE_RADIUS": 9}, False, "stops at 2 m"),
        ({**FENCE, "FENCE_ALT_MAX": 3.5, "FENCE_RADIUS": 4}, False, "mission.max_distance_m = 8"),
        ({**FENCE, "FENCE_ALT_MAX": 9, "FENCE_RADIUS": 9, "FENCE_ACTION": 1}, False, "climbs"),
    ],
)
def test_the_fence_of_the_autopilot_is_compared_with_the_limits_of_the_mission(
    parameters: dict[str, float], good: bool, words: str
) -> None:
    """ArduPilot's avoidance stops the drone FENCE_MARGIN before its fence."""
    fence = Drone(parameters, mission={"max_height_m": 2.5, "max_distance_m": 8}).examined(3.0)
    assert (fence["fence"].verdict is CheckResult.GOOD) == good
    assert words in fence["fence"].seen
    assert good or "link.set_fence" in fence["fence"].remedy


class Port:
    """A serial port that always returns the same bytes."""

    def __init__(self, data: bytes) -> None:
        self._data = data
        self.in_waiting, self.out_waiting = len(data), 0

    def read(self, size: int = 1) -> bytes:
        return self._data

    def write(self, data: bytes) -> int:
        return len(data)

    def close(self) -> None: ...


@pytest.mark.parametrize(
    ("data", "words"),
    [(b"", ("swap TX and RX", "SERIALn_PROTOCOL")), (b"\x8f\xfe" * 20, ("another baud rate",))],
)
def test_a_silent_port_and_a_wrong_baud_rate_have_different_remedies(
    monkeypatch: pytest.MonkeyPatch, data: bytes, words: tuple[str, ...]
) -> None:
    monkeypatch.setattr(SerialTransport, "_open", lambda self: Port(data))
    config = Config.model_validate({"link": {"url": "serial:/dev/ttyAMA0:921600"}})
    transport = SerialTransport(config.link.url, 1, 191)
    bench = make_bench("gp2y0a710k0f")
    examination = Examination(config, transport, bench.bus)
    findings = {f.part: f for t in range(20) for f in examination.step(bench.passes(0.05))}
    assert findings["link"].verdict is CheckResult.BAD
    assert all(word in findings["link"].remedy for word in (*words, "/dev/ttyAMA0"))


@pytest.mark.parametrize(
    ("port", "told"), [("serial0", True), ("ttyAMA10", True), ("ttyAMA0", False)]
)
def test_a_silent_debug_connector_of_a_raspberry_pi_5_is_told(
    monkeypatch: pytest.MonkeyPatch, port: str, told: bool
) -> None:
    monkeypatch.setattr(SerialTransport, "_open", lambda self: Port(b""))
    config = Config.model_validate({"link": {"url": f"serial:/dev/{port}:921600"}})
    bench = make_bench("gp2y0a710k0f")
    examination = Examination(config, SerialTransport(config.link.url, 1, 191), bench.bus)
    findings = {f.part: f for t in range(20) for f in examination.step(bench.passes(0.05))}
    assert ("debug connector: use /dev/ttyAMA0" in findings["link"].remedy) == told


def test_a_port_that_accepts_no_bytes_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    class Stuck(Port):
        def write(self, data: bytes) -> int:
            return 0

    monkeypatch.setattr(SerialTransport, "_open", lambda self: Stuck(b""))
    config = Config.model_validate({"link": {"url": "serial:/dev/ttyAMA0:921600"}})
    bench = make_bench("gp2y0a710k0f")
    examination = Examination(config, SerialTransport(config.link.url, 1, 191), bench.bus)
    findings = {f.part: f for t in range(40) for f in examination.step(bench.passes(0.05))}
    assert findings["sending"].verdict is CheckResult.BAD
    assert "RTSCTS" in findings["sending"].remedy


def test_a_stream_that_another_system_slows_repeatedly_is_reported() -> None:
    drone = Drone()
    slow = other_rates("ATTITUDE", 4)
    findings = drone.examined(4.0)
    assert "streams" not in findings
    for _ in range(8):
        slow.begin(drone.simulation)
        findings = drone.examined(1.0)
    assert findings["streams"].verdict is CheckResult.BAD
    assert re.search(r"ATTITUDE \d+ Hz of 25", findings["streams"].seen)


def test_a_serial_sensor_at_a_wrong_baud_rate_is_reported() -> None:
    bench = make_bench("tfmini_s")
    ports = {b: {**s.model_dump(), "baud": 57600} for b, s in bench.config.beams.items()}
    config = Config.model_validate({"sensors": {"ranges": ports}})
    examination = Examination(config, direct_pair()[1], bench.bus)
    findings = [examination.step(bench.passes(0.05)) for _ in range(20)][-1]
    front = next(finding for finding in findings if finding.part == "front")
    assert front.verdict is CheckResult.BAD
    assert "baud rate is not 57600" in front.remedy


# Swapped sensors


def scans(**distances_m: float | None) -> list[dict[Beam, RangeReading]]:
    random = Random(1)

    def reading(distance_m: float | None) -> RangeReading:
        if distance_m is None:
            return RangeReading(RangeState.TOO_NEAR)
        return RangeReading(RangeState.DISTANCE, distance_m + random.gauss(0, 0.03), 0.03**2)

    return [{Beam(b): reading(d) for b, d in distances_m.items()} for _ in range(30)]


def test_a_hand_before_a_sensor_changes_the_beam_of_that_sensor() -> None:
    before, after = scans(front=2.0, left=3.0), scans(front=None, left=3.0)
    assert changed_beam(before, after) is Beam.FRONT
    assert verdict(Beam.FRONT, Beam.FRONT) == ""


def test_swapped_sensors_are_reported() -> None:
    before, after = scans(front=2.0, left=3.0), scans(front=2.0, left=1.2)
    changed = changed_beam(before, after)
    assert "front and left are swapped" in verdict(Beam.FRONT, changed)


def test_no_beam_changes_without_a_hand() -> None:
    assert changed_beam(scans(front=2.0), scans(front=2.0)) is None
    assert "no reading changed" in verdict(Beam.FRONT, None)


# Measurements for a calibration


class BenchClock:
    def __init__(self, bench: Bench) -> None:
        self._bench = bench

    def wait_until(self, time_s: float) -> float:
        return self._bench.passes(max(0.0, time_s - self._bench.time_s))

    def now_s(self) -> float:
        return self._bench.time_s

    def close(self) -> None:
        """No resource to release."""


def rig_on(bench: Bench) -> Rig:
    config = Config(sensors=bench.config)
    return make_rig(config, direct_pair()[1], bench.bus, BenchClock(bench))


def test_the_readings_at_a_distance_contain_none_of_an_earlier_distance() -> None:
    bench = make_bench("tfmini_s")
    rig = rig_on(bench)
    for distance_m in (1.0, 2.0):
        bench.distances_m[Beam.LEFT] = distance_m
        readings = readings_of(rig, Beam.LEFT, 2.0)
        assert len(readings) == 40
        assert all(r.distance_m == pytest.approx(distance_m, abs=0.1) for r in readings)


def test_a_turn_by_hand_is_measured_until_the_gyro_rests() -> None:
    bench = make_bench("gp2y0a710k0f")
    rig = rig_on(bench)
    bias = rest_bias_rad_s(rig, 3.0)
    began_s = bench.time_s

    class Turning(BenchClock):
        def wait_until(self, time_s: float) -> float:
            now_s = super().wait_until(time_s)
            turns = 1.0 < now_s - began_s < 9.0
            rate = math.radians(45.0) if turns else 0.0
            bench.truth = replace(STILL, yaw_rate_rad_s=rate)
            return now_s

    turning = replace(rig, clock=Turning(bench))
    assert math.degrees(turn_rad(turning, bias)) == pytest.approx(360, rel=0.06)


def test_sensors_behind_two_multiplexers_each_read_their_own_distance() -> None:
    bench = make_bench("two multiplexers")
    for number, beam in enumerate(bench.distances_m):
        bench.distances_m[beam] = 1.0 + 0.5 * number
    config = Config().model_copy(update={"sensors": bench.config})
    examination = Examination(config, direct_pair()[1], bench.bus)
    for _ in range(20):
        examination.step(bench.passes(0.05))
    for beam, reading in examination.readings.items():
        assert reading.distance_m == pytest.approx(bench.distances_m[beam], abs=0.06)
