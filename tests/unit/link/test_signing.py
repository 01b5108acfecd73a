"""Signing: keys, time stamps, and rejected files and frames."""

import errno
import os
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from pymavlink.dialects.v20 import ardupilotmega as mavlink

from companion.core.errors import LinkError
from companion.link.signing import RESERVE, TICKS_PER_S, Signing, load_signing
from companion.link.transports.transport import decode, make_codec
from tests.waiting import DEADLINE_S, until

KEY, OTHER_KEY = b"k" * 32, b"x" * 32
NOW_S = 1.8e9


def at(time_s: float) -> Callable[[], float]:
    return lambda: time_s


def codec(key: bytes | None = KEY, time_s: float = NOW_S, component: int = 191) -> Any:
    signing = None if key is None else Signing(key, clock=at(time_s))
    return make_codec(1, component, signing)


def beat(sender: Any) -> bytes:
    return bytes(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3).pack(sender))


def accepted(receiver: Any, *frames: bytes) -> int:
    return len(decode(receiver, b"".join(frames)))


def test_frames_signed_with_the_key_are_accepted() -> None:
    sender = codec()
    assert accepted(codec(component=1), *(beat(sender) for _ in range(5))) == 5


@pytest.mark.parametrize("key", [None, OTHER_KEY], ids=["unsigned", "another key"])
def test_frames_not_signed_with_the_key_are_refused(key: bytes | None) -> None:
    assert accepted(codec(component=1), beat(codec(key))) == 0


@given(st.integers(0, 200), st.integers(1, 255))
def test_a_changed_frame_is_refused(place: int, flip: int) -> None:
    frame = bytearray(beat(codec()))
    frame[place % len(frame)] ^= flip
    assert accepted(codec(component=1), bytes(frame)) == 0


def test_a_repeated_frame_is_refused() -> None:
    frame, receiver = beat(codec()), codec(component=1)
    assert [accepted(receiver, frame) for _ in range(3)] == [1, 0, 0]


def test_a_newly_started_receiver_refuses_a_frame_of_yesterday() -> None:
    assert accepted(codec(component=1), beat(codec(time_s=NOW_S - 86400))) == 0


def test_a_forged_frame_with_a_future_time_stamp_does_not_block_the_true_sender() -> None:
    receiver, sender = codec(component=1), codec()
    assert accepted(receiver, beat(sender)) == 1
    assert accepted(receiver, beat(codec(OTHER_KEY, NOW_S + 1e7))) == 0
    assert accepted(receiver, beat(sender)) == 1


def test_a_receiver_without_a_key_accepts_signed_frames() -> None:
    assert accepted(codec(None, component=1), beat(codec())) == 1


# The time stamp


def stamps(signing: Signing, count: int) -> list[int]:
    taken = []
    for _ in range(count):
        taken.append(signing.timestamp)
        signing.timestamp += 1
    return taken


def test_time_stamp_follows_the_clock_and_never_repeats() -> None:
    now_s = [NOW_S]
    signing = Signing(KEY, clock=lambda: now_s[0])
    first = stamps(signing, 3)
    now_s[0] += 10
    later = stamps(signing, 3)
    now_s[0] -= 1000
    all_stamps = [*first, *later, *stamps(signing, 3)]
    assert all_stamps == sorted(set(all_stamps))
    assert later[0] - first[0] == pytest.approx(10 * TICKS_PER_S, abs=2)


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=5))
def test_no_time_stamp_repeats_after_restarts_with_any_clock(
    tmp_path_factory: pytest.TempPathFactory, clocks_s: list[float]
) -> None:
    kept = tmp_path_factory.mktemp("kept") / "stamp"
    used: list[int] = []
    for clock_s in clocks_s:
        used += stamps(Signing(KEY, kept, at(NOW_S + clock_s)), 3)
    assert used == sorted(set(used))


def test_time_stamp_is_written_once_a_minute_not_with_every_frame(tmp_path: Path) -> None:
    kept = tmp_path / "stamp"
    now_s = [NOW_S]
    signing = Signing(KEY, kept, lambda: now_s[0])
    written = set()
    for _ in range(600):
        now_s[0] += 0.2
        stamps(signing, 10)
        until(lambda: int(kept.read_text()) > signing.timestamp, "it is written")
        written.add(kept.read_text())
        assert 0 < int(kept.read_text()) - signing.timestamp <= RESERVE
    assert 2 <= len(written) <= 4
    assert kept.stat().st_mode & 0o777 == 0o600


