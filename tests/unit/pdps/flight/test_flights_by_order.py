"""Tests the flights to a place and at a velocity that a script orders, without a simulator."""

import math
from dataclasses import dataclass, field, replace

import numpy as np
import pytest

from companion.core.frames import frd_to_ned, wrap_rad
from companion.core.messages import Beam, RangeReading, RangeState, Setpoint
from companion.mapping.occupancy import Occupancy
from companion.pdps.flight.order import Order, Target, Task
from companion.pdps.flight.phases import step
from companion.pdps.flight.state import FlightState, OffLevel, Phase, TickInput
from companion.safety.obstacle_memory import Surroundings
from tests.unit.pdps.flight.flight_ticks import (
    CLEAR,
    FLYING,
    PLAN,
    SILENT,
    SPACE,
    flying,
    view,
)

TICK_S = 0.05
HIGH = RangeReading(RangeState.NOTHING)


@dataclass
class Drone:
    """A drone that follows each setpoint at once, at 1 m north and 1 m east in free space."""

    flight: FlightState = field(default_factory=lambda: flying(Phase.HOVER))
    space: Occupancy = SPACE
    wall_north_m: float = math.inf
    below: RangeReading = HIGH
    above: RangeReading = HIGH
    battery: float | None = None
    time_s: float = 100.0
    ne_m: tuple[float, float] = (1.0, 1.0)
    height_m: float = PLAN.height_m
    yaw_rad: float = 0.0
    setpoint: Setpoint = field(default_factory=Setpoint)
    path: list[tuple[float, float, float]] = field(default_factory=list)
    """North, east and height, m, of each tick."""

    def tick(self, order: Order) -> None:
        self.flight, action = step(self.flight, self._input(order), PLAN)
        self.setpoint = action.setpoint or Setpoint()
        north_m_s, east_m_s = frd_to_ned(
            self.setpoint.forward_m_s, self.setpoint.right_m_s, self.yaw_rad
        )
        self.ne_m = self.ne_m[0] + TICK_S * north_m_s, self.ne_m[1] + TICK_S * east_m_s
        self.height_m -= TICK_S * self.setpoint.down_m_s
        self.yaw_rad += TICK_S * self.setpoint.yaw_rate_rad_s
        self.time_s += TICK_S
        self.path.append((*self.ne_m, self.height_m))

    def fly(self, order: Order, most_s: float = 60.0) -> str:
        """Fly until the drone hovers; return why the order was not completed."""
        until_s = self.time_s + most_s
        self.tick(order)
        while self.flight.phase is not Phase.HOVER and self.time_s < until_s:
            self.tick(order)
        return self.flight.undone

    def _input(self, order: Order) -> TickInput:
        seen = view(
            replace(FLYING, battery=self.battery),
            time_s=self.time_s,
            height_m=self.height_m,
            position=self.ne_m,
            up=self.above,
        )
        pose = replace(seen.observation.pose, yaw_rad=self.yaw_rad)
        ranges = {**seen.observation.ranges, Beam.DOWN: self.below}
        observation = replace(seen.observation, pose=pose, ranges=ranges, lag_s=0.0)
        around = Surroundings()
        if math.isfinite(self.wall_north_m):
            ahead_m = self.wall_north_m - self.ne_m[0]
            points = np.array([(ahead_m, 0.1 * n) for n in range(-10, 11)])
            around = replace(around, points_frd_m=points, lag_s=0.0)
        return replace(seen, observation=observation, space=self.space, around=around, order=order)


def to(
    north_m: float,
    east_m: float,
    height_m: float | None = None,
    yaw_rad: float | None = None,
    until_s: float = math.inf,
) -> Order:
    target = Target((north_m, east_m), height_m, yaw_rad)
    return Order(1, Task.FLY_TO, target=target, until_s=until_s)


def at(
    forward_m_s: float = 0.0, down_m_s: float = 0.0, number: int = 1, until_s: float = 101.0
) -> Order:
    velocity = Setpoint(forward_m_s, down_m_s=down_m_s)
    return Order(number, Task.FLY_VELOCITY, velocity=velocity, until_s=until_s)


def with_pillar() -> Occupancy:
    """A pillar of 0.6 m in the free space, 1 m ahead of the drone."""
    space = SPACE.copy()
    space.block((2.2, 1.0), 0.3)
    return space


