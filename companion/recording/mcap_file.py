"""Writes an MCAP file that is valid at every moment.

The format ends with an index and a footer, which a killed program cannot write. Therefore each
piece is followed by the shortest valid end, without an index. The next piece overwrites it, and the
last piece contains the index.
"""

from collections.abc import Mapping

from mcap.writer import CompressionType, Writer

from companion.recording import topics
from companion.recording.disk import Disk
from companion.recording.foxglove import to_ns
from companion.recording.shortest_end import SHORTEST_END

CHUNK_BYTES = 1 << 20
"""Larger than all data between two flushes. Chosen."""


class McapFile:
    """Writes messages on the topics of `topics` to a disk.

    Raises:
        RecordingError: the disk failed.
    """

    def __init__(self, disk: Disk) -> None:
        self._disk = disk
        self._output = _Output()
        self._writer = Writer(
            self._output,  # type: ignore[arg-type]
            chunk_size=CHUNK_BYTES,
            compression=CompressionType.LZ4,
        )
        self._writer.start()
        self._channels = topics.register(self._writer)

    def note(self, name: str, entries: Mapping[str, str]) -> None:
        """Write metadata of the whole file."""
        self._writer.add_metadata(name, dict(entries))

    def add(self, topic: str, time_s: float, data: bytes) -> None:
        time_ns = to_ns(time_s)
        self._writer.add_message(self._channels[topic], time_ns, data, time_ns)

    def flush(self) -> None:
        """Pass all added messages to the disk; a crash no longer loses them."""
        self._writer.flush()
        self._disk.append(self._output.take(), SHORTEST_END)

    def close(self) -> None:
        self._writer.finish()
        self._disk.append(self._output.take())
        self._disk.close()


class _Output:
    """Output of the MCAP library, which appends only and reads the offset."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._taken = 0

    def write(self, data: bytes) -> int:
        self._data += data
        return len(data)

    def tell(self) -> int:
        return self._taken + len(self._data)

    def flush(self) -> None:
        """No action: there is no further buffer."""

    def take(self) -> bytes:
        data, self._data = bytes(self._data), bytearray()
        self._taken += len(data)
        return data
