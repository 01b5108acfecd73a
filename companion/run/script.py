"""Flies step by step from a Python script; see docs/scripts.md.

    with connect("drone.toml") as drone:
        drone.take_off()
        drone.scan_room()
        drone.export("room.dxf")
        drone.go_home()

The control loop is that of `companion fly`. It runs in a thread, independently of the script. The
drone lands when the context ends, for any reason.
"""

import threading
from collections.abc import Callable, Mapping
from concurrent.futures import Future
from pathlib import Path
from queue import Empty, SimpleQueue
from types import TracebackType
from typing import TypeVar

from companion.app import App
from companion.config import settings as configuration
from companion.config.settings import Config
from companion.core.errors import FlightEndedError
from companion.core.messages import Beam, FloorPlan, Order, Pose, RangeReading, Task
from companion.export.map_files import save
from companion.export.write import write
from companion.pdps.flight.state import FINAL_PHASES, FlightState, Phase
from companion.run.hardware import open_rig
from companion.run.loop import ControlLoop
from companion.team.radio import new_instance
from companion.team.teammate import Heard
from companion.ticks import Inputs, Outputs, Progress

T = TypeVar("T")
LOOK_S = 0.2
"""Period of the checks while the script waits, s. Chosen."""


def connect(
    config: str | Path | None = None,
    *,
    link: str | None = None,
    bus: str | None = None,
    out: str | Path | None = None,
    settings: Mapping[str, object] | None = None,
    tell: Callable[[str], None] = print,
) -> "Drone":
    """Create a drone, to be used as a context manager.

    `config` is the companion's TOML file. `link`, `bus` and `settings`, such as
    {"mission.height_m": 1.0}, override it. `out` is a folder for recording and map. `tell` receives
    warnings.

    Raises:
        ConfigError: the configuration is invalid; one line that names the key and the remedy.
    """
    given = {"link.url": link, "sensors.bus": bus, **(settings or {})}
    overrides = {key: value for key, value in given.items() if value is not None}
    loaded = configuration.load(Path(config) if config else None, overrides)
    return Drone(loaded, Path(out) if out else None, tell)


