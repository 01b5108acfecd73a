"""Reads tokens and computes challenge responses; only loopback addresses need no token."""

import hashlib
import hmac
import ipaddress
import stat
from pathlib import Path

from companion.core.errors import SecretError
from companion.core.textfile import NotTextError, read_text, reason

MIN_LETTERS = 16
"""Shortest token, characters. Chosen."""
MORE_THAN_OWNER = 0o077
"""Permission bits of group and others, which a token file must not have."""
MAKE_ONE = "(umask 077; openssl rand -hex 16 > {file})"
"""Shell command that creates a token file."""


def is_loopback(host: str) -> bool:
    """Test whether only this machine can reach the host."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False


def needs_token(key: str, value: str, token_key: str, private: str = "127.0.0.1") -> str:
    """Error text for an address that other machines can reach without a token.

    `private` is a value that they cannot reach.
    """
    made = MAKE_ONE.format(file="token")
    return (
        f"{key} {value}: others can reach this address, so it needs {token_key}, "
        f"a file with a token: {made}; or use {private}"
    )


def read_token(file: Path, key: str) -> str:
    """Read a token from a file that only its owner can read.

    `key` is the option or configuration key that names the file, for error texts.

    Raises:
        SecretError: the file is missing, others can read it, or the token is too short.
    """
    try:
        mode = stat.S_IMODE(file.stat().st_mode)
        token = read_text(file).strip()
    except (OSError, NotTextError) as error:
        raise SecretError(f"{key} {file}: {reason(error)}; {MAKE_ONE.format(file=file)}") from error
    if mode & MORE_THAN_OWNER:
        raise SecretError(
            f"{key} {file}: mode {mode:o}, others can read it; chmod 600 {file}, and replace it"
        )
    if len(token) < MIN_LETTERS or not token.isascii() or not token.isalnum():
        raise SecretError(
            f"{key} {file}: should be {MIN_LETTERS} letters and digits or more; "
            f"{MAKE_ONE.format(file=file)}"
        )
    return token


def answer(token: str, challenge: bytes) -> bytes:
    """HMAC-SHA256 of the challenge: proves knowledge of the token without sending it."""
    return hmac.digest(token.encode(), challenge, hashlib.sha256)