def test_the_drone_flies_round_an_obstacle_and_turns_and_climbs_at_its_target() -> None:
    drone = Drone(space=with_pillar())
    assert drone.fly(to(3.5, 1.0, height_m=1.8, yaw_rad=2.0)) == ""
    assert drone.ne_m == pytest.approx((3.5, 1.0), abs=0.1)
    assert drone.height_m == pytest.approx(1.8, abs=0.1)
    assert wrap_rad(drone.yaw_rad) == pytest.approx(2.0, abs=0.06)
    path = np.array(drone.path)
    assert np.hypot(path[:, 0] - 2.2, path[:, 1] - 1.0).min() > 0.3 + 0.3
    climbed = path[path[:, 2] > PLAN.height_m + 0.1]
    assert np.hypot(climbed[:, 0] - 3.5, climbed[:, 1] - 1.0).max() < 0.15


@pytest.mark.parametrize(
    ("order", "why", "within_s"),
    [
        (to(2.2, 1.0), "2.2 m north, 1.0 m east is not free: an obstacle is 0.0 m from it", 1.0),
        (to(9.0, 1.0), "no sensor has measured the space at the place 9.0 m north", 30.0),
        (to(3.5, 1.0, until_s=102.0), "was not reached within timeout_s", 2.1),
        (to(1.0, 1.0, height_m=3.0), "the height 3.0 m is not free: the drone stays at 1.2", 5.0),
    ],
)
def test_a_target_that_is_not_reached_is_refused_with_its_reason(
    order: Order, why: str, within_s: float
) -> None:
    ceiling = RangeReading(RangeState.DISTANCE, 0.5, 0.01)
    drone = Drone(space=with_pillar(), above=ceiling)
    assert why in drone.fly(order)
    assert drone.time_s - 100.0 < within_s


def test_the_drone_flies_at_a_velocity_until_its_time_is_over() -> None:
    drone = Drone()
    assert drone.fly(at(0.5)) == ""
    assert drone.ne_m == pytest.approx((1.5, 1.0), abs=0.05)
    drone.tick(at(0.5))
    assert drone.setpoint == Setpoint()


def test_a_velocity_that_is_renewed_is_flown_without_a_stop() -> None:
    drone = Drone()
    for number in range(1, 21):
        drone.tick(at(0.5, number=number, until_s=drone.time_s + 0.5))
        assert number == 1 or drone.setpoint.forward_m_s == 0.5
    drone.fly(at(0.5, number=20, until_s=drone.time_s + 0.5))
    assert drone.ne_m[0] == pytest.approx(1.725, abs=0.03)


def test_the_guard_stops_the_drone_before_a_wall_and_the_velocity_is_refused() -> None:
    drone = Drone(wall_north_m=2.5)
    why = drone.fly(at(0.5, until_s=130.0))
    assert (
        why == "the velocity is refused by the velocity guard; the nearest obstacle is 0.5 m away"
    )
    assert drone.ne_m[0] < 2.5 - 0.5
    assert drone.time_s < 110.0
    drone.tick(replace(at(0.5, number=2, until_s=130.0), renews=True))
    assert (drone.flight.phase, drone.flight.undone) == (Phase.HOVER, why)
    drone.tick(at(0.5, number=3, until_s=130.0))
    assert drone.flight.phase is Phase.FLY_VELOCITY


def test_off_the_height_of_the_map_the_drone_is_slow_and_returns_before_it_travels() -> None:
    drone = Drone()
    drone.fly(at(down_m_s=-0.4, until_s=102.0))
    assert drone.height_m == pytest.approx(2.0, abs=0.25)
    high_m = drone.height_m
    for _ in range(100):
        drone.tick(at(down_m_s=-0.4))
    assert drone.height_m == pytest.approx(high_m, abs=0.25)
    drone.fly(at(1.0, number=2, until_s=drone.time_s + 1.0))
    assert drone.ne_m[0] == pytest.approx(1.2, abs=0.03)
    drone.path.clear()
    assert drone.fly(replace(to(3.0, 1.0), number=3)) == ""
    path = np.array(drone.path)
    assert path[path[:, 2] > PLAN.height_m + 0.1][:, 0].max() < 1.25
    assert path[-1] == pytest.approx((3.0, 1.0, PLAN.height_m), abs=0.1)


