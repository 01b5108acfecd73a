"""Holds what a new flight of a survey knows from the flights before it, and writes it as bytes.

The bytes go into the flight's recording, so that it can be replayed without the other flights.
"""

import io
import math
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
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
from companion.pdps.room_scan_state import RoomScan, ScanPhase
from companion.pdps.viewpoints import Viewpoint

_WALLS, _SPACE = "walls.", "space."
"""Prefixes of the arrays' names."""


@dataclass(frozen=True, slots=True)
class EarlierFlights:
    """The map of earlier flights, in the frame of the survey: that of the first flight."""

    walls: EarlierWalls
    space: Occupancy
    """Free and occupied space at the height of flight."""
    tried: tuple[Places, ...] = ()
    """Targets of the looks so far: a target that was never seen is dropped after some looks."""

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

    def begin(self) -> FlightState:
        """The state in which the next flight begins. It explores what is left of a room, too."""
        looked = tuple(Viewpoint(START_NE_M, places) for places in self.tried)
        return FlightState(room=RoomScan(ScanPhase.BLOCKED), building=Explore(tried=looked))

    def to_bytes(self) -> bytes:
        """All content, lossless: a NumPy archive."""
        arrays: dict[str, Any] = places_as_arrays(self.tried)
        arrays |= {f"{_WALLS}{each.name}": getattr(self.walls, each.name) for each in _OF_WALLS}
        arrays |= {f"{_SPACE}{name}": array for name, array in self.space.arrays().items()}
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
                names = [name for name in archive.files if name.startswith(_SPACE)]
                space = Occupancy.of_arrays({n.removeprefix(_SPACE): archive[n] for n in names})
                return cls(walls, space, places_of_arrays(archive))
        except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile) as error:
            raise SurveyError(f"the map of earlier flights is not readable: {error!r}") from None


_OF_WALLS = fields(EarlierWalls)


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
