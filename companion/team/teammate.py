"""What is known of one teammate: its state, its walls, and the space that it has seen.

All that it sends is in its own frame. It is placed in this drone's frame by the start of the
teammate: at first that of its pad, later that for which the walls of both agree best. The
alignment corrects only how the teammate's map is placed. It never enters the estimate of this
drone's pose, so nothing is counted twice.
"""

import math
from collections.abc import Callable

import numpy as np

from companion.core.arrays import Array
from companion.core.frames import Vector2, frd_to_ned, moved, places_moved_to, poses_moved_to
from companion.core.values import value
from companion.estimation.placement import matches, refined_start
from companion.estimation.smoothing.joint import moved_to
from companion.estimation.smoothing.state import YAW, Unknowns
from companion.mapping.joined_grid import centres, contradicted
from companion.mapping.occupancy import Occupancy
from companion.mapping.redrawn_grid import RedrawnGrid
from companion.navigation.observation import Claim, DoorwayClaim, LayerClaim, Tracing
from companion.safety.separation import OtherDrone
from companion.team.messages import (
    ON_PAD,
    Body,
    Keyframes,
    LowCeilings,
    MapPiece,
    Packet,
    PacketError,
    State,
    Track,
    WallLines,
    unpack_floats,
    unpack_rays,
)
from companion.team.silence import Silent

SILENT_S = 2.0
"""After this time without a state, nothing is claimed by the teammate any more, s: ten states.
Chosen."""
LOST_S = 10.0
"""After this time its place is unknown, s, unless it holds. Chosen."""
STOPS_WITHIN_M = 0.5
"""A silent drone has stopped within this distance of the place to which it would have flown by its
velocity when it was heard last, m. Chosen: it holds its place after `SILENT_S` at up to 1 m/s, and
drifts. In one flight it was 0.5 m off."""
SIGMA_M = 0.1
"""Error of a teammate's place relative to this drone once the maps are aligned, m. Chosen."""
TURN_SHARE = 4 / 3
"""Largest turn rate of a teammate, as a share of that of its mission. Chosen."""
SAME_PLACE_M = 0.4
"""An obstacle on its map is the same as one on the own map within this distance, m. Chosen: beyond
the error of the alignment."""
MIN_CELLS = 40
"""Least obstacle cells of its map in space that the own map knows, for a comparison. Chosen."""
MAX_CONTRADICTED_SHARE = 0.4
"""Largest share of these cells that may be free on the own map. Chosen: at most 0.23 in a flight
without a fault."""
MAX_PENDING = 400
"""Most map pieces that wait for a missing one. Chosen: a flight of ten minutes has 300."""
MAX_KEYFRAMES = 50_000
"""Most keyframes. Chosen: a flight of an hour has 18,000."""
REFINE_PERIOD_S = 4.0
"""Interval between two alignments of the maps, s. Chosen."""
MOVED_M, RAYS_PER_STAGE = 0.1, 2000
"""Larger shifts of a teammate's keyframe cause a redraw of its map, m, and rays between two stages
of it (`redrawn_grid.py`). Chosen: the error of the alignment is as large, and each alignment moves
the whole map."""
MEASURED_BEFORE_S = 1.0
"""Time of a teammate's readings on this drone's map, s: before all of its own."""
NOTHING_SEEN = Occupancy()
"""The space of a layer in which it was not yet."""


@value
class Heard:
    """A teammate as it was heard last, in this drone's frame."""

    drone: int
    """Its number."""
    ne_m: Vector2
    height_m: float
    yaw_rad: float
    phase: str
    battery: float
    """Remaining charge, 0 to 1."""


