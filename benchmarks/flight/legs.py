"""Simulates flights among thin legs: `python -m benchmarks.flight.legs [--flights 16]`.

The drone flies straight for 20 m among legs of 3 to 5 cm, at random headings to the grid of
`safety/swept_space.py`, with wide or narrow cells. The nose swings as in `navigation/swing.py`. The
speed is bounded as in `safety/velocity_guard.py`, by the grid alone: legs do not change the flight.
Yaw and velocity respond like ArduCopter's, with overshoot. Prints the mean speed, and the share of
legs in the body's way that no beam has detected while the drone could still stop.
"""

import argparse
import math
from dataclasses import dataclass
from itertools import product

import numpy as np

from companion.core.arrays import Array, Mask
from companion.navigation.swing import TO_THE_RIGHT
from companion.safety.control_laws import BODY_RADIUS_M
from companion.safety.swept_space import EYE_M, NARROW, WIDE, GridSpec, SweptGrid
from companion.safety.velocity_guard import CRAWL_M_S, STOPS_M_S2
from sitl.autopilot.response import ARDUCOPTER, Shape, Shaper
from sitl.core.vehicle import STEP_S, Follow, Loop

LENGTH_M, LEGS, THICK_M = 20.0, 400, (0.03, 0.05)
TICK_S, SEES_M, JITTER_RAD = 0.05, 4.0, math.radians(0.5)
LAG_S = 0.6
"""Lag of the vehicle's velocity as assumed by the guard, s."""
STOPS_WITHIN_S = 0.4
"""Time from a stop setpoint to braking of the firmware, s (docs/autopilot.md)."""
RATES_DEG_S, SPEEDS_M_S = (30, 45, 60), (0.6, 1.0)
CELLS = {"wide": WIDE, "narrow": NARROW}


@dataclass(frozen=True)
class Legs:
    """Legs in the way: distance along it and to the right of it, and radii, each (n,), m."""

    along_m: Array
    aside_m: Array
    radius_m: Array

    def touched_m(self) -> Array:
        """(n,): distance along the way of the drone's centre when its body touches each leg, m."""
        reach_m = BODY_RADIUS_M + self.radius_m
        touched_m: Array = self.along_m - np.sqrt(reach_m**2 - self.aside_m**2)
        return touched_m

    def hit_by(self, along_m: float, yaw_rad: float, bearing_rad: float) -> Mask:
        """(n,): the beam of a drone at this pose hits each leg."""
        ahead_m = self.along_m - along_m - EYE_M * math.cos(yaw_rad)
        aside_m = self.aside_m - EYE_M * math.sin(yaw_rad)
        cos_b, sin_b = math.cos(bearing_rad), math.sin(bearing_rad)
        far_m, off_m = ahead_m * cos_b + aside_m * sin_b, aside_m * cos_b - ahead_m * sin_b
        hits: Mask = (far_m > 0) & (far_m < SEES_M) & (np.abs(off_m) < self.radius_m)
        return hits


class Axis:
    """A velocity with the response of the autopilot and its vehicle to a setpoint."""

    def __init__(self, shape: Shape, follow: Follow) -> None:
        self._shaper, self._loop = Shaper(shape), Loop(follow)

    def tick(self, wanted: float) -> float:
        """The velocity one tick later."""
        for _ in range(round(TICK_S / STEP_S)):
            velocity = self._loop.step(self._shaper.step(wanted))
        return velocity


def fly(seed: int, fill: GridSpec, rate_deg_s: float, most_m_s: float) -> tuple[float, float]:
    """Mean speed, m/s, and share of the legs that were detected too late or never."""
    rng = np.random.default_rng(seed)
    heading_rad = rng.uniform(0, math.tau)
    ahead = np.array((math.cos(heading_rad), math.sin(heading_rad)))
    right, begins = np.array((-ahead[1], ahead[0])), rng.uniform(-1, 1, 2)
    legs = Legs(
        rng.uniform(3, LENGTH_M - 1, LEGS),
        rng.uniform(-BODY_RADIUS_M, BODY_RADIUS_M, LEGS),
        rng.uniform(*THICK_M, LEGS) / 2,
    )
    found_m, found_m_s = np.full(LEGS, math.inf), np.zeros(LEGS)
    passed, swing = SweptGrid(fill), TO_THE_RIGHT
    least_m_s = 0.0 if fill.is_proof else CRAWL_M_S
    nose = Axis(ARDUCOPTER.yaw, ARDUCOPTER.airframe.yaw)
    forward = Axis(ARDUCOPTER.horizontal, ARDUCOPTER.airframe.horizontal)
    along_m = speed_m_s = yaw_rad = time_s = 0.0
    while along_m < LENGTH_M:
        time_s += TICK_S
        at = begins + along_m * ahead
        here = float(at[0]), float(at[1])
        lane = passed.lane(here, heading_rad, time_s)
        swing = swing.onward(yaw_rad, lane)
        yaw_rad += nose.tick(swing.side * math.radians(rate_deg_s)) * TICK_S
        beam_rad = yaw_rad + JITTER_RAD * rng.standard_normal()
        new = legs.hit_by(along_m, yaw_rad, beam_rad) & np.isinf(found_m)
        found_m[new], found_m_s[new] = along_m, speed_m_s
        off = EYE_M * (math.cos(yaw_rad) * ahead + math.sin(yaw_rad) * right)
        eye = float(at[0] + off[0]), float(at[1] + off[1])
        passed.sweep(eye, heading_rad + yaw_rad, (0.0, SEES_M), time_s)
        passed.free_hull(here, time_s)
        left_m = max(lane.clear_m - LAG_S * speed_m_s, 0.0)
        bound_m_s = min(most_m_s, max(least_m_s, math.sqrt(2 * STOPS_M_S2 * left_m)))
        speed_m_s = forward.tick(bound_m_s)
        along_m += speed_m_s * TICK_S
    stops_m = STOPS_WITHIN_S * found_m_s + found_m_s**2 / (2 * STOPS_M_S2)
    return along_m / time_s, float((legs.touched_m() - found_m < stops_m).mean())


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--flights", type=int, default=16)
    seeds = range(parser.parse_args().flights)
    print("| cells | turns, deg/s | at most, m/s | mean, m/s | detected too late |")
    print("|---" * 5 + "|")
    for (cells, fill), rate_deg_s, most_m_s in product(CELLS.items(), RATES_DEG_S, SPEEDS_M_S):
        flights = [fly(seed, fill, rate_deg_s, most_m_s) for seed in seeds]
        speed_m_s, late = np.mean(flights, axis=0)
        row = f"{cells} | {rate_deg_s} | {most_m_s} | {speed_m_s:.2f} | {late:.2%}"
        print(f"| {row} |", flush=True)


if __name__ == "__main__":
    main()
