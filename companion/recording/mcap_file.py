"""An MCAP file that is whole at every moment.

The format ends with an index and a footer, which a program that is killed never writes. So
behind each piece stands the shortest end that the format allows, without an index; the next piece
takes its place, and the last one brings the index.
"""

from collections.abc import Mapping

from mcap.writer import CompressionType, Writer

from companion.recording import topics
from companion.recording.disk import Disk
from companion.recording.foxglove import to_ns
from companion.recording.shortest_end import SHORTEST_END

CHUNK_BYTES = 1 << 20
"""More than ever comes together between two flushes."""


class McapFile:
    """Messages on the topics of `topics`, to a disk.

    Raises:
        RecordingError: the disk's.
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
        """Metadata of the whole file."""
        self._writer.add_metadata(name, dict(entries))

    def add(self, topic: str, time_s: float, data: bytes) -> None:
        time_ns = to_ns(time_s)
        self._writer.add_message(self._channels[topic], time_ns, data, time_ns)

    def flush(self) -> None:
        """Hand over all that was added; from then on a crash does not lose it."""
        self._writer.flush()
        self._disk.append(self._output.take(), SHORTEST_END)

    def close(self) -> None:
        self._writer.finish()
        self._disk.append(self._output.take())
        self._disk.close()


class _Output:
    """What the MCAP library writes to: it asks for the offset, and never goes back."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._taken = 0

    def write(self, data: bytes) -> int:
        self._data += data
        return len(data)

    def tell(self) -> int:
        return self._taken + len(self._data)

    def flush(self) -> None:
        """There is nothing behind it."""

    def take(self) -> bytes:
        data, self._data = bytes(self._data), bytearray()
        self._taken += len(data)
        return data
