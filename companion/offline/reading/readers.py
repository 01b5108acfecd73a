"""Which reader reads a log, by the end of its name; a new format is one more line here."""

from collections.abc import Callable, Mapping
from pathlib import Path

from companion.core.errors import LogError
from companion.offline.reading.csv_log import read_csv
from companion.offline.reading.log import Log, Watch

READERS: Mapping[str, Callable[[Path, Watch], Log]] = dict.fromkeys(
    (".csv", ".csv.gz", ".tsv", ".tsv.gz"), read_csv
)


def read_log(path: Path, watch: Watch) -> Log:
    """The log in a file.

    Raises:
        LogError: one line that says why there is none.
    """
    for end, reader in READERS.items():
        if path.name.lower().endswith(end):
            return reader(path, watch)
    raise LogError(f"{path}: not a kind of log that can be read: {', '.join(READERS)}")
