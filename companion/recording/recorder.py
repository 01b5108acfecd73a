"""Records a flight: an MCAP file, and a tlog of its MAVLink messages.

Any error here ends the recording with one warning, and never the flight.
"""

import time
from collections.abc import Callable, Sequence
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import Protocol

from companion.config.settings import Config
from companion.core.errors import RecordingError
from companion.core.messages import FloorPlan, WallSegment
from companion.core.values import value
from companion.earlier import EarlierFlights
from companion.link.transports.transport import Message as MavlinkMessage
from companion.link.transports.transport import Transport
from companion.recording import topics
from companion.recording.disk import Disk
from companion.recording.exact import Tick, encode_plan, encode_ticks
from companion.recording.mcap_file import McapFile
from companion.recording.notes import Notes
from companion.recording.tlog import Tap, TlogEncoder
from companion.ticks import Inputs, Outputs

FLUSH_PERIOD_S = 0.5
"""Interval of writes, s of real time: limits the loss by a crash, and the cost of writing.
Chosen."""
WALLS_PERIOD_S = 10.0
"""Interval of the walls, s. Chosen."""
FORMAT = "1"
"""Format of `/inputs` and `/map`; incremented whenever older programs would misread them."""

Warn = Callable[[str], None]
Clock = Callable[[], float]


class Recorder(Protocol):
    """Interface of the recorder for the control loop."""

    def tap(self, transport: Transport) -> Transport:
        """Wrap the transport, so that its messages are recorded."""
        ...

    def tick(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        """Record one tick, after its setpoint has been sent."""
        ...

    def close(self, plan: FloorPlan) -> None:
        """End the recording with the final map."""
        ...


class NotRecorded:
    """Does not record."""

    def tap(self, transport: Transport) -> Transport:
        return transport

    def tick(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        pass

    def close(self, plan: FloorPlan) -> None:
        pass


NOT_RECORDED = NotRecorded()


def open_recorder(
    folder: Path,
    config: Config,
    began_unix_s: float,
    warn: Warn,
    clock: Clock = time.monotonic,
    *,
    continues: str = "",
    earlier: EarlierFlights | None = None,
) -> Recorder:
    """Open a recorder with new files in `folder`; on failure only warn.

    The files are named by the time, and by the number of a drone of a team.

    `continues` names the recording in the same folder that a crash has interrupted. `earlier`: the
    map of earlier flights with which the flight begins.

    `clock` determines only the times of writes. A simulated flight that takes a second of real time
    is written in a few pieces, without slowing it down.
    """
    if not config.recording.enabled:
        return NOT_RECORDED
    began = datetime.fromtimestamp(began_unix_s, UTC)
    drone = f"_drone_{config.team.drone}" if config.team.name else ""
    name = f"flight_{began:%Y-%m-%d_%H-%M-%S}{drone}"
    path = folder / f"{name}.mcap"
    number = 1
    try:
        while path.exists():  # a Raspberry Pi without network may start twice at the same time
            number += 1
            path = path.with_stem(f"{name}_{number}")
        return FlightRecorder(
            path, config, began_unix_s, warn, clock, continues=continues, earlier=earlier
        )
    except (OSError, RuntimeError) as error:  # a failing disk, or no more threads
        warn(f"this flight is not recorded: {error}")
        return NOT_RECORDED


@value
class _Tick:
    """All data of one tick."""

    exact: Tick
    outputs: Outputs
    walls: Sequence[WallSegment] | None
    mavlink: list[MavlinkMessage]


class FlightRecorder:
    """Records to `path` and to a tlog beside it."""

    def __init__(
        self,
        path: Path,
        config: Config,
        began_unix_s: float,
        warn: Warn,
        clock: Clock,
        *,
        continues: str,
        earlier: EarlierFlights | None,
    ) -> None:
        self.path = path
        self._clock = clock
        self._warn = warn
        self._is_recording = True
        self._file = McapFile(Disk(path))
        self._notes = Notes(self._file, config.sensors.mount_offset_m)
        self._tlog = Disk(path.with_suffix(".tlog"))
        self._tlog_encoder = TlogEncoder(began_unix_s)
        self._tap: Tap | None = None
        self._pending: list[_Tick] = []
        self._flushed_s = clock()
        self._last_s = self._walls_s = 0.0
        self._file.note(
            "recording",
            {
                "format": FORMAT,
                "companion": version("pdps-companion"),
                "began_unix_s": repr(began_unix_s),
                **({"continues": continues} if continues else {}),
            },
        )
        self._file.add(topics.CONFIG, 0.0, config.model_dump_json().encode())
        if earlier is not None:
            self._file.add(topics.EARLIER, 0.0, earlier.to_bytes())

    def tap(self, transport: Transport) -> Transport:
        self._tap = Tap(transport)
        return self._tap

    def tick(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        if self._is_recording:
            self._guarded(lambda: self._tick(now_s, inputs, outputs))

    def close(self, plan: FloorPlan) -> None:
        if self._is_recording:
            self._guarded(lambda: self._close(plan))

    def _guarded(self, work: Callable[[], None]) -> None:
        """Any error, including bugs of this module, ends only the recording."""
        try:
            work()
        except Exception as error:
            self._is_recording = False
            self._pending = []
            if self._tap is not None:
                self._tap.stop()
            reason = error if isinstance(error, RecordingError) else repr(error)
            self._warn(f"recording stopped: {reason}")

    def _tick(self, now_s: float, inputs: Inputs, outputs: Outputs) -> None:
        """Queue the tick; many are written together, which takes half the time."""
        self._last_s = now_s
        walls = None
        if now_s - self._walls_s >= WALLS_PERIOD_S:
            self._walls_s = now_s
            walls = outputs.progress.map_walls()
        mavlink = self._tap.take() if self._tap is not None else []
        self._pending.append(_Tick(Tick(now_s, inputs), outputs, walls, mavlink))
        if self._clock() - self._flushed_s >= FLUSH_PERIOD_S:
            self._flushed_s = self._clock()
            self._flush()

    def _flush(self) -> None:
        ticks, self._pending = self._pending, []
        if not ticks:
            return
        exact = encode_ticks([tick.exact for tick in ticks])
        self._file.add(topics.INPUTS, ticks[-1].exact.now_s, exact)
        for tick in ticks:
            now_s = tick.exact.now_s
            self._notes.add(now_s, tick.exact.inputs, tick.outputs)
            if tick.walls is not None:
                self._notes.add_walls(now_s, tick.walls)
        self._file.flush()
        encode = self._tlog_encoder.encode
        self._tlog.append(b"".join(encode(tick.exact.now_s, tick.mavlink) for tick in ticks))

    def _close(self, plan: FloorPlan) -> None:
        self._flush()
        self._notes.add_walls(self._last_s, plan.walls, plan.ceiling_m)
        self._file.add(topics.MAP, self._last_s, encode_plan(plan))
        self._file.close()
        self._tlog.close()
