"""A flight as requested on the page."""

from dataclasses import dataclass

from companion.config import range_sensors
from companion.config.range_sensors import USUAL_BEAMS
from companion.config.settings import Config
from companion.config.toml_file import validated
from sitl.autopilot.estimation.estimator import REFERENCE_NOISE
from sitl.simulation.simulation import Setup
from sitl.simulation.team_pads import team_setups
from sitl.world.format import World

OWN_PROFILE = "own"
"""Sensors with the requested range and noise, also if no real sensor has them."""
PROFILES = (*range_sensors.PROFILES, OWN_PROFILE)
MIN_RANGE_M = 0.1
"""Smallest range of OWN_PROFILE, m. Chosen."""


@dataclass(frozen=True, slots=True)
class FlightRequest:
    """Values of the controls."""

    world: str
    seed: int = 1
    profile: str = PROFILES[0]
    range_m: float = 5.0
    """Range of OWN_PROFILE, m; its noise is below."""
    range_sigma_m: float = 0.05
    noise: float = 1.0
    """Factor on the reference noise of odometry and the autopilot's gyro."""
    autopilot: str = "ardupilot"
    mission: str = "room"
    standoff: float | str = 1.5
    speed_m_s: float = 1.0
    drones: int = 1

    def config(self) -> Config:
        """The companion's configuration.

        Raises:
            ConfigError: a value is invalid; the text names its key.
        """
        mission = {
            "kind": self.mission,
            "standoff": self.standoff,
            "speed_m_s": self.speed_m_s,
            "time_limit_s": 3600.0,
        }
        return validated(Config, {"sensors": self._sensors(), "mission": mission}, "this page")

    def setups(self, world: World) -> tuple[list[Setup], list[Config]]:
        """A setup and a configuration for each drone, in the world of this name.

        Raises:
            ConfigError: as of `config`.
            SitlError: there is no place for a pad.
        """
        config = self.config()
        setup = Setup(
            world,
            self.world,
            self.seed,
            config.sensors,
            self.autopilot,
            odometry_noise=REFERENCE_NOISE.times(self.noise),
        )
        return team_setups(setup, config, self.drones)

    def _sensors(self) -> dict[str, object]:
        if self.profile != OWN_PROFILE:
            return {"profile": self.profile}
        sensor = {
            "kind": "autopilot",
            "min_m": MIN_RANGE_M,
            "max_m": self.range_m,
            "sigma_m": self.range_sigma_m,
        }
        return {"ranges": {beam.value: sensor for beam in USUAL_BEAMS}}
