"""Keeps a survey in a folder: the recordings of its flights, one index, and the joint map.

    DIR/survey.json       the pad, the flights in the map, and those that do not fit, with reasons
    DIR/flight_*.mcap     one recording for each flight
    DIR/solved/*.npz      each flight solved alone; made again when missing or outdated
    DIR/earlier.npz       what the next flight knows; made again when it is missing or outdated
    DIR/map.json ...      the joint map

A flight belongs to the survey when its recording is in the folder. To remove a flight, delete its
recording: the map is made again without it.
"""

import json
import math
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError
from pydantic.dataclasses import dataclass as checked

from companion.config.team import PadConfig, TeamConfig
from companion.core.arrays import Array
from companion.core.errors import CompanionError, SurveyError
from companion.core.textfile import NotTextError, read_text, reason
from companion.drivers.models import level_units, range_models
from companion.earlier import SURVEY_PAD, EarlierFlights
from companion.export.map_files import save, save_as
from companion.recording.reader import Recording, read
from companion.survey.flights import Flown
from companion.survey.merge import Merged, Starts, merge
from companion.survey.pad import PAD_SIGMA_DEG, PAD_SIGMA_M
from companion.survey.solved import is_kept, kept_or_solved
from companion.survey.team_starts import check_same_team, pad_of, team_sigma, team_starts
from companion.team.pads import relative_pad

Tell = Callable[[str], None]
"""Prints a line of progress."""


@checked(frozen=True, slots=True, config={"extra": "forbid"})
class Pad:
    """How exactly the flights begin on the same pad, as standard deviations."""

    sigma_m: Annotated[float, Field(gt=0, le=1)] = PAD_SIGMA_M
    """On each axis, m."""
    sigma_deg: Annotated[float, Field(gt=0, le=20)] = PAD_SIGMA_DEG
    """Of the heading, °."""

    @property
    def sigma(self) -> Array:
        """(3,): north, east, m, and heading, rad."""
        return np.array([self.sigma_m, self.sigma_m, math.radians(self.sigma_deg)])


