"""Reads a mission file: what to fly, and the events during the flight.

    [mission]            # settings as in docs/config.md
    kind = "room"
    speed_m_s = 0.7

    [[events]]           # faults and the pilot, as in docs/testing.md
    when = "scanning"    # or at_s = 20
    do = "link_down"     # or any other action
    for_s = 5            # permanent by default
    # with = "LOITER"    # the action's arguments: one value, a list, or a table of names
    # optional = true    # the flight may end before the event; by default that is an error

A Python file defines the same as `mission`, a dict, and `events`, a list of `sitl.testing` events.
"""

import runpy
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator, validate_call

from companion.core.textfile import read_text
from sitl.core.errors import SitlError, error_line
from sitl.testing.actions.action import Action
from sitl.testing.actions.table import ACTIONS
from sitl.testing.script import Event, at, optional, when

SUFFIXES = (".toml", ".py")


class MissionError(SitlError, ValueError):
    """A mission file is invalid; the text names key and value."""


@dataclass(frozen=True, slots=True)
class MissionFile:
    """A mission as overrides of the companion's configuration, and its events."""

    settings: Mapping[str, object]
    events: tuple[Event, ...] = ()
    file: str | None = None

    @property
    def sources(self) -> dict[str, str]:
        """The file from which each setting comes."""
        return dict.fromkeys(self.settings, self.file) if self.file else {}


class _Event(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True)

    at_s: float | None = Field(None, ge=0)
    when: str | None = None
    do: str
    for_s: float | None = Field(None, gt=0)
    given: Any = Field(None, alias="with")
    optional: bool = False

    @model_validator(mode="after")
    def _begins_once(self) -> "_Event":
        if (self.at_s is None) == (self.when is None):
            raise ValueError("either at_s or when is needed, not both")
        if self.do not in ACTIONS:
            raise ValueError(f"no action {self.do!r}; known: {', '.join(ACTIONS)}")
        return self

    def event(self) -> Event:
        action = self._action()
        event = at(self.at_s, action) if self.at_s is not None else when(self.when or "", action)
        return optional(event) if self.optional else event

    def _action(self) -> Action:
        values: list[object] = []
        named = {} if self.for_s is None else {"for_s": self.for_s}
        match self.given:
            case None:
                pass
            case dict():
                named = {**self.given, **named}
            case list():
                values = self.given
            case _:
                values = [self.given]
        action: Action = validate_call(ACTIONS[self.do])(*values, **named)
        return action


class _File(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid")

    mission: dict[str, object] = {}
    events: tuple[_Event, ...] = ()


def load_mission(mission: str) -> MissionFile:
    """Load a mission by its kind, such as "room", or from a file.

    Raises:
        MissionError: the file cannot be read or is invalid.
    """
    path = Path(mission)
    if path.suffix.lower() not in SUFFIXES:
        return MissionFile({"mission.kind": mission})
    try:
        return _python(path) if path.suffix.lower() == ".py" else _toml(path)
    except OSError as error:
        raise MissionError(f"{mission}: {error.strerror}") from error
    except ValidationError as error:
        raise MissionError(f"{mission}: {error_line(error)}") from error
    except MissionError:
        raise
    except (ValueError, RecursionError) as error:  # also from huge numbers and deep nesting
        raise MissionError(f"{mission}: not TOML: {error}") from error


def _toml(path: Path) -> MissionFile:
    file = _File.model_validate(tomllib.loads(read_text(path)))
    try:
        events = tuple(event.event() for event in file.events)
    except ValidationError as error:
        raise MissionError(f"{path}: {error.title}: {error_line(error)}") from error
    except ValueError as error:
        raise MissionError(f"{path}: {error}") from error
    return MissionFile(_overrides(file.mission), events, str(path))


def _python(path: Path) -> MissionFile:
    try:
        names: dict[str, Any] = runpy.run_path(str(path))
    except OSError:
        raise
    except (Exception, SystemExit) as error:  # the user's code may raise anything
        raise MissionError(f"{path}: {type(error).__name__}: {error}") from error
    mission, events = names.get("mission"), names.get("events", ())
    if not isinstance(mission, Mapping):
        raise MissionError(f"{path}: mission: a dict of settings is needed")
    if not isinstance(events, Sequence) or not all(isinstance(each, Event) for each in events):
        raise MissionError(f"{path}: events: only at(...) and when(...) of sitl.testing")
    return MissionFile(_overrides(mission), tuple(events), str(path))


def _overrides(mission: Mapping[str, object]) -> dict[str, object]:
    return {f"mission.{key}": value for key, value in mission.items()}
