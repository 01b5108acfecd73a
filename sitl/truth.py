"""What really happens. Only the simulation's own parts, the scorer and the viewer may read it."""

from dataclasses import dataclass

from companion.frames import Vector3


@dataclass(frozen=True, slots=True)
class TrueState:
    """The vehicle in the world's frame: NED, origin and axes of the world file, floor at down = 0.

    `yaw_rad` is clockwise from north; `roll_rad` and `pitch_rad` as in MAVLink ATTITUDE.
    """

    time_s: float
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    yaw_rate_rad_s: float
