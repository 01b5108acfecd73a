"""Solves the flights of recordings, each alone, and keeps the results in files.

To solve a flight, its recording is replayed. That takes most of the time of a joint map, so the
result is kept in a NumPy archive: in the survey's folder, or in that of a merged map. It is used
again while the recording and the program's version are the same.
"""

import hashlib
import io
import json
import zipfile
from dataclasses import asdict
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np

from companion.drivers.models import level_units
from companion.earlier import (
    TRIED,
    layers_as_arrays,
    layers_of_arrays,
    places_as_arrays,
    places_of_arrays,
)
from companion.estimation.smoothing.factors import Models
from companion.estimation.smoothing.flight_record import FlightRecord
from companion.estimation.smoothing.odometry_model import OdometryModel
from companion.estimation.smoothing.range_noise import RangeUnits
from companion.estimation.smoothing.state import Unknowns
from companion.export.map_files import save_as
from companion.recording.reader import Recording
from companion.recording.replay import replay
from companion.survey.flights import Flown

FOLDER = "solved"
"""Name of the folder for the results."""
_RAYS = "rays."
"""Prefix of the arrays' names."""
_OF_X = ("poses", "walls", "reach_m", "calibration")
"""Arrays of `Unknowns`."""


def kept_or_solved(recording: Recording, folder: Path) -> Flown:
    """The flight of a recording, solved, from a file in a folder.

    If the file is missing or outdated, the recording is replayed and solved.

    Raises:
        SurveyError: the drone did not fly, or the flight cannot be solved.
        CompanionError: the file cannot be written.
    """
    kept = _load(recording, folder)
    if kept is not None:
        return kept
    flown = Flown.of(recording.path.name, replay(recording))
    keep(flown, recording.path, folder)
    return flown


def keep(flown: Flown, recording: Path, folder: Path) -> None:
    """Write a solved flight to a folder.

    Raises:
        CompanionError: the file cannot be written.
    """
    path = kept_at(recording, folder)
    path.parent.mkdir(parents=True, exist_ok=True)
    data = _to_bytes(flown, _made_of(recording))
    save_as(lambda content, file: file.write_bytes(content), data, path)


def is_kept(recording: Path, folder: Path) -> bool:
    """True if a result of this recording is there; it may be outdated."""
    return kept_at(recording, folder).exists()


def kept_at(recording: Path, folder: Path) -> Path:
    """File for the solved flight of a recording."""
    return folder / FOLDER / f"{recording.stem}.npz"


def _made_of(recording: Path) -> dict[str, str]:
    """What a result depends on."""
    with recording.open("rb") as file:
        digest = hashlib.file_digest(file, "sha256").hexdigest()
    return {"version": version("pdps-companion"), "sha256": digest}


def _to_bytes(flown: Flown, made_of: dict[str, str]) -> bytes:
    values = {
        "made_of": made_of,
        "rest_bias_rad_s": flown.models.rest_bias_rad_s,
        "odometry": asdict(flown.models.odometry),
        "knows_earlier_flights": flown.knows_earlier_flights,
        "ceiling_m": flown.ceiling_m,
    }
    arrays: dict[str, Any] = {
        "values": np.array(json.dumps(values)),
        "frames": flown.record.frames,
        "hits": flown.record.hits,
        "wall_of": flown.wall_of,
        **{name: getattr(flown.x, name) for name in _OF_X},
        "overhead": flown.overhead,
        "heights": flown.heights,
        **layers_as_arrays(_RAYS, [{"all": rays} for rays in flown.rays]),
        **layers_as_arrays(TRIED, [places_as_arrays(layer) for layer in flown.tried]),
    }
    file = io.BytesIO()
    np.savez_compressed(file, **arrays)
    return file.getvalue()


def _load(recording: Recording, folder: Path) -> Flown | None:
    """The kept flight; None if there is none, or it is damaged or outdated."""
    try:
        with np.load(kept_at(recording.path, folder), allow_pickle=False) as archive:
            values = json.loads(str(archive["values"]))
            if values["made_of"] != _made_of(recording.path):
                return None
            record = FlightRecord.of_ended_flight(archive["frames"], archive["hits"])
            models = Models(
                RangeUnits(level_units(recording.config.sensors)),
                values["rest_bias_rad_s"],
                odometry=OdometryModel(**values["odometry"]),
            )
            return Flown(
                recording.path.name,
                models,
                record,
                models.measured(record),
                values["knows_earlier_flights"],
                Unknowns(**{each: archive[each] for each in _OF_X}),
                archive["wall_of"],
                tuple(layer["all"] for layer in layers_of_arrays(_RAYS, archive)),
                values["ceiling_m"],
                tuple(places_of_arrays(layer) for layer in layers_of_arrays(TRIED, archive)),
                archive["overhead"],
                archive["heights"],
            )
    except (OSError, ValueError, KeyError, TypeError, zipfile.BadZipFile):
        return None
