"""A drone's view of its team: what it hears, what it tells, and what follows for its flight.

    packets ─► checked ─► Teammate ─► places of the others   ─► separation, masking of beams
                             │      ─► what they go to see   ─► choice of the next viewpoint
                             │      ─► space that they saw   ─► planning
    own pose, map, target ─► Sharing ─► packets

There is no leader. What a teammate says changes where this drone goes. It never makes this drone
enter space that its own sensors have not measured.
"""

import math
from collections import defaultdict
from collections.abc import Callable, Iterator, Sequence
from itertools import chain
from typing import TypedDict

import numpy as np

from companion.config.team import MAX_DRONES, TeamConfig
from companion.core.arrays import Array
from companion.core.frames import Vector2
from companion.core.known_walls import KnownWalls
from companion.estimation.smoothing.state import Unknowns
from companion.mapping.joined_grid import JoinedGrid
from companion.mapping.occupancy import Occupancy
from companion.navigation.observation import Claim, DoorwayClaim, TeamLayers, Tracing
from companion.safety.separation import KeepOut, OtherDrone
from companion.team.messages import (
    Keyframes,
    LowCeilings,
    MapPiece,
    OtherVersionError,
    Packet,
    PacketError,
    State,
    Track,
    WallLines,
    decode,
    encode,
)
from companion.team.pads import pad_sigma, relative_pad
from companion.team.sharing import OwnMap, Sharing
from companion.team.silence import Right, must_land, reached, right_to_move
from companion.team.teammate import Heard, Teammate


class TeamView(TypedDict, total=False):
    """Fields of an `Observation`."""

    is_in_team: bool
    explorers_ne_m: tuple[Vector2, ...]
    claims: tuple[Claim, ...]
    tracings: tuple[Tracing, ...]
    doorway_claims: tuple[DoorwayClaim, ...]
    keep_outs: tuple[KeepOut, ...]
    goes_home: bool
    waits_for_radio: bool
    home_by_s: float
    is_contradicted: bool
    team_layers: TeamLayers


