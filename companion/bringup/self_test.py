"""Checks every sensor, the gyro, the link and the autopilot, each independently of the others.

Nothing flies and nothing is armed. Each part is opened alone, so a missing part does not hide the
others.
"""

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence

from companion.bringup.bus_scan import MonitoredWires, wiring_remedy
from companion.bringup.failsafes import needed_parameters, transmitter_loss
from companion.bringup.fences import fence_beside, fence_parameters, is_limited
from companion.bringup.findings import CheckResult, Finding
from companion.bringup.link_test import dropped_messages, slow_streams
from companion.bringup.parameters import AskedParameters
from companion.config.range_sensors import TfminiSensor
from companion.config.settings import Config
from companion.core.errors import SensorError
from companion.core.messages import (
    Beam,
    Command,
    GyroSample,
    RangeReading,
    RangeState,
    Setpoint,
    VehicleState,
)
from companion.drivers.autopilot_gyro import AutopilotGyro
from companion.drivers.gyro import calibrated, open_gyro
from companion.drivers.models import model_of, range_models
from companion.drivers.ranges import RangeSensors
from companion.drivers.wires.bus import Wires
from companion.link.firmware import ArduPilot
from companion.link.link import Link, Listener, Telemetry
from companion.link.link_budget import budget_error
from companion.link.transports.serial_transport import SerialTransport
from companion.link.transports.transport import Transport
from companion.navigation.standoff import standoff_m
from companion.run.hardware import fence_to_set
from companion.safety.preflight import refusal

GYRO_WINDOW = 60
"""Gyro samples per check. Chosen."""
SILENT_S = 1.0
"""A gyro without samples for this time is silent, s. Chosen."""
STILL_RAD_S = math.radians(2.0)
"""Largest deviation from the mean rate at rest, rad/s. Chosen."""
LARGE_BIAS_RAD_S = math.radians(30.0)
"""A larger bias is a fault, rad/s. Chosen."""
AVOID_PROXIMITY_BIT = 2
"""Bit of AVOID_ENABLE (ArduPilot) that enables avoidance by proximity sensors."""
NOT_THE_PINS = ("/dev/serial0", "/dev/ttyAMA10")
"""Names of the debug connector of a Raspberry Pi 5, whose pins 8 and 10 are /dev/ttyAMA0."""
MIN_AVOID_MARGIN_M = 1.0
"""Recommended AVOID_MARGIN, m. Chosen."""
AVOIDANCE = ("AVOID_MARGIN", "AVOID_ENABLE", "PRX1_TYPE")
"""ArduPilot's parameters of its avoidance."""