class Drone:
    """One flight. Every step blocks until it is complete.

    Each step raises FlightEndedError if the flight ends first, by a fault, the pilot or the time
    limit; its text is that of `companion fly`.
    """

    def __init__(self, config: Config, out: Path | None, tell: Callable[[str], None]) -> None:
        self._config = config
        self._out = out
        self._tell = tell
        self._app = App(config, instance=new_instance())
        self._order = Order()
        self._is_to_land = False
        self._latest: Outputs | None = None
        self._plan: FloorPlan | None = None
        self._error: BaseException | None = None
        self._asked: SimpleQueue[Callable[[], None]] = SimpleQueue()
        self._ticked = threading.Condition()
        self._thread = threading.Thread(target=self._fly, name="control loop", daemon=True)

    def __enter__(self) -> "Drone":
        """Start the control loop and wait for the autopilot.

        Raises:
            CompanionError: link or sensors cannot be opened, or no autopilot responds.
        """
        self._thread.start()
        self._wait(lambda flight: flight.phase is not Phase.CONNECT)
        if self._flight.phase in FINAL_PHASES:
            raise FlightEndedError(self._flight.ending)
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Land at the current position if in flight; Ctrl-C leaves the landing to the autopilot."""
        self._is_to_land = True
        while self._thread.is_alive():
            self._thread.join(LOOK_S)
        if self._error is not None and error is None:
            raise self._error

    # Steps

    def take_off(self) -> None:
        """Take off to `mission.height_m`, after the gyro's calibration and a valid estimate."""
        self._do(Task.TAKE_OFF)

    def scan_room(self) -> None:
        """Scan the current room with PDPS; ends when the outline of the room is closed."""
        self._do(Task.SCAN, "room")

    def explore(self, mission: str = "building") -> None:
        """Map all that is reachable, with mission "building", "exterior" or "layers".

        docs/missions.md describes the missions.

        Raises:
            ValueError: another mission.
        """
        if mission not in ("building", "exterior", "layers"):
            raise ValueError(f"mission = {mission!r}: should be building, exterior or layers")
        self._do(Task.SCAN, mission)

    def go_home(self) -> None:
        """Fly to the take-off point through free space."""
        self._do(Task.HOME)

    def land(self) -> None:
        """Land at the current position, which ends the flight."""
        self._order = Order(self._order.number + 1, Task.LAND)
        self._wait(lambda flight: flight.phase in FINAL_PHASES)
        self._thread.join()
        if self._error is not None:
            raise self._error
        if not self._flight.completed:
            raise FlightEndedError(self._flight.ending)

    # State and map

    @property
    def activity(self) -> str:
        """Current activity as text; after the flight, its result."""
        flight = self._flight
        return flight.ending if flight.phase in FINAL_PHASES else flight.activity

    @property
    def pose(self) -> Pose | None:
        """Current pose, local NED; None before the gyro is calibrated."""
        return self._latest.pose if self._latest else None

    @property
    def teammates(self) -> tuple[Heard, ...]:
        """The other drones of its team that it hears now."""
        team, latest = self._app.team, self._latest
        return team.mates.heard(latest.scan.time_s) if team and latest else ()

    @property
    def readings(self) -> Mapping[Beam, RangeReading]:
        """Latest range readings by beam."""
        return self._latest.scan.readings if self._latest else {}

    def map(self) -> FloorPlan:
        """Current map; after landing, the final map with the whole flight smoothed.

        Before landing, a wall may be in two pieces, or twice in the map a few centimetres apart.
        """
        asked: Future[FloorPlan] = Future()
        self._asked.put(lambda: asked.set_result(self._app.floor_plan()))
        while not asked.done() and self._thread.is_alive():
            with self._ticked:
                self._ticked.wait_for(asked.done, LOOK_S)
        if self._error is not None:
            raise self._error
        return asked.result() if self._plan is None else self._plan

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

    # The control loop's thread

    def _fly(self) -> None:
        try:
            self._fly_recorded()
        except BaseException as error:
            self._error = error
        with self._ticked:
            self._ticked.notify_all()

    def _fly_recorded(self) -> None:
        with open_rig(self._config, self._out, self._tell) as (rig, recorder):

            def record(now_s: float, inputs: Inputs, outputs: Outputs) -> None:
                recorder.tick(now_s, inputs, outputs)
                self._tick(outputs)

            try:
                ControlLoop(
                    self._app,
                    rig,
                    _nobody_at_a_terminal,
                    lambda: self._is_to_land,
                    record,
                    orders=lambda: self._order,
                ).run()
            finally:
                self._plan = self._app.final_floor_plan()
                recorder.close(self._plan)
                if self._out is not None:
                    save(self._plan, self._out, self._flight.unfinished)

    def _tick(self, outputs: Outputs) -> None:
        while True:
            try:
                self._asked.get_nowait()()
            except Empty:
                break
        with self._ticked:
            self._latest = outputs
            self._ticked.notify_all()

    @property
    def _flight(self) -> FlightState:
        return self._app.flight

    def _do(self, task: Task, mission: str = "") -> None:
        number = self._order.number + 1
        self._order = Order(number, task, mission)
        self._wait(lambda flight: flight.obeyed == number and flight.phase is Phase.HOVER)
        if self._flight.phase is not Phase.HOVER:
            raise FlightEndedError(self._flight.ending)

    def _wait(self, is_so: Callable[[FlightState], bool]) -> None:
        """Wait until the condition is met or the flight has ended."""

        def is_done() -> bool:
            flight = self._flight
            return is_so(flight) or flight.phase in FINAL_PHASES or not self._thread.is_alive()

        with self._ticked:
            while not self._ticked.wait_for(is_done, LOOK_S):  # Ctrl-C gets through in between
                continue
        if self._error is not None:
            raise self._error


def _nobody_at_a_terminal(progress: Progress) -> None:
    """Ignore the progress: a script reads the state it needs."""
