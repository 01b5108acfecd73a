"""Builds the messages that report the vehicle's current state."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.range_sensors import AutopilotRange
from companion.core.frames import Place
from companion.core.messages import Beam
from sitl.autopilot.control import Manoeuvre
from sitl.autopilot.estimation.navigation import Navigation
from sitl.autopilot.estimation.own_sensors import Imu, rangefinder_messages
from sitl.autopilot.firmware import EmulatedFirmware, ParameterValues
from sitl.autopilot.streams import Maker, Message
from sitl.core.truth import TrueState
from sitl.sensors.time_of_flight import TofUnit

BATTERY_CELLS = 4
"""Number of battery cells in series. Chosen."""
CELL_EMPTY_V, CELL_FULL_V = 3.5, 4.2
"""Cell voltages at 0 and 100 %, V; linear in between. Chosen."""
ABSENT_CELL = 65535
"""Voltage of an absent cell in BATTERY_STATUS (147)."""
SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
)
"""Bits of SYS_STATUS (1) that are always set."""
RECEIVER: int = mavlink.MAV_SYS_STATUS_SENSOR_RC_RECEIVER
FLOW: int = mavlink.MAV_SYS_STATUS_SENSOR_OPTICAL_FLOW
VISION: int = mavlink.MAV_SYS_STATUS_SENSOR_VISION_POSITION
LANDED_STATES = {
    Manoeuvre.GROUND: mavlink.MAV_LANDED_STATE_ON_GROUND,
    Manoeuvre.CLIMB: mavlink.MAV_LANDED_STATE_TAKEOFF,
    Manoeuvre.LAND: mavlink.MAV_LANDED_STATE_LANDING,
}
"""MAV_LANDED_STATE by manoeuvre; in the air for all others."""


@dataclass(slots=True)
class Status:
    """State that the telemetry reports; the core updates it."""

    mode: int
    armed: bool = False
    crashed: bool = False
    in_failsafe: bool = False
    is_armable: bool = False
    has_transmitter: bool = False
    manoeuvre: Manoeuvre = Manoeuvre.GROUND
    battery: float = 1.0
    step: int = 0
    booted_step: int = 0
    """Step at which the clock was zero."""

    @property
    def boot_ms(self) -> int:
        return max(self.step - self.booted_step, 0) * 10

    @property
    def boot_us(self) -> int:
        return self.boot_ms * 1000


class Telemetry:
    """Builds messages. A message that is not available yet is an empty list."""

    def __init__(
        self,
        firmware: EmulatedFirmware,
        parameters: ParameterValues,
        status: Status,
        navigation: Navigation,
        truth: TrueState,
        *,
        imu: Imu,
    ) -> None:
        self._imu = imu
        self.claimed: tuple[int | None, int | None] = (None, None)
        """A fault for tests: type and autopilot in HEARTBEAT."""
        self.stays_taking_off = False
        """A fault for tests: report "taking off" during the whole flight."""
        self.rangefinders: Mapping[Beam, tuple[TofUnit, AutopilotRange]] = {}
        """Rangefinders connected to the autopilot."""
        self._is = firmware
        self._parameters = parameters
        self._status = status
        self._navigation = navigation
        self.truth = truth
        """Ground truth for roll and pitch, which even a cheap attitude estimate has."""

    def makers(self, *, sends_truth: bool) -> dict[int, Maker]:
        """Makers by message id."""
        estimator_status = self._estimator_status()[0].get_msgId()
        makers = {
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position,
            mavlink.MAVLINK_MSG_ID_GLOBAL_POSITION_INT: self._global_position,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            mavlink.MAVLINK_MSG_ID_VFR_HUD: self._vfr_hud,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._extended_state,
            estimator_status: self._estimator_status,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self._sys_status,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: self._system_time,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: self._battery_status,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._version,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self._home,
            mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN: self.origin,
            mavlink.MAVLINK_MSG_ID_DISTANCE_SENSOR: self._distances,
            mavlink.MAVLINK_MSG_ID_SCALED_IMU: self._scaled_imu,
        }
        if self._is.sends_highres_imu:
            makers[mavlink.MAVLINK_MSG_ID_HIGHRES_IMU] = self._highres_imu
        if sends_truth:
            makers[self._is.ground_truth] = lambda: [self._is.true_state(self.truth)]
        return makers

    def heartbeat(self) -> Message:
        status = self._status
        vehicle_type, autopilot = self.claimed
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR if vehicle_type is None else vehicle_type,
            self._is.autopilot if autopilot is None else autopilot,
            self._is.base_mode(status.mode, armed=status.armed),
            status.mode,
            self._system_status(),
            3,
        )

    def _system_status(self) -> int:
        """MAV_STATE."""
        status = self._status
        if status.crashed or status.in_failsafe:
            return int(mavlink.MAV_STATE_CRITICAL)
        if status.manoeuvre is not Manoeuvre.GROUND:
            return int(mavlink.MAV_STATE_ACTIVE)
        settled = self._navigation.estimator.has_settled
        return int(mavlink.MAV_STATE_STANDBY if settled else mavlink.MAV_STATE_BOOT)

    def _local_position(self) -> list[Message]:
        if not self._navigation.has_position:
            return []
        estimate = self._navigation.estimator
        return [
            mavlink.MAVLink_local_position_ned_message(
                self._status.boot_ms, *estimate.position_ned_m, *estimate.velocity_ned_m_s
            )
        ]

    def _global_position(self) -> list[Message]:
        """GLOBAL_POSITION_INT (33), as ground stations show it; empty until the origin is set."""
        origin = self._navigation.origin
        if origin is None or not self._navigation.has_position:
            return []
        estimate = self._navigation.estimator
        north_m, east_m, down_m = estimate.position_ned_m
        lon_deg, lat_deg = Place(1e-7 * origin[0], 1e-7 * origin[1]).lon_lat_deg(north_m, east_m)
        height_mm = round(-1000 * down_m)
        return [
            mavlink.MAVLink_global_position_int_message(
                self._status.boot_ms,
                *(round(1e7 * lat_deg), round(1e7 * lon_deg)),
                *(origin[2] + height_mm, height_mm),
                *(round(100 * each) for each in estimate.velocity_ned_m_s),
                round(100 * math.degrees(estimate.yaw_rad)) % 36000,
            )
        ]

    def _attitude(self) -> list[Message]:
        estimate = self._navigation.estimator
        return [
            mavlink.MAVLink_attitude_message(
                self._status.boot_ms,
                self.truth.roll_rad,
                self.truth.pitch_rad,
                estimate.yaw_rad,
                *(0.0, 0.0, estimate.yaw_rate_rad_s),
            )
        ]

    def _vfr_hud(self) -> list[Message]:
        estimate = self._navigation.estimator
        speed = math.hypot(*estimate.velocity_ned_m_s[:2])
        heading_deg = round(math.degrees(estimate.yaw_rad)) % 360
        height_m, climb = -estimate.position_ned_m[2], -estimate.velocity_ned_m_s[2]
        return [mavlink.MAVLink_vfr_hud_message(speed, speed, heading_deg, 0, height_m, climb)]

    def _system_time(self) -> list[Message]:
        return [mavlink.MAVLink_system_time_message(0, self._status.boot_ms)]

    def _distances(self) -> list[Message]:
        navigation = self._navigation
        echoes = self._is.distance_echoes(navigation.outside, navigation.time_s, self._parameters)
        return echoes + rangefinder_messages(self.rangefinders, self._status.boot_ms)

    def _scaled_imu(self) -> list[Message]:
        return [self._imu.scaled(self._status.boot_ms, self.truth.yaw_rate_rad_s)]

    def _highres_imu(self) -> list[Message]:
        return [self._imu.highres(self._status.boot_us, self.truth.yaw_rate_rad_s)]

    def _extended_state(self) -> list[Message]:
        landed = LANDED_STATES.get(self._status.manoeuvre, mavlink.MAV_LANDED_STATE_IN_AIR)
        if self.stays_taking_off and landed == mavlink.MAV_LANDED_STATE_IN_AIR:
            landed = mavlink.MAV_LANDED_STATE_TAKEOFF
        return [mavlink.MAVLink_extended_sys_state_message(0, landed)]

    def _estimator_status(self) -> list[Message]:
        return [self._is.estimator_status(self._status.boot_us, self._navigation.health)]

    @property
    def battery_v(self) -> float:
        charge = self._status.battery * (CELL_FULL_V - CELL_EMPTY_V)
        return BATTERY_CELLS * (CELL_EMPTY_V + charge)

    def _percent(self) -> int:
        return round(100 * self._status.battery)

    def _sys_status(self) -> list[Message]:
        armable = mavlink.MAV_SYS_STATUS_PREARM_CHECK if self._status.is_armable else 0
        flow = FLOW if self._navigation.sources.flow else 0
        vision = VISION if self._navigation.has_external_pose else 0
        receiver = RECEIVER if self._status.has_transmitter else 0
        sensors = SENSORS | flow | vision | receiver
        return [
            mavlink.MAVLink_sys_status_message(
                sensors,
                sensors,
                sensors | armable | self._is.healthy_unless_failed,
                200,
                round(1000 * self.battery_v),
                1200,
                self._percent(),
                *(0, 0, 0, 0, 0, 0),
            )
        ]

    def _battery_status(self) -> list[Message]:
        cell_mv = round(1000 * self.battery_v / BATTERY_CELLS)
        cells = [cell_mv] * BATTERY_CELLS + [ABSENT_CELL] * (10 - BATTERY_CELLS)
        return [
            mavlink.MAVLink_battery_status_message(
                0, 0, 1, 2500, cells, 1200, -1, -1, self._percent()
            )
        ]

    def _version(self) -> list[Message]:
        return [
            mavlink.MAVLink_autopilot_version_message(
                self._is.capabilities,
                self._is.flight_sw_version,
                *(0, 0, 0),
                *(bytes(8), bytes(8), bytes(8)),
                *(0, 0, 0),
            )
        ]

    def _home(self) -> list[Message]:
        if self._navigation.origin is None:
            return []
        level = [1.0, 0.0, 0.0, 0.0]
        return [
            mavlink.MAVLink_home_position_message(
                *self._navigation.origin,
                *(0.0, 0.0, 0.0),
                level,
                *(0.0, 0.0, 0.0),
                self._status.boot_us,
            )
        ]

    def origin(self) -> list[Message]:
        """GPS_GLOBAL_ORIGIN (49); empty until the origin is set."""
        origin = self._navigation.origin
        if origin is None:
            return []
        return [mavlink.MAVLink_gps_global_origin_message(*origin, self._status.boot_us)]
