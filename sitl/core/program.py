"""The version of the program, by its sources: equal versions give equal flights."""

import hashlib
from functools import cache
from importlib.metadata import version
from pathlib import Path

import companion
import sitl

SHOWN = 12
"""Length of the shown hash, hexadecimal digits. Chosen."""


@cache
def program_version() -> str:
    """The version of the package, and a hash of all sources of companion and simulator."""
    digest = hashlib.sha256()
    for package in (companion, sitl):
        folder = Path(str(package.__file__)).parent
        for path in sorted(folder.rglob("*.py")):
            digest.update(path.relative_to(folder).as_posix().encode() + b"\0")
            digest.update(path.read_bytes())
    return f"{version('pdps-companion')}+{digest.hexdigest()[:SHOWN]}"
