"""MAVLink 2 signing: rejects frames without a valid signature, and replayed frames.

A signature covers the frame and a time stamp in units of 10 µs since 2015 (MAVLink guide, message
signing). A machine without a real-time clock, such as a Raspberry Pi, may start with an earlier
time than at its last shutdown; receivers would then reject its frames as replays. The time stamp is
therefore stored in a file, up to one minute ahead of the last used one. A background thread writes
the file before this minute is over, so the control loop does not wait. In flight, a file that
cannot be written causes one warning, and the time stamp is kept in memory.
"""

import contextlib
import errno
import hashlib
import hmac
import os
import re
import stat
import time
from collections.abc import Callable
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.background_writer import BackgroundWriter
from companion.core.errors import LinkError
from companion.core.textfile import NotTextError, read_text

EPOCH_S = 1_420_070_400
"""2015-01-01 in Unix time, s; epoch of the time stamps (MAVLink guide, message signing)."""
TICKS_PER_S = 100_000
"""Time stamp units per second (MAVLink guide, message signing)."""
RESERVE = 60 * TICKS_PER_S
"""Lead of the stored time stamp over the used one, in units of 10 µs. Chosen."""
RENEWED = RESERVE // 4
"""Remaining lead at which the file is written again, in units of 10 µs.

Chosen: 15 s, more than any card needs to write one line.
"""
MAX_TICKS = 2**48
"""Upper bound of a time stamp: a frame has six bytes for it."""
SIGNATURE_BYTES = 6
"""Length of the signature at the end of a frame, bytes."""
MORE_THAN_OWNER = 0o077
"""Mode bits of a key file that give access to other users."""
WRONG_PLACE = frozenset(
    {
        *(errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EACCES, errno.EPERM),
        *(errno.ELOOP, errno.ENAMETOOLONG),
    }
)
"""Error numbers of a path that can never be used; other errors come from the storage medium."""

Warn = Callable[[str], object]


class Signing(mavlink.MAVLinkSigning):  # type: ignore[misc]
    """Key and time stamp of one end; the time stamp follows the clock and never decreases.

    `refuses`: raise an error for an unusable file. True on the ground, False in flight.

    Raises:
        LinkError: the path `kept` cannot be used, or the file contains no time stamp.
    """

    def __init__(
        self,
        key: bytes,
        kept: Path | None = None,
        clock: Callable[[], float] = time.time,
        warn: Warn = lambda _: None,
        *,
        refuses: bool = True,
    ) -> None:
        self._clock = clock
        self._kept = kept
        self._warn = warn
        self._refuses = refuses
        self._has_warned = False
        self._timestamp = self._read()
        self._writer = BackgroundWriter(self._write)
        self._reserved = self._timestamp
        """Time stamp that is in the file or is being written."""
        self._begin()
        super().__init__()
        self.secret_key = key
        self.sign_outgoing = True

    @property
    def timestamp(self) -> int:
        """Time stamp of the next frame, in units of 10 µs since 2015; never waits or raises."""
        self._follow_clock()
        if self._kept is not None and self._reserved - self._timestamp < RENEWED:
            self._reserved = self._timestamp + RESERVE
            self._writer.write(self._reserved)
        if self._writer.trouble:
            self._complain(self._writer.trouble)
        return self._timestamp

    @timestamp.setter
    def timestamp(self, value: int) -> None:
        self._timestamp = max(self._timestamp, value)

    def _follow_clock(self) -> None:
        now = int((self._clock() - EPOCH_S) * TICKS_PER_S)
        self._timestamp = max(self._timestamp, now)

    def _begin(self) -> None:
        """On the ground, write the first reserve now: an unusable path is found before take-off."""
        if self._kept is None or not self._refuses:
            return
        self._follow_clock()
        self._reserved = self._timestamp + RESERVE
        try:
            self._write(self._reserved)
        except OSError as error:
            self._refuse(error)

    def _read(self) -> int:
        if self._kept is None:
            return 0
        try:
            kept = int(self._kept.read_text())
            if not 0 <= kept < MAX_TICKS:
                raise ValueError(f"{kept} is no time stamp")
        except FileNotFoundError:
            return 0
        except (OSError, ValueError) as error:
            self._refuse(error)
            return 0
        return kept

    def _write(self, timestamp: int) -> None:
        """Write the file atomically, also if the power fails."""
        assert self._kept is not None
        new = self._kept.with_name(self._kept.name + ".new")
        flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC
        with contextlib.closing(os.fdopen(os.open(new, flags, 0o600), "w")) as file:
            file.write(f"{timestamp}\n")
            file.flush()
            os.fsync(file.fileno())
        new.replace(self._kept)

    def _refuse(self, error: OSError | ValueError) -> None:
        is_refused = not isinstance(error, OSError) or error.errno in WRONG_PLACE
        if self._refuses and is_refused:
            raise LinkError(
                f"link.signing_timestamp = {self._kept}: {_words(error)}; "
                "name a file that can be written; if its stamp is lost, delete it and set the clock"
            ) from error
        self._complain(_words(error))

    def _complain(self, words: str) -> None:
        if self._has_warned:
            return
        self._has_warned = True
        self._warn(
            f"link.signing_timestamp = {self._kept}: {words}; the time stamp is kept in memory, "
            "which lasts until this computer restarts"
        )


def _words(error: OSError | ValueError) -> str:
    return getattr(error, "strerror", None) or str(error)


class SigningCodec(mavlink.MAVLink):  # type: ignore[misc]
    """Rejects frames that are not signed with our key, and replayed frames."""

    def check_signature(self, frame: bytearray, system_id: int, component_id: int) -> bool:
        """Check the signature before its time: pymavlink also stores the time of forged frames.

        Otherwise one forged frame with a future time would block all later frames of its sender.
        """
        digest = hashlib.sha256(self.signing.secret_key + frame[:-SIGNATURE_BYTES]).digest()
        signature = bytes(frame[-SIGNATURE_BYTES:])
        if not hmac.compare_digest(digest[:SIGNATURE_BYTES], signature):
            return False
        return bool(super().check_signature(frame, system_id, component_id))


def load_signing(
    key_file: Path,
    kept: Path | None,
    warn: Warn = lambda _: None,
    *,
    refuses: bool = True,
) -> Signing:
    """Signing with the key in `key_file`, and the time stamp in `kept` or beside the key.

    Raises:
        LinkError: one of the files cannot be used; the message names it and the remedy.
    """
    kept = kept or key_file.with_suffix(".timestamp")
    return Signing(read_key(key_file), kept, warn=warn, refuses=refuses)


def read_key(key_file: Path) -> bytes:
    """Read a key of 32 bytes from a file of 64 hexadecimal digits that only its owner can read.

    Raises:
        LinkError: the file is missing, other users can read it, or it contains no key.
    """
    try:
        mode = stat.S_IMODE(key_file.stat().st_mode)
        text = read_text(key_file)
    except (OSError, NotTextError) as error:
        raise LinkError(f"link.signing_key = {key_file}: {error}; is it this user's?") from error
    if mode & MORE_THAN_OWNER:
        raise LinkError(
            f"link.signing_key = {key_file}: mode {mode:o}, others can read it; "
            f"chmod 600 {key_file}, and take a new key"
        )
    if not re.fullmatch(r"[0-9a-fA-F]{64}", text.strip()):
        raise LinkError(
            f"link.signing_key = {key_file}: should be 64 hexadecimal digits; "
            f"openssl rand -hex 32 > {key_file}"
        )
    return bytes.fromhex(text.strip())
