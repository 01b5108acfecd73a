"""What the companion asks for again and again until it is so: commands, streams, a parameter.

IDLE ──wanted──► SENT ──wanted again, 0.5 s later at least──► SENT again, confirmation + 1
▲                │ ▲                                          │
└── not wanted ──┘ └──────────────────────────────────────────┘

Whoever wants a command stops wanting it when the vehicle shows that it is so (mode, armed): acks
get lost, and PX4 sends two that may contradict each other. Only a take-off, which does not show at
once, is not sent again after it was accepted.
"""

from dataclasses import dataclass

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.link.transport import Message

RESEND_S = 0.5
MOST_CONFIRMATIONS = 255


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
        self.confirmation = min(self.confirmation + 1, MOST_CONFIRMATIONS)
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
    """A message wanted at a rate; asked for again while it stays silent."""

    message_id: int
    rate_hz: float
    seen_s: float = float("-inf")
    asked_s: float = float("-inf")

    SILENT_S = 1.5

    def requests(self, now_s: float, target: tuple[int, int]) -> list[Message]:
        quiet_s = now_s - max(self.seen_s, self.asked_s)
        if quiet_s < max(self.SILENT_S, 2 / self.rate_hz):
            return []
        self.asked_s = now_s
        interval_us = 1e6 / self.rate_hz
        command = mavlink.MAV_CMD_SET_MESSAGE_INTERVAL
        return [command_long(target, command, (self.message_id, interval_us))]
