"""Who may look on: everybody on this machine, and elsewhere who has the token."""

import hashlib
import hmac
import ipaddress
import stat
from pathlib import Path

from companion.core.errors import ViewError
from companion.core.textfile import NotTextError, read_text, reason

MIN_LETTERS = 16
MORE_THAN_OWNER = 0o077
MAKE_ONE = "(umask 077; openssl rand -hex 16 > {file})"


def is_loopback(host: str) -> bool:
    """Whether only this machine can reach it."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def needs_token(key: str, value: str, token_key: str) -> str:
    """What is said of an address that others can reach, when there is no token."""
    made = MAKE_ONE.format(file="token")
    return (
        f"{key} {value}: others can reach this address, so it needs {token_key}, "
        f"a file with a token: {made}; or keep to 127.0.0.1"
    )


def read_token(file: Path, key: str) -> str:
    """The token in a file that only its owner can read; `key` is how the user named the file.

    Raises:
        ViewError: the file is not there, others can read it, or the token is too short.
    """
    try:
        mode = stat.S_IMODE(file.stat().st_mode)
        token = read_text(file).strip()
    except (OSError, NotTextError) as error:
        raise ViewError(f"{key} {file}: {reason(error)}; {MAKE_ONE.format(file=file)}") from error
    if mode & MORE_THAN_OWNER:
        raise ViewError(
            f"{key} {file}: mode {mode:o}, others can read it; chmod 600 {file}, and take a new one"
        )
    if len(token) < MIN_LETTERS or not token.isascii() or not token.isalnum():
        raise ViewError(
            f"{key} {file}: should be {MIN_LETTERS} letters and digits or more; "
            f"{MAKE_ONE.format(file=file)}"
        )
    return token


def answer(token: str, challenge: bytes) -> bytes:
    """What proves that somebody has the token, without telling it."""
    return hmac.digest(token.encode(), challenge, hashlib.sha256)
