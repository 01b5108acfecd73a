"""Tests what a drone knows of its teammates: places, claims, maps, over a radio that loses much."""

import math
from collections import deque
from dataclasses import replace
from functools import partial
from random import Random

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from companion.core.frames import Vector2
from companion.mapping.occupancy import Occupancy
from companion.mapping.redrawn_grid import RedrawnGrid
from companion.team.messages import VERSION, Packet, Track, encode
from companion.team.silence import HOLDS_S, LANDS_S
from companion.team.team import Team
from companion.team.teammate import LOST_S, SILENT_S
from tests.unit.team.rooms import PADS, TURN_RAD_S, WALL_SIGMA_M, Member, config, state, walls_of

Packets = tuple[bytes, ...]
TICK_S = 0.05
SEEN_NE_M: Vector2 = (2.0, -1.0)
"""A place in the room, in the frame of the first drone."""


def talk(
    one: Member,
    other: Member,
    until_s: float,
    *,
    since_s: float = 0.0,
    loss: float = 0.0,
    late_s: float = 0.0,
    seed: int = 1,
) -> None:
    """Let both drones tell each other what they know."""
    random = Random(seed)
    ways = [(one, other, deque[Packets]()), (other, one, deque[Packets]())]
    for tick in range(round((until_s - since_s) / TICK_S)):
        now_s = since_s + tick * TICK_S
        for sender, receiver, under_way in ways:
            packets = sender.tell(now_s)
            under_way.append(tuple(packet for packet in packets if random.random() >= loss))
            arrived = under_way.popleft() if len(under_way) > late_s / TICK_S else ()
            receiver.hear(now_s, arrived)


def test_a_place_of_a_teammate_is_known_in_the_own_frame() -> None:
    """The second drone stands at 1 m north, 0.5 m east, and looks east."""
    first, second = Member(1, 0), Member(2, 0)
    first.hear(0.0, second.tell(0.0))
    [other] = first.team.others(0.0, waits=False)
    assert other.ne_m == pytest.approx((1.0, 0.5))
    assert not other.has_right_of_way
    second.hear(0.0, first.tell(0.0))
    [other] = second.team.others(0.0, waits=False)
    assert other.ne_m == pytest.approx((-0.5, 1.0))
    assert other.has_right_of_way


def test_of_two_drones_the_one_that_waits_gives_way() -> None:
    first, second = Member(1, 0), Member(2, 0)
    second.hear(0.0, first.tell(0.0, waits=True))
    [other] = second.team.others(0.0, waits=False)
    assert not other.has_right_of_way


def test_a_packet_that_was_overtaken_changes_nothing() -> None:
    first, second = Member(1, 0), Member(2, 0)
    early = second.team.tell(0.0, state((0.0, 0.0)), second.own)
    late = second.team.tell(0.3, state((0.0, 1.0)), second.own)
    first.hear(0.4, (*late, *early))
    [other] = first.team.others(0.4, waits=False)
    assert other.ne_m == pytest.approx((0.0, 0.5))


def test_what_a_teammate_has_measured_is_known() -> None:
    """The first drone has measured its north wall only from far away."""
    first, second = Member(1, 0), Member(2, 0)
    first.sigmas_m[0] = 0.3
    assert first.team_knows_m() == pytest.approx(first.sigmas_m)
    talk(first, second, 5.0)
    assert first.team_knows_m()[0] < WALL_SIGMA_M
    assert second.team_knows_m() == pytest.approx(WALL_SIGMA_M, rel=0.5)


@pytest.mark.parametrize("turn_deg_s", [45, 90])
def test_the_heading_of_a_teammate_that_turns_is_known_less_well_with_time(
    turn_deg_s: float,
) -> None:
    """It told its heading 0.2 s ago, and may have turned since."""
    first, second = Member(1, 0), Member(2, 0)
    first.team = Team(config(1), math.radians(turn_deg_s))
    first.hear(0.0, second.tell(0.0))
    [now], [later] = (first.team.others(now_s, waits=False) for now_s in (0.0, 0.2))
    assert later.yaw_off_rad - now.yaw_off_rad > 0.2 * math.radians(turn_deg_s)


