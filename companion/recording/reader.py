"""Reads a recording, complete or interrupted."""

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

from foxglove_schemas_protobuf.Log_pb2 import Log
from google.protobuf.message import DecodeError
from mcap.exceptions import McapError
from mcap.records import Channel, Chunk, Footer, McapRecord, Message, Metadata
from mcap.stream_reader import CRCValidationError, StreamReader, breakup_chunk
from msgspec import MsgspecError, json
from pydantic import ValidationError

from companion.config.settings import Config
from companion.core.errors import RecordingError
from companion.core.messages import FloorPlan, Pose, Setpoint
from companion.earlier import EarlierFlights
from companion.recording import topics
from companion.recording.exact import Tick, decode_plan, decode_ticks
from companion.recording.recorder import FORMAT
from companion.recording.topics import PhaseRecord

LARGEST_RECORD_BYTES = 1 << 28
"""A larger record length is a sign of a damaged file. Chosen."""
OUR_COMPRESSIONS = ("", "lz4")
"""Compressions of chunks that this program writes."""
_DAMAGE_ERRORS = (
    *(McapError, CRCValidationError, struct.error),
    *(
        RuntimeError,
        ValueError,
        EOFError,
        OverflowError,
        MemoryError,
    ),  # errors of lz4, and of damaged lengths
)
"""Errors of the MCAP library at the end of an interrupted file."""
_pose_decoder = json.Decoder(Pose)
_phase_decoder = json.Decoder(PhaseRecord)
_setpoint_decoder = json.Decoder(Setpoint)


@dataclass(frozen=True, slots=True)
class RecordedFault:
    """A fault or its end, with the flight's text."""

    time_s: float
    source: str
    text: str
    is_over: bool


@dataclass(slots=True)
class Recording:
    """All contents of a recording."""

    path: Path
    config: Config = field(default_factory=Config)
    companion_version: str = ""
    began_unix_s: float = 0.0
    ticks: list[Tick] = field(default_factory=list)
    poses: list[Pose] = field(default_factory=list)
    """Poses as estimated in flight, not smoothed."""
    setpoints: list[tuple[float, Setpoint]] = field(default_factory=list)
    phases: list[PhaseRecord] = field(default_factory=list)
    faults: list[RecordedFault] = field(default_factory=list)
    autopilot_texts: list[tuple[float, str]] = field(default_factory=list)
    earlier: EarlierFlights | None = None
    """Map of earlier flights with which the flight began."""
    plan: FloorPlan | None = None
    """The flight's final map; None if it was interrupted."""
    continues: str = ""
    """Name of an earlier file that ended in a crash, and whose contents it includes."""
    is_whole: bool = False
    """The file was closed."""


def read(path: Path) -> Recording:
    """Read everything up to the end of the recording, or up to damaged data.

    Raises:
        RecordingError: there is no such file, or it is not a recording of this program.
    """
    recording = Recording(path)
    try:
        for topic, record in _records(path, recording):
            _add(recording, topic, record)
    except (MsgspecError, DecodeError, ValidationError, KeyError, ValueError) as error:
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise RecordingError(f"{path}: not readable by this version: {reason}") from error
    if not recording.companion_version:
        raise RecordingError(f"{path}: not a recording of companion")
    return recording


def _records(path: Path, recording: Recording) -> Iterator[tuple[str, Message]]:
    """Messages with their topics; metadata and the end are stored in `recording`."""
    channels: dict[int, str] = {}
    for record in _until_damage(path):
        if isinstance(record, Channel):
            channels[record.id] = record.topic
        elif isinstance(record, Message):
            yield channels[record.channel_id], record
        elif isinstance(record, Metadata) and record.name == "recording":
            _add_metadata(recording, record.metadata)
        elif isinstance(record, Footer):
            recording.is_whole = record.summary_start > 0


def _until_damage(path: Path) -> Iterator[McapRecord]:
    try:
        with path.open("rb") as file:
            reader = StreamReader(
                file,
                emit_chunks=True,
                validate_crcs=True,
                record_size_limit=LARGEST_RECORD_BYTES,
            )
            for record in reader.records:
                if not isinstance(record, Chunk):
                    yield record
                elif record.compression in OUR_COMPRESSIONS:
                    yield from breakup_chunk(record, validate_crc=True)
                else:
                    return  # a damaged byte, or a foreign file
    except OSError as error:
        raise RecordingError(f"{path}: {error.strerror}") from error
    except _DAMAGE_ERRORS:
        return


def _add_metadata(recording: Recording, entries: dict[str, str]) -> None:
    if entries["format"] != FORMAT:
        raise RecordingError(
            f"{recording.path}: recorded in format {entries['format']}, this program reads "
            f"{FORMAT}; use companion {entries['companion']}"
        )
    if continues := entries.get("continues"):
        before = Path(continues).name
        _prepend(recording, read(recording.path.with_name(before)))
        recording.continues = before
    recording.companion_version = entries["companion"]
    recording.began_unix_s = float(entries["began_unix_s"])


def _prepend(recording: Recording, before: Recording) -> None:
    """Prepend the contents of the file that a crash interrupted."""
    recording.ticks += before.ticks
    recording.poses += before.poses
    recording.setpoints += before.setpoints
    recording.phases += before.phases
    recording.faults += before.faults
    recording.autopilot_texts += before.autopilot_texts


def _add(recording: Recording, topic: str, message: Message) -> None:
    time_s, data = message.log_time * 1e-9, message.data
    match topic:
        case topics.INPUTS:
            recording.ticks += decode_ticks(data)
        case topics.ESTIMATE:
            recording.poses.append(_pose_decoder.decode(data))
        case topics.SETPOINT:
            recording.setpoints.append((time_s, _setpoint_decoder.decode(data)))
        case topics.PHASE:
            recording.phases.append(_phase_decoder.decode(data))
        case topics.FAULTS:
            log = Log.FromString(data)
            over = log.level == Log.INFO
            recording.faults.append(RecordedFault(time_s, log.name, log.message, over))
        case topics.AUTOPILOT:
            recording.autopilot_texts.append((time_s, Log.FromString(data).message))
        case topics.CONFIG:
            recording.config = Config.model_validate_json(data)
        case topics.EARLIER:
            recording.earlier = EarlierFlights.from_bytes(data)
        case topics.MAP:
            recording.plan = decode_plan(data)