class Team:
    """All teammates of this drone."""

    def __init__(self, config: TeamConfig, turn_rad_s: float, instance: int = 0) -> None:
        """`turn_rad_s`: rate of the turns in the mission, which is the same for all drones.

        `instance` differs at each start of the program.
        """
        self._config = config
        self._turn_rad_s = turn_rad_s
        self._instance = instance
        self._sharing = Sharing()
        self._joined: defaultdict[int, JoinedGrid] = defaultdict(JoinedGrid)
        """Of each layer."""
        self._sent = 0
        self.dropped = 0
        """Number of packets that could not be used."""
        self.notice = ""
        """What the pilot should know of the team; the latest."""
        self._mates = {
            drone: self._new_mate(drone)
            for drone in range(1, len(config.pads) + 1)
            if drone != config.drone
        }
        self._doubles: dict[tuple[int, int], Teammate] = {}
        """Drones with the number of another one, by number and instance."""

    def _new_mate(self, drone: int) -> Teammate:
        config = self._config
        own, pad = config.pads[config.drone - 1], config.pads[drone - 1]
        sigma = math.sqrt(2) * pad_sigma(config)
        first = drone < config.drone
        return Teammate(relative_pad(own, pad), sigma, self._turn_rad_s, comes_first=first)

    def hear(
        self,
        now_s: float,
        packets: Sequence[bytes],
        walls: Callable[[], Unknowns],
        space: Occupancy,
        layer: int = 0,
    ) -> None:
        """Take the packets that have arrived.

        `walls` returns the walls of this drone; `space` is its own grid, of a layer.
        """
        for data in packets:
            try:
                self._take(now_s, decode(data))
            except OtherVersionError as error:
                self.dropped += 1
                if error.team == self._config.name:
                    self.notice = f"team: {error}; install one version on all drones"
            except PacketError:
                self.dropped += 1
        for drone, mate in self._mates.items():
            mate.advance()
            if mate.refine(now_s, walls) and mate.contradicts(space, layer):
                self.notice = (
                    f"team: drone {drone} contradicts this drone's map, so its map is not used; "
                    "is it on its pad?"
                )

    def _take(self, now_s: float, packet: Packet) -> None:
        if packet.team != self._config.name:
            return
        mate = self._sender(now_s, packet)
        if mate.is_outdated(packet):
            return
        match packet.body:
            case State():
                mate.hear_state(now_s, packet.body)
            case WallLines():
                mate.hear_walls(packet.body)
            case MapPiece():
                mate.hear_piece(packet.body)
            case Keyframes():
                mate.hear_keyframes(packet.body)
            case Track():
                mate.hear_track(packet.body)
            case LowCeilings():
                mate.hear_low(packet.body)

    def _sender(self, now_s: float, packet: Packet) -> Teammate:
        """The teammate that sent a packet.

        A restarted program takes its place once the one before has been silent for long enough.
        Until then both are kept: there may be two drones with one number.
        """
        mate = self._mates.get(packet.drone)
        if mate is None and packet.drone != self._config.drone:
            raise PacketError(f"from drone {packet.drone}")
        if mate is not None and (packet.instance == mate.instance or not mate.is_known(now_s)):
            if packet.instance != mate.instance:
                mate.reset(packet.instance)
            return mate
        key = packet.drone, packet.instance
        if key not in self._doubles:
            if len(self._doubles) >= MAX_DRONES:
                raise PacketError(f"{len(self._doubles)} other drones have numbers of this team")
            self._doubles[key] = self._new_mate(packet.drone)
            self._doubles[key].reset(packet.instance)
        self.notice = f"team: two drones have the number {packet.drone}; give each its own"
        return self._doubles[key]

    def others(
        self, now_s: float, *, waits: bool, layer: int | None = None
    ) -> tuple[OtherDrone, ...]:
        """Where the teammates are.

        `waits`: this drone waits, and lets all others pass. `layer`: the layer in which it is.
        """
        holding = self._right_to_move(now_s).others_hold
        everybody = [(drone in holding, mate) for drone, mate in self._mates.items()]
        everybody += [(False, mate) for mate in self._doubles.values()]
        found = (
            mate.drone(now_s, holds=holds, other_waits=waits, other_layer=layer)
            for holds, mate in everybody
        )
        return tuple(each for each in found if each is not None)

    def links(self, now_s: float) -> dict[int, int]:
        """Number of radio links to each teammate that is reached, also through others."""
        told = {
            drone: mate.state.links
            for drone, mate in self._mates.items()
            if mate.state is not None and mate.is_heard(now_s)
        }
        return reached(told, self._config.drone)

    def _right_to_move(self, now_s: float) -> Right:
        """Who moves, if some do not hear each other."""
        silences = {drone: mate.silent(now_s) for drone, mate in self._mates.items()}
        silent = {drone: silence for drone, silence in silences.items() if silence is not None}
        if not silent:
            return Right()
        flying = {drone for drone, mate in self._mates.items() if mate.is_flying}
        return right_to_move(self._config.drone, now_s, silent, flying & self.links(now_s).keys())

    def _is_contradicted(self, now_s: float) -> bool:
        """True if this drone must land because its map contradicts those of others."""
        flying = [
            (drone, mate.is_credible)
            for drone, mate in self._mates.items()
            if mate.is_flying and mate.is_heard(now_s)
        ]
        agree = [drone for drone, is_credible in flying if is_credible]
        contradict = [drone for drone, is_credible in flying if not is_credible]
        return must_land(self._config.drone, agree, contradict)

    def heard(self, now_s: float) -> tuple[Heard, ...]:
        """The teammates whose place is known, in the order of their numbers."""
        heard = (mate.heard(now_s, drone) for drone, mate in self._mates.items())
        return tuple(each for each in heard if each is not None)

    def view(self, now_s: float, layer: int = 0, *, goes_home: bool = False) -> TeamView:
        """What the missions know of the teammates.

        `layer`: the layer in which this drone is. `goes_home`: it has no part of the mission.
        """
        claims = (mate.claim(now_s, layer) for mate in self._mates.values())
        explorers = (mate.explorer_ne_m(now_s) for mate in self._mates.values())
        tracings = (mate.tracing(now_s) for mate in self._mates.values())
        doorways = (mate.doorway_claim(now_s, layer) for mate in self._mates.values())
        right = self._right_to_move(now_s)
        return TeamView(
            is_in_team=any(mate.pieces for mate in self._credible),
            explorers_ne_m=tuple(each for each in explorers if each is not None),
            claims=tuple(each for each in claims if each is not None),
            tracings=tuple(each for each in tracings if each is not None),
            doorway_claims=tuple(each for each in doorways if each is not None),
            goes_home=goes_home,
            waits_for_radio=right.holds,
            home_by_s=right.home_by_s,
            is_contradicted=self._is_contradicted(now_s),
        )

    def layers(self, now_s: float, space: Callable[[int], Occupancy]) -> TeamLayers:
        """What is known of the layers. `space` returns the joined map of one."""
        claims = (mate.layer_claim(now_s) for mate in self._mates.values())
        seen = (mate.layers_seen for mate in self._mates.values())
        return TeamLayers(
            tuple(each for each in claims if each is not None),
            frozenset(chain.from_iterable(seen)),
            space,
            self._flown_ne_m,
        )

    def _flown_ne_m(self, layer: int) -> Array:
        """(n, 2): places of a layer that the teammates have flown over."""
        flown = (mate.flown_ne_m(layer) for mate in self._credible)
        return np.vstack([np.empty((0, 2)), *flown])

    def with_measured(self, known: KnownWalls, walls: Unknowns) -> KnownWalls:
        """The walls of this drone as the joint map will know them.

        What teammates have measured is not measured again. `walls`: the same, for matching.
        """
        for mate in self._mates.values():
            known = known.with_measured(mate.measured_m(walls))
        return known

    @property
    def _credible(self) -> list[Teammate]:
        return [mate for mate in self._mates.values() if mate.is_credible]

    def joined(self, grid: Occupancy, layer: int = 0) -> Occupancy:
        """A grid with the space of its layer that the teammates have seen."""
        return self._joined[layer].of(grid, [mate.grid(layer) for mate in self._credible])

    def low_ne_m(self, height_m: float) -> tuple[Vector2, ...]:
        """Places where a teammate has measured something that hangs lower than this."""
        return tuple(chain.from_iterable(mate.low_ne_m(height_m) for mate in self._credible))

    @property
    def received(self) -> dict[int, int]:
        """Number of map pieces that have arrived from each teammate."""
        return {drone: mate.pieces for drone, mate in self._mates.items()}

    def tell(self, now_s: float, state: Callable[[], State], own: OwnMap) -> tuple[bytes, ...]:
        """The packets to send now."""
        return tuple(self._packets(now_s, state, own))

    def _packets(self, now_s: float, state: Callable[[], State], own: OwnMap) -> Iterator[bytes]:
        arrived = {
            drone: mate.state.received.get(self._config.drone, 0)
            for drone, mate in self._mates.items()
            if mate.state is not None and mate.is_heard(now_s)
        }
        for body in self._sharing.due(now_s, state, own, arrived):
            packet = Packet(self._config.name, self._config.drone, self._instance, self._sent, body)
            self._sent += 1
            yield encode(packet)
