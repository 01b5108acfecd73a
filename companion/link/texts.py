"""STATUSTEXT (253), put together from its chunks.

ArduPilot marks the end of a text by a chunk that is not full, empty if need be; a text of one chunk
has the id 0. PX4 numbers all from 0 on, and ends a text of exactly 50 characters without a sign.
Such a text ends by the next one, or by silence.
"""

from companion.link.transports.transport import Message

CHUNK_LENGTH = 50
OVERDUE_S = 0.5
"""Chunks of one text follow each other at once."""


class Texts:
    """Of one autopilot; time is an argument."""

    def __init__(self) -> None:
        self._begun: dict[int, str] = {}
        """By id: texts whose end has not been seen."""
        self._heard_s = 0.0

    def hear(self, message: Message, now_s: float) -> list[str]:
        """What is whole by now."""
        self._heard_s = now_s
        over = [id_ for id_ in self._begun if id_ != message.id or message.chunk_seq == 0]
        ended = [self._begun.pop(id_) for id_ in over]
        text = self._begun.pop(message.id, "") + message.text
        if len(message.text) < CHUNK_LENGTH:
            ended.append(text)
        else:
            self._begun[message.id] = text
        return [text.rstrip() for text in ended]  # PX4's end with a tab

    def overdue(self, now_s: float) -> list[str]:
        """What will not go on any more."""
        if not self._begun or now_s - self._heard_s < OVERDUE_S:
            return []
        texts = [text.rstrip() for text in self._begun.values()]
        self._begun.clear()
        return texts
