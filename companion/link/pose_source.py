"""Checks that the autopilot can use our pose: its parameters, and other senders of poses.

With a heading from the compass, the frames of our pose and of the autopilot's velocity rotate
against each other. With two pose sources, each with its own reset counter, the autopilot resets
its estimate at every message and flies away.
"""

from collections.abc import Mapping

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.transports.transport import Message

POSES = frozenset(
    {
        mavlink.MAVLINK_MSG_ID_ODOMETRY,
        mavlink.MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE,
        mavlink.MAVLINK_MSG_ID_VISION_SPEED_ESTIMATE,
        mavlink.MAVLINK_MSG_ID_VISION_POSITION_DELTA,
        mavlink.MAVLINK_MSG_ID_GLOBAL_VISION_POSITION_ESTIMATE,
        mavlink.MAVLINK_MSG_ID_ATT_POS_MOCAP,
    }
)
"""Ids of the MAVLink messages that carry an external pose."""
GONE_S = 5.0
"""A component that sends no pose for this long has stopped, s. Chosen."""


class PoseSource:
    """Pose sources of one vehicle; time is an argument."""

    def __init__(self) -> None:
        self._others: dict[int, float] = {}
        """By component id: time of its latest pose."""

    def overhear(self, message: Message, now_s: float) -> None:
        """Note a message from another component of this vehicle, forwarded by the autopilot."""
        if message.get_msgId() in POSES:
            self._others[message.get_srcComponent()] = now_s

    def complaint(
        self, now_s: float, wanted: Mapping[str, int], values: Mapping[str, float]
    ) -> str:
        """Reason why the autopilot cannot use our pose; empty if it can."""
        others = [str(c) for c, received_s in self._others.items() if now_s - received_s <= GONE_S]
        if others:
            return (
                f"component {', '.join(others)} sends it a pose as well as we do: "
                "end that, or set link.send_pose = false"
            )
        unknown = [name for name in wanted if name not in values]
        if unknown:
            return f"link.send_pose: it does not report {', '.join(unknown)}"
        wrong = [
            f"{name} is {values[name]:g}, set it to {value}"
            for name, value in wanted.items()
            if values[name] != value
        ]
        return f"link.send_pose: {'; '.join(wrong)}" if wrong else ""
