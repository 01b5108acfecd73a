"""Checks the senders on the link: only a supported autopilot with a unique id is flown.

Before arming, the companion verifies the type of the autopilot, and that no other component sends
with the ids of the companion or the autopilot. Each message of a problem names the remedy.
"""

from collections import deque

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.config.settings import LinkConfig
from companion.link.firmware import FIRMWARES, MULTICOPTERS
from companion.link.transports.transport import Message

Source = tuple[int, int]
"""MAVLink system and component."""
SUPPORTED = frozenset(firmware.autopilot for firmware in FIRMWARES)
"""Supported values of HEARTBEAT.autopilot."""
DISCONTINUITIES, DISCONTINUITIES_WITHIN_S = 4, 5.0
"""Discontinuities within this time, s, that mean two autopilots with the same id.

A restarting autopilot causes three: its clock steps back, and PX4 briefly reports another type.
With two autopilots of one id, clock or type alternate with every message.
"""


class Senders:
    """All senders on the link, from their heartbeats; time is an argument."""

    def __init__(self, config: LinkConfig) -> None:
        self._url = config.url
        self._ours: Source = (config.system_id, config.component_id)
        self._target: Source = (config.system_id, int(mavlink.MAV_COMP_ID_AUTOPILOT1))
        self._kinds: dict[Source, tuple[int, int]] = {}
        """HEARTBEAT.autopilot and .type of each sender."""
        self._discontinuities_s: deque[float] = deque(maxlen=DISCONTINUITIES)
        self._has_same_id = self._has_two_autopilots = False
        self._not_autopilot: int | None = None
        """HEARTBEAT.type of a sender with the autopilot's ids that is no autopilot."""

    def receive(self, message: Message, now_s: float) -> None:
        """Process a message from any sender."""
        source = message.get_srcSystem(), message.get_srcComponent()
        self._has_same_id |= source == self._ours
        if message.get_type() != "HEARTBEAT":
            return
        kind = message.autopilot, message.type
        if source == self._target and self._kinds.get(source, kind) != kind:
            self.note_discontinuity(now_s)
        if source == self._target and kind[0] == mavlink.MAV_AUTOPILOT_INVALID:
            self._not_autopilot = kind[1]
        self._kinds[source] = kind

    def note_discontinuity(self, now_s: float) -> None:
        """Note that the autopilot's type has changed, or that its clock has stepped back."""
        self._discontinuities_s.append(now_s)
        is_full = len(self._discontinuities_s) == DISCONTINUITIES
        self._has_two_autopilots |= (
            is_full and now_s - self._discontinuities_s[0] <= DISCONTINUITIES_WITHIN_S
        )

    @property
    def problem(self) -> str:
        """Reason why a known autopilot is not flown; empty if there is none."""
        system, component = self._ours
        if self._has_two_autopilots and self._not_autopilot is not None:
            return (
                f"{_name('MAV_TYPE', self._not_autopilot)} uses system {system}, component 1, the "
                "autopilot's: give it ids of its own"
            )
        if self._has_two_autopilots:
            return (
                f"two autopilots at {self._url} have system id {system}: "
                "give each a system id of its own"
            )
        if self._has_same_id:
            return (
                f"another sender uses system {system}, component {component}, too: stop "
                "the other companion, or give this one another link.component_id"
            )
        return ""

    @property
    def other_senders(self) -> str:
        """Description of the other senders, for a missing autopilot; empty without senders."""
        if (kind := self._kinds.get(self._target)) and kind[0] != mavlink.MAV_AUTOPILOT_INVALID:
            return self._not_flown(*kind)
        autopilots = [s for s, k in self._kinds.items() if k[0] != mavlink.MAV_AUTOPILOT_INVALID]
        if systems := sorted({system for system, _ in autopilots} - {self._target[0]}):
            several = len(systems) > 1
            names = " and ".join(map(str, systems))
            others = f"systems {names} send" if several else f"system {names} sends"
            return f"{others} there, not {self._target[0]}: link.system_id"
        if autopilots:
            return (
                f"the autopilot at {self._url} is component {autopilots[0][1]} of its system, "
                "not 1: set its component id to 1"
            )
        return self._others()

    def _not_flown(self, autopilot: int, vehicle_type: int) -> str:
        if autopilot not in SUPPORTED:
            name = _name("MAV_AUTOPILOT", autopilot)
            return f"unsupported autopilot {name} at {self._url}: ArduPilot and PX4 are supported"
        if vehicle_type not in MULTICOPTERS:
            return f"{_vehicle(vehicle_type)} at {self._url}: only multicopters are flown"
        return ""

    def _others(self) -> str:
        if not self._kinds:
            return ""
        others = ", ".join(
            f"{_name('MAV_TYPE', kind[1])} (system {system}, component {component})"
            for (system, component), kind in sorted(self._kinds.items())
        )
        return (
            f"no autopilot at {self._url}, only {others}: is the autopilot connected, and "
            "does the router pass its messages on?"
        )


def _vehicle(vehicle_type: int) -> str:
    """Name of a vehicle type with its article."""
    name = _name("MAV_TYPE", vehicle_type).lower().replace("_", " ")
    words = "vehicle of no known type" if vehicle_type == mavlink.MAV_TYPE_GENERIC else name
    return f"{'an' if words[0] in 'aeiou' else 'a'} {words}"


def _name(enum: str, value: int) -> str:
    entry = mavlink.enums[enum].get(value)
    return entry.name.removeprefix(f"{enum}_") if entry else str(value)
