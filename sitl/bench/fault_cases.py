"""Draws random flights with faults: world, fault, and time of the fault."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from random import Random
from types import MappingProxyType
from typing import Any

from companion.core.messages import Beam
from sitl.core.noise import stream
from sitl.testing.actions.table import ACTIONS
from sitl.testing.script import Event, at
from sitl.world.cropping import cropped
from sitl.world.format import Box, Start, Walls, World
from sitl.world.generator import random_world

LEVEL = (Beam.FRONT, Beam.LEFT, Beam.RIGHT)
PROFILES = ("gp2y0a710k0f", "gp2y0a710k0f", "gp2y0a710k0f", "paper", "vl53l1x", "tfmini_s")
"""Profiles to draw from, the usual one with three times the probability. Chosen."""
AUTOPILOTS = ("ardupilot", "ardupilot", "px4")
BUILDINGS_SHARE, BUILDINGS, BUILDING_M = 0.25, 50, 8.0
"""Probability of a building, number of buildings, and side of the cropped piece, m. Chosen."""
SECOND_FAULT_SHARE = 0.2
"""Probability of a second fault. Chosen."""
MIN_ROOM_M, MAX_ROOM_M = 4.5, 8.0
"""Sides of a room, m. Chosen."""
EARLY_SHARE, EARLY_S, LATEST_S = 0.1, 10.0, 50.0
"""Probability of an early fault, end of the early time, and latest time of a fault, s. Chosen."""
FOR_GOOD_SHARE, LONGEST_S = 0.3, 30.0
"""Probability of a permanent fault, and longest duration of others, s. Chosen."""

Given = Mapping[str, Any]
Draw = Callable[[Random], Given]


@dataclass(frozen=True, slots=True)
class Injected:
    """A fault, as in a mission file."""

    name: str
    """Row in the table of results."""
    at_s: float
    do: str
    given: Given

    def event(self) -> Event:
        return at(self.at_s, ACTIONS[self.do](**self.given))

    def __str__(self) -> str:
        given = ", ".join(f"{name}={value}" for name, value in self.given.items())
        return f"{self.do}({given}) at {self.at_s:g} s"


@dataclass(frozen=True, slots=True)
class Case:
    """One flight of the campaign; seed and number determine it."""

    seed: int
    number: int
    world: World
    profile: str
    autopilot: str
    faults: tuple[Injected, ...]


def draw_case(seed: int, number: int) -> Case:
    """The flight of that number; the faults of the table follow in turn."""
    random = stream(seed, f"faulty flight {number}")
    world = _building(random) if random.random() < BUILDINGS_SHARE else _room(random)
    names = list(FAULTS)
    faults = [_inject(names[number % len(names)], random)]
    if random.random() < SECOND_FAULT_SHARE:
        faults.append(_inject(random.choice(names), random))
    profile, autopilot = random.choice(PROFILES), random.choice(AUTOPILOTS)
    return Case(seed, number, world, profile, autopilot, tuple(faults))


def _inject(name: str, random: Random) -> Injected:
    do, draw = FAULTS[name]
    early = random.random() < EARLY_SHARE
    at_s = random.uniform(0.0, EARLY_S) if early else random.uniform(EARLY_S, LATEST_S)
    if do in BEFORE_TAKE_OFF:
        at_s = 0.0
    return Injected(name, round(at_s, 2), do, draw(random))


def _room(random: Random) -> World:
    """A rectangular room, sometimes with a pillar near a corner."""
    depth_m, width_m = (round(random.uniform(MIN_ROOM_M, MAX_ROOM_M), 2) for _ in range(2))
    corners = (0.0, 0.0), (depth_m, 0.0), (depth_m, width_m), (0.0, width_m)
    pillars: tuple[Box, ...] = ()
    if random.random() < 0.3:
        side_m = round(random.uniform(0.3, 0.6), 2)
        pillars = (Box(corner=(0.3, 0.3), size=(side_m, side_m), top_m=2.6),)
    place = random.uniform(0.4, 0.6) * depth_m, random.uniform(0.4, 0.6) * width_m
    return World(
        name=f"room {depth_m:g} × {width_m:g}",
        height_m=2.6,
        walls=(Walls(points=corners, closed=True),),
        boxes=pillars,
        starts=(Start(name="start", position=place),),
    )


def _building(random: Random) -> World:
    """A piece of a random building with its furniture."""
    return cropped(random_world(random.randint(1, BUILDINGS)), BUILDING_M, 0)


# Faults

BEFORE_TAKE_OFF = ("refuse_arming", "swap")
"""Actions that start at time 0."""
AHEAD_M = 1.5
"""Distance of a person ahead of the drone, m. Chosen."""


def _duration(random: Random) -> dict[str, object]:
    """A permanent fault, or 0.1 to 30 s with a log-uniform distribution."""
    if random.random() < FOR_GOOD_SHARE:
        return {}
    return {"for_s": round(math.exp(random.uniform(math.log(0.1), math.log(LONGEST_S))), 2)}


def _nothing(random: Random) -> Given:
    return {}


def _of_a_beam(random: Random) -> Given:
    return {"beam": random.choice(list(LEVEL)).value, **_duration(random)}


def _link(**troubles: float) -> Draw:
    return lambda random: {**troubles, **_duration(random)}


FAULTS: Mapping[str, tuple[str, Draw]] = MappingProxyType(
    {
        "range sensor dead": ("unplug", _of_a_beam),
        "range sensor's input shows others": (
            "unplug",
            lambda random: {**_of_a_beam(random), "memory": round(random.uniform(0.7, 0.97), 2)},
        ),
        "range sensor stuck": ("stick", _of_a_beam),
        "range sensor noisy": (
            "noisy",
            lambda random: {**_of_a_beam(random), "times": round(random.uniform(3, 20), 1)},
        ),
        "up sensor dead": ("unplug", lambda random: {"beam": "up", **_duration(random)}),
        "down sensor stuck": ("stick", lambda random: {"beam": "down", **_duration(random)}),
        "range sensors swapped": (
            "swap",
            lambda random: dict(
                zip(("one", "other"), (b.value for b in random.sample(LEVEL, 2)), strict=True)
            ),
        ),
        "bus gone": ("break_bus", _duration),
        "bus hangs": (
            "hang_bus",
            lambda random: {"transfer_s": round(random.uniform(0.02, 2), 2), **_duration(random)},
        ),
        "ADC gone": ("dead_adc", _duration),
        "gyro dead": ("dead_gyro", _duration),
        "gyro saturated": ("saturate_gyro", _duration),
        "gyro biased": (
            "bias_gyro",
            lambda random: {"deg_s": round(random.uniform(-8, 8), 2), **_duration(random)},
        ),
        "link lost": ("link_down", _duration),
        "20 % loss": ("bad_link", _link(loss=0.2)),
        "duplicates": ("bad_link", _link(duplicates=0.3)),
        "reordering": ("bad_link", _link(reordering=0.3)),
        "jitter of 300 ms": ("bad_link", _link(jitter_s=0.3)),
        "all of these": (
            "bad_link",
            _link(loss=0.2, duplicates=0.2, reordering=0.2, jitter_s=0.3),
        ),
        "autopilot restarts": ("restart_autopilot", _nothing),
        "clock jumps": (
            "jump_clock",
            lambda random: {"seconds": round(random.uniform(-20, 20), 2)},
        ),
        "pilot takes over": (
            "pilot_mode",
            lambda random: {"name": "LAND" if random.random() < 0.3 else "RTL"},
        ),
        "arming refused": ("refuse_arming", _duration),
        "estimator fails": ("lose_flow", _duration),
        "battery low": ("battery", lambda random: {"percent": round(random.uniform(10, 20), 1)}),
        "battery critical": (
            "battery",
            lambda random: {"percent": round(random.uniform(0, 10), 1)},
        ),
        "odometry jumps": (
            "jump_odometry",
            lambda random: {
                "north_m": round(random.gauss(0, 1.5), 2),
                "east_m": round(random.gauss(0, 1.5), 2),
                "down_m": round(random.gauss(0, 0.3), 2),
                "yaw_deg": round(random.gauss(0, 20), 1),
            },
        ),
        "companion hangs": (
            "hang",
            lambda random: {"for_s": round(random.uniform(0.1, 12), 2)},
        ),
        "computer starved": ("starve", _duration),
        "computer starved between reads": (
            "starve",
            lambda random: {"between_reads": True, **_duration(random)},
        ),
        "somebody in the way": (
            "somebody_near",
            lambda random: {"forward_m": AHEAD_M, "for_s": round(random.uniform(1, 20), 2)},
        ),
        "gust": (
            "gust",
            lambda random: {
                "north_m_s": round(random.uniform(-0.25, 0.25), 2),
                "east_m_s": round(random.uniform(-0.25, 0.25), 2),
                "for_s": round(random.uniform(0.5, 3), 2),
            },
        ),
        "disarmed in the air": ("crash", _nothing),
        "none": ("hang", lambda random: {"for_s": 0.0}),
    }
)
"""Action of `sitl.testing` and its arguments, by row of the table."""