def test_a_silent_drone_does_not_trace_on() -> None:
    first, second = Member(1, 0), Member(2, 0)
    track = partial(Track, 0.0, -1, True, b"")
    second.own = replace(second.own, track=track)
    first.hear(0.0, second.tell(0.0))
    assert [each.is_tracing for each in first.team.view(1.0)["tracings"]] == [True]
    assert [each.is_tracing for each in first.team.view(SILENT_S + 1)["tracings"]] == [False]


def test_a_silent_teammate_claims_nothing_and_is_lost_in_the_end() -> None:
    first, second = Member(1, 0), Member(2, 0)
    first.hear(0.0, second.tell(0.0, target=((1.0, 0.0),), arrives_in_s=4.0))
    [claim] = first.team.view(1.0)["claims"]
    assert claim.places_ne_m[0] == pytest.approx((1.0, 1.5))
    assert claim.arrives_in_s == pytest.approx(3.0)
    assert not first.team.view(SILENT_S + 0.1)["claims"]
    assert first.team.others(SILENT_S + 0.1, waits=False)
    assert not first.team.others(HOLDS_S + 0.1, waits=False)


def test_of_two_drones_without_radio_the_second_holds_its_place_until_the_first_is_home() -> None:
    first, second = Member(1, 0), Member(2, 0)
    second.hear(0.0, first.tell(0.0))
    first.hear(0.0, second.tell(0.0))
    for now_s, holds in ((SILENT_S - 0.1, False), (LOST_S + 1, True), (HOLDS_S + 0.1, False)):
        assert not first.team.view(now_s)["waits_for_radio"]
        assert second.team.view(now_s)["waits_for_radio"] == holds
        assert math.isinf(second.team.view(now_s)["home_by_s"])
    assert first.team.view(LOST_S + 1)["home_by_s"] == pytest.approx(HOLDS_S)
    [other] = first.team.others(LOST_S + 1, waits=False)
    assert other.ne_m == pytest.approx((1.0, 0.5))
    [heard] = first.team.others(SILENT_S - 0.1, waits=False)
    assert other.off_m > heard.off_m + 0.4  # it has flown on for a while, and drifts
    assert not second.team.others(LOST_S + 1, waits=False)
    second.hear(LOST_S + 2, first.tell(LOST_S + 2))
    assert not second.team.view(LOST_S + 2)["waits_for_radio"]


def test_nobody_leaves_its_place_before_a_silent_drone_is_home() -> None:
    first, second = Member(1, 0), Member(2, 0)
    first.hear(0.0, second.tell(0.0, layer=None))
    assert first.team.view(LANDS_S - 0.1)["waits_for_radio"]
    assert not first.team.view(LANDS_S + 0.1)["waits_for_radio"]


@pytest.mark.parametrize("is_flying", [False, True])
def test_a_drone_does_not_wait_for_one_that_lands(is_flying: bool) -> None:
    """A companion ends after the landing, and its last message may be lost."""
    first, second = Member(1, 0), Member(2, 0)
    landing = {"is_flying": is_flying, "needs_column": is_flying, "layer": None}
    second.hear(0.0, first.tell(0.0, **landing))
    assert not second.team.view(SILENT_S + 1)["waits_for_radio"]


def test_the_place_of_a_drone_that_flew_home_is_lost_sooner() -> None:
    first, second = Member(1, 0), Member(2, 0)
    first.hear(0.0, second.tell(0.0, layer=None))
    assert not first.team.others(LOST_S + 1, waits=False)