class Examination:
    """Checks all parts of one drone; `step` is called at every tick.

    `needs_pilot`: the autopilot is ready only while a pilot could take the drone over. `listeners`
    also receive the autopilot's messages.
    """

    def __init__(
        self,
        config: Config,
        transport: Transport,
        wires: Wires,
        *,
        needs_pilot: bool = False,
        listeners: Sequence[Listener] = (),
    ) -> None:
        self._config = config
        self._transport = transport
        self._wires = MonitoredWires(wires)
        self._errors: dict[str, str] = {}
        self._parameters = AskedParameters(config.link.system_id)
        self._needs_pilot = needs_pilot
        self._sensors = dict(self._open_ranges())
        all_listeners: list[Listener] = [*listeners, self._parameters]
        all_listeners += [s.from_autopilot for s in self._sensors.values() if s.from_autopilot]
        try:
            gyro = open_gyro(wires, config.sensors)
            self._gyro = calibrated(gyro, config.sensors)
            all_listeners += [gyro] if isinstance(gyro, AutopilotGyro) else []
        except SensorError as error:
            self._errors["gyro"] = str(error)
        fence = fence_to_set(config)
        self.link = Link(
            transport, config.link, all_listeners, needs_pilot=needs_pilot, fence=fence
        )
        self.telemetry = Telemetry(VehicleState())
        """What the autopilot has sent since the step before."""
        self._rates: deque[GyroSample] = deque(maxlen=GYRO_WINDOW)
        self._overload = budget_error(config)
        self.readings: dict[Beam, RangeReading] = {}

    def _open_ranges(self) -> Iterator[tuple[Beam, RangeSensors]]:
        for beam, sensor in self._config.sensors.beams.items():
            try:
                yield beam, RangeSensors(self._wires, self._config.sensors, only=[beam])
            except SensorError as error:
                remedy = wiring_remedy(self._wires, sensor)
                self._errors[beam.value] = f"{error}{remedy}"

    def step(self, now_s: float) -> list[Finding]:
        """Present findings of all parts."""
        self.listen(now_s)
        return self.examine(now_s)

    def listen(self, now_s: float) -> VehicleState:
        """Take what the autopilot has sent."""
        self.telemetry = self.link.poll(now_s)
        return self.telemetry.vehicle

    def sweep(self, now_s: float) -> list[Finding]:
        """Read all sensors once."""
        beams = [self._of_beam(beam, now_s) for beam in self._config.sensors.beams]
        return [*beams, self._of_gyro(now_s)]

    def examine(
        self, now_s: float, setpoint: Setpoint | None = None, command: Command | None = None
    ) -> list[Finding]:
        """Present findings of all parts; setpoint and command go to the autopilot."""
        self.link.send(now_s, setpoint, command)
        findings = [*self.sweep(now_s), *self._of_traffic()]
        vehicle = self.telemetry.vehicle
        if not vehicle.connected:
            return [*findings, self._of_silent_link(vehicle.unfit)]
        link = f"{vehicle.mode}, {'armed' if vehicle.armed else 'disarmed'}"
        fitness = CheckResult.BAD if vehicle.unfit else CheckResult.GOOD
        findings.append(Finding("link", fitness, link, vehicle.unfit))
        findings.append(self._of_battery(vehicle))
        remedy = next((r for words, r in REMEDIES if words in vehicle.waits_for), "")
        if vehicle.waits_for:
            verdict = CheckResult.BAD if "send_pose" in vehicle.waits_for else CheckResult.WAIT
            seen = vehicle.waits_for
            if "preflight." in seen:  # a text with its own remedy
                seen, _, remedy = seen.partition(": ")
            findings.append(Finding("autopilot", verdict, seen, remedy))
        else:
            findings.append(Finding("autopilot", CheckResult.GOOD, "estimate ready"))
        return [*findings, *self._of_parameters(now_s)]

    def _of_beam(self, beam: Beam, now_s: float) -> Finding:
        if beam.value in self._errors:
            return Finding(beam.value, CheckResult.BAD, "absent", self._errors[beam.value])
        reading = self._sensors[beam].read(now_s).readings[beam]
        self.readings[beam] = reading
        sensor = self._config.sensors.beams[beam]
        match reading.state:
            case RangeState.DISTANCE:
                sigma_cm = 100 * math.sqrt(reading.variance_m2)
                return Finding(
                    beam.value, CheckResult.GOOD, f"{reading.distance_m:.2f} m ± {sigma_cm:.0f} cm"
                )
            case RangeState.NOTHING:
                far = f"nothing within {model_of(sensor).max_m:g} m"
                return Finding(beam.value, CheckResult.GOOD, far)
            case RangeState.TOO_NEAR:
                near = f"something nearer than {model_of(sensor).min_m:g} m"
                return Finding(beam.value, CheckResult.GOOD, near)
            case RangeState.STALE | RangeState.FAILED:
                remedy = "check its plug and its 5 V"
                if isinstance(sensor, TfminiSensor):
                    remedy = self._wires.remedy(sensor)
                seen = "silent"
                if not math.isnan(reading.raw):
                    seen = f"{reading.raw:.2f} V, outside the output range of a working sensor"
                return Finding(beam.value, CheckResult.BAD, seen, remedy)

    def _of_gyro(self, now_s: float) -> Finding:
        if "gyro" in self._errors:
            return Finding("gyro", CheckResult.BAD, "absent", self._errors["gyro"])
        self._rates.extend(self._gyro.read(now_s))
        if len(self._rates) < GYRO_WINDOW:
            return Finding("gyro", CheckResult.WAIT, "measuring")
        if now_s - self._rates[-1].time_s > SILENT_S:
            return Finding("gyro", CheckResult.BAD, "silent", "check its wiring and supply")
        rates = [sample.yaw_rate_rad_s for sample in self._rates]
        mean = sum(rates) / len(rates)
        seen = f"{math.degrees(mean):+.2f} °/s, clockwise positive"
        if max(abs(rate - mean) for rate in rates) > STILL_RAD_S:
            return Finding(
                "gyro", CheckResult.WAIT, seen, "the drone turns; it must be at rest for take-off"
            )
        if abs(mean) > LARGE_BIAS_RAD_S:
            remedy = "a bias this large means a defective chip or a steady rotation"
            return Finding("gyro", CheckResult.BAD, seen, remedy)
        return Finding("gyro", CheckResult.GOOD, seen)

    def _of_battery(self, vehicle: VehicleState) -> Finding:
        if vehicle.battery is None:
            remedy = "no return on low battery; ArduPilot: BATT_MONITOR, PX4: BAT1_SOURCE"
            return Finding("battery", CheckResult.GOOD, "not reported", remedy)
        why = refusal(vehicle, self._config.mission)
        verdict = CheckResult.BAD if why and not vehicle.unfit else CheckResult.GOOD
        left = f"{100 * vehicle.battery:.0f} % left"
        return Finding("battery", verdict, left, why if verdict is CheckResult.BAD else "")

    def _of_silent_link(self, unfit: str) -> Finding:
        url = self._config.link.url
        if unfit:
            return Finding("link", CheckResult.BAD, "received, but not accepted", unfit)
        transport = self._transport
        if isinstance(transport, SerialTransport) and transport.messages_received == 0:
            if transport.bytes_received:
                remedy = f"no MAVLink in the bytes: {url} has another baud rate than SERIALn_BAUD"
                return Finding("link", CheckResult.BAD, "garbage", remedy)
            remedy = (
                f"no bytes received at {url}: swap TX and RX, set SERIALn_PROTOCOL = 2, "
                "and disable the login shell on the port"
            )
            if self._config.link.serial_port in NOT_THE_PINS:
                remedy += "; on a Raspberry Pi 5 this is the debug connector: use /dev/ttyAMA0"
            return Finding("link", CheckResult.BAD, "silent", remedy)
        remedy = (
            f"no autopilot of system {self._config.link.system_id} at {url}: check link.url, "
            "link.system_id, and the router's endpoints"
        )
        if self._config.link.signing_key is not None:
            remedy += "; or its messages are not signed with link.signing_key"
        return Finding("link", CheckResult.BAD, "silent", remedy)

    def _of_traffic(self) -> Iterator[Finding]:
        """Findings on the link's traffic; none if it has no faults."""
        if self._overload:
            yield Finding("baud rate", CheckResult.BAD, "too low", self._overload)
        if symptom := dropped_messages(self._transport):
            yield Finding("sending", CheckResult.BAD, *symptom)
        if symptom := slow_streams(self.link.streams):
            yield Finding("streams", CheckResult.BAD, *symptom)

    def _of_parameters(self, now_s: float) -> Iterator[Finding]:
        """Findings on the autopilot's own safety functions, once their parameters are known."""
        firmware = self.link.firmware
        if firmware is None:
            return
        names = [*AVOIDANCE] if isinstance(firmware, ArduPilot) else []
        names += needed_parameters(firmware) if self._needs_pilot else ()
        plan = self._config.mission
        names += fence_parameters(firmware) if is_limited(plan) else ()
        self.link.transmit(self._parameters.requests(now_s, names))
        values = self._parameters.values(firmware)
        if self._needs_pilot and (loss := transmitter_loss(firmware, values)):
            yield loss
        if fence := fence_beside(firmware, values, plan):
            yield fence
        if all(name in values for name in AVOIDANCE):
            yield from self._of_avoidance(values)

    def _of_avoidance(self, parameters: Mapping[str, float]) -> Iterator[Finding]:
        """ArduPilot's avoidance also limits the velocities that we command."""
        margin_m = parameters["AVOID_MARGIN"]
        seen = f"AVOID_MARGIN {margin_m:g} m"
        if not int(parameters["AVOID_ENABLE"]) & AVOID_PROXIMITY_BIT or not parameters["PRX1_TYPE"]:
            yield Finding("avoidance", CheckResult.GOOD, "off")
            return
        sensors = self._config.sensors
        front = range_models(sensors)[Beam.FRONT]
        wanted_m = standoff_m(self._config.mission.standoff, front, sensors.mount_offset_m)
        sides = [self.readings.get(beam) for beam in (Beam.LEFT, Beam.RIGHT)]
        width_m = sum(r.distance_m if r and r.is_distance else math.inf for r in sides)
        if margin_m < wanted_m and 2 * margin_m < width_m:
            yield Finding("avoidance", CheckResult.GOOD, seen)
            return
        reason = (
            f"it prevents the stand-off of {wanted_m:g} m"
            if margin_m >= wanted_m
            else f"the room is {width_m:.1f} m wide here"
        )
        remedy = (
            f"{reason}: set AVOID_MARGIN to {MIN_AVOID_MARGIN_M:g}, "
            "or clear bit 1 (proximity) of AVOID_ENABLE"
        )
        yield Finding("avoidance", CheckResult.BAD, seen, remedy)


REMEDIES = (
    ("has not settled", "keep it at rest; if this persists, calibrate its accelerometers"),
    (
        "no velocity source",
        "optical flow (ArduPilot: FLOW_TYPE, EK3_SRC1_VELXY = 5; PX4: EKF2_OF_CTRL = 1), "
        "or other odometry; on the ground flow may need some light and texture",
    ),
    ("no position", "wait for the origin; ArduPilot: EK3_SRC1_POSXY, PX4: EKF2_HGT_REF"),
    ("LOCAL_POSITION_NED", "it has no position yet; check its messages"),
    (
        "EXTENDED_SYS_STATE",
        "check that link and router pass all messages; ArduCopter 4.6 and PX4 1.16 send it",
    ),
    ("does not confirm", "check for another program that sets it, and for a one-way link"),
)
"""Remedy for each text of `VehicleState.waits_for` that contains the words."""
