"""What the autopilot says: order and chunking as on a real one."""

import math
from collections.abc import Callable, Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.values import value
from sitl.autopilot.streams import Message

TEXT_LENGTH = 50


@value
class TextHabit:
    """How an autopilot sends STATUSTEXT (253)."""

    needs_ground_station: bool = False
    """It goes out only on links on which a ground station's HEARTBEAT has come in."""
    numbers_all: bool = False
    """All have an id, from 0 on, and nothing marks the end of one that fills its last chunk."""
    ending: str = ""
    """What stands at the end of each."""


MARKED = TextHabit()
"""A short chunk is the end of a text that has an id."""


class Outbox:
    """Messages of one link in the order in which they are sent."""

    def __init__(self) -> None:
        self._messages: list[Message] = []
        self.ground_station_s = -math.inf
        """When a ground station's HEARTBEAT last came in on this link."""

    def add(self, message: Message) -> None:
        self._messages.append(message)

    def extend(self, messages: list[Message]) -> None:
        self._messages.extend(messages)

    def begin_answer(self) -> int:
        """A mark for `answer`: all that is added from here on explains the ack."""
        return len(self._messages)

    def answer(self, ack: Message, mark: int) -> None:
        """An ack goes before what explains it."""
        self._messages.insert(mark, ack)

    def take(self) -> list[Message]:
        messages, self._messages = self._messages, []
        return messages


class Broadcast:
    """What every link hears; texts only those to which they go."""

    def __init__(
        self,
        outboxes: Sequence[Outbox],
        habit: TextHabit = MARKED,
        hears_texts: Callable[[Outbox], bool] = lambda _: True,
    ) -> None:
        self._outboxes = outboxes
        self._habit = habit
        self._hears_texts = hears_texts
        self._text_id = 0

    def add(self, message: Message) -> None:
        for outbox in self._outboxes:
            outbox.add(message)

    def text(self, severity: int, text: str) -> None:
        """STATUSTEXT (253), in chunks of 50 characters."""
        habit = self._habit
        text += habit.ending
        chunks = [text[i : i + TEXT_LENGTH] for i in range(0, len(text), TEXT_LENGTH)]
        text_id = 0
        if habit.numbers_all:
            text_id = self._text_id
            self._text_id = (text_id + 1) % 65536
        elif len(chunks) > 1:
            self._text_id = self._text_id % 65535 + 1
            text_id = self._text_id
            if len(chunks[-1]) == TEXT_LENGTH:
                chunks.append("")  # a short chunk ends the text
        for outbox in filter(self._hears_texts, self._outboxes):
            for sequence, chunk in enumerate(chunks):
                outbox.add(
                    mavlink.MAVLink_statustext_message(severity, chunk.encode(), text_id, sequence)
                )
