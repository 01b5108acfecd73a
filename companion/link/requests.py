"""What the companion asks for again and again until it is so: commands, streams, a parameter.

IDLE ──wanted──► SENT ──wanted again, 0.5 s later at least──► SENT again, confirmation + 1
▲                │ ▲                                          │
└── not wanted ──┘ └──────────────────────────────────────────┘

Whoever wants a command stops wanting it when the vehicle shows that it is so (mode, armed): acks
get lost, and PX4 sends two that may contradict each other. Only a take-off, which does not show at
once, is not sent again after it was accepted.
"""

import math
from collections import Counter
from dataclasses import dataclass, field
from typing import ClassVar

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.transports.transport import Message

RESEND_S = 0.5
MAX_CONFIRMATIONS = 255


def command_long(
    target: tuple[int, int], command: int, parameters: tuple[float, ...], confirmation: int = 0
) -> Message:
    """COMMAND_LONG (76); parameters not given are 0."""
    padded = (*parameters, *(0.0,) * (7 - len(parameters)))
    return mavlink.MAVLink_command_long_message(*target, command, confirmation, *padded)


@dataclass(slots=True)
class CommandSender:
    """Sends the one command that is wanted now, until it is wanted no more."""

    wanted: tuple[int, tuple[float, ...]] | None = None
    """The latest that was wanted at all."""
    confirmation: int = 0
    sent_s: float = float("-inf")
    refusal: str = ""
    """Why the latest command was refused, in the autopilot's words as far as it gave any."""
    is_accepted: bool = False
    """Some ack of it said so."""
    is_answered: bool = False
    """There was an ack since it was sent last."""
    _refused: str = ""

    @property
    def is_refused(self) -> bool:
        """It has been answered, and never been accepted."""
        return self.is_answered and not self.is_accepted

    def messages(
        self,
        now_s: float,
        wanted: tuple[int, tuple[float, ...]] | None,
        target: tuple[int, int],
    ) -> list[Message]:
        """What to send at this moment."""
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
        """A STATUSTEXT that follows a refusal tells its reason (the ack comes first)."""
        if self._refused:
            self.refusal = f"{self.refusal}: {text}"
            self._refused = ""


def _name(enum: str, value: int) -> str:
    entry = mavlink.enums[enum].get(value)
    return entry.name.removeprefix(f"{enum}_") if entry else str(value)


@dataclass(slots=True)
class Stream:
    """A message wanted at a rate; asked for again while it is silent, or clearly too slow.

    What was granted does not last: a ground station asks for its own rates on the same link, and an
    autopilot forgets. So it is counted how often the message comes. Of a message with instances,
    such as DISTANCE_SENSOR with one per sensor, the one that comes most often counts.
    """

    message_id: int
    rate_hz: float
    measured_hz: float | None = None
    """In the latest window that is over."""
    _seen_s: float = -math.inf
    _asked_s: float = -math.inf
    _begun_s: float = -math.inf
    """Of the present window."""
    _counts: Counter[object] = field(default_factory=Counter)
    _patience_s: float = 3.0
    """Between two requests because it is too slow; longer as long as they help nothing."""
    _unanswered: int = 0
    """How often it was asked for since one of them came."""

    SILENT_S: ClassVar[float] = 0.4
    """Before the flight misses its position, which is after 0.5 s."""
    MAX_WAIT_S: ClassVar[float] = 1.5
    WINDOW_S: ClassVar[float] = 3.0
    MIN_COUNT: ClassVar[int] = 10
    """Of messages in a window: a rate of fewer cannot be told from chance."""
    MIN_SHARE: ClassVar[float] = 0.7
    """Of the rate; a link with 20 % of loss is not too slow."""
    MAX_PATIENCE_S: ClassVar[float] = 30.0

    @property
    def is_slow(self) -> bool:
        return self.measured_hz is not None and self.measured_hz < self.MIN_SHARE * self.rate_hz

    @property
    def _silent_s(self) -> float:
        return max(self.SILENT_S, 3 / self.rate_hz)

    def note(self, message: Message, now_s: float) -> None:
        """One of them has come."""
        if now_s - self._seen_s >= self._silent_s:  # that it was silent is no rate
            self._begin_window(now_s)
        self._seen_s, self._unanswered = now_s, 0
        instance = message.instance_field and getattr(message, message.instance_field)
        self._counts[instance] += 1

    def requests(self, now_s: float, target: tuple[int, int]) -> list[Message]:
        """What is due; called at every tick."""
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
        """For an answer; at first not for long, as the request may be lost."""
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
