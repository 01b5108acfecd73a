"""Queues the autopilot's messages: order and chunking as on a real one."""

import math
from collections.abc import Callable, Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.values import value
from sitl.autopilot.streams import Message

TEXT_LENGTH = 50
"""Characters in a STATUSTEXT (253)."""


@value
class TextHabit:
    """An autopilot's way of sending STATUSTEXT (253)."""

    needs_ground_station: bool = False
    """Texts are sent only on links that have received a ground station's HEARTBEAT."""
    numbers_all: bool = False
    """Every text has an id, starting at 0. No empty chunk follows a full last chunk."""
    ending: str = ""
    """Suffix of each text."""


MARKED = TextHabit()
"""A chunk that is not full ends a text with an id."""


class Outbox:
    """Messages of one link in the order of sending."""

    def __init__(self) -> None:
        self._messages: list[Message] = []
        self.ground_station_s = -math.inf
        """Time of the last HEARTBEAT from a ground station on this link, s."""

    def add(self, message: Message) -> None:
        self._messages.append(message)

    def extend(self, messages: list[Message]) -> None:
        self._messages.extend(messages)

    def begin_answer(self) -> int:
        """A mark for `answer`: messages added from here on explain the acknowledgement."""
        return len(self._messages)

    def answer(self, ack: Message, mark: int) -> None:
        """Insert an acknowledgement before the messages that explain it."""
        self._messages.insert(mark, ack)

    def take(self) -> list[Message]:
        messages, self._messages = self._messages, []
        return messages


class Broadcast:
    """Sends to every link; texts only to links that receive texts."""

    def __init__(
        self,
        outboxes: Sequence[Outbox],
        habit: TextHabit = MARKED,
        receives_texts: Callable[[Outbox], bool] = lambda _: True,
    ) -> None:
        self._outboxes = outboxes
        self._habit = habit
        self._receives_texts = receives_texts
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
        for outbox in filter(self._receives_texts, self._outboxes):
            for sequence, chunk in enumerate(chunks):
                outbox.add(
                    mavlink.MAVLink_statustext_message(severity, chunk.encode(), text_id, sequence)
                )
