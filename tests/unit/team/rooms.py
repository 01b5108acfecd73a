"""Messages of a drone in a square room, for tests of teams."""

import math
from collections.abc import Callable

import numpy as np

from companion.config.team import PadConfig, TeamConfig
from companion.core.arrays import Array
from companion.core.frames import Vector2, along
from companion.core.known_walls import KnownWalls
from companion.estimation.smoothing.state import Unknowns
from companion.mapping.rays import Ray
from companion.mapping.redrawn_grid import RedrawnGrid
from companion.team.messages import State
from companion.team.sharing import OwnMap
from companion.team.team import Team

HALF_M = 3.0
"""The room is 6 m wide, with the first drone's start in the middle."""
PADS = (PadConfig(), PadConfig(north_m=1.0, east_m=0.5, heading_deg=90.0))
WALL_SIGMA_M = 0.02
TURN_RAD_S = math.radians(45)
"""The default of `mission.turn_rate_deg_s`."""
WALLS_RAD = (0.0, 0.5 * math.pi, math.pi, -0.5 * math.pi)


def config(drone: int) -> TeamConfig:
    return TeamConfig(name="test", drone=drone, pads=PADS)


def start_of(drone: int) -> Array:
    """(3,): where a drone stands on its pad, in the frame of the first."""
    pad = PADS[drone - 1]
    return np.array([pad.north_m, pad.east_m, math.radians(pad.heading_deg)])


def walls_of(drone: int, off: Array | None = None) -> Unknowns:
    """The walls of the room in a drone's frame; `off` (3,): how far it stands off its pad."""
    north_m, east_m, yaw_rad = (start_of(drone) + (np.zeros(3) if off is None else off)).tolist()
    normals_rad = np.array(WALLS_RAD)
    offsets_m = HALF_M - np.cos(normals_rad) * north_m - np.sin(normals_rad) * east_m
    x = Unknowns.at(np.zeros((1, 3)), 0.0)
    x.add_walls(
        np.column_stack([normals_rad - yaw_rad, offsets_m]), np.tile([-HALF_M, HALF_M], (4, 1))
    )
    return x


def space_of(drone: int, turns: int, off_ne_m: Vector2 = (0.0, 0.0)) -> tuple[RedrawnGrid, Array]:
    """The grid of a drone that has turned on its pad, with its keyframes; 40 rays for each turn."""
    grid, keyframes = RedrawnGrid(), np.zeros((turns, 3))
    north_m, east_m, yaw_rad = (start_of(drone) + np.array([*off_ne_m, 0.0])).tolist()
    for turn in range(turns):
        rays = []
        first_rad = -math.pi + math.tau / 40 * turn / turns
        for bearing_rad in (first_rad + np.arange(40) * math.tau / 40).tolist():
            unit = along((0.0, 0.0), bearing_rad + yaw_rad, 1.0)
            ends = [
                (HALF_M - abs(at) * math.copysign(1, at * by)) / abs(by)
                for at, by in zip((north_m, east_m), unit, strict=True)
                if abs(by) > 1e-9
            ]
            rays.append(Ray((0.0, 0.0), bearing_rad, min(ends), 0.02, True, 1.0 + turn))
        grid.add(rays, keyframes[: turn + 1])
        grid.advance()
    return grid, keyframes


def state(ne_m: tuple[float, float] = (0.0, 0.0), **fields: object) -> Callable[[], State]:
    """A state in the air."""
    values: dict[str, object] = {
        "ne_m": ne_m,
        "height_m": 1.2,
        "yaw_rad": 0.0,
        "velocity_ne_m_s": (0.0, 0.0),
        "position_sigma_m": 0.05,
        "phase": "exploring",
        "is_flying": True,
        "needs_column": False,
        "waits": False,
        "battery": 0.8,
        "target": (),
        "is_extra": False,
        "arrives_in_s": 0.0,
        "received": {},
        "layer": 0,
        "layers_seen": (),
        "doorway_ne_m": None,
        "links": {},
    }
    return lambda: State(**(values | fields))  # type: ignore[arg-type]


class Member:
    """A drone of the team that says what it has seen."""

    def __init__(self, drone: int, turns: int, off: Array | None = None) -> None:
        self.team = Team(config(drone), TURN_RAD_S)
        self.grid, keyframes = space_of(drone, turns)
        self.walls = walls_of(drone, off)
        self.sigmas_m = np.full(4, WALL_SIGMA_M)
        """Of the offsets of its walls, independent of each other."""
        self.own = OwnMap((self.grid,), 0, keyframes, self.known_walls, None)

    def move(self, off_ne_m: Vector2) -> None:
        """Stand off the pad, in the frame of the first drone, and turn there."""
        self.grid, keyframes = space_of(2, len(self.own.keyframes), off_ne_m)
        self.own = OwnMap((self.grid,), 0, keyframes, self.known_walls, None)

    def known_walls(self) -> KnownWalls:
        walls, never = self.walls, np.full(4, -np.inf)
        covariance_m2 = np.diag(self.sigmas_m**2)
        return KnownWalls(walls.normals, walls.walls[:, 1], walls.reach_m, covariance_m2, never)

    def team_knows_m(self) -> Array:
        """(4,): sigmas of its walls, with what the team knows of them."""
        return self.team.with_measured(self.known_walls(), self.walls).sigmas_m

    def tell(self, now_s: float, **fields: object) -> tuple[bytes, ...]:
        told = state((0.0, 0.0), received=self.team.received, **fields)
        return self.team.tell(now_s, told, self.own)

    def hear(self, now_s: float, packets: tuple[bytes, ...]) -> None:
        self.team.hear(now_s, packets, lambda: self.walls, self.grid.grid)
