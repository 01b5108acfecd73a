"""Builds the controls of an action from its parameters."""

import html
import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from viser import GuiApi, GuiDropdownHandle, GuiEvent

from companion.core.messages import Beam
from companion.link.firmware import ARDUCOPTER_MODES, PX4_MODES
from sitl.autopilot.firmware import Throttle
from sitl.core.errors import SitlError
from sitl.view.faults import names, parameters, summary

MODES = {
    "ardupilot": tuple(sorted(ARDUCOPTER_MODES.values())),
    "px4": tuple(sorted(PX4_MODES.values())),
}
"""Modes that the pilot's switch can select."""
FIRST_MODE = {"ardupilot": "LOITER", "px4": "POSCTL"}
BEAMS = tuple(beam.value for beam in Beam if beam is not Beam.BACK)
CHOICES: Mapping[str, Sequence[str]] = {
    "beam": BEAMS,
    "one": BEAMS,
    "other": BEAMS[::-1],
    "throttle": tuple(throttle.value for throttle in Throttle),
}
"""Values of parameters by name."""
FIRST: Mapping[str, object] = {
    "seconds": 10.0,
    "percent": 15.0,
    "deg_s": 5.0,
    "message": "EXTENDED_SYS_STATE",
    "rate_hz": 4.0,
    "north_m_s": 0.3,
    "east_m_s": 0.0,
    "places": "4 5 1.2",
    "forward_m": 1.8,
}
"""First values of parameters without a default. Chosen: as in docs/testing.md."""
LASTS_S = 2.0
"""First duration of an action, s. Chosen."""
UNITS = {
    "_m_s": ", m/s",
    "deg_s": "rate, °/s",
    "_deg": ", °",
    "_hz": ", Hz",
    "_m": ", m",
    "_s": ", s",
}
"""Units at the end of the names of parameters."""
SUMMARY = '<div style="font-size:.8em;margin:0 1em .6em;opacity:.8">{}</div>'
PERMANENT = "0: permanent"


@dataclass(frozen=True, slots=True)
class Field:
    """One control."""

    handle: Any
    read: Callable[[Any], object]
    """From the control's value to the argument; None if it has none."""


class ActionControls:
    """A choice of the action, its parameters, and a button."""

    def __init__(self, gui: GuiApi, autopilot: Callable[[], str]) -> None:
        """`autopilot`: the kind that flies, which determines the modes."""
        self._gui = gui
        self._autopilot = autopilot
        self._names = {name.replace("_", " "): name for name in names()}
        self.action: GuiDropdownHandle[str] = gui.add_dropdown("action", tuple(self._names))
        self._summary = gui.add_html("")
        self._place = gui.add_folder(None)
        self.inject = gui.add_button("Inject")
        self._fields: dict[str, Field] = {}
        self.action.on_update(self._offer)
        self.offer()

    @property
    def name(self) -> str:
        """Name of the selected action."""
        return self._names[self.action.value]

    @property
    def arguments(self) -> dict[str, object]:
        """Arguments of the selected action.

        Raises:
            SitlError: a place is not three numbers.
        """
        read = {name: field.read(field.handle.value) for name, field in self._fields.items()}
        return {name: argument for name, argument in read.items() if argument is not None}

    def _offer(self, _: GuiEvent[GuiDropdownHandle[str]]) -> None:
        self.offer()

    def offer(self) -> None:
        """Show the controls of the selected action."""
        for field in self._fields.values():
            field.handle.remove()
        text = html.escape(summary(self.name).replace("`", ""))
        self._summary.content = SUMMARY.format(text)
        with self._place:
            self._fields = {
                name: self._field(parameter) for name, parameter in parameters(self.name).items()
            }

    def _field(self, parameter: inspect.Parameter) -> Field:
        gui, name = self._gui, parameter.name
        is_needed = parameter.default is inspect.Parameter.empty
        first = FIRST.get(name) if is_needed else parameter.default
        label = _label(name)
        if name == "for_s":
            hint = None if is_needed else PERMANENT
            least_s = 0.1 if is_needed else 0.0
            number = gui.add_number(label, LASTS_S, min=least_s, max=600.0, step=0.5, hint=hint)
            return Field(number, lambda value: value or None)
        if (choices := self._choices(parameter)) is not None:
            chosen = first if first in choices else None
            return Field(gui.add_dropdown(label, choices, initial_value=chosen), str)
        if parameter.annotation is bool:
            return Field(gui.add_checkbox(label, bool(first)), bool)
        if parameter.annotation is float:
            return Field(gui.add_number(label, _number(first), step=0.1), float)
        if name == "places":
            text = gui.add_text(label, str(first), hint="North, east, height, m; more after a ;")
            return Field(text, _places)
        return Field(gui.add_text(label, str(first or "")), lambda value: value.strip() or None)

    def _choices(self, parameter: inspect.Parameter) -> Sequence[str] | None:
        if (self.name, parameter.name) == ("pilot_mode", "name"):
            kind = self._autopilot()
            first = FIRST_MODE[kind]
            return (first, *(mode for mode in MODES[kind] if mode != first))
        return CHOICES.get(parameter.name)


def _label(name: str) -> str:
    """Name of a parameter for people, with its unit."""
    if name == "name":
        return "mode"
    for suffix, unit in UNITS.items():
        if name.endswith(suffix):
            return f"{name.removesuffix(suffix)}{unit}".replace("_", " ")
    return name.replace("_", " ")


def _number(value: object) -> float:
    return float(value) if isinstance(value, int | float) else 0.0


def _places(text: str) -> list[tuple[float, ...]]:
    """Places from `north east height; north east height`."""
    try:
        places = [
            tuple(float(number) for number in place.replace(",", " ").split())
            for place in text.split(";")
            if place.strip()
        ]
    except ValueError:
        places = []
    if not places or any(len(place) != 3 for place in places):
        raise SitlError(f"places = {text!r}: should be north, east and height in m, as in 4 5 1.2")
    return places
