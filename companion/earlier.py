"""Holds what a new flight of a survey knows from the flights before it, and writes it as bytes.

The bytes go into the flight's recording, so that it can be replayed without the other flights.
"""

import io
import math
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields
from itertools import zip_longest
from typing import Any

import numpy as np

from companion.core.arrays import Array, Indices
from companion.core.errors import SurveyError
from companion.core.messages import WallSegment
from companion.estimation.smoothing.estimate import EarlierWalls
from companion.estimation.smoothing.state import place_on
from companion.mapping.occupancy import Occupancy
from companion.navigation.grid_planner import START_NE_M
from companion.pdps.explore import Explore
from companion.pdps.flight.state import FlightState
from companion.pdps.frontiers import Places
from companion.pdps.layers import Layers
from companion.pdps.room_scan_state import RoomScan, ScanPhase
from companion.pdps.viewpoints import Viewpoint

_WALLS, _SPACE, TRIED = "walls.", "space.", "tried."
"""Prefixes of the arrays' names."""
_OVERHEAD, _PAD = "overhead", "pad"
SURVEY_PAD: Array = np.zeros(3)
"""The pad on which the first flight of a survey began: it defines the frame of the survey."""


@dataclass(frozen=True, slots=True)
class EarlierFlights:
    """The map of earlier flights, in the frame of the pad on which the next flight begins."""

    walls: EarlierWalls
    spaces: tuple[Occupancy, ...]
    """Free and occupied space of each layer, from the lowest, at its height of flight."""
    tried: tuple[tuple[Places, ...], ...] = ()
    """Targets of the looks in each layer: one that was never seen is dropped after some looks."""
    overhead: Array = field(default_factory=lambda: np.empty((0, 4)))
    """(n, 4), m: readings of the up beam, as in `Overhead.readings`."""
    pad: Array = field(default_factory=SURVEY_PAD.copy)
    """(3,): the pad in the frame of the survey, as north, east, m, and heading, rad."""

    def segments(self) -> tuple[WallSegment, ...]:
        """The walls from their first to their last hit, for display."""
        lines, reach_m, covariance = self.walls.walls, self.walls.reach_m, self.walls.covariance
        segments = []
        for wall, (low_m, high_m) in enumerate(reach_m.tolist()):
            start, end = (place_on(lines[wall], along_m) for along_m in (low_m, high_m))
            own = slice(2 * wall, 2 * wall + 2)
            across = np.array(
                [-(low_m + high_m) / 2, 1.0]
            )  # of direction and offset, at its middle
            variance_m2 = float(across @ covariance[own, own] @ across)
            direction_rad = math.sqrt(covariance[2 * wall, 2 * wall])
            segments.append(WallSegment(start, end, math.sqrt(variance_m2), 0, direction_rad))
        return tuple(segments)

    @property
    def viewpoints(self) -> tuple[tuple[Viewpoint, ...], ...]:
        """The looks in each layer of `spaces`."""
        by_layer = zip_longest(self.spaces, self.tried, fillvalue=())
        return tuple(
            tuple(Viewpoint(START_NE_M, places) for places in tried) for _, tried in by_layer
        )

    def begin(self) -> FlightState:
        """The state in which the next flight begins. It explores what is left of a room, too."""
        looked = self.viewpoints
        return FlightState(
            room=RoomScan(ScanPhase.BLOCKED),
            building=Explore(tried=looked[0]),
            layers=Layers.on(0, looked),
        )

    def to_bytes(self) -> bytes:
        """All content, lossless: a NumPy archive."""
        arrays: dict[str, Any] = {_OVERHEAD: self.overhead, _PAD: self.pad}
        arrays |= {f"{_WALLS}{each.name}": getattr(self.walls, each.name) for each in _OF_WALLS}
        arrays |= layers_as_arrays(_SPACE, [space.arrays() for space in self.spaces])
        arrays |= layers_as_arrays(TRIED, [places_as_arrays(layer) for layer in self.tried])
        file = io.BytesIO()
        np.savez_compressed(file, **arrays)
        return file.getvalue()

    @classmethod
    def from_bytes(cls, data: bytes) -> "EarlierFlights":
        """Read what `to_bytes` wrote.

        Raises:
            SurveyError: it is damaged, or from another version.
        """
        try:
            with np.load(io.BytesIO(data), allow_pickle=False) as archive:
                walls = EarlierWalls(*(archive[f"{_WALLS}{each.name}"] for each in _OF_WALLS))
                spaces, tried = layers_of_arrays(_SPACE, archive), layers_of_arrays(TRIED, archive)
                return cls(
                    walls,
                    tuple(Occupancy.of_arrays(arrays) for arrays in spaces),
                    tuple(places_of_arrays(arrays) for arrays in tried),
                    archive[_OVERHEAD],
                    archive.get(_PAD, SURVEY_PAD),  # not in old recordings
                )
        except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
            raise SurveyError(f"the map of earlier flights is not readable: {error!r}") from None


_OF_WALLS = fields(EarlierWalls)


def layers_as_arrays(prefix: str, layers: Sequence[Mapping[str, Any]]) -> dict[str, Any]:
    """The arrays of all layers under one name each: prefix, number of the layer, own name."""
    return {
        f"{prefix}{number}.{name}": array
        for number, arrays in enumerate(layers)
        for name, array in arrays.items()
    }


def layers_of_arrays(prefix: str, arrays: Mapping[str, Any]) -> list[dict[str, Any]]:
    """The layers that `layers_as_arrays` wrote."""
    layers: dict[int, dict[str, Any]] = {}
    for name in arrays:
        if name.startswith(prefix):
            number, _, own = name.removeprefix(prefix).partition(".")
            layers.setdefault(int(number), {})[own] = arrays[name]
    return [layers[number] for number in sorted(layers)]


def places_as_arrays(tried: Sequence[Places]) -> dict[str, Array | Indices]:
    """Groups of places, such as the targets of looks, as arrays by name."""
    return {
        "tried_sizes": np.array([len(places) for places in tried], dtype=np.int64),
        "tried": np.array([place for places in tried for place in places]).reshape(-1, 2),
    }


def places_of_arrays(arrays: Mapping[str, Any]) -> tuple[Places, ...]:
    """The groups that `places_as_arrays` wrote."""
    all_ne_m, ends = arrays["tried"], np.cumsum(arrays["tried_sizes"])[:-1]
    return tuple(
        tuple((north_m, east_m) for north_m, east_m in group.tolist())
        for group in np.split(all_ne_m, ends)
        if len(group)
    )
