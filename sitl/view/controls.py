"""Defines the page's controls: world, flight, display, mission, sensors, pilot and faults."""

from viser import (
    GuiApi,
    GuiDropdownHandle,
    GuiEvent,
    GuiNumberHandle,
    GuiSliderHandle,
    GuiTextHandle,
)

from companion.config.settings import MISSION_KINDS, STANDOFFS
from companion.config.team import TEAM_DRONES
from sitl.core.errors import SitlError
from sitl.view.action_controls import MODES, ActionControls
from sitl.view.flight.messages import Inject
from sitl.view.request import OWN_PROFILE, PROFILES, FlightRequest
from sitl.world.loading import world_names

ADD, REMOVE = "Add UAV", "Remove UAV"
FAST = 1000.0
"""Factor of real time that stands for as fast as possible. Chosen."""
SPEEDS = {"¼ ×": 0.25, "1 ×": 1.0, "2 ×": 2.0, "5 ×": 5.0, "10 ×": 10.0, "20 ×": 20.0, "all": FAST}
"""Factors of real time; the last one is as fast as possible."""
FIRST_SPEED = "10 ×"


class Controls:
    """Handles of all controls; the page connects them."""

    def __init__(self, gui: GuiApi) -> None:
        self.world = gui.add_folder("World")
        with self.world:
            self.worlds = gui.add_button_group("built-in", world_names())
            self.file: GuiTextHandle = gui.add_text(
                "file or name",
                "",
                hint="A world file (.toml, .json, .yaml, .stl, .obj, .ply, .glb) or random_17",
            )
            self.open = gui.add_button("Open")
        with gui.add_folder("Flight"):
            self.uavs = gui.add_button_group("UAVs", (ADD, REMOVE), hint="Before take-off")
            self.start = gui.add_button("Start", color="teal")
            self.time = gui.add_button_group("time", ("Pause", "Resume", "Step"))
            self.speed: GuiDropdownHandle[str] = gui.add_dropdown(
                "speed", tuple(SPEEDS), initial_value=FIRST_SPEED, hint="Times real time"
            )
            self.stop = gui.add_button("Stop: land now", color="red")
        with gui.add_folder("Display", expand_by_default=False):
            self.hide_truth = gui.add_checkbox("hide the truth", False)
            self.exaggeration: GuiSliderHandle[float] = gui.add_slider(
                "2σ bands ×", 1.0, 20.0, 1.0, 5.0, hint="Scale of the drawn bands"
            )
            self.fit = gui.add_button("All in view")
        with gui.add_folder("Mission"):
            self.mission: GuiDropdownHandle[str] = gui.add_dropdown("kind", MISSION_KINDS)
            self.standoff: GuiTextHandle = gui.add_text(
                "stand-off", "1.5", hint="Metres from 0.6 to 5, or range, or accurate"
            )
            self.flight_speed: GuiSliderHandle[float] = gui.add_slider(
                "speed, m/s", 0.1, 2.0, 0.1, 1.0
            )
            self.seed: GuiNumberHandle[int] = gui.add_number("seed", 1, min=0, step=1)
        with gui.add_folder("Sensors and noise", expand_by_default=False):
            self.profile: GuiDropdownHandle[str] = gui.add_dropdown("profile", PROFILES)
            self.range: GuiSliderHandle[float] = gui.add_slider(
                "range, m", 1.0, 15.0, 0.5, 5.0, visible=False, hint="Of the profile own"
            )
            self.sigma: GuiSliderHandle[float] = gui.add_slider(
                "noise σ, cm", 0.5, 20.0, 0.5, 5.0, visible=False, hint="Of the profile own"
            )
            self.noise: GuiSliderHandle[float] = gui.add_slider(
                "odometry ×", 0.0, 4.0, 0.25, 1.0, hint="Factor on the reference noise"
            )
            self.autopilot: GuiDropdownHandle[str] = gui.add_dropdown("autopilot", tuple(MODES))
        with gui.add_folder("Pilot and faults", expand_by_default=False):
            self._action = ActionControls(gui, lambda: self.autopilot.value)
            self.inject = self._action.inject
        self.profile.on_update(self._offer_own)
        self.autopilot.on_update(self._offer_modes)

    def _offer_own(self, _: GuiEvent[GuiDropdownHandle[str]]) -> None:
        """Show the sliders of the profile `own`; a disabled slider would still accept numbers."""
        is_own = self.profile.value == OWN_PROFILE
        self.range.visible = self.sigma.visible = is_own

    def _offer_modes(self, _: GuiEvent[GuiDropdownHandle[str]]) -> None:
        self._action.offer()

    @property
    def most_drones(self) -> int:
        """Most drones that fly the selected mission together."""
        return TEAM_DRONES.get(self.mission.value, 1)

    def request(self, world: str, drones: int) -> FlightRequest:
        """The flight that the controls select.

        Raises:
            SitlError: the stand-off is neither a number nor a known word.
        """
        return FlightRequest(
            world,
            int(self.seed.value),
            self.profile.value,
            self.range.value,
            self.sigma.value / 100,
            self.noise.value,
            self.autopilot.value,
            self.mission.value,
            _standoff(self.standoff.value),
            self.flight_speed.value,
            drones,
        )

    @property
    def times_real_time(self) -> float:
        return SPEEDS[self.speed.value]

    def to_inject(self, drone: int) -> Inject:
        """The selected action.

        Raises:
            SitlError: an argument is invalid.
        """
        return Inject(drone, self._action.name, self._action.arguments)


def _standoff(text: str) -> float | str:
    if text.strip() in STANDOFFS:
        return text.strip()
    try:
        return float(text)
    except ValueError:
        words = " or ".join(STANDOFFS)
        raise SitlError(f"stand-off = {text!r}: should be metres, or {words}") from None
