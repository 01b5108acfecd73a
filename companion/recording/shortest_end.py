"""The shortest valid end of an MCAP file: without index and checksum."""

from mcap.data_stream import RecordBuilder
from mcap.records import DataEnd, Footer

MAGIC = b"\x89MCAP0\r\n"
"""Last bytes of every MCAP file."""


def _shortest_end() -> bytes:
    builder = RecordBuilder()
    DataEnd(data_section_crc=0).write(builder)
    Footer(summary_start=0, summary_offset_start=0, summary_crc=0).write(builder)
    return bytes(builder.end()) + MAGIC


SHORTEST_END = _shortest_end()
"""DataEnd, Footer and magic."""
