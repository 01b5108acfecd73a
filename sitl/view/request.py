"""A flight as somebody asks for it on the page."""

from dataclasses import dataclass

from companion.config import range_sensors
from companion.config.range_sensors import USUAL_BEAMS
from companion.config.settings import Config, validated
from sitl.autopilot.estimation.estimator import REFERENCE_NOISE
from sitl.simulation.simulation import Setup
from sitl.world.loading import load_world

OWN_PROFILE = "own"
"""Sensors with the range and the noise that were asked for, whatever nature allows."""
PROFILES = (*range_sensors.PROFILES, OWN_PROFILE)
MIN_RANGE_M = 0.1


@dataclass(frozen=True, slots=True)
class FlightRequest:
    """What the controls say."""

    world: str
    seed: int = 1
    profile: str = PROFILES[0]
    range_m: float = 5.0
    """Of OWN_PROFILE, as is its noise."""
    range_sigma_m: float = 0.05
    noise: float = 1.0
    """So many times the reference noise of odometry and the autopilot's gyro."""
    autopilot: str = "ardupilot"
    mission: str = "room"
    standoff: float | str = 1.5
    speed_m_s: float = 1.0

    def config(self) -> Config:
        """The companion's.

        Raises:
            ConfigError: a value that cannot be used, by its key.
        """
        mission = {
            "kind": self.mission,
            "standoff": self.standoff,
            "speed_m_s": self.speed_m_s,
            "time_limit_s": 3600.0,
        }
        return validated(Config, {"sensors": self._sensors(), "mission": mission}, "this page")

    def setup(self, config: Config) -> Setup:
        """The simulator's.

        Raises:
            WorldError: the world cannot be used.
        """
        return Setup(
            load_world(self.world),
            self.world,
            self.seed,
            config.sensors,
            self.autopilot,
            odometry_noise=REFERENCE_NOISE.times(self.noise),
        )

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
