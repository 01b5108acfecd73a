"""Stores that a rehearsal was passed, and refuses the flight of a real drone without one.

A pass belongs to one program, one configuration and one autopilot, and expires. Of the
configuration only what the rehearsal has tried counts: the mission is changed between flights.
"""

import time
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path

from msgspec import MsgspecError, json

from companion.config.settings import Config
from companion.core.errors import LinkError, OutputError, RehearsalError
from companion.core.values import value
from companion.link.identity import AutopilotIdentity
from companion.link.link import Link
from companion.link.transports.transport import Transport
from companion.run.clocks import Clock
from companion.safety.health.lateness import TICK_S

ANSWER_S = 8.0
"""Longest wait for the autopilot's version, s: as long as a flight waits for its first message."""
DAY_S = 86400.0
"""A day, s."""
REHEARSED = {"link", "sensors", "recording"}
"""Groups of the configuration that a rehearsal tries."""
HOW = "companion fly --rehearse rehearses the flight, with the propellers off"
"""Remedy of all refusals."""


@value
class RehearsalPass:
    """What was rehearsed, when, and with what."""

    unix_s: float
    """Time of the pass, seconds since 1970."""
    program: str
    config: str
    """Fingerprint of the configuration."""
    autopilot: str
    lines: tuple[str, ...] = ()
    """What the rehearsal has seen, for people."""

    @property
    def date(self) -> str:
        return f"{datetime.fromtimestamp(self.unix_s, UTC):%Y-%m-%d %H:%M} UTC"


def fingerprint(config: Config) -> str:
    """SHA-256 of all settings that a rehearsal tries, hexadecimal."""
    return sha256(config.model_dump_json(include=REHEARSED).encode()).hexdigest()


def passed_now(config: Config, autopilot: str, lines: tuple[str, ...]) -> RehearsalPass:
    """The pass of a rehearsal that has ended now."""
    program = version("pdps-companion")
    return RehearsalPass(time.time(), program, fingerprint(config), autopilot, lines)


def store(path: Path, passed: RehearsalPass) -> None:
    """Write a pass.

    Raises:
        OutputError: the file cannot be written.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(json.format(json.encode(passed), indent=2) + b"\n")
    except OSError as error:
        raise OutputError(
            f"preflight.rehearsal_file = {path}: {error.strerror}; set it to a file that this "
            "user may write"
        ) from error


def forget(path: Path) -> None:
    """Remove an earlier pass: a rehearsal that fails leaves none.

    Raises:
        OutputError: the file cannot be removed.
    """
    try:
        path.unlink(missing_ok=True)
    except OSError as error:
        raise OutputError(f"preflight.rehearsal_file = {path}: {error.strerror}") from error


def valid_pass(config: Config, now_unix_s: float) -> RehearsalPass:
    """The stored pass for this program and configuration; the autopilot is not yet compared.

    A clock that is set back does not end a pass: a Raspberry Pi has none that runs without power.

    Raises:
        RehearsalError: there is none, or it is for something else, or it has expired.
    """
    path, days = config.preflight.rehearsal_file, config.preflight.rehearsal_days
    where = f"preflight.rehearsal_file = {path}"
    try:
        passed = json.decode(path.read_bytes(), type=RehearsalPass)
    except FileNotFoundError:
        raise RehearsalError(f"{where}: this drone has passed no rehearsal; {HOW}") from None
    except (OSError, MsgspecError) as error:
        raise RehearsalError(f"{where}: not readable: {error}; {HOW}") from error
    program = version("pdps-companion")
    if passed.program != program:
        changed = f"of companion {passed.program}, and this is {program}"
    elif passed.config != fingerprint(config):
        changed = f"of {passed.date}, and {', '.join(sorted(REHEARSED))} have changed since"
    elif now_unix_s - passed.unix_s > days * DAY_S:
        changed = f"of {passed.date}, older than preflight.rehearsal_days = {days:g}"
    else:
        return passed
    raise RehearsalError(f"{where}: the rehearsal is {changed}; {HOW}")


def autopilot_identity(config: Config, transport: Transport, clock: Clock) -> str:
    """Firmware and board of the autopilot.

    Raises:
        LinkError: it does not answer in `ANSWER_S`.
    """
    identity = AutopilotIdentity(config.link.system_id)
    link = Link(transport, config.link, [identity])
    now_s = clock.now_s()
    end_s = now_s + ANSWER_S
    while not identity.text:
        if now_s > end_s:
            raise LinkError(
                f"link.url = {config.link.url}: the autopilot does not report its version, which "
                "the rehearsal is compared with; companion check shows what the link receives"
            )
        link.poll(now_s)
        link.send(now_s, None, None)
        link.transmit(identity.requests(now_s))
        now_s = clock.wait_until(now_s + TICK_S)
    return identity.text


def refuse_unrehearsed(config: Config, transport: Transport, clock: Clock) -> None:
    """Refuse a flight without a valid pass for this autopilot.

    Raises:
        RehearsalError: there is no valid pass.
        LinkError: the autopilot does not answer.
    """
    passed = valid_pass(config, time.time())
    autopilot = autopilot_identity(config, transport, clock)
    if autopilot != passed.autopilot:
        raise RehearsalError(
            f"preflight.rehearsal_file = {config.preflight.rehearsal_file}: the rehearsal was with "
            f"an autopilot of {passed.autopilot}, and this one is {autopilot}; {HOW}"
        )
