"""Chooses what this drone tells its teammates, and when, within a limit of bytes per second.

    State, WallLines, Keyframes, Track   at their intervals; a lost one is replaced by the next
    LowCeilings                          likewise
    MapPiece                             in order; repeated until every teammate has it

So losses, delays and partitions of the radio cost time, and a drone that joins late gets all.
"""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np

from companion.core.arrays import Array
from companion.core.known_walls import KnownWalls
from companion.core.values import value
from companion.mapping.redrawn_grid import RedrawnGrid
from companion.team.messages import (
    Body,
    Keyframes,
    LowCeilings,
    MapPiece,
    State,
    Track,
    WallLines,
    pack_floats,
    pack_rays,
)

STATE_PERIOD_S, WALLS_PERIOD_S, KEYFRAMES_PERIOD_S, TRACK_PERIOD_S = 0.2, 2.0, 1.0, 0.5
LOW_PERIOD_S = 4.0
"""Intervals of the messages, s. Chosen."""
RAYS_PER_PIECE = 160
"""Rays of a map piece: two seconds of four beams, 2 kB. Chosen."""
KEYFRAMES_PER_BLOCK = 100
"""Keyframes of a block, 1.2 kB. Chosen."""
MAX_KEYFRAMES_PER_PIECE = 300
"""A drone that stands still for longer than so many keyframes begins a new piece. Chosen."""
MAX_WALLS, MAX_LOW = 400, 400
"""Most walls, and places where something hangs low, that are told. Chosen."""
PIECES_BYTES_PER_S = 10_000.0
"""Limit of the map pieces, bytes/s. Chosen: with the other messages 16 kB/s."""
BURST_BYTES = 6_000.0
"""Map pieces sent at once, bytes. Chosen."""
REPEAT_S = 1.0
"""A map piece is not repeated sooner, s. Chosen: longer than the way to a teammate and back."""


@value
class OwnMap:
    """The map of this drone, in its frame."""

    spaces: Sequence[RedrawnGrid]
    """Of each layer, from the lowest."""
    layer: int
    """The layer in which it flies."""
    keyframes: Array
    """(k, 3): north, east, yaw."""
    walls: Callable[[], KnownWalls]
    """Returns its walls; called only when they are needed."""
    track: Callable[[], Track] | None
    """Returns its round of the room; None in other missions."""
    low: Callable[[], Array] | None = None
    """Returns places (n, 3) with the height of what hangs there, as `Overhead.heights`; None in
    missions without layers."""


class Sharing:
    """The messages of one drone."""

    def __init__(self) -> None:
        self._state_s = self._walls_s = self._keyframes_s = self._track_s = -math.inf
        self._low_s = -math.inf
        self._next_block = 0
        self._pieces: list[tuple[int, int, int]] = []
        """Layer, first ray and number of rays of each piece."""
        self._cut_to: dict[int, int] = {}
        """Number of rays of each layer that are in pieces."""
        self._sent_s: list[float] = []
        """Time when each piece was sent last, s."""
        self._budget_bytes = 0.0
        self._last_s = 0.0

    def due(
        self,
        now_s: float,
        state: Callable[[], State],
        own: OwnMap,
        arrived: Mapping[int, int],
    ) -> Iterator[Body]:
        """Messages to send now. `arrived`: number of pieces that each teammate in range has."""
        if now_s - self._state_s >= STATE_PERIOD_S:
            self._state_s = now_s
            yield state()
        if now_s - self._walls_s >= WALLS_PERIOD_S:
            self._walls_s = now_s
            yield _wall_lines(own.walls())
        if now_s - self._keyframes_s >= KEYFRAMES_PERIOD_S and len(own.keyframes):
            self._keyframes_s = now_s
            yield self._block(own.keyframes)
        if now_s - self._track_s >= TRACK_PERIOD_S and own.track is not None:
            self._track_s = now_s
            yield own.track()
        if now_s - self._low_s >= LOW_PERIOD_S and own.low is not None:
            self._low_s = now_s
            low = own.low()
            yield LowCeilings(pack_floats(low[np.argsort(low[:, 2])[:MAX_LOW]]))
        self._cut(own)
        yield from self._due_pieces(now_s, own, arrived)

    def _block(self, keyframes: Array) -> Keyframes:
        """The next block of the trajectory; after the last one, the first."""
        first = self._next_block if self._next_block < len(keyframes) else 0
        self._next_block = first + KEYFRAMES_PER_BLOCK
        return Keyframes(first, pack_floats(keyframes[first : self._next_block]))

    def _cut(self, own: OwnMap) -> None:
        """Cut new rays into pieces; in the present layer the rest waits until there are enough."""
        for layer in sorted(range(len(own.spaces)), key=own.layer.__eq__):
            space, least = own.spaces[layer], RAYS_PER_PIECE if layer == own.layer else 1
            while space.ray_count >= (first := self._cut_to.get(layer, 0)) + least:
                most = min(RAYS_PER_PIECE, space.ray_count - first)
                keyframe = space.rays_from(first, most)[:, 0]
                count = int(np.searchsorted(keyframe, keyframe[0] + MAX_KEYFRAMES_PER_PIECE))
                self._pieces.append((layer, first, count))
                self._cut_to[layer] = first + count
                self._sent_s.append(-math.inf)

    def _due_pieces(
        self, now_s: float, own: OwnMap, arrived: Mapping[int, int]
    ) -> Iterator[MapPiece]:
        """Pieces that a teammate misses, oldest first."""
        earned_bytes = PIECES_BYTES_PER_S * (now_s - self._last_s)
        self._budget_bytes = min(self._budget_bytes + earned_bytes, BURST_BYTES)
        self._last_s = now_s
        for number in range(min(arrived.values(), default=len(self._pieces)), len(self._pieces)):
            if self._budget_bytes < 0:
                return
            if now_s - self._sent_s[number] < REPEAT_S:
                continue
            piece = self._piece(number, own)
            self._sent_s[number] = now_s
            self._budget_bytes -= len(piece.rays) + len(piece.poses)
            yield piece

    def _piece(self, number: int, own: OwnMap) -> MapPiece:
        """A piece with the keyframes of its rays."""
        layer, first_ray, count = self._pieces[number]
        rays = own.spaces[layer].rays_from(first_ray, count)
        first, last = int(rays[0, 0]), int(rays[-1, 0])
        poses = own.keyframes[first : last + 1]
        return MapPiece(number, first, pack_floats(poses), pack_rays(rays, first), layer)


def _wall_lines(walls: KnownWalls) -> WallLines:
    north, east = walls.normals.T
    rows = [np.arctan2(east, north), walls.offsets_m, *walls.reach_m.T, walls.sigmas_m]
    return WallLines(pack_floats(np.column_stack(rows)[:MAX_WALLS]))