@settings(max_examples=20)
@given(st.floats(0, 0.6), st.floats(0, 0.6), st.integers(0, 1000))
def test_all_that_a_teammate_saw_arrives_over_any_radio(
    loss: float, late_s: float, seed: int
) -> None:
    first, second = Member(1, 0), Member(2, 40)
    talk(first, second, 60.0, loss=loss, late_s=late_s, seed=seed)
    assert first.team.received == {2: 40 * 40 // 160}
    joined = first.team.joined(Occupancy())
    assert joined.free[joined.cell(SEEN_NE_M)]
    assert joined.nearest_m((3.0, 0.0), 1.0) < 0.15
    assert first.team.dropped == 0


def test_a_drone_that_joins_late_gets_all() -> None:
    first, second, late = Member(1, 0), Member(2, 40), Member(1, 0)
    late.team = Team(config(1), TURN_RAD_S, instance=9)
    talk(first, second, 30.0)
    talk(late, second, 60.0, since_s=30.0)
    assert late.team.received == first.team.received


def test_a_partition_costs_time_and_nothing_else() -> None:
    first, second = Member(1, 0), Member(2, 40)
    talk(first, second, 60.0, loss=1.0)
    assert first.team.received == {2: 0}
    talk(first, second, 90.0, since_s=60.0)
    assert first.team.received == {2: 10}


def test_a_drone_sends_at_most_20_kilobytes_a_second() -> None:
    """It has the map of ten minutes to tell, and nothing arrives."""
    first, second = Member(1, 0), Member(2, 1200)
    sent = 0
    for tick in range(200):
        packets = second.tell(tick * TICK_S)
        sent += sum(map(len, packets))
        first.hear(tick * TICK_S, second.tell(tick * TICK_S)[:0])
    assert sent < 10 * 20_000


@settings(max_examples=20)
@given(st.floats(-0.15, 0.15), st.floats(-0.15, 0.15), st.floats(-4.0, 4.0))
def test_shared_walls_correct_where_a_teammate_stands(
    north_m: float, east_m: float, yaw_deg: float
) -> None:
    off = np.array([north_m, east_m, math.radians(yaw_deg)])
    first, second = Member(1, 0), Member(2, 0, off)
    talk(first, second, 10.0)
    [other] = first.team.others(10.0, waits=False)
    assert math.dist(other.ne_m, (1.0 + north_m, 0.5 + east_m)) < 0.05


def test_strange_packets_are_dropped_and_counted() -> None:
    team = Team(config(1), TURN_RAD_S)
    foreign = encode(Packet("others", 2, 0, 0, state()()))
    unknown = encode(Packet("test", len(PADS) + 1, 0, 0, state()()))
    packets = b"", b"\x93nonsense", foreign, unknown
    team.hear(0.0, packets, lambda: walls_of(1), Occupancy())
    assert team.dropped == 3
    [on_its_pad] = team.others(0.0, waits=False)
    assert not on_its_pad.is_flying


def test_a_restarted_teammate_begins_anew_when_the_one_before_is_silent() -> None:
    first, second = Member(1, 0), Member(2, 40)
    talk(first, second, 30.0)
    again = Member(2, 0)
    again.team = Team(config(2), TURN_RAD_S, instance=9)
    first.hear(31.0, again.tell(31.0))
    assert first.team.received == {2: 10}
    first.hear(30.0 + LOST_S, again.tell(30.0 + LOST_S))
    assert first.team.received == {2: 0}


def test_two_drones_with_one_number_are_kept_apart_and_told() -> None:
    first, second, double = Member(1, 0), Member(2, 0), Member(2, 0)
    double.team = Team(config(2), TURN_RAD_S, instance=9)
    first.hear(0.0, second.tell(0.0))
    assert not first.team.notice
    packets = double.team.tell(0.1, state((2.0, 0.0)), double.own)
    first.hear(0.1, packets)
    assert len(first.team.others(0.1, waits=False)) == 2
    assert "two drones have the number 2" in first.team.notice
    second.hear(0.1, packets)
    assert "two drones have the number 2" in second.team.notice
    assert [each.is_flying for each in second.team.others(0.1, waits=False)] == [False, True]


def test_a_drone_with_other_software_is_told() -> None:
    first, second = Member(1, 0), Member(2, 0)
    [told, *_] = second.tell(0.0)
    header = msgspec.msgpack.decode(told)
    header[0] = VERSION + 1
    first.hear(0.0, (msgspec.msgpack.encode(header),))
    assert f"drone 2 sends version {VERSION + 1}" in first.team.notice
    assert first.team.dropped == 1


@pytest.mark.parametrize("off_m", [0.0, 2.0])
def test_the_map_of_a_drone_that_is_not_on_its_pad_is_not_used(off_m: float) -> None:
    """The second drone stands 2 m off; its walls cannot be matched with those of the first."""
    first, second = Member(1, 40), Member(2, 40, np.array([off_m, -off_m, 0.0]))
    second.move((off_m, -off_m))
    talk(first, second, 40.0)
    is_used = off_m == 0
    assert ("drone 2 contradicts" in first.team.notice) == (not is_used)
    is_joined = first.team.joined(Occupancy()).free.any()
    assert is_joined == is_used
    assert (first.team_knows_m() < first.sigmas_m).any() == is_used
    assert first.team.others(40.0, waits=False)


def test_a_map_arrives_in_its_layer() -> None:
    """The second drone has turned 40 times in the second layer, and never in the lowest one."""
    first, second = Member(1, 0), Member(2, 40)
    second.own = replace(second.own, spaces=(RedrawnGrid(), second.grid), layer=1)
    talk(first, second, 30.0)
    lowest, higher = (first.team.joined(Occupancy(), layer) for layer in range(2))
    assert not lowest.free.any()
    assert higher.free[higher.cell(SEEN_NE_M)]


def test_a_drone_that_leaves_a_layer_tells_all_that_it_saw_there() -> None:
    """It turned twice, which is less than a piece of the map."""
    first, second = Member(1, 0), Member(2, 2)
    talk(first, second, 10.0)
    assert first.team.received == {2: 0}
    second.own = replace(second.own, spaces=(second.grid, RedrawnGrid()), layer=1)
    talk(first, second, 20.0, since_s=10.0)
    assert first.team.received == {2: 1}


def test_what_a_teammate_claims_counts_in_its_layer() -> None:
    first, second = Member(1, 0), Member(2, 0)
    first.hear(0.0, second.tell(0.0, target=((1.0, 0.0),), layer=1, layers_seen=(0,)))
    assert not first.team.view(0.0, layer=0)["claims"]
    assert first.team.view(0.0, layer=1)["claims"]
    layers = first.team.layers(0.0, lambda _: Occupancy())
    assert [claim.number for claim in layers.claims] == [1]
    assert layers.seen == {0}


def test_a_silent_drone_and_one_on_its_way_home_have_no_layer() -> None:
    first, second = Member(1, 0), Member(2, 0)
    first.hear(0.0, second.tell(0.0, layer=1))
    assert not first.team.layers(SILENT_S + 0.1, lambda _: Occupancy()).claims
    first.hear(3.0, second.tell(3.0, layer=None))
    assert not first.team.layers(3.0, lambda _: Occupancy()).claims


def test_the_drone_in_the_lower_layer_has_the_right_of_way() -> None:
    first, second = Member(1, 0), Member(2, 0)
    first.hear(0.0, second.tell(0.0, layer=0))
    second.hear(0.0, first.tell(0.0, layer=1))
    [lower] = first.team.others(0.0, waits=False, layer=1)
    [higher] = second.team.others(0.0, waits=False, layer=0)
    assert lower.has_right_of_way
    assert not higher.has_right_of_way


def test_a_lintel_that_a_teammate_has_passed_is_known_in_the_own_frame() -> None:
    first, second = Member(1, 0), Member(2, 0)
    second.own = replace(second.own, low=lambda: np.array([[1.0, 0.0, 2.0], [3.0, 0.0, 2.6]]))
    first.hear(0.0, second.tell(0.0))
    [lintel] = first.team.low_ne_m(2.3)
    assert lintel == pytest.approx((1.0, 1.5))
