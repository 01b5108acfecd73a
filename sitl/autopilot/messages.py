"""What the autopilot says: order and chunking as on a real one."""

from collections.abc import Sequence

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from sitl.autopilot.streams import Message

TEXT_LENGTH = 50


class Outbox:
    """Messages of one link in the order in which they are sent."""

    def __init__(self) -> None:
        self._messages: list[Message] = []

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
    """What every link hears."""

    def __init__(self, outboxes: Sequence[Outbox]) -> None:
        self._outboxes = outboxes
        self._text_id = 0

    def add(self, message: Message) -> None:
        for outbox in self._outboxes:
            outbox.add(message)

    def text(self, severity: int, text: str) -> None:
        """STATUSTEXT (253), in chunks of 50 characters."""
        chunks = [text[i : i + TEXT_LENGTH] for i in range(0, len(text), TEXT_LENGTH)]
        text_id = 0
        if len(chunks) > 1:
            self._text_id = self._text_id % 65535 + 1
            text_id = self._text_id
            if len(chunks[-1]) == TEXT_LENGTH:
                chunks.append("")  # a short chunk ends the text
        for sequence, chunk in enumerate(chunks):
            self.add(
                mavlink.MAVLink_statustext_message(severity, chunk.encode(), text_id, sequence)
            )
