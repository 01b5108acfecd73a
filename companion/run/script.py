"""Flies step by step from a Python script; see docs/scripts.md.

    with connect("drone.toml") as drone:
        drone.take_off()
        drone.scan_room()
        drone.export("room.dxf")
        drone.go_home()

The control loop is that of `companion fly`. It runs in a thread, independently of the script. The
drone lands when the context ends, for any reason.
"""

import math
from collections.abc import Callable, Mapping
from pathlib import Path
from types import TracebackType

from companion.config import settings as configuration
from companion.config.settings import Config
from companion.core.messages import Beam, FloorPlan, Pose, RangeReading, Setpoint
from companion.export.write import write
from companion.pdps.flight.order import Target, Task
from companion.pdps.flight.state import FINAL_PHASES
from companion.run.script_flight import OrderedFlight
from companion.run.script_limits import require_target, require_velocity
from companion.run.telemetry import Subscriptions
from companion.team.teammate import Heard


def connect(
    config: str | Path | None = None,
    *,
    link: str | None = None,
    bus: str | None = None,
    out: str | Path | None = None,
    settings: Mapping[str, object] | None = None,
    tell: Callable[[str], None] = print,
    skip_rehearsal: bool = False,
) -> "Drone":
    """Create a drone, to be used as a context manager.

    `config` is the companion's TOML file. `link`, `bus` and `settings`, such as
    {"mission.height_m": 1.0}, override it. `out` is a folder for recording and map. `tell` receives
    warnings. A real drone needs a rehearsal by `companion fly --rehearse`, unless `skip_rehearsal`.

    Raises:
        ConfigError: the configuration is invalid; one line that names the key and the remedy.
    """
    given = {"link.url": link, "sensors.bus": bus, **(settings or {})}
    overrides = {key: value for key, value in given.items() if value is not None}
    loaded = configuration.load(Path(config) if config else None, overrides)
    return Drone(loaded, Path(out) if out else None, tell, skip_rehearsal=skip_rehearsal)


