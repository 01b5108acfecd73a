"""MAVLink 2 signing: only who has the key is listened to, and nothing twice.

A signature is over the frame and a time stamp, 10 µs since 2015 (MAVLink guide, message signing). A
machine without a clock of its own, such as a Raspberry Pi, may start with an earlier time than it
ended with; what it then signs would be taken for a replay. So the time stamp is kept in a file,
always up to a minute ahead of what has been used. The control loop does not wait for the file: it
is written aside, in time before the minute is up. In flight, a file that cannot be written is told
once, and the stamp is kept in memory.
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

from companion.core.aside import Aside
from companion.core.errors import LinkError
from companion.core.textfile import NotTextError, read_text

EPOCH_S = 1_420_070_400
"""2015-01-01, by the Unix clock."""
TICKS_PER_S = 100_000
RESERVE = 60 * TICKS_PER_S
RENEWED = RESERVE // 4
"""Of the reserve that is left when it is asked for again; no card takes 15 s for one line."""
MAX_TICKS = 2**48
"""A frame has six bytes for its stamp."""
SIGNATURE_BYTES = 6
MORE_THAN_OWNER = 0o077
WRONG_PLACE = frozenset(
    {
        *(errno.ENOENT, errno.ENOTDIR, errno.EISDIR, errno.EACCES, errno.EPERM),
        *(errno.ELOOP, errno.ENAMETOOLONG),
    }
)
"""The configuration names a file that can never be used; all other errors are the medium's."""

Warn = Callable[[str], object]


class Signing(mavlink.MAVLinkSigning):  # type: ignore[misc]
    """One end's key and time stamp, which follows the clock and never goes back.

    `refuses`: on the ground a file at a wrong place is refused. In the air nothing is.

    Raises:
        LinkError: the file `kept` is at a wrong place, or holds no time stamp.
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
        self._writer = Aside(self._write)
        self._reserved = self._timestamp
        """The file is, or is being, written up to here."""
        self._begin()
        super().__init__()
        self.secret_key = key
        self.sign_outgoing = True

    @property
    def timestamp(self) -> int:
        """Of the next frame; never waits, and never raises."""
        self._follow_clock()
        if self._kept is not None and self._reserved - self._timestamp < RENEWED:
            self._reserved = self._timestamp + RESERVE
            self._writer.give(self._reserved)
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
        """On the ground the first reserve is waited for: a wrong place is found before take-off."""
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
        """All of it or nothing, whenever the power goes."""
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
    """Refuses what is not signed with our key, or was signed before."""

    def check_signature(self, frame: bytearray, system_id: int, component_id: int) -> bool:
        """First the signature, then its time: pymavlink notes the time of forged frames, too.

        One forged frame from the future would else silence whoever it claims to come from.
        """
        digest = hashlib.sha256(self.signing.secret_key + frame[:-SIGNATURE_BYTES]).digest()
        told = bytes(frame[-SIGNATURE_BYTES:])
        if not hmac.compare_digest(digest[:SIGNATURE_BYTES], told):
            return False
        return bool(super().check_signature(frame, system_id, component_id))


def load_signing(
    key_file: Path,
    kept: Path | None,
    warn: Warn = lambda _: None,
    *,
    refuses: bool = True,
) -> Signing:
    """The key in a file, and the time stamp kept beside it or in `kept`; as `Signing`.

    Raises:
        LinkError: one of them cannot be used; says which, and the remedy.
    """
    kept = kept or key_file.with_suffix(".timestamp")
    return Signing(read_key(key_file), kept, warn=warn, refuses=refuses)


def read_key(key_file: Path) -> bytes:
    """32 bytes, from a file of 64 hexadecimal digits that only its owner can read.

    Raises:
        LinkError: the file is not there, others can read it, or it holds no key.
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
