"""Reads a campaign file: which flights to fly.

limit_s = 3600                  # a flight that takes longer is lost
memory_mb = 4000                # of each process on this machine; default: an equal share

[vary]                          # every combination of these is flown
world = ["paper", "random_7"]   # sets and names as for `sitl bench missions`
seed = { from = 1, to = 15 }    # whole numbers
clutter = [0.0, 0.5]
team = 2                        # one value for all
"mission.speed_m_s" = [0.5, 1]  # any key of the companion's configuration

[draw]                          # instead of every combination: so many, drawn at random
flights = 2000
seed = 1
"""

import itertools
import random
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from companion.config.settings import Config
from companion.core.errors import CompanionError
from companion.core.textfile import NotTextError, read_text, reason
from sitl.bench.sets import places
from sitl.campaign.flight import BEAM, PARAMETER, CampaignFlight, Options
from sitl.core.errors import SitlError, error_line
from sitl.sensors.beam import BeamPhysics
from sitl.world.format import WorldError

MAX_FLIGHTS = 1_000_000
"""Most flights of a campaign. Chosen."""
TRIES_PER_FLIGHT = 100
"""Draws for each flight, until one differs from those before. Chosen."""

CHECKED = ("world", "seed", "clutter_seed")
"""Settings whose values need no further check."""

Scalar = bool | int | float | str


class CampaignFileError(SitlError, ValueError):
    """A campaign file is invalid; the text names key and value."""


class Range(BaseModel):
    """From one number to another. Drawn at random; whole numbers also in combinations."""

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)

    begin: int | float = Field(alias="from")
    end: int | float = Field(alias="to")

    @property
    def is_whole(self) -> bool:
        return isinstance(self.begin, int) and isinstance(self.end, int)

    def drawn(self, source: random.Random) -> int | float:
        if self.is_whole:
            return source.randint(int(self.begin), int(self.end))
        return source.uniform(self.begin, self.end)


class Draw(BaseModel):
    """How many flights are drawn, and by which seed."""

    model_config = ConfigDict(frozen=True, extra="forbid")

    flights: int = Field(ge=1, le=MAX_FLIGHTS)
    seed: int = 1


class _File(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    limit_s: float = Field(3600.0, gt=0)
    memory_mb: int | None = Field(None, ge=100)
    vary: dict[str, Scalar | Range | list[Scalar]] = Field(default_factory=dict)
    draw: Draw | None = None


@dataclass(frozen=True, slots=True)
class Campaign:
    """The flights of a campaign."""

    flights: tuple[CampaignFlight, ...]
    varied: tuple[str, ...]
    """Settings that differ between flights."""
    limit_s: float
    memory_mb: int | None


def load_campaign(path: Path) -> Campaign:
    """Read and check a campaign file.

    Raises:
        CampaignFileError: the file cannot be read, or a key or value is invalid.
    """
    try:
        file = _File.model_validate(tomllib.loads(read_text(path)))
    except (OSError, NotTextError) as error:
        raise CampaignFileError(f"{path}: {reason(error)}") from error
    except ValidationError as error:
        raise CampaignFileError(f"{path}: {error_line(error)}") from error
    except (ValueError, RecursionError) as error:  # also from huge numbers and deep nesting
        raise CampaignFileError(f"{path}: not TOML: {error}") from error
    try:
        axes = {key: _values(key, value, file.draw) for key, value in file.vary.items()}
        settings = _drawn(axes, file.draw) if file.draw else _combined(axes)
        flights = tuple(CampaignFlight(each) for each in settings)
        _check(axes, flights[0])
    except (SitlError, CompanionError, WorldError) as error:
        raise CampaignFileError(f"{path}: {error}") from error
    except ValidationError as error:
        raise CampaignFileError(f"{path}: {error_line(error)}") from error
    varied = tuple(key for key in axes if len({str(each.settings[key]) for each in flights}) > 1)
    return Campaign(flights, varied, file.limit_s, file.memory_mb)


def _values(
    key: str, value: Scalar | Range | list[Scalar], draw: Draw | None
) -> list[Scalar] | Range:
    """The values of a setting to combine, or the range to draw from."""
    _check_key(key)
    if isinstance(value, Range):
        if value.begin > value.end:
            raise CampaignFileError(f"{key}: from {value.begin} is more than to {value.end}")
        if draw:
            return value
        if not value.is_whole:
            raise CampaignFileError(
                f"{key}: a range of fractions can only be drawn; add [draw] flights, or give a list"
            )
        return list(range(int(value.begin), int(value.end) + 1))
    values = value if isinstance(value, list) else [value]
    if not values:
        raise CampaignFileError(f"{key} = []: needs at least one value")
    if key == "world":
        return [world for name in values for world in _worlds(str(name))]
    return values


def _worlds(name: str) -> list[Scalar]:
    """The worlds of a set, the plans of a folder, or one world."""
    return list(dict.fromkeys(world for world, _ in places(name)))


def _check_key(key: str) -> None:
    if key in Options.model_fields or key.startswith(PARAMETER):
        return
    section, _, name = key.partition(".")
    if f"{section}." == BEAM and name in BeamPhysics.model_fields:
        return
    if section in Config.model_fields and name:
        return
    known = ", ".join(Options.model_fields)
    raise CampaignFileError(
        f"{key}: no such setting; known are {known}, beam.* and param.*, and the keys of "
        "docs/config-reference.md"
    )


def _combined(axes: Mapping[str, list[Scalar] | Range]) -> Iterator[dict[str, object]]:
    lists = [axis for axis in axes.values() if isinstance(axis, list)]
    number = 1
    for each in lists:
        number *= len(each)
    if number > MAX_FLIGHTS:
        raise CampaignFileError(f"{number} combinations: at most {MAX_FLIGHTS}; use [draw]")
    for values in itertools.product(*lists):
        yield dict(zip(axes, values, strict=True))


def _drawn(axes: Mapping[str, list[Scalar] | Range], draw: Draw) -> list[dict[str, object]]:
    """So many flights, no two of them equal."""
    source = random.Random(draw.seed)
    found: dict[str, dict[str, object]] = {}
    for _ in range(TRIES_PER_FLIGHT * draw.flights):
        settings: dict[str, object] = {
            key: axis.drawn(source) if isinstance(axis, Range) else source.choice(axis)
            for key, axis in axes.items()
        }
        found.setdefault(str(settings), settings)
        if len(found) == draw.flights:
            return list(found.values())
    raise CampaignFileError(
        f"*: only {len(found)} different flights were drawn, {draw.flights} are wanted; "
        "vary more, for example seed = { from = 1, to = 1000000 }"
    )


def _check(axes: Mapping[str, list[Scalar] | Range], first: CampaignFlight) -> None:
    """Check each value in the first flight; a bad combination becomes the row of its flights."""
    first.check()
    for key, axis in axes.items():
        ends = axis[1:] if isinstance(axis, list) else [axis.begin, axis.end]
        for value in ends if key not in CHECKED else []:
            CampaignFlight({**first.settings, key: value}).check()
