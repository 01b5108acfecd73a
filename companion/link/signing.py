"""MAVLink 2 signing: only who has the key is listened to, and nothing twice.

A signature is over the frame and a time stamp, 10 µs since 2015 (MAVLink guide, message signing). A
machine without a clock of its own, such as a Raspberry Pi, may start with an earlier time than it
ended with; what it then signs would be taken for a replay. So the time stamp is kept in a file,
always up to a minute ahead of what has been used.
"""

import contextlib
import hashlib
import hmac
import os
import re
import stat
import time
from collections.abc import Callable
from pathlib import Path

from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.errors import LinkError

EPOCH_S = 1_420_070_400
"""2015-01-01, by the Unix clock."""
TICKS_PER_S = 100_000
RESERVE = 60 * TICKS_PER_S
SIGNATURE_BYTES = 6
MORE_THAN_OWNER = 0o077


class Signing(mavlink.MAVLinkSigning):  # type: ignore[misc]
    """One end's key and time stamp, which follows the clock and never goes back."""

    def __init__(
        self, key: bytes, kept: Path | None = None, clock: Callable[[], float] = time.time
    ) -> None:
        self._clock = clock
        self._kept = kept
        self._timestamp = self._reserved = _read(kept)
        super().__init__()
        self.secret_key = key
        self.sign_outgoing = True

    @property
    def timestamp(self) -> int:
        """Of the next frame."""
        now = int((self._clock() - EPOCH_S) * TICKS_PER_S)
        self._timestamp = max(self._timestamp, now)
        if self._timestamp >= self._reserved:
            self._reserved = self._timestamp + RESERVE
            _write(self._kept, self._reserved)
        return self._timestamp

    @timestamp.setter
    def timestamp(self, value: int) -> None:
        self._timestamp = max(self._timestamp, value)


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


def load_signing(key_file: Path, kept: Path | None) -> Signing:
    """The key in a file, and the time stamp kept beside it or in `kept`.

    Raises:
        LinkError: one of them cannot be used; says which, and the remedy.
    """
    return Signing(read_key(key_file), kept or key_file.with_suffix(".timestamp"))


def read_key(key_file: Path) -> bytes:
    """32 bytes, from a file of 64 hexadecimal digits that only its owner can read.

    Raises:
        LinkError: the file is not there, others can read it, or it holds no key.
    """
    try:
        mode = stat.S_IMODE(key_file.stat().st_mode)
        text = key_file.read_text()
    except (OSError, UnicodeDecodeError) as error:
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


def _read(kept: Path | None) -> int:
    if kept is None or not kept.exists():
        return 0
    try:
        return int(kept.read_text())
    except (OSError, ValueError) as error:
        raise LinkError(
            f"link.signing_timestamp = {kept}: {error}; if it is lost, delete it, and set the clock"
        ) from error


def _write(kept: Path | None, timestamp: int) -> None:
    """All of it or nothing, whenever the power goes."""
    if kept is None:
        return
    new = kept.with_name(kept.name + ".new")
    try:
        with contextlib.closing(os.fdopen(os.open(new, os.O_WRONLY | os.O_CREAT, 0o600), "w")) as f:
            f.write(f"{timestamp}\n")
            f.flush()
            os.fsync(f.fileno())
        new.replace(kept)
    except OSError as error:
        raise LinkError(
            f"link.signing_timestamp = {kept}: {error.strerror}; name a file that can be written"
        ) from error