@checked(frozen=True, slots=True, config={"extra": "forbid"})
class Index:
    """Content of `survey.json`."""

    pad: Pad = Pad()
    merged: tuple[str, ...] = ()
    """Recordings in the joint map, by name."""
    left_out: dict[str, str] = Field(default_factory=dict)
    """Recordings that are not in it, with reasons."""
    frame: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Pad of its first flight: `north_m`, `east_m` and `heading_deg` in `team.pads`."""

    @property
    def known(self) -> set[str]:
        """Names of all recordings that the joint map takes into account."""
        return {*self.merged, *self.left_out}


@dataclass(frozen=True, slots=True)
class SurveyMap:
    """The joint map, and the recordings of its flights in the order of `merged.flights`."""

    merged: Merged
    recordings: tuple[Recording, ...]
    earlier: EarlierFlights
    """What the next flight has to know."""


class Survey:
    """A survey on the disk; the folder is made with the first file."""

    def __init__(self, folder: Path, tell: Tell, team: TeamConfig | None = None) -> None:
        """Read the index. `team`: that of the drone that flies next, if one does.

        Raises:
            SurveyError: the index is damaged, or a value in it is invalid.
        """
        self.folder = folder
        self.index = _read_index(folder / "survey.json")
        self._tell, self._team = tell, team

    @property
    def files(self) -> list[Path]:
        """All recordings in the folder, in the order of their names, which contain the time."""
        return sorted(self.folder.glob("*.mcap"))

    def earlier(self) -> EarlierFlights | None:
        """What the next flight has to know; None before the first flight.

        Raises:
            CompanionError: the flights cannot be made into one map, or it cannot be saved.
        """
        path = self.folder / "earlier.npz"
        if path.exists() and self.index.known == {file.name for file in self.files}:
            try:
                earlier = EarlierFlights.from_bytes(path.read_bytes())
            except (OSError, SurveyError) as error:
                self._tell(f"{path}: {error}; it is made again")
            else:
                if np.array_equal(earlier.pad, self._next_pad(self.index.frame)):
                    return earlier
        joint = self.make_map()
        return joint.earlier if joint else None

    def _next_pad(self, frame: tuple[float, float, float]) -> Array:
        """(3,): the pad of the drone that flies next, in a frame as in `Index.frame`.

        One that flies alone begins where the first flight began.
        """
        if self._team is None or not self._team.name:
            return SURVEY_PAD
        north_m, east_m, heading_deg = frame
        first = PadConfig(north_m=north_m, east_m=east_m, heading_deg=heading_deg)
        return relative_pad(first, pad_of(self._team))

    def make_map(self) -> SurveyMap | None:
        """Solve all flights together, and save the joint map; None without a flight.

        Raises:
            CompanionError: the flights cannot be made into one map, or it cannot be saved.
        """
        left_out: dict[str, str] = {}
        recordings, flown = self._flown(left_out)
        if not flown:
            return None
        self._tell(f"solving {len(flown)} flights together")
        used = [recordings[each.name] for each in flown]
        check_same_team(used)
        sigma = np.maximum(self.index.pad.sigma, team_sigma(used))
        merged = merge(flown, Starts(sigma, team_starts(used)))
        left_out |= {each.name: each.reason for each in merged.left_out}
        names = tuple(flight.name for flight in merged.flights)
        first = pad_of(used[0].config.team)
        frame = first.north_m, first.east_m, first.heading_deg
        earlier = merged.for_next_flight(sigma, self._next_pad(frame))
        data = earlier.to_bytes()
        save(merged.plan, self.folder)
        save_as(lambda data, path: path.write_bytes(data), data, self.folder / "earlier.npz")
        self.index = Index(self.index.pad, names, left_out, frame)
        save_as(_write_index, self.index, self.folder / "survey.json")
        return SurveyMap(merged, tuple(recordings[name] for name in names), earlier)

    def _flown(self, left_out: dict[str, str]) -> tuple[dict[str, Recording], list[Flown]]:
        """All flights, each solved alone; `left_out` receives those that cannot be used."""
        recordings: dict[str, Recording] = {}
        for file in self.files:
            try:
                recordings[file.name] = read(file)
            except CompanionError as error:
                left_out[file.name] = str(error)
        for recording in list(recordings.values()):
            if recordings.pop(recording.continues, None):
                left_out[recording.continues] = f"{recording.path.name} continues it"
        check_same_sensors(list(recordings.values()))
        flown: list[Flown] = []
        for number, (name, recording) in enumerate(recordings.items(), 1):
            if not is_kept(recording.path, self.folder):
                self._tell(f"solving flight {number} of {len(recordings)}: {name}")
            try:
                flown.append(kept_or_solved(recording, self.folder))
            except SurveyError as error:
                left_out[name] = str(error)
        return recordings, flown


def check_same_sensors(recordings: Sequence[Recording]) -> None:
    """Refuse recordings that do not belong together.

    Wiring and calibration may differ: the recorded readings are calibrated.

    Raises:
        SurveyError: two have sensors of different kinds, or mounted differently.
    """
    for recording in recordings[1:]:
        if _measured_with(recording) != _measured_with(recordings[0]):
            raise SurveyError(
                f"{recording.path}: [sensors] differs from that of {recordings[0].path}; "
                "merge flights with the same kinds of sensors, mounted in the same way"
            )


def _measured_with(recording: Recording) -> tuple[object, ...]:
    sensors = recording.config.sensors
    return range_models(sensors), level_units(sensors)


def _read_index(path: Path) -> Index:
    if not path.exists():
        return Index()
    try:
        return TypeAdapter(Index).validate_json(read_text(path))
    except (OSError, NotTextError) as error:
        raise SurveyError(f"{path}: {reason(error)}") from error
    except ValidationError as error:
        first = error.errors()[0]
        where = ": ".join(filter(None, (str(path), ".".join(str(part) for part in first["loc"]))))
        raise SurveyError(
            f"{where}: {first['msg']}; correct it, or delete the file for the defaults"
        ) from None


def _write_index(index: Index, path: Path) -> None:
    path.write_text(json.dumps(asdict(index), indent=2) + "\n", encoding="utf-8")
