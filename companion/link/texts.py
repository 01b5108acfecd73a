"""Assembles STATUSTEXT (253) texts from their chunks.

ArduPilot ends a text with a chunk that is not full, if necessary an empty one. Its texts of one
chunk have the id 0. PX4 numbers all texts from 0 on, and sends no end mark after a text of exactly
50 characters. Such a text is complete when the next one begins, or after `OVERDUE_S`.
"""

from companion.link.transports.transport import Message

CHUNK_LENGTH = 50
"""Length of the text field in STATUSTEXT (253), characters."""
OVERDUE_S = 0.5
"""A text without a further chunk for this long is complete, s.

Chosen: the chunks of one text arrive together.
"""


class StatusTexts:
    """Texts of one autopilot; time is an argument."""

    def __init__(self) -> None:
        self._begun: dict[int, str] = {}
        """By id: texts whose last chunk has not arrived."""
        self._heard_s = 0.0

    def receive(self, message: Message, now_s: float) -> list[str]:
        """Add a chunk; returns the texts that are now complete."""
        self._heard_s = now_s
        over = [id_ for id_ in self._begun if id_ != message.id or message.chunk_seq == 0]
        ended = [self._begun.pop(id_) for id_ in over]
        text = self._begun.pop(message.id, "") + message.text
        if len(message.text) < CHUNK_LENGTH:
            ended.append(text)
        else:
            self._begun[message.id] = text
        return [text.rstrip() for text in ended]  # PX4's texts end with a tab

    def overdue(self, now_s: float) -> list[str]:
        """Texts that are complete because no further chunk arrived in `OVERDUE_S`."""
        if not self._begun or now_s - self._heard_s < OVERDUE_S:
            return []
        texts = [text.rstrip() for text in self._begun.values()]
        self._begun.clear()
        return texts