class Teammate:
    """One teammate."""

    def __init__(self, start: Array, sigma: Array, turn_rad_s: float, *, comes_first: bool) -> None:
        """`start`, `sigma` (3,): its pad in this drone's frame, north, east, m, and heading, rad.

        `turn_rad_s`: rate of its turns. `comes_first`: it has the right of way.
        """
        self._pad, self._sigma, self._turn_rad_s = start, sigma, turn_rad_s
        self._comes_first = comes_first
        self.reset(0)

    def reset(self, instance: int) -> None:
        """Forget all that an earlier start of its program has sent."""
        self.instance = instance
        self.is_credible = True
        """Its map does not contradict the map of this drone."""
        self.start = self._pad.copy()
        """(3,): where it began, in this drone's frame."""
        self._is_aligned = False
        self._refined_s = -math.inf
        self.state: State | None = None
        self._heard_s = -math.inf
        self._latest: dict[type[Body], int] = {}
        """Number of the latest packet of each kind."""
        self._walls: Unknowns | None = None
        self._wall_sigmas_m = np.empty(0)
        self._pending: dict[int, MapPiece] = {}
        self.pieces = 0
        """Number of map pieces that have arrived, from the first on."""
        self._keyframes = np.empty((0, 3))
        self._grids: dict[int, RedrawnGrid] = {0: _new_grid()}
        """Grid of each layer in which it has been."""
        self._low = np.empty((0, 3))
        self._track: Track | None = None
        self._track_places = np.empty((0, 2))

    def is_outdated(self, packet: Packet) -> bool:
        """True if a later packet of the same kind has overtaken it; map pieces never are."""
        kind = type(packet.body)
        if kind is MapPiece:
            return False
        latest = self._latest.get(kind, -1)
        self._latest[kind] = max(packet.number, latest)
        return packet.number < latest

    def hear_state(self, now_s: float, state: State) -> None:
        self.state, self._heard_s = state, now_s

    def hear_walls(self, walls: WallLines) -> None:
        """Take its walls.

        Raises:
            PacketError: they are invalid.
        """
        rows = unpack_floats(walls.rows, 5)
        if not (rows[:, 4] > 0).all():
            raise PacketError("the sigma of a wall is not positive")
        known = Unknowns.at(np.zeros((1, 3)), 0.0)
        known.add_walls(rows[:, :2], rows[:, 2:4])
        self._walls, self._wall_sigmas_m = known, rows[:, 4]

    def hear_piece(self, piece: MapPiece) -> None:
        """Take a piece of its map; pieces are drawn in their order.

        Raises:
            PacketError: it is invalid.
        """
        if self.pieces <= piece.number < self.pieces + MAX_PENDING:
            self._pending[piece.number] = piece
        while (next_piece := self._pending.pop(self.pieces, None)) is not None:
            self._draw(next_piece)
            self.pieces += 1

    def _draw(self, piece: MapPiece) -> None:
        poses = unpack_floats(piece.poses, 3)
        if not len(poses) or piece.first > MAX_KEYFRAMES:
            raise PacketError(f"{len(poses)} keyframes from {piece.first} on")
        rays = unpack_rays(piece.rays, piece.first, len(poses), MEASURED_BEFORE_S)
        known = self._keyframes[: piece.first]
        between = np.repeat(poses[:1], piece.first - len(known), axis=0)  # without rays
        self._keyframes = np.vstack([known, between, poses])
        self._grids.setdefault(piece.layer, _new_grid()).extend(rays, self._placed_keyframes())

    def hear_keyframes(self, block: Keyframes) -> None:
        """Take a corrected part of its trajectory.

        Raises:
            PacketError: it is invalid.
        """
        poses = unpack_floats(block.poses, 3)[: max(len(self._keyframes) - block.first, 0)]
        if len(poses):
            self._keyframes[block.first : block.first + len(poses)] = poses
            self._correct()

    def _correct(self) -> None:
        placed = self._placed_keyframes()
        for grid in self._grids.values():
            grid.correct(placed)

    def hear_low(self, low: LowCeilings) -> None:
        """Take the places where something hangs low.

        Raises:
            PacketError: they are invalid.
        """
        self._low = unpack_floats(low.rows, 3)

    def hear_track(self, track: Track) -> None:
        """Take its way along the walls of the room.

        Raises:
            PacketError: it is invalid.
        """
        self._track_places, self._track = unpack_floats(track.places, 2), track

    def refine(self, now_s: float, walls: Callable[[], Unknowns]) -> bool:
        """Align the maps by the walls of both, if it is time; True if it was done.

        `walls` returns the own walls.
        """
        if self._walls is None or now_s - self._refined_s < REFINE_PERIOD_S:
            return False
        self._refined_s = now_s
        known = walls()
        if not len(known.walls) or not len(self._walls.walls):
            return False
        self.start = refined_start(self._walls, known, self._pad, self._sigma)
        self._is_aligned = True
        self._correct()
        return True

    def measured_m(self, walls: Unknowns) -> Array:
        """(w,): how well it has measured each of the own walls: sigmas, m; else infinite."""
        sigmas_m = np.full(len(walls.walls), math.inf)
        if self._walls is not None and self._is_aligned and self.is_credible:
            for match in matches(moved_to(self._walls, self.start), walls):
                sigma_m = self._wall_sigmas_m[match.wall]
                sigmas_m[match.known] = min(sigmas_m[match.known], sigma_m)
        return sigmas_m

    def contradicts(self, space: Occupancy, layer: int) -> bool:
        """Compare its map with the own grid of a layer; True if it is found not credible now."""
        was_credible = self.is_credible
        met, free = contradicted(self.grid(layer), space, SAME_PLACE_M)
        if met >= MIN_CELLS:
            self.is_credible = free < MAX_CONTRADICTED_SHARE * met
        return was_credible and not self.is_credible

    def advance(self) -> None:
        """Draw some of its rays."""
        for grid in self._grids.values():
            grid.advance()

    def grid(self, layer: int) -> Occupancy:
        """The space of a layer that it has seen, in this drone's frame."""
        known = self._grids.get(layer)
        return known.grid if known else NOTHING_SEEN

    def low_ne_m(self, height_m: float) -> tuple[Vector2, ...]:
        """Places where something hangs lower than this."""
        places = places_moved_to(self.start, self._low[self._low[:, 2] < height_m, :YAW])
        return tuple((north_m, east_m) for north_m, east_m in places.tolist())

    def is_known(self, now_s: float) -> bool:
        """True if its place is known."""
        return now_s - self._heard_s < LOST_S

    @property
    def is_flying(self) -> bool:
        """True if it was in the air, and not in its column to land, when it was heard last."""
        state = self.state
        if state is None or not state.is_flying:
            return False
        return not (state.needs_column and state.layer is None)

    def silent(self, now_s: float) -> Silent | None:
        """Its silence; None while it is heard, or if it does not fly."""
        if self.state is None or not self.is_flying or self.is_heard(now_s):
            return None
        return Silent(self._heard_s, self.state.layer is None)

    def is_heard(self, now_s: float) -> bool:
        """True if it was heard lately."""
        return now_s - self._heard_s < SILENT_S

    def drone(
        self, now_s: float, *, holds: bool, other_waits: bool, other_layer: int | None
    ) -> OtherDrone | None:
        """Where it is: on its pad until it is heard; None if it was not heard for long.

        `holds`: it holds its place. `other_waits`: this drone waits, and lets it pass.
        `other_layer`: this drone's layer.
        """
        if self.state is not None and not (self.is_known(now_s) or holds):
            return None
        state, age_s = self.state or ON_PAD, now_s - self._heard_s
        yaw_rad = float(self.start[YAW])
        velocity = frd_to_ned(*state.velocity_ne_m_s, yaw_rad)
        (north_m, east_m), known_s = self._in_own_frame(state.ne_m), min(age_s, SILENT_S)
        sigma_m = math.hypot(state.position_sigma_m, SIGMA_M)
        yaw_off_rad = TURN_SHARE * self._turn_rad_s * known_s
        if not self._is_aligned:
            north_sigma_m, east_sigma_m, yaw_sigma_rad = self._sigma.tolist()
            turned_m = yaw_sigma_rad * math.hypot(*state.ne_m)
            sigma_m = math.hypot(sigma_m, north_sigma_m, east_sigma_m, turned_m)
            yaw_off_rad += 3 * yaw_sigma_rad
        return OtherDrone(
            (north_m + velocity[0] * known_s, east_m + velocity[1] * known_s),
            state.height_m,
            state.yaw_rad + yaw_rad,
            yaw_off_rad,
            sigma_m,
            state.is_flying,
            state.needs_column,
            self._has_right_of_way(state, other_waits, other_layer),
            STOPS_WITHIN_M if age_s > SILENT_S and self.state is not None else 0.0,
        )

    def heard(self, now_s: float, drone: int) -> Heard | None:
        """What it has told of itself; None if its place is unknown. `drone`: its number."""
        state = self.state
        if state is None or not self.is_known(now_s):
            return None
        place, yaw_rad = self._in_own_frame(state.ne_m), state.yaw_rad + float(self.start[YAW])
        return Heard(drone, place, state.height_m, yaw_rad, state.phase, state.battery)

    def _has_right_of_way(self, state: State, other_waits: bool, other_layer: int | None) -> bool:
        """True if the other drone lets it pass below: the one in the higher layer climbs less."""
        if state.layer is not None and other_layer is not None and state.layer != other_layer:
            return state.layer < other_layer
        return other_waits if state.waits != other_waits else self._comes_first

    def layer_claim(self, now_s: float) -> LayerClaim | None:
        """Its layer; None if it has none, has only extras left, or is not heard any more."""
        state = self.state
        if state is None or not self.is_heard(now_s) or not self.is_credible:
            return None
        if state.layer is None or state.is_extra:
            return None
        return LayerClaim(state.layer, self._comes_first)

    def flown_ne_m(self, layer: int) -> Array:
        """(n, 2): places of a layer that it has flown over."""
        grid = self.grid(layer)
        return centres(grid, grid.flown)

    @property
    def layers_seen(self) -> tuple[int, ...]:
        """Layers of which it knows that they were seen."""
        return self.state.layers_seen if self.state and self.is_credible else ()

    def doorway_claim(self, now_s: float, layer: int) -> DoorwayClaim | None:
        """Its doorway; None without one, in another layer, or if it is not heard any more."""
        state = self.state
        if state is None or not self.is_heard(now_s) or not self.is_credible:
            return None
        if state.doorway_ne_m is None or state.layer not in (None, layer):
            return None
        middle, here = map(self._in_own_frame, (state.doorway_ne_m, state.ne_m))
        return DoorwayClaim(middle, here, self._comes_first, state.layer is None)

    def claim(self, now_s: float, layer: int) -> Claim | None:
        """What it goes to look at in a layer; None if nothing, or if it is not heard any more."""
        state = self.state
        if state is None or not self.is_heard(now_s) or not self.is_credible:
            return None
        if not state.target or state.layer != layer:
            return None
        places = tuple(self._in_own_frame(place) for place in state.target)
        left_s = max(state.arrives_in_s - (now_s - self._heard_s), 0.0)
        from_ne_m = self._in_own_frame(state.ne_m)
        return Claim(places, left_s, state.is_extra, self._comes_first, from_ne_m)

    def explorer_ne_m(self, now_s: float) -> Vector2 | None:
        """Where it is; None unless it explores, and has more to do than extras."""
        state = self.state
        if state is None or not self.is_heard(now_s) or not self.is_credible:
            return None
        explores = state.is_flying and state.layer is not None and not state.waits
        return self._in_own_frame(state.ne_m) if explores and not state.is_extra else None

    def tracing(self, now_s: float) -> Tracing | None:
        """Its round of the room; None if it traces none."""
        track, state = self._track, self.state
        if track is None or state is None or not self.is_credible:
            return None
        return Tracing(
            self._in_own_frame(state.ne_m),
            None if track.wall_rad is None else track.wall_rad + float(self.start[YAW]),
            track.side,
            state.is_flying and self.is_known(now_s),
            track.is_tracing and state.is_flying and self.is_heard(now_s),
            places_moved_to(self.start, self._track_places),
            self._comes_first,
        )

    def _in_own_frame(self, ne_m: Vector2) -> Vector2:
        north_m, east_m, yaw_rad = self.start.tolist()
        return moved((north_m, east_m), ne_m, yaw_rad)

    def _placed_keyframes(self) -> Array:
        """(k, 3): its keyframes in this drone's frame."""
        return poses_moved_to(self.start, self._keyframes)


def _new_grid() -> RedrawnGrid:
    return RedrawnGrid(moved_m=MOVED_M, rays_per_stage=RAYS_PER_STAGE)
