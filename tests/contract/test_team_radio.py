"""Contract of the radios of a team: the simulated one, and Zenoh by addresses and by discovery."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from itertools import count
from pathlib import Path
from uuid import uuid4

import pytest

from companion.config.team import PadConfig, TeamConfig
from companion.core.errors import SecretError, TeamError
from companion.team.radio import NoRadio, TeamRadio
from companion.team.zenoh_radio import open_team_radio
from sitl.core.radio import NO_LINK_ERRORS
from sitl.simulation.team_radio import TeamAir
from tests.processes.started import free_tcp_port
from tests.waiting import until

DRONES = 3


@contextmanager
def simulated(folder: Path) -> Iterator[list[TeamRadio]]:
    yield list(TeamAir(1, DRONES, lambda: 0.0, NO_LINK_ERRORS).radios)


def configs(key_file: Path | None = None, *, interface: str = "") -> list[TeamConfig]:
    """A team of its own: others on this machine may use the same interface."""
    name = uuid4().hex
    addresses = () if interface else tuple(f"127.0.0.1:{free_tcp_port()}" for _ in range(DRONES))
    return [
        TeamConfig(
            name=name,
            drone=drone,
            pads=(PadConfig(),) * DRONES,
            addresses=addresses,
            interface=interface,
            key_file=key_file,
        )
        for drone in range(1, DRONES + 1)
    ]


@contextmanager
def opened(team: list[TeamConfig]) -> Iterator[list[TeamRadio]]:
    with ExitStack() as stack:
        yield [stack.enter_context(open_team_radio(config)) for config in team]


@contextmanager
def zenoh(folder: Path) -> Iterator[list[TeamRadio]]:
    with opened(configs()) as radios:
        yield radios


@contextmanager
def discovered(folder: Path) -> Iterator[list[TeamRadio]]:
    with opened(configs(interface="lo")) as radios:
        yield radios


def key(folder: Path, letter: str) -> Path:
    file = folder / f"key_{letter}"
    file.write_text(32 * letter)
    file.chmod(0o600)
    return file


@contextmanager
def keyed(folder: Path) -> Iterator[list[TeamRadio]]:
    with opened(configs(key(folder, "a"))) as radios:
        yield radios


@pytest.fixture(
    params=[simulated, zenoh, keyed, discovered],
    ids=["simulated", "zenoh", "zenoh with a key", "zenoh by discovery"],
)
def radios(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[list[TeamRadio]]:
    with request.param(tmp_path) as of_a_team:
        yield of_a_team


def hears(radio: TeamRadio, senders: list[TeamRadio], packet: bytes) -> None:
    """Wait until a packet that is sent again and again arrives."""

    def has_arrived() -> bool:
        for sender in senders:
            sender.send([packet])
        return packet in radio.receive()

    until(has_arrived, "the packet")


def test_all_others_receive_what_a_drone_sends(radios: list[TeamRadio]) -> None:
    for number, radio in enumerate(radios):
        others = [each for other, each in enumerate(radios) if other != number]
        for other in others:
            hears(other, [radio], b"from %d" % number)


def test_a_drone_does_not_receive_its_own_packets(radios: list[TeamRadio]) -> None:
    first, second, third = radios
    hears(second, [first], b"first")
    hears(third, [first], b"first")
    assert b"first" not in first.receive()


def test_packets_arrive_once_and_in_order(radios: list[TeamRadio]) -> None:
    """Some may be lost: a radio that cannot send at once drops a packet."""
    first, second, _ = radios
    arrived: list[bytes] = []
    numbers = count(1)

    def are_many() -> bool:
        first.send([b"%06d" % next(numbers) for _ in range(5)])
        arrived.extend(second.receive())
        return len(arrived) >= 100

    until(are_many, "a hundred packets")
    assert arrived == sorted(set(arrived))


def test_packets_with_another_key_are_dropped(tmp_path: Path) -> None:
    first, second, third = configs()
    keys = [key(tmp_path, letter) for letter in "aba"]
    with ExitStack() as stack:
        one, stranger, two = (
            stack.enter_context(open_team_radio(each.model_copy(update={"key_file": file})))
            for each, file in zip((first, second, third), keys, strict=True)
        )
        heard: list[bytes] = []

        def hears_its_own() -> bool:
            stranger.send([b"stranger"])
            one.send([b"own"])
            heard.extend(two.receive())
            return heard.count(b"own") > 20

        until(hears_its_own, "packets with the key")
        assert b"stranger" not in heard


def test_an_address_that_others_reach_needs_a_key(tmp_path: Path) -> None:
    config = TeamConfig(name="test", addresses=("0.0.0.0:7447",))
    with (
        pytest.raises(TeamError, match=r"team.addresses = '0.0.0.0:7447'.*team.key_file"),
        open_team_radio(config),
    ):
        pass
    open_to_all = key(tmp_path, "a")
    open_to_all.chmod(0o644)
    with (
        pytest.raises(SecretError, match=r"team.key_file = .*others can read it"),
        open_team_radio(config.model_copy(update={"key_file": open_to_all})),
    ):
        pass


def test_an_interface_that_others_reach_needs_a_key() -> None:
    config = TeamConfig(name="test", interface="wlan0")
    with (
        pytest.raises(TeamError, match=r"team.interface = 'wlan0'.*team.key_file.*or use lo"),
        open_team_radio(config),
    ):
        pass


def test_a_missing_interface_is_named(tmp_path: Path) -> None:
    config = TeamConfig(name="test", interface="none0", key_file=key(tmp_path, "a"))
    with pytest.raises(TeamError, match=r"team.interface: none0: "), open_team_radio(config):
        pass


def test_a_drone_alone_needs_no_radio() -> None:
    with open_team_radio(TeamConfig()) as radio:
        radio.send([b"nothing"])
        assert radio.receive() == ()
        assert isinstance(radio, NoRadio)
