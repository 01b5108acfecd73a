"""Selects the reader of a log by its file name extension; a new format needs one entry here."""

from collections.abc import Callable, Mapping
from pathlib import Path

from companion.core.errors import LogError
from companion.offline.reading.csv_log import read_csv
from companion.offline.reading.log import Log, Watch

READERS: Mapping[str, Callable[[Path, Watch], Log]] = dict.fromkeys(
    (".csv", ".csv.gz", ".tsv", ".tsv.gz"), read_csv
)


def read_log(path: Path, watch: Watch) -> Log:
    """Read the log in a file.

    Raises:
        LogError: one line with the reason.
    """
    for end, reader in READERS.items():
        if path.name.lower().endswith(end):
            return reader(path, watch)
    raise LogError(f"{path}: unknown log format; known: {', '.join(READERS)}")
