"""Tests the messages of a team: what is sent arrives, and nothing else does."""

import math

import msgspec
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from companion.mapping.redrawn_grid import RAY_COLUMNS
from companion.team.messages import (
    MAX_PACKET_BYTES,
    VERSION,
    OtherVersionError,
    Packet,
    PacketError,
    decode,
    encode,
    pack_rays,
    unpack_floats,
    unpack_rays,
)
from tests.unit.team.rooms import state

METRES = st.floats(-1000, 1000)


@given(METRES, METRES, st.integers(1, 8), st.integers(0, 2**40))
def test_a_state_arrives_as_sent(north_m: float, east_m: float, drone: int, number: int) -> None:
    packet = Packet("team", drone, 7, number, state((north_m, east_m))())
    assert decode(encode(packet)) == packet


@given(st.binary(max_size=300))
def test_any_bytes_are_a_packet_or_an_error(data: bytes) -> None:
    try:
        decode(data)
    except PacketError:
        return


@given(st.data())
def test_a_damaged_packet_is_refused_or_within_its_bounds(data: st.DataObject) -> None:
    whole = bytearray(encode(Packet("team", 1, 7, 3, state()())))
    at = data.draw(st.integers(0, len(whole) - 1))
    whole[at] = data.draw(st.integers(0, 255))
    try:
        packet = decode(bytes(whole))
    except PacketError:
        return
    assert 1 <= packet.drone <= 8


@pytest.mark.parametrize("north_m", [math.nan, math.inf, -math.inf, 2e4])
def test_a_place_that_is_no_place_is_refused(north_m: float) -> None:
    with pytest.raises(PacketError):
        decode(encode(Packet("team", 1, 7, 3, state((north_m, 0.0))())))


@pytest.mark.parametrize("fields", [{"layer": -1}, {"layer": 64}, {"layers_seen": (64,)}])
def test_a_layer_that_is_no_layer_is_refused(fields: dict[str, object]) -> None:
    with pytest.raises(PacketError):
        decode(encode(Packet("team", 1, 7, 3, state((0.0, 0.0), **fields)())))


@given(st.none() | st.integers(0, 63), st.frozensets(st.integers(0, 63)))
def test_the_layers_of_a_drone_arrive_as_sent(layer: int | None, seen: frozenset[int]) -> None:
    told = state(layer=layer, layers_seen=tuple(sorted(seen)))()
    packet = Packet("team", 1, 7, 3, told)
    assert decode(encode(packet)) == packet


def test_another_version_is_named() -> None:
    header = msgspec.msgpack.decode(encode(Packet("team", 1, 7, 3, state()())))
    header[0] = VERSION + 1
    with pytest.raises(OtherVersionError, match=f"version {VERSION + 1}"):
        decode(msgspec.msgpack.encode(header))


def test_a_packet_that_is_too_long_is_refused() -> None:
    with pytest.raises(PacketError):
        decode(bytes(MAX_PACKET_BYTES + 1))


@given(
    st.lists(
        st.tuples(
            st.integers(0, 40),
            st.floats(-1, 1),
            st.floats(-1, 1),
            st.floats(-7, 7),
            st.floats(0, 12),
            st.floats(0, 1),
            st.booleans(),
        ),
        max_size=40,
    ),
    st.integers(0, 2000),
)
def test_rays_arrive_to_the_millimetre(rows: list[tuple[float, ...]], first: int) -> None:
    rays = np.array([[*map(float, row), 0.0] for row in sorted(rows)]).reshape(-1, RAY_COLUMNS)
    rays[:, 0] += first
    arrived = unpack_rays(pack_rays(rays, first), first, 41, 1.0)
    assert np.array_equal(arrived[:, [0, 6]], rays[:, [0, 6]])
    assert np.allclose(arrived[:, [1, 2, 4, 5]], rays[:, [1, 2, 4, 5]], atol=6e-4)
    turned = np.exp(1j * (arrived[:, 3] - rays[:, 3]))
    assert np.allclose(turned, 1, atol=2e-4)


@given(st.binary(max_size=80), st.integers(1, 4))
def test_any_bytes_are_numbers_or_an_error(data: bytes, columns: int) -> None:
    try:
        values = unpack_floats(data, columns)
    except PacketError:
        return
    assert np.isfinite(values).all()


@given(st.binary(max_size=80), st.integers(0, 5))
def test_any_bytes_are_rays_or_an_error(data: bytes, keyframes: int) -> None:
    try:
        rays = unpack_rays(data, 0, keyframes, 1.0)
    except PacketError:
        return
    assert (rays[:, 0] < keyframes).all()