class Drone:
    """One flight. Every step blocks until it is complete.

    Each step raises FlightEndedError if the flight ends first, by a fault, the pilot, a lost link
    or the time limit; its text is that of `companion fly`. It raises NotCompletedError if the
    flight goes on without the step: if the drone is on the ground, if it turned back for its
    battery or time and hovers over the start, or if another step or `stop` replaced the step.
    """

    def __init__(
        self,
        config: Config,
        out: Path | None,
        tell: Callable[[str], None],
        *,
        skip_rehearsal: bool = False,
    ) -> None:
        self._config = config
        self._flight = OrderedFlight(config, out, tell, skip_rehearsal=skip_rehearsal)

    def __enter__(self) -> "Drone":
        """Start the control loop and wait for the autopilot.

        Raises:
            CompanionError: link or sensors cannot be opened, or no autopilot responds.
        """
        self._flight.begin()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Land at the current position if in flight; Ctrl-C leaves the landing to the autopilot."""
        self._flight.end(error)

    # Steps

    def take_off(self) -> None:
        """Take off to `mission.height_m`, after the gyro's calibration and a valid estimate."""
        self._flight.do(Task.TAKE_OFF)

    def scan_room(self) -> None:
        """Scan the current room with PDPS; ends when the outline of the room is closed."""
        self._flight.do(Task.SCAN, "room")

    def explore(self, mission: str = "building") -> None:
        """Map all that is reachable, with mission "building", "exterior" or "layers".

        docs/missions.md describes the missions.

        Raises:
            ValueError: another mission.
        """
        if mission not in ("building", "exterior", "layers"):
            raise ValueError(f"mission = {mission!r}: should be building, exterior or layers")
        self._flight.do(Task.SCAN, mission)

    def fly_to(
        self,
        north_m: float,
        east_m: float,
        *,
        height_m: float | None = None,
        yaw_rad: float | None = None,
        timeout_s: float | None = None,
    ) -> None:
        """Fly to a place through measured free space, round all obstacles, and hover there.

        The place is in the frame of the map: local NED from the take-off place, north along the
        nose at take-off. The drone travels at the height of the map, `mission.height_m`. Over the
        place it climbs or descends to `height_m`, above the take-off point, and turns to `yaw_rad`,
        clockwise from north. If it knows no path, it looks all round once. `timeout_s` is in
        seconds of the flight. The next step that travels returns to the height of the map first.

        Raises:
            NotCompletedError: the place is not free, not reachable or not reached in time; the text
                names the reason and the remedy.
            ValueError: a height or another value is out of its limits.
        """
        target = Target((north_m, east_m), height_m, yaw_rad)
        require_target(target, timeout_s, self._config.mission)
        until_s = math.inf if timeout_s is None else self._flight.now_s + timeout_s
        self._flight.do(Task.FLY_TO, target=target, until_s=until_s)

    def fly_velocity(
        self,
        forward_m_s: float = 0.0,
        right_m_s: float = 0.0,
        down_m_s: float = 0.0,
        yaw_rate_rad_s: float = 0.0,
        *,
        seconds: float | None = None,
    ) -> None:
        """Fly at a velocity in the body frame (FRD), and hover after `seconds` of the flight.

        Without `seconds` it returns at once. Then the drone keeps the velocity for one second, or
        until the next step: call it again in time. The velocity guard limits every setpoint, so the
        drone may be slower. Off the height of the map it flies level at no more than 0.2 m/s. Below
        that height it descends only over a valid reading of the down beam, and not below 0.5 m.
        `yaw_rate_rad_s` is clockwise.

        Raises:
            NotCompletedError: the guard has refused the velocity for a second. Without `seconds`,
                the next call raises it.
            ValueError: the velocity is above `mission.speed_m_s`, `mission.turn_rate_deg_s` or
                0.4 m/s up or down, or `seconds` is not positive.
        """
        velocity = Setpoint(forward_m_s, right_m_s, down_m_s, yaw_rate_rad_s)
        require_velocity(velocity, seconds, self._config.mission)
        if seconds is None:
            self._flight.keep_velocity(velocity)
        else:
            self._flight.fly_velocity(velocity, seconds)

    def stop(self) -> None:
        """End the present step: the drone hovers, and the step raises NotCompletedError.

        It is for another thread, and returns at once. A landing, a take-off, and the return with
        the battery or time that is left continue.
        """
        self._flight.stop()

    def go_home(self) -> None:
        """Fly to the take-off point through free space."""
        self._flight.do(Task.HOME)

    def land(self) -> None:
        """Land at the current position, which ends the flight."""
        self._flight.land()

    # State and map

    @property
    def telemetry(self) -> Subscriptions:
        """Subscriptions to pose, readings, battery, activity and walls."""
        return self._flight.telemetry

    @property
    def activity(self) -> str:
        """Current activity as text; after the flight, its result."""
        flight = self._flight.state
        return flight.ending if flight.phase in FINAL_PHASES else flight.activity

    @property
    def pose(self) -> Pose | None:
        """Current pose, local NED; None before the gyro is calibrated."""
        return self._flight.latest.pose if self._flight.latest else None

    @property
    def teammates(self) -> tuple[Heard, ...]:
        """The other drones of its team that it hears now."""
        team = self._flight.app.team
        return team.mates.heard(self._flight.now_s) if team and self._flight.latest else ()

    @property
    def readings(self) -> Mapping[Beam, RangeReading]:
        """Latest range readings by beam."""
        return self._flight.latest.scan.readings if self._flight.latest else {}

    def map(self) -> FloorPlan:
        """Current map; after landing, the final map with the whole flight smoothed.

        Before landing, a wall may be in two pieces, or twice in the map a few centimetres apart.
        """
        return self._flight.plan()

    def export(self, path: str | Path) -> None:
        """Write the map to a file; the suffix selects a format of docs/exports.md, or png.

        Raises:
            ValueError: unknown format.
            MissingExtraError: the library of the format is not installed.
            OutputError: the file cannot be written.
        """
        link = self._config.link
        place = link.place
        write(self.map(), Path(path), Path(path).stem, place)
