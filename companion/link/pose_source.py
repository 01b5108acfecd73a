"""What keeps an autopilot from flying by our pose: how it is set, and who else tells it one.

With its heading from the compass, the frame of our pose and that of its velocity turn against each
other. With two who tell it poses, each with reset counters of its own, it moves its estimate at
every message, and flies away.
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
GONE_S = 5.0
"""Who has told no pose for so long has stopped."""


class PoseSource:
    """Of one vehicle; time is an argument."""

    def __init__(self) -> None:
        self._others: dict[int, float] = {}
        """By component: when it last told a pose."""

    def overhear(self, message: Message, now_s: float) -> None:
        """A message of another component's of this vehicle, which the autopilot passes on."""
        if message.get_msgId() in POSES:
            self._others[message.get_srcComponent()] = now_s

    def complaint(self, now_s: float, wanted: Mapping[str, int], told: Mapping[str, float]) -> str:
        """Why it would not fly by our pose; or nothing."""
        others = [str(c) for c, heard_s in self._others.items() if now_s - heard_s <= GONE_S]
        if others:
            return (
                f"component {', '.join(others)} tells it a pose as well as we do: "
                "end that, or set link.send_pose = false"
            )
        unknown = [name for name in wanted if name not in told]
        if unknown:
            return f"link.send_pose: it does not tell {', '.join(unknown)}"
        wrong = [
            f"{name} is {told[name]:g}, set it to {value}"
            for name, value in wanted.items()
            if told[name] != value
        ]
        return f"link.send_pose: {'; '.join(wrong)}" if wrong else ""
