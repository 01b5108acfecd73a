"""Ground truth of the vehicle. Only simulation, scoring and the viewer may read it."""

from collections import deque

from companion.core.frames import Vector3
from companion.core.values import value


@value
class TrueState:
    """The vehicle's true state in the world frame: NED, origin as in the world file.

    The floor is at down = 0. `yaw_rad` is clockwise from north.
    `roll_rad` and `pitch_rad` are as in MAVLink ATTITUDE.
    """

    time_s: float
    position_ned_m: Vector3
    velocity_ned_m_s: Vector3
    roll_rad: float
    pitch_rad: float
    yaw_rad: float
    yaw_rate_rad_s: float


STEP_S = 0.01
"""Time between two states, s."""
HISTORY_STEPS = 8
"""States kept. The oldest value that a sensor holds is 50 ms old."""


class History:
    """The latest states. A sensor holds the value of an earlier moment."""

    def __init__(self, start: TrueState, steps: int = HISTORY_STEPS) -> None:
        self._states = deque([start], maxlen=steps)

    def add(self, state: TrueState) -> None:
        self._states.append(state)

    def at(self, time_s: float) -> TrueState:
        """The state nearest to `time_s`, so the mean delay is zero; the oldest if none is near."""
        for state in reversed(self._states):
            if state.time_s <= time_s + 0.5 * STEP_S:
                return state
        return self._states[0]