@pytest.mark.parametrize(
    ("prepare", "words"),
    [
        (lambda folder: folder / "nowhere" / "stamp", "No such file or directory"),
        (lambda folder: Path("/dev/null") / "stamp", "Not a directory"),
        (lambda folder: written(folder / "stamp", "yesterday"), "delete it"),
        (lambda folder: written(folder / "stamp", str(2**48)), "no time stamp"),
        (lambda folder: written(folder / "stamp", ""), "delete it"),
    ],
)
def test_an_unusable_time_stamp_file_is_refused_at_start(
    tmp_path: Path, prepare: Callable[[Path], Path], words: str
) -> None:
    with pytest.raises(LinkError, match=rf"signing_timestamp.*{words}"):
        stamps(Signing(KEY, prepare(tmp_path), at(NOW_S)), 1)


def written(path: Path, text: str) -> Path:
    path.write_text(text)
    return path


MEDIUM = [errno.ENOSPC, errno.EROFS, errno.EIO, errno.EDQUOT, errno.EMFILE]


def fails(monkeypatch: pytest.MonkeyPatch, call: str, number: int) -> None:
    """Make this call of the operating system fail from now on."""

    def fail(*_: object, **__: object) -> None:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(f"companion.link.signing.os.{call}", fail)


@pytest.mark.parametrize("number", MEDIUM)
@pytest.mark.parametrize("call", ["open", "fsync"])
@pytest.mark.parametrize("from_the_start", [True, False])
def test_a_failed_medium_is_reported_once_and_the_time_stamp_continues(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int, call: str, from_the_start: bool
) -> None:
    now_s, warnings = [NOW_S], list[str]()
    if from_the_start:
        fails(monkeypatch, call, number)
    signing = Signing(KEY, tmp_path / "stamp", lambda: now_s[0], warnings.append)
    fails(monkeypatch, call, number)
    used = []
    for _ in range(10):
        now_s[0] += 30
        used += stamps(signing, 3)
    until(lambda: bool(stamps(signing, 1)) and bool(warnings), "it is told")
    used += stamps(signing, 3)
    assert used == sorted(set(used))
    assert len(warnings) == 1
    assert "signing_timestamp" in warnings[0]
    assert os.strerror(number) in warnings[0]


@pytest.mark.parametrize("number", [*MEDIUM, errno.EACCES, errno.ENOENT])
def test_in_flight_a_failed_medium_is_reported_and_not_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    warnings: list[str] = []
    fails(monkeypatch, "open", number)
    signing = Signing(KEY, tmp_path / "stamp", at(NOW_S), warnings.append, refuses=False)
    until(lambda: bool(stamps(signing, 1)) and bool(warnings), "it is told")


@pytest.mark.parametrize("text", ["", "torn", "-1"])
def test_in_flight_a_lost_time_stamp_is_replaced_by_the_clock(tmp_path: Path, text: str) -> None:
    warnings: list[str] = []
    kept = written(tmp_path / "stamp", text)
    signing = Signing(KEY, kept, at(NOW_S), warnings.append, refuses=False)
    assert signing.timestamp == codec().signing.timestamp
    assert len(warnings) == 1


def test_a_medium_that_hangs_does_not_block(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    answers = threading.Event()
    kept = tmp_path / "stamp"
    now_s = [NOW_S]
    signing = Signing(KEY, kept, lambda: now_s[0])
    monkeypatch.setattr("companion.link.signing.os.fsync", lambda _: answers.wait(DEADLINE_S))
    for _ in range(100):
        now_s[0] += 30
        stamps(signing, 1)
    assert int(kept.read_text()) < signing.timestamp
    answers.set()
    until(lambda: int(kept.read_text()) > signing.timestamp, "it is written")


# The key


def key_file(folder: Path, text: str, mode: int = 0o600) -> Path:
    path = folder / "signing.key"
    path.write_text(text)
    os.chmod(path, mode)
    return path


def test_a_key_is_64_hexadecimal_digits_in_a_private_file(tmp_path: Path) -> None:
    signing = load_signing(key_file(tmp_path, KEY.hex() + "\n"), None)
    assert signing.secret_key == KEY
    assert signing.timestamp > 0
    assert (tmp_path / "signing.timestamp").exists()


@pytest.mark.parametrize(
    ("text", "mode", "words"),
    [
        (KEY.hex(), 0o640, "chmod 600"),
        (KEY.hex(), 0o604, "others can read it"),
        ("secret", 0o600, "64 hexadecimal digits"),
        ("", 0o600, "openssl rand"),
    ],
)
def test_invalid_keys_are_refused_with_the_remedy(
    tmp_path: Path, text: str, mode: int, words: str
) -> None:
    with pytest.raises(LinkError, match=words) as refused:
        load_signing(key_file(tmp_path, text, mode), None)
    assert KEY.hex() not in str(refused.value)


def test_a_missing_key_file_is_named(tmp_path: Path) -> None:
    with pytest.raises(LinkError, match=r"none\.key"):
        load_signing(tmp_path / "none.key", None)
