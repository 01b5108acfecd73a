"""Publishes a flight live to Foxglove, with the topics, schemas and messages of its recording.

Nothing is encoded without a client.
"""

import time
from collections.abc import Callable
from pathlib import Path
from typing import Protocol

from companion.config.settings import Config
from companion.core.extras import needs_extra
from companion.core.messages import FloorPlan
from companion.link.transports.transport import Transport
from companion.recording import topics
from companion.recording.notes import NUMBERS_PERIOD_S, Notes, Sink
from companion.recording.recorder import Recorder
from companion.ticks import Inputs, Outputs

WALLS_PERIOD_S = 2.0
"""Interval of the walls while a client receives them, s.

Chosen: each message contains the whole map. A recording has them less often.
"""
LAYOUT = Path(__file__).with_name("foxglove_layout.json")
"""Layout of Foxglove's panels for these topics."""
FAREWELL_S = 0.5
"""Time in which clients receive the final map before the server ends, s. Chosen."""


class Stream(Sink, Protocol):
    """Interface of the server for the publisher."""

    @property
    def has_clients(self) -> bool: ...

    def is_received(self, topic: str) -> bool: ...

    def newly_received(self) -> set[str]: ...

    def set_time(self, time_s: float) -> None: ...

    def close(self) -> None: ...


def publish_too(recorder: Recorder, config: Config, tell: Callable[[str], None]) -> Recorder:
    """Publish what `recorder` records, if `view.foxglove` of the configuration is an address.

    `tell` receives the address, and a warning if the stream ends before the flight.

    Raises:
        ViewError: other machines can reach the address and `view.foxglove_open` is false, or the
            address cannot be used.
        MissingExtraError: foxglove-sdk is not installed.
    """
    if not config.view.foxglove:
        return recorder
    with needs_extra("foxglove"):
        from companion.view.foxglove_server import TopicServer  # noqa: PLC0415 - an extra
    server = TopicServer(config.view)
    tell(f"Foxglove: {server.url}, with the layout {LAYOUT}")
    return LiveRecorder(recorder, server, config, tell)


class LiveRecorder:
    """A recorder that also publishes what it records."""

    def __init__(
        self, recorder: Recorder, stream: Stream, config: Config, warn: Callable[[str], None]
    ) -> None:
        self._recorder = recorder
        self._stream = stream
        self._config = config
        self._warn = warn
        self._notes = Notes(stream, config.sensors.mount_offset_m)
        self._is_open = True
        self._last_s = 0.0
        self._clock_s = self._walls_s = float("-inf")

    def tap(self, transport: Transport) -> Transport:
        return self._recorder.tap(transport)

    def tick(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        self._recorder.tick(now_s, inputs, outputs)
        self._last_s = now_s
        self._guarded(lambda: self._publish(now_s, inputs, outputs))

    def close(self, plan: FloorPlan) -> None:
        """End the recording and the stream; its last message is the final map."""
        self._recorder.close(plan)
        self._guarded(lambda: self._publish_map(plan))
        self._stream.close()

    def _guarded(self, work: Callable[[], None]) -> None:
        """Any error, including bugs of this module, ends only the stream."""
        if not self._is_open or not self._stream.has_clients:
            return
        try:
            work()
        except Exception as error:
            self._is_open = False
            self._stream.close()
            self._warn(f"the Foxglove stream is closed: {error!r}")

    def _publish(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        if now_s - self._clock_s >= NUMBERS_PERIOD_S - 1e-6:
            self._clock_s = now_s
            self._stream.set_time(now_s)
        new = self._stream.newly_received()
        if topics.CONFIG in new:
            self._stream.add(topics.CONFIG, now_s, self._config.model_dump_json().encode())
        self._notes.add(now_s, inputs, outputs)
        is_due = now_s - self._walls_s >= WALLS_PERIOD_S and self._stream.is_received(topics.WALLS)
        if is_due or topics.WALLS in new:
            self._walls_s = now_s
            self._notes.add_walls(now_s, outputs.progress.map_walls())

    def _publish_map(self, plan: FloorPlan) -> None:
        self._notes.add_walls(self._last_s, plan.walls, plan.ceiling_m)
        time.sleep(FAREWELL_S)  # the server drops what it has not sent when it ends