@pytest.mark.parametrize(
    ("order", "phase"), [(to(3.0, 1.0), Phase.HOVER), (Order(1, Task.HOME), Phase.LAND)]
)
def test_under_an_obstacle_the_drone_gives_up_the_return_to_the_height_of_the_map(
    order: Order, phase: Phase
) -> None:
    drone = Drone(above=RangeReading(RangeState.DISTANCE, 0.5, 0.01), height_m=0.7)
    drone.flight = replace(drone.flight, off_level=OffLevel(0.7))
    drone.fly(order, most_s=31.0)
    assert drone.flight.phase is phase
    why = drone.flight.undone or drone.flight.trouble
    assert why == "the way back to the height of the map, 1.2 m, is not free"
    assert drone.ne_m == pytest.approx((1.0, 1.0))


@pytest.mark.parametrize(("below_m", "least_m"), [(0.6, 1.1), (5.0, 0.5)])
def test_a_descent_keeps_clear_of_what_is_below(below_m: float, least_m: float) -> None:
    drone = Drone(below=RangeReading(RangeState.DISTANCE, below_m, 0.01))
    for _ in range(100):
        drone.tick(at(down_m_s=0.4, until_s=110.0))
        below_m = drone.below.distance_m + TICK_S * -drone.setpoint.down_m_s
        drone.below = RangeReading(RangeState.DISTANCE, below_m, 0.01)
    assert drone.height_m == pytest.approx(least_m, abs=0.05)
    assert "clearance to what is below, and a height of 0.5 m" in drone.flight.undone


@pytest.mark.parametrize("phase", [Phase.ROOM, Phase.FLY_TO, Phase.FLY_VELOCITY, Phase.HOME])
def test_a_new_order_replaces_a_running_step(phase: Phase) -> None:
    drone = Drone()
    drone.tick(to(3.0, 1.0))
    drone.tick(Order(2))
    drone.tick(at(0.1, number=3, until_s=200.0))
    drone.flight = replace(drone.flight, phase=phase, obeyed=3)
    drone.tick(Order(4))
    assert (drone.flight.phase, drone.setpoint) == (Phase.HOVER, Setpoint())
    assert drone.flight.undone == "another step or stop() ended it"
    drone.tick(Order(4))
    assert drone.flight.obeyed == 4


def test_a_stop_also_ends_a_change_of_height_and_the_return_from_it() -> None:
    drone = Drone()
    for order in (to(1.0, 1.0, height_m=2.0), Order(2), replace(to(3.0, 1.0), number=3), Order(4)):
        for _ in range(20):
            drone.tick(order)
        assert (drone.flight.phase is Phase.HOVER) is (order.task is Task.WAIT)
        if order.task is Task.WAIT:
            assert abs(drone.height_m - drone.path[-20][2]) < 0.05
            assert drone.height_m != pytest.approx(PLAN.height_m, abs=0.05)


def test_an_order_that_needs_nothing_forgets_the_refusal_before() -> None:
    drone = Drone(space=with_pillar())
    assert drone.fly(to(2.2, 1.0))
    assert drone.fly(Order(2, Task.TAKE_OFF)) == ""


@pytest.mark.parametrize("order", [to(3.0, 1.0), at(0.1, until_s=200.0)])
def test_limits_and_the_pilot_end_an_ordered_flight_as_a_mission(order: Order) -> None:
    drone = Drone()
    drone.tick(order)
    flying_by_order = drone.flight
    drone.battery = 0.15
    drone.tick(order)
    assert drone.flight.phase is Phase.HOME
    assert drone.flight.undone == "turned back with 15 % of the battery"
    drone.tick(Order(2, Task.FLY_VELOCITY, velocity=Setpoint(0.5), until_s=200.0))
    assert drone.flight.phase is Phase.HOME
    pilot = replace(FLYING, mode="LOITER", in_offboard_mode=False)
    for seen, phase in (
        (view(pilot), Phase.HANDED_OVER),
        (view(fault=SILENT), Phase.HOLD),
        (view(time_s=91.0 + PLAN.time_limit_s, right=CLEAR), Phase.LAND),
        (view(land_requested=True), Phase.LAND),
    ):
        assert step(flying_by_order, replace(seen, order=order), PLAN)[0].phase is phase
