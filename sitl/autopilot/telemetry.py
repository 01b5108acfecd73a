"""The messages that tell how the vehicle is, made from what it is at this moment."""

from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.control import Manoeuvre
from sitl.autopilot.estimator import FlowEstimator
from sitl.autopilot.personality import Personality
from sitl.autopilot.streams import Maker, Message
from sitl.truth import TrueState

BATTERY_CELLS = 4
CELL_EMPTY_V, CELL_FULL_V = 3.5, 4.2
ABSENT_CELL = 65535
SENSORS = (
    mavlink.MAV_SYS_STATUS_SENSOR_3D_GYRO
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_ACCEL
    | mavlink.MAV_SYS_STATUS_SENSOR_3D_MAG
    | mavlink.MAV_SYS_STATUS_SENSOR_OPTICAL_FLOW
)
LANDED_STATES = {
    Manoeuvre.GROUND: mavlink.MAV_LANDED_STATE_ON_GROUND,
    Manoeuvre.CLIMB: mavlink.MAV_LANDED_STATE_TAKEOFF,
    Manoeuvre.LAND: mavlink.MAV_LANDED_STATE_LANDING,
}


@dataclass(slots=True)
class Status:
    """What the telemetry tells; the core keeps it up to date."""

    mode: int
    armed: bool = False
    crashed: bool = False
    is_armable: bool = False
    origin: tuple[int, int, int] | None = None
    manoeuvre: Manoeuvre = Manoeuvre.GROUND
    battery: float = 1.0
    step: int = 0

    @property
    def boot_ms(self) -> int:
        return self.step * 10

    @property
    def boot_us(self) -> int:
        return self.step * 10_000


class Telemetry:
    """Makes the messages; None stands for one that cannot be told yet."""

    def __init__(self, personality: Personality, status: Status, estimator: FlowEstimator) -> None:
        self._personality = personality
        self._status = status
        self._estimator = estimator
        self.truth: TrueState
        """For roll and pitch, which even a cheap attitude estimate knows."""

    @property
    def has_position(self) -> bool:
        return self._estimator.has_settled and self._status.origin is not None

    def makers(self) -> dict[int, Maker]:
        """By message id."""
        estimator_status = self._personality.estimator_status(0, has_position=False).id
        return {
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: self._local_position,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: self._attitude,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: self._extended_state,
            estimator_status: self._estimator_status,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: self._sys_status,
            mavlink.MAVLINK_MSG_ID_BATTERY_STATUS: self._battery_status,
            mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION: self._version,
            mavlink.MAVLINK_MSG_ID_HOME_POSITION: self._home,
        }

    def heartbeat(self) -> Message:
        status = self._status
        flying = status.manoeuvre is not Manoeuvre.GROUND
        state = mavlink.MAV_STATE_ACTIVE if flying else mavlink.MAV_STATE_STANDBY
        return mavlink.MAVLink_heartbeat_message(
            mavlink.MAV_TYPE_QUADROTOR,
            self._personality.autopilot,
            self._personality.base_mode(status.mode, armed=status.armed),
            status.mode,
            mavlink.MAV_STATE_CRITICAL if status.crashed else state,
            3,
        )

    def _local_position(self) -> Message | None:
        if not self.has_position:
            return None
        estimate = self._estimator
        return mavlink.MAVLink_local_position_ned_message(
            self._status.boot_ms, *estimate.position_ned_m, *estimate.velocity_ned_m_s
        )

    def _attitude(self) -> Message:
        return mavlink.MAVLink_attitude_message(
            self._status.boot_ms,
            self.truth.roll_rad,
            self.truth.pitch_rad,
            self._estimator.yaw_rad,
            *(0.0, 0.0, self._estimator.yaw_rate_rad_s),
        )

    def _extended_state(self) -> Message:
        landed = LANDED_STATES.get(self._status.manoeuvre, mavlink.MAV_LANDED_STATE_IN_AIR)
        return mavlink.MAVLink_extended_sys_state_message(0, landed)

    def _estimator_status(self) -> Message:
        return self._personality.estimator_status(
            self._status.boot_us, has_position=self.has_position
        )

    def _cell_mv(self) -> int:
        charge = self._status.battery * (CELL_FULL_V - CELL_EMPTY_V)
        return round(1000 * (CELL_EMPTY_V + charge))

    def _percent(self) -> int:
        return round(100 * self._status.battery)

    def _sys_status(self) -> Message:
        armable = mavlink.MAV_SYS_STATUS_PREARM_CHECK if self._status.is_armable else 0
        millivolts = self._cell_mv() * BATTERY_CELLS
        return mavlink.MAVLink_sys_status_message(
            SENSORS,
            SENSORS,
            SENSORS | armable,
            200,
            millivolts,
            1200,
            self._percent(),
            *(0, 0, 0, 0, 0, 0),
        )

    def _battery_status(self) -> Message:
        cells = [self._cell_mv()] * BATTERY_CELLS + [ABSENT_CELL] * (10 - BATTERY_CELLS)
        return mavlink.MAVLink_battery_status_message(
            0, 0, 1, 2500, cells, 1200, -1, -1, self._percent()
        )

    def _version(self) -> Message:
        return mavlink.MAVLink_autopilot_version_message(
            self._personality.capabilities,
            self._personality.flight_sw_version,
            *(0, 0, 0),
            *(bytes(8), bytes(8), bytes(8)),
            *(0, 0, 0),
        )

    def _home(self) -> Message | None:
        if self._status.origin is None:
            return None
        level = [1.0, 0.0, 0.0, 0.0]
        return mavlink.MAVLink_home_position_message(
            *self._status.origin,
            *(0.0, 0.0, 0.0),
            level,
            *(0.0, 0.0, 0.0),
            self._status.boot_us,
        )
