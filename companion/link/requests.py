"""Sends commands and stream requests, with retries until they take effect.

IDLE ──wanted──► SENT ──still wanted, after 0.5 s or more──► SENT again, confirmation + 1
▲                │ ▲                                          │
└── not wanted ──┘ └──────────────────────────────────────────┘

The caller requests a command until the vehicle state (mode, armed) shows its effect. An ack is not
sufficient: acks get lost, and PX4 sends two that may contradict each other. The exception is a
take-off, whose effect shows late: it is not repeated once it is accepted.
"""

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.transports.transport import Message

RESEND_S = 0.5
"""Minimum time between two transmissions of one command, s. Chosen."""
MAX_CONFIRMATIONS = 255
"""Maximum of `confirmation` in COMMAND_LONG (76), a uint8."""


def command_long(
    target: tuple[int, int], command: int, parameters: tuple[float, ...], confirmation: int = 0
) -> Message:
    """COMMAND_LONG (76); omitted parameters are 0."""
    padded = (*parameters, *(0.0,) * (7 - len(parameters)))
    return mavlink.MAVLink_command_long_message(*target, command, confirmation, *padded)


@dataclass(slots=True)
class CommandSender:
    """Sends the current command repeatedly while the caller requests it."""

    wanted: tuple[int, tuple[float, ...]] | None = None
    """The latest requested command and its parameters."""
    confirmation: int = 0
    sent_s: float = float("-inf")
    refusal: str = ""
    """Reason why the latest command was refused, with the autopilot's text if it sent one."""
    is_accepted: bool = False
    """At least one ack accepted the command."""
    is_answered: bool = False
    """An ack was received since the latest transmission."""
    _refused: str = ""

    @property
    def is_refused(self) -> bool:
        """The command was answered and never accepted."""
        return self.is_answered and not self.is_accepted

    def messages(
        self,
        now_s: float,
        wanted: tuple[int, tuple[float, ...]] | None,
        target: tuple[int, int],
    ) -> list[Message]:
        """Messages that are due at `now_s`."""
        if wanted is None:
            return []
        if wanted != self.wanted:
            self.wanted, self.confirmation, self.sent_s = wanted, 0, float("-inf")
            self.is_accepted, self.refusal, self._refused = False, "", ""
        is_done = self.is_accepted and wanted[0] == mavlink.MAV_CMD_NAV_TAKEOFF
        if is_done or now_s - self.sent_s < RESEND_S:
            return []
        message = command_long(target, *wanted, confirmation=self.confirmation)
        self.confirmation = min(self.confirmation + 1, MAX_CONFIRMATIONS)
        self.sent_s, self.is_answered = now_s, False
        return [message]

    def acknowledge(self, ack: Message) -> None:
        """Note a COMMAND_ACK (77)."""
        if self.wanted is None or ack.command != self.wanted[0]:
            return
        accepted = ack.result in (mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_IN_PROGRESS)
        self.is_answered = True
        self.is_accepted |= accepted
        self._refused = "" if accepted else _name("MAV_RESULT", ack.result)
        command = _name("MAV_CMD", ack.command)
        self.refusal = f"{command}: {self._refused}" if self._refused else ""

    def explain(self, text: str) -> None:
        """Add the STATUSTEXT that follows a refusal as its reason; the ack comes first."""
        if self._refused:
            self.refusal = f"{self.refusal}: {text}"
            self._refused = ""


def _name(enum: str, value: int) -> str:
    entry = mavlink.enums[enum].get(value)
    return entry.name.removeprefix(f"{enum}_") if entry else str(value)


@dataclass(slots=True)
class Stream:
    """A message stream at a requested rate; requested again if it stops or is clearly too slow.

    A granted rate does not last: a ground station requests its own rates on the same link, and an
    autopilot may drop a stream. The received rate is therefore measured. For a message with
    instances, such as DISTANCE_SENSOR with one per sensor, the most frequent instance counts.
    """

    message_id: int
    rate_hz: float
    measured_hz: float | None = None
    """Rate in the latest complete window, Hz."""
    _seen_s: float = -math.inf
    _asked_s: float = -math.inf
    _begun_s: float = -math.inf
    """Start of the current window."""
    _counts: Counter[object] = field(default_factory=Counter)
    _patience_s: float = 3.0
    """Time between two requests for a slow stream, s; doubles while requests have no effect."""
    _unanswered: int = 0
    """Number of requests since the last received message."""

    SILENT_S: ClassVar[float] = 0.4
    """A stream is silent after this long, s. Chosen: below 0.5 s, when the position times out."""
    MAX_WAIT_S: ClassVar[float] = 1.5
    """Maximum time between two requests for a silent stream, s. Chosen."""
    WINDOW_S: ClassVar[float] = 3.0
    """Minimum length of a window in which the rate is measured, s. Chosen."""
    MIN_COUNT: ClassVar[int] = 10
    """Expected messages in a window. Chosen: with fewer, the measured rate is not significant."""
    MIN_SHARE: ClassVar[float] = 0.7
    """Minimum measured rate as a share of the requested one. Chosen: tolerates 20 % packet loss."""
    MAX_PATIENCE_S: ClassVar[float] = 30.0
    """Maximum time between two requests for a slow stream, s. Chosen."""

    @property
    def is_slow(self) -> bool:
        return self.measured_hz is not None and self.measured_hz < self.MIN_SHARE * self.rate_hz

    @property
    def _silent_s(self) -> float:
        return max(self.SILENT_S, 3 / self.rate_hz)

    def note(self, message: Message, now_s: float) -> None:
        """Count a received message."""
        if now_s - self._seen_s >= self._silent_s:  # silence is no part of the rate
            self._begin_window(now_s)
        self._seen_s, self._unanswered = now_s, 0
        instance = message.instance_field and getattr(message, message.instance_field)
        self._counts[instance] += 1

    def requests(self, now_s: float, target: tuple[int, int]) -> list[Message]:
        """Requests that are due; called at every tick."""
        self._measure(now_s)
        is_silent = now_s - self._seen_s >= self._silent_s and self._has_waited(now_s)
        is_too_slow = self.is_slow and now_s - self._asked_s >= self._patience_s
        if self._asked_s > -math.inf and not is_silent and not is_too_slow:
            return []
        if is_silent and self.measured_hz is not None:
            self.measured_hz = 0.0
        if is_too_slow:
            self._patience_s = min(2 * self._patience_s, self.MAX_PATIENCE_S)
        self._asked_s = now_s
        self._unanswered += 1
        self._begin_window(now_s)
        interval_us = 1e6 / self.rate_hz
        command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        return [command_long(target, command, (self.message_id, interval_us))]

    def _has_waited(self, now_s: float) -> bool:
        """The wait for an answer is over; it is short at first, as the request may be lost."""
        wait_s = min(RESEND_S * 2 ** min(self._unanswered - 1, 8), self.MAX_WAIT_S)
        return bool(now_s - self._asked_s >= max(wait_s, self._silent_s))

    def _measure(self, now_s: float) -> None:
        window_s = max(self.WINDOW_S, self.MIN_COUNT / self.rate_hz)
        passed_s = now_s - self._begun_s
        if not window_s <= passed_s < math.inf:
            return
        self.measured_hz = max(self._counts.values(), default=0) / passed_s
        if not self.is_slow:
            self._patience_s = window_s
        self._begin_window(now_s)

    def _begin_window(self, now_s: float) -> None:
        self._begun_s = now_s
        self._counts.clear()
